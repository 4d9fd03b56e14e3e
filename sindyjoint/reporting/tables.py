"""Tables: the terms of a model as rows, as CSV text, and as a table for a terminal."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

from sindyjoint.equation.element import JointElement
from sindyjoint.equation.formula import formula_pretty
from sindyjoint.equation.model import JointModel
from sindyjoint.reporting.style import pretty_unit
from sindyjoint.reporting.text_table import DASH, TextTable, csv_text, terminal_table
from sindyjoint.soundness.finding import Finding
from sindyjoint.text import in_words_of, rounded, superscript

if TYPE_CHECKING:
    from rich.table import Table

TERM_COLUMNS = (
    "id",
    "symbol",
    "name",
    "formula",
    "coefficient",
    "standard_error",
    "interval95_low",
    "interval95_high",
    "unit",
    "unique_share",
)


@dataclass(frozen=True)
class TermRow:
    """A term as people read it.

    Parameters
    ----------
    id, symbol, name, formula, unit : str
        Formula and unit in plain text: ``θ²``, ``N·m/rad²``.
    value : str
        Coefficient and uncertainty, rounded: ``5910 ± 40``.
    interval : str
        95 % interval, each end to the place that the uncertainty allows.
    coefficient, standard_error : float
    share : float
        Moment that no other term can take over, of the RMS moment.
    """

    id: str
    symbol: str
    name: str
    formula: str
    unit: str
    value: str
    interval: str
    coefficient: float
    standard_error: float
    share: float


def term_rows(model: JointModel) -> list[TermRow]:
    """Return the terms of a model as rows to read, then the numbers of its elements; these have no share."""
    return [*_own_rows(model), *(row for element in model.elements for row in _element_rows(element, model))]


def _element_rows(element: JointElement, model: JointModel) -> list[TermRow]:
    motion = model.joint.motion
    formulas = [formula_pretty(column.expression, motion) for column in element.form.columns]
    formulas += [""] * len(element.parameters)
    return [
        TermRow(
            id=f"{element.id}.{number.name}",
            symbol=number.name,
            name=in_words_of(motion, element.name),
            formula=formula,
            unit=pretty_unit(number.unit),
            value=superscripted(rounded(number.value, number.standard_error)),
            interval=interval_text(*number.interval95, number.standard_error),
            coefficient=number.value,
            standard_error=number.standard_error,
            share=float("nan"),
        )
        for number, formula in zip(element.numbers, formulas, strict=True)
    ]


def _own_rows(model: JointModel) -> list[TermRow]:
    return [
        TermRow(
            id=term.id,
            symbol=term.symbol,
            name=in_words_of(model.joint.motion, term.name),
            formula=formula_pretty(term.expression, model.joint.motion),
            unit=pretty_unit(term.unit),
            value=superscripted(rounded(term.coefficient, term.standard_error)),
            interval=interval_text(*term.interval95, term.standard_error),
            coefficient=term.coefficient,
            standard_error=term.standard_error,
            share=term.unique_share,
        )
        for term in model.terms
    ]


def model_table(model: JointModel) -> TextTable:
    """Return the terms of a model as a table of a page."""
    return TextTable(
        "terms",
        "Coefficients with one standard error.",
        ("Term", "Symbol", "Of", "Value", "Unit", "95 % interval"),
        tuple(
            (row.name, row.symbol, row.formula or DASH, row.value, row.unit, row.interval)
            for row in term_rows(model)
        ),
    )


def interval_text(low: float, high: float, error: float) -> str:
    """Return an interval with its ends rounded to the place of the error.

    Examples
    --------
    >>> interval_text(5830.71, 5993.9, 41.7)
    '5830 … 5990'
    """
    ends = [superscripted(rounded(end, error)).partition(" ±")[0].lstrip("(") for end in (low, high)]
    powers = {rounded(end, error).rpartition(")")[2] for end in (low, high)}
    if len(powers) == 1 and (power := powers.pop()):
        return f"({ends[0]} … {ends[1]}){_power(power)}"
    if any(")" in rounded(end, error) for end in (low, high)):
        return f"{low:.4g} … {high:.4g}"
    return f"{ends[0]} … {ends[1]}"


def superscripted(text: str) -> str:
    """Return ``(1.2 ± 0.1)e9`` as ``(1.2 ± 0.1)·10⁹``; a minus sign where a hyphen stood.

    Examples
    --------
    >>> superscripted("(-2.684 ± 0.012)e9")
    '(−2.684 ± 0.012)·10⁹'
    """
    head, bracket, power = text.rpartition(")e")
    shown = f"{head}){_power('e' + power)}" if bracket else text
    return shown.replace("-", "−")


def _power(power: str) -> str:
    return f"·10{superscript(power.lstrip('e'))}"


def terms_csv(model: JointModel) -> str:
    """Return the terms as CSV text, numbers in full, SI."""
    rows = []
    for term in model.terms:
        numbers = map(repr, (term.coefficient, term.standard_error, *term.interval95))
        name = in_words_of(model.joint.motion, term.name)
        text = (term.id, term.symbol, name, term.formula)
        rows.append((*text, *numbers, term.unit, repr(term.unique_share)))
    for element in model.elements:
        for number in element.numbers:
            values = map(repr, (number.value, number.standard_error, *number.interval95))
            name = in_words_of(model.joint.motion, element.name)
            text = (f"{element.id}.{number.name}", number.name, name, number.formula)
            rows.append((*text, *values, number.unit, ""))
    return csv_text(TERM_COLUMNS, rows)


def terms_table(model: JointModel) -> Table:
    """Return the terms as a rich table for a terminal."""
    columns = ("term", "", "of", "value", "unit", "unique share")
    rows = [
        (row.name, row.symbol, row.formula, row.value, row.unit, share_text(row.share))
        for row in term_rows(model)
    ]
    return terminal_table(columns, rows, "lllrlr", ruled=True, wraps=True)


def share_text(share: float) -> str:
    """Return a share in per cent; a dash where there is none.

    Examples
    --------
    >>> share_text(0.272)
    '27.2 %'
    """
    return f"{100 * share:.1f} %" if share == share else DASH


def findings_table(findings: Sequence[Finding]) -> TextTable:
    """Return what a check of the data found, one row for each finding."""
    columns = ("Finding", "Where", "Severity", "Extent", "What it does; what to do")
    rows = tuple(
        (
            f.id,
            ", ".join(part for part in (f.run, f.channel) if part) or "all runs",
            f"{f.severity}, left out" if f.masked else f.severity,
            f.extent,
            f"{f.effect}; {f.remedy}",
        )
        for f in findings
    )
    title = "What the check of the data found, by the ids that --accept takes."
    return TextTable("findings", title, columns, rows, text=columns)
