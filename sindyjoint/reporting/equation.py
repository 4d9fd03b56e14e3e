"""The terms of an equation as tables, its symbols and numbers as text, and MathML, which browsers typeset."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from html import escape
from itertools import zip_longest
from typing import TYPE_CHECKING, Any

import sympy
from sympy.printing.mathml import MathMLPresentationPrinter

from sindyjoint.equation.equation_text import numbered, renamed
from sindyjoint.equation.formula import formula_pretty
from sindyjoint.equation.model import INERTIA, JointModel
from sindyjoint.reporting.style import pretty_unit
from sindyjoint.reporting.tables import DASH, TextTable, csv_text
from sindyjoint.text import in_words_of, quantities, rounded, superscript

if TYPE_CHECKING:
    from sindyjoint.diagnosis.effects.fitted import FittedEffect


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
                share_text(r.share),
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


def _power(power: str) -> str:
    return f"·10{superscript(power.lstrip('e'))}"


def terms_csv(model: JointModel) -> str:
    """Return the terms as CSV text, numbers in full, SI."""
    rows = []
    for row in term_rows(model):
        numbers = map(repr, (row.coefficient, row.standard_error, *row.interval95))
        share = repr(row.share) if row.share == row.share else ""
        rows.append((row.id, row.symbol, row.name, row.written, *numbers, row.si, share))
    return csv_text(TERM_COLUMNS, rows)


def share_text(share: float) -> str:
    """Return a share in per cent; a dash where there is none.

    Examples
    --------
    >>> share_text(0.272)
    '27.2 %'
    """
    return f"{100 * share:.1f} %" if share == share else DASH


THIN_SPACE = '<mspace width="0.17em"/>'
# sympy names entities that are not XML, and sets a hyphen where a minus belongs.
_BETTER = {
    "<mo>&InvisibleTimes;</mo>": THIN_SPACE,
    "<mi>&ExponentialE;</mi>": "<mi>e</mi>",
    "<mo>-</mo>": "<mo>−</mo>",
}
_DOTS = {"theta": ("", "θ", "x"), "omega": ("˙", "θ", "x"), "alpha": ("¨", "θ", "x")}


class _StatePrinter(MathMLPresentationPrinter):
    """Presentation MathML with θ, θ̇, θ̈ (x, ẋ, ẍ) for the variables of a formula."""

    def __init__(self, motion: str):
        super().__init__()
        self._motion = motion

    def _made(self, tag: str, *children: Any, **attributes: str) -> Any:
        """Return an element of text and other elements."""
        element = self.dom.createElement(tag)
        for name, value in attributes.items():
            element.setAttribute(name, value)
        for child in children:
            element.appendChild(self.dom.createTextNode(child) if isinstance(child, str) else child)
        return element

    def _print_Symbol(self, sym: Any, style: str = "plain") -> Any:
        if sym.name not in _DOTS:
            return super()._print_Symbol(sym, style)
        dots, angle, displacement = _DOTS[sym.name]
        letter = self._made("mi", displacement if self._motion == "translation" else angle)
        return self._made("mover", letter, self._made("mo", dots), accent="true") if dots else letter

    def _print_sign(self, expr: Any) -> Any:
        brackets = [self._made("mo", text, stretchy="false") for text in "()"]
        return self._made(
            "mrow", self._made("mi", "sgn"), brackets[0], self._print(expr.args[0]), brackets[1]
        )

    def _print_Mul(self, expr: Any) -> Any:
        # A decay stays a factor with a negative exponent: sympy would set it under the bar of a fraction.
        decays = [factor for factor in expr.args if factor.func is sympy.exp]
        if not decays:
            return super()._print_Mul(expr)
        others = expr.func(*[factor for factor in expr.args if factor.func is not sympy.exp])
        factors = ([] if others == 1 else [others]) + decays
        parts = [
            part for factor in factors for part in (self._made("mo", "&InvisibleTimes;"), self._print(factor))
        ]
        return self._made("mrow", *parts[1:])

    def _print_exp(self, expr: Any) -> Any:
        return self._made("msup", self._made("mi", "e"), self._print(expr.args[0]))

    def _print_Float(self, expr: Any) -> Any:
        return self._made("mn", f"{float(expr):.4g}")


def mathml(model: JointModel, further: Sequence[str] = ()) -> str:
    """Return the equation, with symbols for coefficients, as ``<math>`` elements; all text in them is escaped.

    The rates of internal states follow, one in a line.

    ``further`` names moments that are no terms of a joint model; they are added by name.
    """
    motion = model.joint.motion
    printer = _StatePrinter(motion)
    terms = sorted(model.terms, key=lambda t: t.id != INERTIA)
    parts = [_product(printer, term.symbol, term.expression) for term in terms]
    if model.joint.inertia:
        letter, variable = ("m", "x") if motion == "translation" else ("I", "θ")
        second = f'<mover accent="true"><mi>{variable}</mi><mo>¨</mo></mover>'
        parts.insert(0, f"<mi>{letter}</mi><mo>⁢</mo>{second}")
    rates = []
    for element, written in zip(model.elements, numbered(model.elements), strict=True):
        columns, states = renamed(element, written)
        parts += [_product(printer, c.symbol, c.expression) for c in columns]
        rates += [_rate_mathml(printer, *state) for state in states]
    parts += [_named_moment(name, motion) for name in further]
    load = "F" if motion == "translation" else "M"
    # Each summand is a separate row: a browser may break the line only between them.
    right = "<mo>+</mo>".join(f"<mrow>{part}</mrow>" for part in parts) or "<mn>0</mn>"
    return _lines([(f"<mi>{load}</mi>", right), *rates])


def effect_mathml(effect: FittedEffect, motion: str) -> str:
    """Return the moment of an effect, and the rates of its internal states, as lines of ``<math>``."""
    printer, variant = _StatePrinter(motion), effect.variant
    name = _named_moment(in_words_of(motion, effect.effect.name), motion)
    moment = "<mo>+</mo>".join(_product(printer, c.symbol, c.expression) for c in variant.columns)
    rates = (_rate_mathml(printer, state.name, state.rate, state.limit) for state in variant.states)
    return _lines([(name, moment), *rates])


def _lines(equations: Sequence[tuple[str, str]]) -> str:
    return "".join(f'<math display="block">{left}<mo>=</mo>{right}</math>' for left, right in equations)


def _rate_mathml(printer: _StatePrinter, name: str, rate: Any, limit: Any) -> tuple[str, str]:
    """Return the left and right side of the rate of an internal state, its limit behind it."""
    letter = symbol_mathml(name)
    right = _formula(printer, rate)
    if limit is not None:
        right += (
            f'<mo>,</mo><mspace width="1em"/><mrow><mo>|</mo>{letter}<mo>|</mo></mrow><mo>≤</mo>'
            f"{_formula(printer, limit)}"
        )
    return f'<mover accent="true">{letter}<mo>˙</mo></mover>', right


def _named_moment(name: str, motion: str) -> str:
    letter = "F" if motion == "translation" else "M"
    return f"<msub><mi>{letter}</mi><mtext>{escape(name)}</mtext></msub>"


def symbol_mathml(symbol: str) -> str:
    """Return a coefficient's symbol, its index lowered: k1 as k with index 1."""
    head, tail = split_symbol(symbol)
    if not tail:
        return f"<mi>{escape(head)}</mi>"
    return f"<msub><mi>{escape(head)}</mi><mi>{escape(tail)}</mi></msub>"


def _product(printer: _StatePrinter, name: str, expression: Any) -> str:
    """Return a coefficient times a formula."""
    symbol = symbol_mathml(name)
    if expression.is_number and expression == 1:
        return symbol
    formula = _formula(printer, expression)
    if expression.is_Add or expression.could_extract_minus_sign():
        formula = f"<mrow><mo>(</mo>{formula}<mo>)</mo></mrow>"
    return f"{symbol}{THIN_SPACE}{formula}"


def _formula(printer: _StatePrinter, expression: Any) -> str:
    formula: str = printer.doprint(expression)
    for written, better in _BETTER.items():
        formula = formula.replace(written, better)
    return formula
