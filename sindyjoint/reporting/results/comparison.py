"""A comparison: its tables, and every form they take; on a terminal, as pictures, as a page, as files."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from functools import partial
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
from rich.markup import escape

from sindyjoint.judgement.comparison import Choice, Comparison
from sindyjoint.judgement.headlines import judge_comparison
from sindyjoint.reporting.equation import mathml
from sindyjoint.reporting.figure import Axes, Kind, by_name, fixed
from sindyjoint.reporting.page import Blocks, Page, Provenance, markup, provenance, section, sentence
from sindyjoint.reporting.results.comparison_tables import (
    against_terms_table,
    choices_table,
    coefficients_table,
    folds_table,
    given_model_table,
    seconds,
    tests_table,
)
from sindyjoint.reporting.results.discovery_terms import dependence
from sindyjoint.reporting.style import INK, MUTED, PALETTE, RULE, plain, shortened
from sindyjoint.reporting.tables import (
    Console,
    TextTable,
    aligned,
    csv_records,
    print_table,
    tabulate,
)
from sindyjoint.reporting.view import FINDING, View
from sindyjoint.soundness.finding import Soundness
from sindyjoint.text import quantities, spelled
from sindyjoint.trust import Trust


def _inclusion_rows(result: Comparison) -> list[tuple[str, list[float]]]:
    """Return label and share of each term: of the resampled campaigns first, then of every choice."""
    terms = result.shown_ids
    share = dict(zip(result.ids, result.inclusion, strict=True))
    choices = [choice for group in result.groups.values() for choice in group]
    chosen = [(choice.name, [float(choice[term] is not None) for term in terms]) for choice in choices]
    return [("resampled campaigns", [share.get(term, 0.0) for term in terms]), *chosen]


def inclusion(result: Comparison, ax: Axes) -> Axes:
    """Draw which term is chosen by what: a row for each choice, and for the resampled campaigns."""
    from matplotlib.patches import Rectangle

    terms, rows = result.shown_ids, _inclusion_rows(result)
    for y, (_, values) in enumerate(rows):
        for x, value in enumerate(values):
            # Area shows the share of replicates; a full square is a certain choice.
            side, colour = 0.86 * np.sqrt(value), PALETTE[0] if terms[x] in result.reference else PALETTE[1]
            if value > 0:
                ax.add_patch(Rectangle((x - side / 2, y - side / 2), side, side, color=colour, linewidth=0))
    for end in np.cumsum([1, *map(len, result.groups.values())])[:-1]:
        ax.axhline(end - 0.5, color=MUTED, linewidth=0.6)
    ax.axvline(len(result.reference) - 0.5, color=INK, linewidth=0.8)
    whose = "the paper's five" if result.of_paper else "the model's terms"
    ax.set(
        xlim=(-0.5, len(terms) - 0.5), ylim=(len(rows) - 0.5, -0.5), yticks=range(len(rows)),
        yticklabels=[plain(shortened(name, 20)) for name, _ in rows], title=f"left of the line: {whose}",
    )  # fmt: skip
    names = [spelled(term, result.motion) for term in terms]
    ax.set_xticks(range(len(terms)), names, rotation=40, ha="right", rotation_mode="anchor")
    ax.tick_params(length=0)
    ax.grid(color=RULE, linewidth=0.3)
    return ax


KINDS = by_name(
    Kind(
        "inclusion",
        "Inclusion map",
        "A square: the term is chosen. In the first row its area is the share of resampled campaigns that do.",
        fixed(inclusion),
        wide=True,
        height=lambda result: 2.0 + 0.17 * len(_inclusion_rows(result)),
    ),
    Kind(
        "dependence",
        "Coefficients by frequency",
        "Each coefficient at each single frequency with its 95 % interval.{crosses} Line and grey band: their "
        "mean and the margin within which they count as the same.",
        lambda result: [partial(dependence, test=test) for test in result.tests],
    ),
)


class ComparisonView(
    View[Comparison, Comparison],
    results=(Comparison,),
    data=Comparison,
    kind="Comparison",
    folder="comparison",
    kinds=KINDS,
    record_file="comparison.json",
    judged_by=FINDING,
    unsaved={"discovery": None, "left_out": {}, "soundness": Soundness()},
):
    """A comparison."""

    def tables(self, result: Comparison) -> tuple[TextTable, ...]:
        """Return the tables of a comparison, that of all choices first."""
        tables = [choices_table(result)]
        tables += [
            against_terms_table(by, result, choices) for by, choices in result.groups.items() if choices
        ]
        tables.append(coefficients_table(result))
        if result.tests:
            tables.append(tests_table(result.tests, result.motion))
        if result.left_out:
            tables.append(folds_table(result))
        if result.given is not None:
            tables.append(given_model_table(result.given, result.motion))
        return tuple(tables)

    def page(self, result: Comparison, data: Comparison, show: Blocks, folder: Path | None) -> Page:
        """Return how far all agree, which terms are chosen by what, and every table."""
        model = None if result.discovery is None else result.discovery.model
        found = (
            show.equation(markup(mathml(model))) if model and model.terms else "",
            show.verdict(sentence(result.agreement)) if result.of_paper else "",
        )
        load = quantities(result.motion).moment.lower()
        about = (
            f"Sorted by the error of the {load} that was left out, with its standard error. Model by "
            f"{result.methods[0].name}: {result.model.reason}."
        )
        answers = [
            f"{spelled(test.name, result.motion)}: {test.answer}; {test.reason}." for test in result.tests
        ]
        above = {"choices": show.paragraph(about, "reason")}
        below = {
            "choices": (show.pictures("inclusion"),),
            "frequency-dependence": (show.items(answers), show.pictures("dependence")),
        }
        sections = [
            section(
                table.name,
                table.title,
                table.name.replace("-", " ").capitalize(),
                above.get(table.name, ""),
                show.table(table),
                *below.get(table.name, ()),
            )
            for table in self.tables(result)
        ]
        return Page(
            _title(result),
            "Term selection compared",
            result.joint,
            (show.answers(self.headline(result), self.question, "", found),),
            (*sections, section("warnings", "To be aware of", "", show.warnings(self.warnings(result), ""))),
        )

    def origin(self, result: Comparison, command_line: Any, seed: object, files: Any) -> Provenance:
        """Return the origin of the campaign's runs, too."""
        return provenance(result.discovery.campaign, seed, command_line, files)

    def records(self, result: Comparison) -> list[dict[str, Any]]:
        """Return every choice, term by term, numbers in SI units."""
        groups = {**result.groups, "model": (result.model,)}
        missing = float("nan")
        none = SimpleNamespace(coefficient=missing, standard_error=missing, interval95=(missing, missing))
        return [
            {
                "kind": kind,
                "name": choice.name,
                "term": term,
                "chosen": int(choice[term] is not None),
                "coefficient": (held := choice[term] or none).coefficient,
                "standard_error": held.standard_error,
                "interval95_low": held.interval95[0],
                "interval95_high": held.interval95[1],
                "unit": result.units.get(term, ""),
            }
            for kind, choices in groups.items()
            for choice in choices
            for term in result.shown_ids
        ]

    def files(self, result: Comparison, data: Comparison) -> dict[str, str]:
        """Return the tables as CSV, Markdown and LaTeX."""
        tables = self.tables(result)
        latex = "\n".join(table.latex() for table in tables)
        return {
            "comparison.csv": csv_records(self.records(result)),
            "comparison.md": _markdown(result, tables, self.warnings(result)),
            "comparison.tex": f"% needs \\usepackage{{booktabs}}\n{latex}",
        }

    def headline(self, result: Comparison) -> Trust:
        """Return whether methods, frequencies and resampled campaigns agree."""
        return result.trust or judge_comparison(result)

    def about(self, result: Comparison) -> str:
        """Return the joint, and how much is compared."""
        simulated = " (simulated)" if result.simulated else ""
        plural = {"method": "methods", "library": "libraries", result.parts: result.several}
        many = [f"{len(each)} {plural.get(by, f'{by}s')}" for by, each in result.groups.items() if each]
        return f"{escape(result.joint)}{simulated}: terms by {', '.join(many)}"

    def show_result(self, result: Comparison, console: Console) -> None:
        """Print the model, what every choice leads to, and whether coefficients change with frequency."""
        names = ", ".join(spelled(term, result.motion) for term in result.model.ids)
        known = result.discovery is not None and result.model.terms
        said = result.discovery.model.equation() if known else names or result.model.reason
        console.print(f"  {escape(said)}\n")
        print_table(choices_table(result).headed(), console, "llrrrrl", wraps=True)
        if result.of_paper:
            console.print(f"\n{escape(result.agreement)}")
        if result.tests:
            console.print()
            tests = tests_table(result.tests, result.motion).take(
                "term", "trend over band", "at most", "p", "answer"
            )
            heads = ("over the tested band", "trend", "at most", "p", "answer")
            print_table(tests.headed(*heads), console, "lrrrl", wraps=True)

    def warnings(self, result: Comparison) -> tuple[str, ...]:
        """Return what these runs do not tell apart, too."""
        return (*result.undetermined, *result.warnings)

    def details(self, result: Comparison) -> Iterator[str]:
        """Yield how long each method took, and what it led to."""
        columns: dict[str, Callable[[Choice], str]] = {
            "method": lambda choice: choice.name,
            "time": lambda choice: seconds(choice.seconds),
            "terms": lambda choice: " ".join(term.id for term in choice.terms) or "none",
        }
        choices = [choice for group in result.groups.values() for choice in group]
        yield from aligned(tabulate("choices", "", choices, columns))
        yield from (f"{stage}: {seconds(spent)}" for stage, spent in result.seconds.items())


def _title(result: Comparison) -> str:
    *first, last = (by for by, choices in result.groups.items() if choices)
    return f"{result.joint}: terms by {', '.join(first)} and {last}"


def _markdown(result: Comparison, tables: Sequence[TextTable], warnings: Sequence[str]) -> str:
    notes = "\n".join(f"- {text}" for text in warnings)
    parts = [
        f"# {_title(result)}",
        *(["Simulated, not measured."] if result.simulated else []),
        f"{result.agreement}.",
        *(f"## {table.title}\n\n{table.markdown()}" for table in tables),
        *([f"## To be aware of\n\n{notes}"] if notes else []),
    ]
    return "\n\n".join(parts) + "\n"
