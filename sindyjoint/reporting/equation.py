"""The terms of an equation as tables, its symbols and numbers as text."""

import math
from collections import namedtuple
from html import escape
from itertools import zip_longest

from sindyjoint.equation.formula import formula_pretty
from sindyjoint.equation.model import JointModel
from sindyjoint.reporting.style import pretty_unit
from sindyjoint.reporting.tables import DASH, TextTable, csv_text, shown, tabulate
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


#: A term, or a number of an element: what ``terms.csv`` says of it, and its formula in plain text, ``θ²``.
TermRow = namedtuple(
    "TermRow",
    "id symbol name formula coefficient standard_error interval95_low interval95_high unit unique_share written",
)
TERM_COLUMNS = TermRow._fields[:-1]


def term_rows(model: JointModel) -> list[TermRow]:
    """Return the terms of a model, then the numbers of its elements, which have no share; SI."""
    motion = model.joint.motion
    rows = [
        TermRow(
            t.id, t.symbol, in_words_of(motion, t.name), t.formula, t.coefficient, t.standard_error, *t.interval95,
            t.unit, t.unique_share, formula_pretty(t.expression, motion),
        )
        for t in model.terms
    ]  # fmt: skip
    for element in model.elements:
        name = in_words_of(motion, element.name)
        for n, column in zip_longest(element.numbers, element.form.columns):
            low, high = n.interval95
            written = formula_pretty(column.expression, motion) if column else ""
            said = f"{element.id}.{n.name}", n.name, name, n.formula, n.value, n.standard_error, low, high
            rows.append(TermRow(*said, n.unit, math.nan, written))
    return rows


def model_table(model: JointModel) -> TextTable:
    """Return the terms of a model: on a page all columns, on a terminal some of them."""
    what = quantities(model.joint.motion).moment.lower()
    return tabulate(
        "terms",
        f"Coefficients with one standard error; unique share: the share of the RMS {what} that no other term could "
        "take over.",
        term_rows(model),
        {
            "Term": lambda r: r.name,
            "Symbol": lambda r: r.symbol,
            "Of": lambda r: r.written or DASH,
            "Value": lambda r: superscripted(rounded(r.coefficient, r.standard_error)),
            "Unit": lambda r: pretty_unit(r.unit),
            # Each end to the place that the uncertainty allows.
            "95 % interval": lambda r: interval_text(r.interval95_low, r.interval95_high, r.standard_error),
            "Unique share": lambda r: shown("{:.1f} %", 100 * r.unique_share),
        },
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
    return csv_text(TERM_COLUMNS, [row[:-1] for row in term_rows(model)])
