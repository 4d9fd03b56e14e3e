"""A comparison: its tables, and every form they take; on a terminal, as pictures, as a page, as files."""

from collections.abc import Callable, Iterator, Sequence
from functools import partial
from types import SimpleNamespace
from typing import Any

import numpy as np

from sindyjoint.discovery.frequency import FrequencyTest
from sindyjoint.judgement.comparison import Choice, Comparison, GivenModel
from sindyjoint.judgement.headlines import judge_comparison
from sindyjoint.limits import DISCOVERY
from sindyjoint.reporting.equation import estimate, interval_text, signed_percent, with_unit
from sindyjoint.reporting.figure import Kind, by_name, fixed
from sindyjoint.reporting.mathml import mathml
from sindyjoint.reporting.page import Blocks, Page, markup, section, sentence
from sindyjoint.reporting.results.discovery_terms import dependence
from sindyjoint.reporting.style import INK, MUTED, PALETTE, RULE, Axes, plain, shortened
from sindyjoint.reporting.tables import (
    DASH,
    Console,
    TextTable,
    aligned,
    csv_records,
    escape,
    shown,
    tabulate,
)
from sindyjoint.reporting.view import FINDING, View
from sindyjoint.soundness import Soundness
from sindyjoint.text import list_some, quantities, rounded, spelled


def _best_first(choices: Sequence[Choice]) -> list[Choice]:
    """Return choices by what they err on what was left out, then on the response, then on what was fitted.

    Those that are equal as far as is shown keep their order.
    """

    def errors(choice: Choice) -> list[float]:
        known = (choice.held_out, choice.response, choice.residual)
        return [round(value, 4) if choice.terms and np.isfinite(value) else np.inf for value in known]

    return sorted(choices, key=errors)


def against_terms_table(by: str, result: Comparison, choices: Sequence[Choice]) -> TextTable:
    """Return a row for each term, and for what a search was not given; a column for each choice, best first."""
    name, title = {
        "method": ("methods", "Methods against terms"),
        "frequency": ("frequencies", "Each single frequency against terms"),
        "library": ("libraries", "Libraries against terms"),
        "friction law": ("friction-laws", "Laws of friction under the load"),
    }.get(by, (f"{by}s", f"Each single {by} against terms"))
    choices = _best_first(choices)
    held = [t for t in result.shown_ids if t in result.reference or any(choice[t] for choice in choices)]
    rows = [
        (
            with_unit(term, result.units.get(term, "?"), result.motion),
            *(estimate(one.coefficient, one.standard_error) if (one := c[term]) else DASH for c in choices),
        )
        for term in held
    ]
    more = {
        "time of the path, s": [f"{c.seconds:.2f}" if np.isfinite(c.seconds) else DASH for c in choices],
        "its search is not given": [", ".join(choice.not_given) or DASH for choice in choices],
    }
    rows += [(called, *cells) for called, cells in more.items() if set(cells) != {DASH}]
    return TextTable(name, title, ("term", *(choice.name for choice in choices)), tuple(rows))


def coefficients_table(result: Comparison) -> TextTable:
    """List each term of the model: inclusion, value and interval."""
    share = dict(zip(result.ids, result.inclusion, strict=True))
    return tabulate(
        "coefficients",
        "Coefficients",
        result.model.terms,
        {
            "term": lambda term: with_unit(term.id, result.units.get(term.id, "?"), result.motion),
            "in resampled campaigns": lambda term: _percent(share.get(term.id, float("nan"))),
            "value": lambda term: estimate(term.coefficient, term.standard_error),
            "95 % interval": lambda term: interval_text(*term.interval95, term.standard_error),
        },
    )


def tests_table(tests: Sequence[FrequencyTest], motion: str) -> TextTable:
    """Return a row for each coefficient: its value at each frequency, and whether that changes."""

    def at_frequency(test: FrequencyTest, at: int) -> str:
        return estimate(test.estimates[at], test.standard_errors[at])

    def answer(test: FrequencyTest) -> str:
        small = test.answer == "independent within margin" and test.p_value < DISCOVERY.level
        return test.answer + (f"; a change of {signed_percent(test.change)} is significant" if small else "")

    return tabulate(
        "frequency-dependence",
        "Are the coefficients the same at every frequency?",
        tests,
        {
            "term": lambda test: spelled(test.name, motion),
            **{f"{f:.4g} Hz": partial(at_frequency, at=at) for at, f in enumerate(tests[0].frequencies)},
            "Q": lambda test: f"{test.q:.1f}",
            "I²": lambda test: f"{100 * test.i_squared:.0f} %",
            "τ / mean": lambda test: _percent(test.tau / abs(test.mean)),
            "trend over band": lambda test: signed_percent(test.change),
            "p": lambda test: f"{test.p_value:.2g}",
            "at most": lambda test: _percent(test.change_bound),
            "answer": answer,
        },
    )


def folds_table(result: Comparison) -> TextTable:
    """Return what is found without each frequency, level or part, and its error there."""
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
    kinds = " or ".join(
        kind if kind in ("frequency", "level", "run") else f"level of {kind}" for kind in result.left_out
    )
    apart = {"time": "one part of the run", "run": "one run"}.get(
        "".join(result.left_out), f"the runs of one {kinds}"
    )
    return TextTable(
        "left-out",
        f"Without {apart}",
        ("left out", f"error of its {quantities(result.motion).moment.lower()}", "terms found"),
        tuple(rows),
    )


def choices_table(result: Comparison) -> TextTable:
    """Return what every choice leads to, by method, frequency, level and library, best first; and the floor."""
    own = "the paper's" if result.of_paper else "the model's"
    load, given = quantities(result.motion).moment.lower(), result.given
    further: list[tuple[str, ...]] = []
    if given is not None:
        left = _percent(given.residual)
        further.append(
            (
                "given model", "", str(len(given.terms)), DASH if given.seen else left, _percent(given.response), left,
                _listed(given.elements, result.motion),
            )
        )  # fmt: skip
    floor = _percent(result.noise_floor) if np.isfinite(result.noise_floor) else "unknown"
    further.append(("noise floor", *[""] * 4, floor, ""))
    choices = [(by, choice) for by, choices in result.groups.items() for choice in _best_first(choices)]
    return tabulate(
        "choices",
        "Choices, best first",
        choices,
        {
            "Choice": lambda one: shortened(one[1].name),
            "By": lambda one: one[0],
            "Terms": lambda one: str(len(one[1].terms)),
            f"Left-out {load}": lambda one: _percent(one[1].held_out, one[1].held_out_error),
            "Response": lambda one: _percent(one[1].response),
            "Residual": lambda one: _percent(one[1].residual),
            f"Instead of {own}": lambda one: _difference(result, one[1]),
        },
        further,
        text=("Choice",),
    )


def given_model_table(given: GivenModel, motion: str) -> TextTable:
    """Return a model that was there before, beside the others."""
    return TextTable(
        "given-model",
        "The given model",
        ("", "given model"),
        (
            ("terms", _listed(given.terms, motion)),
            ("elements", _listed(given.elements, motion)),
            ("its numbers were fitted to this campaign", "yes" if given.seen else "no"),
        ),
    )


def _listed(ids: Sequence[str], motion: str) -> str:
    return ", ".join(spelled(name, motion) for name in ids) or DASH


def _difference(result: Comparison, choice: Choice) -> str:
    """Return what a choice has instead of the terms that it is held against."""
    if not choice.terms:
        return "no model"
    signed = zip("+−", choice.beside(result.reference), strict=True)
    parts = [f"{sign} {spelled(term, result.motion)}" for sign, terms in signed for term in terms]
    return list_some(parts, "terms") if parts else "the same"


def _percent(value: float, error: float = float("nan")) -> str:
    if np.isfinite(value) and np.isfinite(error) and error > 0:
        return f"{rounded(100 * value, 100 * error)} %"
    return f"{100 * value:.{2 if value < 0.1 else 0}f} %" if np.isfinite(value) else DASH


def _inclusion_rows(result: Comparison) -> list[tuple[str, list[float]]]:
    """Return label and share of each term: of the resampled campaigns first, then of every choice."""
    terms = result.shown_ids
    share = dict(zip(result.ids, result.inclusion, strict=True))
    chosen = [
        (choice.name, [float(choice[term] is not None) for term in terms])
        for group in result.groups.values()
        for choice in group
    ]
    return [("resampled campaigns", [share.get(term, 0.0) for term in terms]), *chosen]


def inclusion(result: Comparison, ax: Axes) -> None:
    """Draw which term is chosen by what: a row for each choice, and for the resampled campaigns."""
    from matplotlib.patches import Rectangle

    terms, rows = result.shown_ids, _inclusion_rows(result)
    for (y, x), value in np.ndenumerate(np.array([values for _, values in rows], dtype=float)):
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
    ax.set_xticks(
        range(len(terms)), [spelled(term, result.motion) for term in terms], rotation=40, ha="right",
        rotation_mode="anchor",
    )  # fmt: skip
    ax.tick_params(length=0)
    ax.grid(color=RULE, linewidth=0.3)


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


def _tables(result: Comparison) -> tuple[TextTable, ...]:
    """Return the tables of a comparison, that of all choices first."""
    return (
        choices_table(result),
        *(against_terms_table(by, result, choices) for by, choices in result.groups.items() if choices),
        coefficients_table(result),
        *([tests_table(result.tests, result.motion)] if result.tests else []),
        *([folds_table(result)] if result.left_out else []),
        *(given_model_table(given, result.motion) for given in (result.given,) if given is not None),
    )


def _page(result: Comparison, data: Comparison, show: Blocks) -> Page:
    """Return how far all agree, which terms are chosen by what, and every table."""
    model = None if result.discovery is None else result.discovery.model
    about = (
        f"Sorted by the error of the {quantities(result.motion).moment.lower()} that was left out, with its standard "
        f"error. Model by {result.methods[0].name}: {result.model.reason}."
    )
    answers = [f"{spelled(test.name, result.motion)}: {test.answer}; {test.reason}." for test in result.tests]
    below = {
        "choices": (show.pictures("inclusion"),),
        "frequency-dependence": (show.items(answers), show.pictures("dependence")),
    }
    sections = [
        section(
            table.name,
            table.title,
            table.name.replace("-", " ").capitalize(),
            show.paragraph(about, "reason") if table.name == "choices" else "",
            show.table(table),
            *below.get(table.name, ()),
        )
        for table in _tables(result)
    ]
    return Page(
        _title(result),
        "Term selection compared",
        result.joint,
        "",
        (
            show.equation(markup(mathml(model))) if model and model.terms else "",
            show.verdict(sentence(result.agreement)) if result.of_paper else "",
        ),
        (),
        (*sections, section("warnings", "To be aware of", "", show.warnings(_warnings(result), ""))),
    )


def _rows(result: Comparison) -> list[dict[str, Any]]:
    """Return every choice, term by term, numbers in SI units."""
    none = SimpleNamespace(coefficient=np.nan, standard_error=np.nan, interval95=(np.nan, np.nan))
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
        for kind, choices in {**result.groups, "model": (result.model,)}.items()
        for choice in choices
        for term in result.shown_ids
    ]


def _files(result: Comparison, data: Comparison) -> dict[str, str]:
    """Return the tables as CSV, Markdown and LaTeX."""
    tables = _tables(result)
    return {
        "comparison.csv": csv_records(_rows(result)),
        "comparison.md": _markdown(result, tables, _warnings(result)),
        "comparison.tex": "\n".join(["% needs \\usepackage{booktabs}", *(table.latex() for table in tables)]),
    }


def _about(result: Comparison) -> str:
    """Return the joint, and how much is compared."""
    plural = {"method": "methods", "library": "libraries", result.parts: result.several}
    many = [f"{len(each)} {plural.get(by, f'{by}s')}" for by, each in result.groups.items() if each]
    return f"{escape(result.joint)}{' (simulated)' * result.simulated}: terms by {', '.join(many)}"


def _printed(result: Comparison, console: Console) -> list[Any]:
    """Return the model, what every choice leads to, and whether coefficients change with frequency."""
    names = ", ".join(spelled(term, result.motion) for term in result.model.ids)
    known = result.discovery is not None and result.model.terms
    said = result.discovery.model.equation() if known else names or result.model.reason
    shown = [f"  {escape(said)}\n", choices_table(result).headed(wraps=True)]
    shown += [f"\n{escape(result.agreement)}"] * result.of_paper
    if result.tests:
        taken = tests_table(result.tests, result.motion).take(
            "term", "trend over band", "at most", "p", "answer"
        )
        shown += ["", taken.headed("over the tested band", "trend", "at most", "p", "answer", wraps=True)]
    return shown


def _warnings(result: Comparison) -> tuple[str, ...]:
    """Return what these runs do not tell apart, too."""
    return (*result.undetermined, *result.warnings)


_CHOSEN: dict[str, Callable[[Choice], str]] = {
    "method": lambda choice: choice.name,
    "time": lambda choice: shown("{:.2f} s", choice.seconds),
    "terms": lambda choice: " ".join(term.id for term in choice.terms) or "none",
}


def _details(result: Comparison) -> Iterator[str]:
    """Yield how long each method took, and what it led to."""
    choices = [choice for group in result.groups.values() for choice in group]
    yield from aligned(tabulate("choices", "", choices, _CHOSEN))
    yield from (f"{stage}: {shown('{:.2f} s', spent)}" for stage, spent in result.seconds.items())


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


COMPARISON = View(
    about=_about,
    data=Comparison,
    kind="Comparison",
    folder="comparison",
    kinds=KINDS,
    record_file="comparison.json",
    judged_by=lambda result: FINDING,
    unsaved={"discovery": None, "left_out": {}, "soundness": Soundness()},
    # Whether methods, frequencies and resampled campaigns agree.
    headline=lambda result: result.trust or judge_comparison(result),
    tables=_tables,
    rows=_rows,
    page=_page,
    campaign=lambda result: result.discovery.campaign,
    files=_files,
    printed=_printed,
    warnings=_warnings,
    details=_details,
)
