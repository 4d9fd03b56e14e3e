"""The terms of an equation as tables, its symbols and numbers as text."""

import math
from dataclasses import dataclass
from html import escape
from itertools import zip_longest

from sindyjoint.equation.formula import formula_pretty
from sindyjoint.equation.model import JointModel
from sindyjoint.reporting.style import pretty_unit
from sindyjoint.reporting.tables import DASH, TextTable, csv_text, shown
from sindyjoint.text import in_words_of, quantities, rounded, spelled, superscript

_NAMES = "alpha beta gamma delta epsilon zeta eta theta kappa lambda mu nu xi rho sigma tau phi chi psi omega"
GREEK = dict(zip(_NAMES.split(), "αβγδεζηθκλμνξρστφχψω", strict=True))


def symbol_html(symbol: str) -> str:
    """Return a coefficient's symbol for a line of text: k1 as *k* with index 1."""
    head, tail = split_symbol(symbol)
    return f"<i>{escape(head)}</i>" + (f"<sub>{escape(tail)}</sub>" if tail else "")


def split_symbol(symbol: str) -> tuple[str, str]:
    """Return letter and index of a coefficient's symbol.

    Examples
    --------
    >>> split_symbol("k1"), split_symbol("M_F"), split_symbol("I")
    (('k', '1'), ('M', 'F'), ('I', ''))
    >>> split_symbol("mu_a")
    ('μ', 'a')
    """
    head, _, tail = symbol.partition("_")
    if not tail and len(head) > 1 and head[0].isalpha() and head[1:].isdigit():
        head, tail = head[0], head[1:]
    return GREEK.get(head, head), GREEK.get(tail, tail)


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
    """A term, or a number of an element, as people read it.

    Parameters
    ----------
    id, symbol, name : str
    written, formula : str
        As in a catalogue, and in plain text: ``θ²``.
    si : str
        Unit, as in a catalogue.
    coefficient, standard_error : float
    interval95 : tuple of float
    share : float
        Moment that no other term can take over, of the RMS moment; NaN of the number of an element.
    """

    id: str
    symbol: str
    name: str
    written: str
    formula: str
    si: str
    coefficient: float
    standard_error: float
    interval95: tuple[float, float]
    share: float = float("nan")

    @property
    def unit(self) -> str:
        """Unit in plain text: ``N·m/rad²``."""
        return pretty_unit(self.si)

    @property
    def value(self) -> str:
        """Coefficient and uncertainty, rounded: ``5910 ± 40``."""
        return superscripted(rounded(self.coefficient, self.standard_error))

    @property
    def interval(self) -> str:
        """95 % interval, each end to the place that the uncertainty allows."""
        return interval_text(*self.interval95, self.standard_error)


def term_rows(model: JointModel) -> list[TermRow]:
    """Return the terms of a model as rows to read, then the numbers of its elements."""
    motion = model.joint.motion
    rows = [
        TermRow(
            t.id, t.symbol, in_words_of(motion, t.name), t.formula, formula_pretty(t.expression, motion), t.unit,
            t.coefficient, t.standard_error, t.interval95, t.unique_share,
        )
        for t in model.terms
    ]  # fmt: skip
    for element in model.elements:
        name = in_words_of(motion, element.name)
        for n, column in zip_longest(element.numbers, element.form.columns):
            formula = formula_pretty(column.expression, motion) if column else ""
            said = f"{element.id}.{n.name}", n.name, name, n.formula, formula, n.unit
            rows.append(TermRow(*said, n.value, n.standard_error, n.interval95))
    return rows


def model_table(model: JointModel) -> TextTable:
    """Return the terms of a model: on a page all columns, on a terminal some of them."""
    what = quantities(model.joint.motion).moment.lower()
    return TextTable(
        "terms",
        f"Coefficients with one standard error; unique share: the share of the RMS {what} that no other term could "
        "take over.",
        ("Term", "Symbol", "Of", "Value", "Unit", "95 % interval", "Unique share"),
        tuple(
            (
                r.name,
                r.symbol,
                r.formula or DASH,
                r.value,
                pretty_unit(r.unit),
                r.interval,
                shown("{:.1f} %", 100 * r.share),
            )
            for r in term_rows(model)
        ),
        text=("Unit",),
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


def estimate(value: float, error: float) -> str:
    """Return a value with its error; without it to four digits, and a dash where nothing is known.

    Examples
    --------
    >>> estimate(-5912.3, 41.7), estimate(2.0, float("nan")), estimate(float("nan"), 1.0)
    ('−5910 ± 40', '2', '–')
    """
    known = math.isfinite(value) and math.isfinite(error)
    return superscripted(rounded(value, error)) if known else shown("{:.4g}", value).replace("-", "−")


def signed_percent(share: float) -> str:
    """Return a change in per cent, with its sign; a dash where it is not known.

    Examples
    --------
    >>> signed_percent(-0.0213)
    '−2.1 %'
    """
    return shown("{:+.1f} %", 100 * share).replace("-", "−")


def with_unit(term: str, unit: str, motion: str) -> str:
    """Return a term by its name, with the unit of its coefficient in brackets."""
    return f"{spelled(term, motion)} ({pretty_unit(unit)})"


def _power(power: str) -> str:
    return f"·10{superscript(power.lstrip('e'))}"


def terms_csv(model: JointModel) -> str:
    """Return the terms as CSV text, numbers in full, SI."""
    rows = [
        (r.id, r.symbol, r.name, r.written, r.coefficient, r.standard_error, *r.interval95, r.si, r.share)
        for r in term_rows(model)
    ]
    return csv_text(TERM_COLUMNS, rows)
