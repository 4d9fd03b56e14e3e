"""The equation as MathML, which every browser typesets without help from the net."""

from __future__ import annotations

from collections.abc import Sequence
from html import escape
from typing import TYPE_CHECKING, Any

import sympy
from sympy.printing.mathml import MathMLPresentationPrinter

from sindyjoint.equation.equation_text import Style
from sindyjoint.equation.model import JointModel
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
        parts = [
            part
            for factor in ([] if others == 1 else [others]) + decays
            for part in (self._made("mo", "&InvisibleTimes;"), self._print(factor))
        ]
        return self._made("mrow", *parts[1:])

    def _print_exp(self, expr: Any) -> Any:
        return self._made("msup", self._made("mi", "e"), self._print(expr.args[0]))

    def _print_Float(self, expr: Any) -> Any:
        return self._made("mn", f"{float(expr):.4g}")


def symbol_mathml(symbol: str) -> str:
    """Return a coefficient's symbol, its index lowered: k1 as k with index 1."""
    head, tail = split_symbol(symbol)
    letter, index = f"<mi>{escape(head)}</mi>", f"<mi>{escape(tail)}</mi>"
    return f"<msub>{letter}{index}</msub>" if tail else letter


def formula_mathml(expression: Any, motion: str) -> str:
    """Return a formula of the state."""
    formula: str = _StatePrinter(motion).doprint(expression)
    for written, better in _BETTER.items():
        formula = formula.replace(written, better)
    return formula


_WHOLE = '<math display="block">{}<mo>=</mo>{}</math>'
_SECOND = '<mi>{}</mi><mo>⁢</mo><mover accent="true"><mi>{}</mi><mo>¨</mo></mover>'
# Each summand is a separate row: a browser may break the line only between them.
_PLUS = "</mrow><mo>+</mo><mrow>"
MATHML = Style(
    formula_mathml, symbol_mathml, THIN_SPACE, (_SECOND.format("I", "θ"), _SECOND.format("m", "x")),
    _WHOLE.format('<mover accent="true">{}<mo>˙</mo></mover>', "{}{}"),
    '<mo>,</mo><mspace width="1em"/><mrow><mo>|</mo>{}<mo>|</mo></mrow><mo>≤</mo>{}', "",
    _WHOLE.format("{}", "<mrow>{}</mrow>"), _PLUS, "<mrow><mo>(</mo>{}<mo>)</mo></mrow>", "<mn>0</mn>",
    ("<mi>M</mi>", "<mi>F</mi>"),
)  # fmt: skip


def mathml(model: JointModel, further: Sequence[str] = ()) -> str:
    """Return the equation, with symbols for coefficients, as ``<math>`` elements; all text in them is escaped.

    The rates of internal states follow, one in a line.

    ``further`` names moments that are no terms of a joint model; they are added by name.
    """
    moments = [_named_moment(name, model.joint.motion) for name in further]
    return MATHML.equation(model.joint, model.terms, model.elements, moments)


def effect_mathml(effect: FittedEffect, motion: str) -> str:
    """Return the moment of an effect, and the rates of its internal states, as lines of ``<math>``."""
    variant, name = effect.variant, _named_moment(in_words_of(motion, effect.effect.name), motion)
    moment = "<mo>+</mo>".join(MATHML.product(c.symbol, c.expression, motion) for c in variant.columns)
    rates = (MATHML.rate_of(state.name, state.rate, state.limit, motion) for state in variant.states)
    return "".join([_WHOLE.format(name, moment), *rates])


def _named_moment(name: str, motion: str) -> str:
    return f"<msub>{MATHML.loads[motion == 'translation']}<mtext>{escape(name)}</mtext></msub>"
