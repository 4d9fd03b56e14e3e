"""A comparison: its tables, and every form they take; on a terminal, as a page, as files."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from sindyjoint.discovery.frequency import FrequencyTest
from sindyjoint.discovery.policy import POLICY as DISCOVERY
from sindyjoint.judgement.comparison import Comparison
from sindyjoint.judgement.headlines import judge_comparison
from sindyjoint.reporting.equation import mathml
from sindyjoint.reporting.figures.comparison import KINDS
from sindyjoint.reporting.page import markup
from sindyjoint.reporting.provenance import Provenance, provenance
from sindyjoint.reporting.style import pretty_unit, shortened
from sindyjoint.reporting.tables import interval_text, superscripted
from sindyjoint.reporting.text_table import (
    DASH,
    TextTable,
    aligned,
    csv_text,
    print_wrapped,
    short_number,
    terminal_table,
)
from sindyjoint.reporting.view import FINDING, View
from sindyjoint.soundness.finding import Soundness
from sindyjoint.text import quantities, rounded, spelled

if TYPE_CHECKING:
    from rich.console import Console

    from sindyjoint.judgement.comparison import Choice, GivenModel
    from sindyjoint.trust import Trust


# Of the CSV file, and of a data frame.
LONG_COLUMNS = ("kind", "name", "term", "chosen", "coefficient", "standard_error", "interval95_low",
                "interval95_high", "unit")  # fmt: skip


class ComparisonView(View[Comparison, Comparison]):
    """A comparison."""

    results = (Comparison,)
    data = Comparison
    kind = "Comparison"
    folder = "comparison"
    kinds = KINDS
    template = "comparison.html.j2"
    record_file = "comparison.json"
    judged_by = FINDING
    unsaved = {"discovery": None, "left_out": {}, "soundness": Soundness()}  # noqa: RUF012

    def tables(self, result: Comparison) -> tuple[TextTable, ...]:
        """Return the tables of a comparison."""
        tables = [_against_terms("methods", "Methods against terms", result, result.methods)]
        if result.frequencies:
            title = f"Each single {result.parts} against terms"
            tables.append(_against_terms(result.several, title, result, result.frequencies))
        tables.append(_against_terms("libraries", "Libraries against terms", result, result.libraries))
        tables.append(_coefficients(result))
        if result.tests:
            tables.append(_tests(result.tests, result.motion))
        if result.left_out:
            tables.append(_folds(result))
        if result.given is not None:
            tables.append(_given_model(result.given, result.motion))
        return tuple(tables)

    def content(self, result: Comparison, data: Comparison, folder: Path | None) -> dict[str, Any]:
        """Return what the page shows."""
        model = None if result.discovery is None else result.discovery.model
        return {"title": _title(result), "equation": markup(mathml(model)) if model and model.terms else ""}

    def lead(self, result: Comparison, data: Comparison) -> tuple[str, int]:
        """Return the inclusion map."""
        return "inclusion", 0

    def origin(self, result: Comparison, command_line: Any, seed: object, files: Any) -> Provenance:
        """Return the origin of the campaign's runs, too."""
        return provenance(result.discovery.campaign, seed, command_line, files)

    def records(self, result: Comparison) -> list[dict[str, Any]]:
        """Return every choice, term by term, numbers in SI units."""
        return [dict(zip(LONG_COLUMNS, row, strict=True)) for row in _long_rows(result, float("nan"))]

    def files(self, result: Comparison, data: Comparison) -> dict[str, str]:
        """Return the tables as CSV, Markdown and LaTeX."""
        tables = self.tables(result)
        return {
            "comparison.csv": long_csv(result),
            "comparison.md": _markdown(result, tables),
            "comparison.tex": "% needs \\usepackage{booktabs}\n"
            + "\n".join(table.latex() for table in tables),
        }

    def headline(self, result: Comparison) -> Trust:
        """Return whether methods, frequencies and resampled campaigns agree."""
        return result.trust or judge_comparison(result)

    def about(self, result: Comparison) -> str:
        """Return the joint, and how much is compared."""
        from rich.markup import escape

        simulated = " (simulated)" if result.simulated else ""
        apart = f", {len(result.frequencies)} {result.several}" if result.frequencies else ""
        many = f"{len(result.methods)} methods{apart}, {len(result.libraries)} libraries"
        return f"{escape(result.joint)}{simulated}: terms by {many}"

    def show_result(self, result: Comparison, console: Console) -> None:
        """Print the model, what every choice leads to, and whether coefficients change with frequency."""
        from rich.markup import escape

        names = ", ".join(spelled(term, result.motion) for term in result.model.ids)
        known = result.discovery is not None and result.model.terms
        console.print(
            f"  {escape(result.discovery.model.equation() if known else names or result.model.reason)}\n"
        )
        choices = _choice_rows(result)
        load = quantities(result.motion).moment.lower()
        columns = (
            "",
            "terms",
            "residual",
            f"left-out {load}",
            "response",
            f"instead of {result.paper_set.removesuffix(' terms')}",
        )
        print_wrapped(terminal_table(columns, choices, "lrrrrl"), console)
        console.print(f"\n{escape(result.agreement)}")
        if result.tests:
            rows = [
                (
                    spelled(t.name, result.motion),
                    _trend(t),
                    _percent(t.change_bound),
                    f"{t.p_value:.2g}",
                    t.answer,
                )
                for t in result.tests
            ]
            heads = ("over the tested band", "trend", "at most", "p", "answer")
            console.print()
            print_wrapped(terminal_table(heads, rows, "lrrrl"), console)
        for text in (*result.undetermined, *result.warnings):
            console.print(f"- {escape(text)}")

    def details(self, result: Comparison) -> Iterator[str]:
        """Yield how long each method took, and what it led to."""
        rows = [("method", "time", "held out", "response", "terms")]
        for choice in (*result.methods, *result.frequencies, *result.libraries):
            rows.append(
                (
                    choice.name,
                    _seconds(choice.seconds),
                    short_number(choice.held_out),
                    short_number(choice.response),
                    " ".join(term.id for term in choice.terms) or "none",
                )
            )
        yield from aligned(rows)
        yield from (f"{stage}: {_seconds(spent)}" for stage, spent in result.seconds.items())


def _title(result: Comparison) -> str:
    return (
        f"{result.joint}: terms by method, {f'{result.parts} and ' if result.frequencies else 'and '}library"
    )


def _against_terms(name: str, title: str, result: Comparison, choices: Sequence[Choice]) -> TextTable:
    rows = []
    for term in result.shown_ids:
        if any(choice[term] for choice in choices) or term in result.wanted:
            rows.append(
                (
                    f"{spelled(term, result.motion)} ({pretty_unit(result.units.get(term, '?'))})",
                    *(_cell(c, term) for c in choices),
                )
            )
    rows.append(("terms", *(str(len(c.terms)) for c in choices)))
    rows.append(("the paper's set", *("yes" if c.agrees else "no" for c in choices)))
    if any(np.isfinite(c.residual) for c in choices):
        rows.append(("residual", *(_percent(c.residual) for c in choices)))
    if any(np.isfinite(c.held_out) for c in choices):
        load = quantities(result.motion).moment.lower()
        rows.append((f"error of left-out {load}", *(_percent(c.held_out) for c in choices)))
    if any(np.isfinite(c.response) for c in choices):
        rows.append(("error of left-out response", *(_percent(c.response) for c in choices)))
    if any(np.isfinite(c.seconds) for c in choices):
        rows.append(("time of the path, s", *(f"{c.seconds:.2f}" for c in choices)))
    if any(c.not_given for c in choices):
        rows.append(("its search is not given", *(", ".join(c.not_given) or DASH for c in choices)))
    return TextTable(name, title, ("term", *(c.name for c in choices)), tuple(rows))


def _coefficients(result: Comparison) -> TextTable:
    """List each term of the model: inclusion, value and interval after correction, and the bias that was corrected."""
    share = dict(zip(result.ids, result.inclusion, strict=True))
    rows = []
    for term in result.model.terms:
        rows.append(
            (
                f"{spelled(term.id, result.motion)} ({pretty_unit(result.units[term.id])})",
                _percent(share.get(term.id, float("nan"))),
                _value(term.coefficient, term.standard_error),
                interval_text(*term.interval95, term.standard_error),
                f"{100 * (result.bias[term.id] / abs(term.coefficient)):+.2f} %".replace("-", "−")
                if term.id in result.bias
                else DASH,
            )
        )
    return TextTable(
        "coefficients",
        "Coefficients",
        ("term", "in resampled campaigns", "value", "95 % interval", "bias taken out"),
        tuple(rows),
    )


def _tests(tests: Sequence[FrequencyTest], motion: str) -> TextTable:
    columns = (
        "term",
        *(f"{f:.4g} Hz" for f in tests[0].frequencies),
        "Q",
        "I²",
        "τ / mean",
        "trend over band",
        "p",
        "at most",
        "answer",
    )
    rows = []
    for test in tests:
        values = [_value(x, s) for x, s in zip(test.estimates, test.standard_errors, strict=True)]
        spread = (f"{test.q:.1f}", f"{100 * test.i_squared:.0f} %", _percent(test.tau / abs(test.mean)))
        trend = _trend(test)
        text: str = test.answer
        if text == "independent within margin" and test.p_value < DISCOVERY.frequency_level:
            text += f"; a change of {trend} is significant"
        answer = (trend, f"{test.p_value:.2g}", _percent(test.change_bound), text)
        rows.append((spelled(test.name, motion), *values, *spread, *answer))
    return TextTable(
        "frequency-dependence", "Are the coefficients the same at every frequency?", columns, tuple(rows)
    )


def _trend(test: FrequencyTest) -> str:
    """Return the change over the tested band, of the mean."""
    return f"{100 * test.change:+.1f} %".replace("-", "−")


def _folds(result: Comparison) -> TextTable:
    rows = [
        (
            f"{kind}: {', '.join(fold.left_out)}",
            _percent(fold.moment_error),
            "the same"
            if fold.kept == result.model.ids
            else ", ".join(spelled(term, result.motion) for term in fold.kept) or "none",
        )
        for kind, validation in result.left_out.items()
        for fold in validation.folds
    ]
    single = set(result.left_out) == {"time"}
    kinds = " or ".join(
        kind if kind in ("frequency", "level") else f"level of {kind}" for kind in result.left_out
    )
    apart = (
        "one run"
        if set(result.left_out) == {"run"}
        else f"the runs of one {kinds}".replace("level of run", "run")
    )
    return TextTable(
        "left-out",
        "Without one part of the run" if single else f"Without {apart}",
        ("left out", f"error of its {quantities(result.motion).moment.lower()}", "terms found"),
        tuple(rows),
    )


def long_csv(result: Comparison) -> str:
    """Return every choice, term by term, as CSV: numbers in full, SI."""
    return csv_text(LONG_COLUMNS, _long_rows(result, ""))


def _long_rows(result: Comparison, missing: Any) -> list[tuple[Any, ...]]:
    """Return every choice, term by term; ``missing`` stands for the numbers of a term that was not chosen."""
    groups = {
        "method": result.methods,
        result.parts: result.frequencies,
        "library": result.libraries,
        "model": (result.model,),
    }
    rows: list[tuple[Any, ...]] = []
    for kind, choices in groups.items():
        for choice in choices:
            for term in result.shown_ids:
                held, unit = choice[term], result.units.get(term, "")
                values = (held.coefficient, held.standard_error, *held.interval95) if held else (missing,) * 4
                rows.append((kind, choice.name, term, int(held is not None), *values, unit))
    return rows


def _markdown(result: Comparison, tables: Sequence[TextTable]) -> str:
    notes = [f"- {text}" for text in (*result.undetermined, *result.warnings)]
    head = (
        f"# {_title(result)}\n\n"
        + ("Simulated, not measured.\n\n" if result.simulated else "")
        + result.agreement
        + ".\n"
    )
    return "\n".join(
        [
            head,
            *(f"## {table.title}\n\n{table.markdown()}\n" for table in tables),
            *(["## To be aware of\n", *notes, ""] if notes else []),
        ]
    )


def _choice_rows(result: Comparison) -> list[tuple[str, ...]]:
    """Return what every method, frequency and library leads to, and the noise floor."""
    rows = [
        (
            shortened(choice.name),
            str(len(choice.terms)),
            *map(_percent, (choice.residual, choice.held_out, choice.response)),
            _difference(choice, result.motion),
        )
        for choice in (*result.methods, *result.frequencies, *result.libraries)
    ]
    given = result.given
    if given is not None:
        left_out = DASH if given.seen else _percent(given.residual)
        held = _percent(given.residual), left_out, _percent(given.response)
        rows.append(("given model", str(len(given.terms)), *held, _elements(given, result.motion)))
    floor = _percent(result.noise_floor) if np.isfinite(result.noise_floor) else "unknown"
    return [*rows, ("noise floor", "", floor, "", "", "")]


def _elements(given: GivenModel, motion: str) -> str:
    names = ", ".join(spelled(name, motion) for name in given.elements)
    return f"its own, with {names}" if names else "its own"


def _given_model(given: GivenModel, motion: str) -> TextTable:
    """Return a model that was there before, beside the others."""
    load = quantities(motion).moment.lower()
    rows = (
        ("terms", ", ".join(spelled(term, motion) for term in given.terms) or DASH),
        ("elements", ", ".join(spelled(name, motion) for name in given.elements) or DASH),
        (f"error of the {load}", _percent(given.residual)),
        ("error of the simulated response", _percent(given.response)),
        ("its numbers were fitted to this campaign", "yes" if given.seen else "no"),
    )
    return TextTable("given-model", "The given model", ("", "given model"), rows)


def _difference(choice: Choice, motion: str) -> str:
    """Return what a choice has instead of the paper's terms."""
    if not choice.terms:
        return "no model"
    if choice.agrees:
        return "the same"
    parts = [f"+ {spelled(term, motion)}" for term in choice.extra]
    return ", ".join([*parts, *(f"− {spelled(term, motion)}" for term in choice.missing)])


def _cell(choice: Choice, term: str) -> str:
    held = choice[term]
    return DASH if held is None else _value(held.coefficient, held.standard_error)


def _value(value: float, error: float) -> str:
    return superscripted(rounded(value, error)) if np.isfinite(error) else f"{value:.4g}".replace("-", "−")


def _percent(value: float) -> str:
    return (
        f"{100 * value:.2f} %"
        if np.isfinite(value) and value < 0.1
        else f"{100 * value:.0f} %"
        if np.isfinite(value)
        else DASH
    )


def _seconds(value: float) -> str:
    return "–" if not np.isfinite(value) else f"{value:.2f} s"
