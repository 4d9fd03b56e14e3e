"""A comparison for people: its tables as CSV, Markdown, LaTeX and HTML, its picture, its folder, its lines."""

from __future__ import annotations

import csv
import io
import os
import re
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from sindyjoint.discovery.frequency import FrequencyTest
from sindyjoint.discovery.policy import POLICY as DISCOVERY
from sindyjoint.paper import TERMS as PAPER_TERMS
from sindyjoint.reporting.page import inline_svg, markup, render
from sindyjoint.reporting.provenance import provenance
from sindyjoint.reporting.style import (
    INK,
    MUTED,
    PALETTE,
    RULE,
    plain,
    pretty_unit,
    shortened,
)
from sindyjoint.reporting.tables import interval_text, superscripted
from sindyjoint.text import rounded, spelled

if TYPE_CHECKING:
    from matplotlib.axes import Axes

    from sindyjoint.workflows.comparison import Choice, Comparison

DASH = "–"
MAP_CAPTION = (
    "A square: the term is chosen. In the first row its area is the share of resampled campaigns that do."
)
LATEX = {
    "&": r"\&",
    "%": r"\%",
    "_": r"\_",
    "#": r"\#",
    "$": r"\$",
    "{": r"\{",
    "}": r"\}",
    "\\": r"\textbackslash{}",
    "–": "--",
    "−": r"$-$",
    "±": r"$\pm$",
    "·": r"$\cdot$",
    "τ": r"$\tau$",
    "…": r"\ldots{}",
}
SUPERSCRIPT = str.maketrans("⁻⁰¹²³⁴⁵⁶⁷⁸⁹", "-0123456789")


@dataclass(frozen=True)
class TextTable:
    """A table of text that every format is made of.

    Parameters
    ----------
    name, title : str
    columns : tuple of str
    rows : tuple of tuple of str
    """

    name: str
    title: str
    columns: tuple[str, ...]
    rows: tuple[tuple[str, ...], ...]

    def markdown(self) -> str:
        """Return the table as Markdown."""
        lines = [self.columns, ("---",) * len(self.columns), *self.rows]
        body = "\n".join(
            "| " + " | ".join(cell.replace("|", r"\|") for cell in line) + " |" for line in lines
        )
        return f"## {self.title}\n\n{body}\n"

    def latex(self) -> str:
        """Return the table as LaTeX for the package booktabs."""
        lines = [" & ".join(_tex(cell) for cell in line) + r" \\" for line in (self.columns, *self.rows)]
        head, body = lines[0], "\n".join(lines[1:])
        align = "l" + "r" * (len(self.columns) - 1)
        return (
            f"\\begin{{table}}\n\\caption{{{_tex(self.title)}}}\n\\begin{{tabular}}{{{align}}}\n\\toprule\n{head}\n\\midrule\n"
            f"{body}\n\\bottomrule\n\\end{{tabular}}\n\\end{{table}}\n"
        )


def comparison_tables(result: Comparison) -> tuple[TextTable, ...]:
    """Return the tables of a comparison."""
    tables = [_against_terms("methods", "Methods against terms", result, result.methods)]
    if result.frequencies:
        title = "Each frequency alone against terms"
        tables.append(_against_terms("frequencies", title, result, result.frequencies))
    tables.append(_against_terms("libraries", "Libraries against terms", result, result.libraries))
    tables.append(_coefficients(result))
    if result.tests:
        tables.append(_tests(result.tests))
    if result.left_out:
        tables.append(_folds(result))
    return tuple(tables)


def _against_terms(name: str, title: str, result: Comparison, choices: Sequence[Choice]) -> TextTable:
    rows = []
    for term in result.shown_ids:
        if any(choice[term] for choice in choices) or term in PAPER_TERMS:
            rows.append(
                (
                    f"{spelled(term)} ({pretty_unit(result.units.get(term, '?'))})",
                    *(_cell(c, term) for c in choices),
                )
            )
    rows.append(("terms", *(str(len(c.terms)) for c in choices)))
    rows.append(("the paper's set", *("yes" if c.agrees else "no" for c in choices)))
    if any(np.isfinite(c.held_out) for c in choices):
        rows.append(("error of left-out moment", *(_percent(c.held_out) for c in choices)))
    if any(np.isfinite(c.response) for c in choices):
        rows.append(("error of left-out response", *(_percent(c.response) for c in choices)))
    if any(np.isfinite(c.seconds) for c in choices):
        rows.append(("time of the path, s", *(f"{c.seconds:.2f}" for c in choices)))
    return TextTable(name, title, ("term", *(c.name for c in choices)), tuple(rows))


def _coefficients(result: Comparison) -> TextTable:
    """Tell each term of the model: inclusion, value and interval after correction, and the bias that was corrected."""
    share = dict(zip(result.ids, result.inclusion, strict=True))
    rows = []
    for term in result.model.terms:
        rows.append(
            (
                f"{spelled(term.id)} ({pretty_unit(result.units[term.id])})",
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


def _tests(tests: Sequence[FrequencyTest]) -> TextTable:
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
        trend = f"{100 * test.change:+.1f} %".replace("-", "−")
        said: str = test.answer
        if said == "independent within margin" and test.p_value < DISCOVERY.frequency_level:
            said += f"; a change of {trend} is significant"
        answer = (trend, f"{test.p_value:.2g}", _percent(test.change_bound), said)
        rows.append((spelled(test.name), *values, *spread, *answer))
    return TextTable(
        "frequency-dependence", "Are the coefficients the same at every frequency?", columns, tuple(rows)
    )


def _folds(result: Comparison) -> TextTable:
    rows = [
        (
            f"{kind}: {', '.join(fold.left_out)}",
            _percent(fold.moment_error),
            "the same"
            if fold.kept == result.model.ids
            else ", ".join(spelled(term) for term in fold.kept) or "none",
        )
        for kind, validation in result.left_out.items()
        for fold in validation.folds
    ]
    single = set(result.left_out) == {"time"}
    return TextTable(
        "left-out",
        "Without one part of the run" if single else "Without the runs of one frequency or level",
        ("left out", "error of its moment", "terms found"),
        tuple(rows),
    )


def long_csv(result: Comparison) -> str:
    """Return every choice, term by term, as CSV: numbers in full, SI."""
    text = io.StringIO()
    writer = csv.writer(text, lineterminator="\n")
    numbers = ("coefficient", "standard_error", "interval95_low", "interval95_high")
    writer.writerow(("kind", "name", "term", "chosen", *numbers, "unit"))
    groups = {
        "method": result.methods,
        "frequency": result.frequencies,
        "library": result.libraries,
        "model": (result.model,),
    }
    for kind, choices in groups.items():
        for choice in choices:
            for term in result.shown_ids:
                held, unit = choice[term], result.units.get(term, "")
                values = (
                    (held.coefficient, held.standard_error, *held.interval95)
                    if held
                    else ("",) * len(numbers)
                )
                writer.writerow((kind, choice.name, term, int(held is not None), *values, unit))
    return text.getvalue()


def inclusion_height(result: Comparison) -> float:
    """Return the height of the inclusion map, inches: its rows, and the names of the terms below them."""
    return 2.0 + 0.17 * len(_inclusion_rows(result))


def _inclusion_rows(result: Comparison) -> list[tuple[str, list[float]]]:
    """Return label and share of each term: of the resampled campaigns first, then of every choice."""
    terms = result.shown_ids
    share = dict(zip(result.ids, result.inclusion, strict=True))
    rows = [("resampled campaigns", [share.get(term, 0.0) for term in terms])]
    for choices in (result.methods, result.frequencies, result.libraries):
        rows += [(choice.name, [float(choice[term] is not None) for term in terms]) for choice in choices]
    return rows


def inclusion(result: Comparison, ax: Axes) -> Axes:
    """Draw which term is chosen by what: one row for each method, frequency, library, and the resampled campaigns."""
    terms, rows = result.shown_ids, _inclusion_rows(result)
    ends = np.cumsum([1, len(result.methods), len(result.frequencies)])
    for y, (_, values) in enumerate(rows):
        for x, value in enumerate(values):
            if value > 0:
                colour = PALETTE[0] if terms[x] in PAPER_TERMS else PALETTE[1]
                # Area tells the share of replicates; a full square is a certain choice.
                ax.add_patch(_square(x, y, 0.86 * np.sqrt(value), colour))
    for end in ends:
        ax.axhline(end - 0.5, color=MUTED, linewidth=0.6)
    ax.axvline(len(PAPER_TERMS) - 0.5, color=INK, linewidth=0.8)
    ax.set_xlim(-0.5, len(terms) - 0.5)
    ax.set_ylim(len(rows) - 0.5, -0.5)
    names = [spelled(term) for term in terms]
    ax.set_xticks(range(len(terms)), names, rotation=40, ha="right", rotation_mode="anchor")
    ax.set_yticks(range(len(rows)), [plain(shortened(name, 20)) for name, _ in rows])
    ax.tick_params(length=0)
    ax.grid(color=RULE, linewidth=0.3)
    ax.set_title("left of the line: the paper's five")
    return ax


def _square(x: float, y: float, side: float, colour: str) -> Any:
    from matplotlib.patches import Rectangle

    return Rectangle((x - side / 2, y - side / 2), side, side, color=colour, linewidth=0)


def write_comparison(
    result: Comparison,
    folder: str | os.PathLike[str],
    command_line: str | Sequence[str] | None = None,
    seed: object = None,
) -> Path:
    """Write comparison.json, .csv, .md, .tex, report.html and figures/inclusion.svg, whole or not at all.

    Raises
    ------
    OutputError
        If the folder cannot be written.
    """
    from sindyjoint.reporting.figures import kinds_of
    from sindyjoint.reporting.output import draw_all, json_text, write_folder
    from sindyjoint.reporting.saved import DATA_FILE, saved_text

    tables = comparison_tables(result)
    kinds = kinds_of(result)
    pictures = draw_all(result)
    title = f"{result.joint}: terms by method, frequency and library"
    origin = provenance(result.discovery.campaign, seed, command_line)
    page = render(
        "comparison.html.j2",
        title=title,
        origin=origin,
        result=result,
        tables=tables,
        kinds=kinds,
        pictures={kind: markup(inline_svg(svg, kind, kinds[kind].title)) for kind, svg in pictures.items()},
    )
    texts = {
        DATA_FILE: saved_text(result),
        "comparison.json": json_text(result.to_dict()),
        "comparison.csv": long_csv(result),
        "comparison.md": _markdown(result, title, tables),
        "comparison.tex": "% needs \\usepackage{booktabs}\n" + "\n".join(table.latex() for table in tables),
        "report.html": page,
    }
    return write_folder(folder, pictures, texts)


def _markdown(result: Comparison, title: str, tables: Sequence[TextTable]) -> str:
    notes = [f"- {text}" for text in (*result.undetermined, *result.warnings)]
    head = (
        f"# {title}\n\n"
        + ("Simulated, not measured.\n\n" if result.simulated else "")
        + result.agreement
        + ".\n"
    )
    return "\n".join(
        [
            head,
            *(table.markdown() for table in tables),
            *(["## To be aware of\n", *notes, ""] if notes else []),
        ]
    )


def show_comparison(result: Comparison) -> None:
    """Print the comparison for a person."""
    simulated = " (simulated)" if result.simulated else ""
    print(f"{result.joint}{simulated}\n{result.agreement}\n")
    wide = max(len(choice.name) for choice in (*result.methods, *result.libraries))
    for choice in (*result.methods, *result.frequencies, *result.libraries):
        error = f"  left-out moment {_percent(choice.held_out)}" if np.isfinite(choice.held_out) else ""
        print(f"  {choice.name:<{wide}}  {_difference(choice)}{error}")
    if result.tests:
        print("\nthe same at every frequency?")
        for test in result.tests:
            print(f"  {spelled(test.name)}: {test.answer}; {test.reason}")
    for text in (*result.undetermined, *result.warnings):
        print(f"\nnote: {text}")


def _difference(choice: Choice) -> str:
    if not choice.terms:
        return "no model"
    if choice.agrees:
        return "the paper's five"
    parts = [f"without {_list(choice.missing)}"] if choice.missing else []
    parts += [f"with {_list(choice.extra)}"] if choice.extra else []
    return f"{len(choice.terms)} terms: the paper's " + ", ".join(parts)


def _list(terms: Sequence[str]) -> str:
    return " and ".join(spelled(term) for term in terms)


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


def _tex(text: str) -> str:
    text = re.sub(r"·10([⁻⁰¹²³⁴⁵⁶⁷⁸⁹]+)", lambda found: f"\0{found[1].translate(SUPERSCRIPT)}\1", text)
    text = "".join(LATEX.get(char, char) for char in text)
    text = re.sub(r"([⁻⁰¹²³⁴⁵⁶⁷⁸⁹]+)", lambda found: f"$^{{{found[1].translate(SUPERSCRIPT)}}}$", text)
    return text.replace("\0", r"$\cdot 10^{").replace("\1", "}$")
