"""The equation as MathML, which every browser typesets without help from the net."""

from __future__ import annotations

from collections.abc import Sequence
from html import escape
from typing import TYPE_CHECKING, Any

import sympy
from sympy.printing.mathml import MathMLPresentationPrinter

from sindyjoint.equation.equation_text import numbered, renamed
from sindyjoint.equation.model import INERTIA, JointModel
from sindyjoint.reporting.equation import split_symbol
from sindyjoint.text import in_words_of

if TYPE_CHECKING:
    from sindyjoint.diagnosis.effects.fitted import FittedEffect

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
