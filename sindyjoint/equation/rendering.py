"""Formulas written out: text that reads back, a line for people, LaTeX.

sympy's printers are imported here at the top; import this module only when something is to be printed.
"""

import re
from typing import Any

from sympy import Symbol
from sympy.printing.latex import LatexPrinter
from sympy.printing.precedence import precedence
from sympy.printing.str import StrPrinter

from sindyjoint.equation.parsing import MOST, variable_symbols

# In this order sympy's alphabetical sorting of factors gives θ before θ̇ (dots are combining characters).
_NAMES = {
    "rotation": {"θ": r"\theta", "θ\u0307": r"\dot{\theta}", "θ\u0308": r"\ddot{\theta}"},
    "translation": {"x": "x", "x\u0307": r"\dot{x}", "x\u0308": r"\ddot{x}"},
}
_SUPERSCRIPTS = str.maketrans("-0123456789", "⁻⁰¹²³⁴⁵⁶⁷⁸⁹")


class FormulaPrinter(StrPrinter):
    """Text in the syntax of the catalogues: lower-case functions, numbers to the last digit."""

    def _print_Float(self, expr: Any) -> str:
        return repr(float(expr))

    def _print_Exp1(self, expr: Any) -> str:
        return "exp(1)"

    def _print_Abs(self, expr: Any) -> str:
        name = type(expr).__name__.lower()
        arguments = [self._print(argument) for argument in expr.args]
        while len(arguments) > MOST["arguments"]:
            first = ", ".join(arguments[: MOST["arguments"]])
            arguments = [f"{name}({first})", *arguments[MOST["arguments"] :]]
        return f"{name}({', '.join(arguments)})"

    _print_Max = _print_Min = _print_Abs

    def _print_Heaviside(self, expr: Any) -> str:
        return f"heaviside({self._print(expr.args[0])})"


def _positive_first(terms: list[Any]) -> list[Any]:
    # |θ| - g reads better than -g + |θ|.
    return sorted(terms, key=lambda term: term.as_coeff_Mul()[0].is_negative is True)


class PrettyLine(FormulaPrinter):
    """One line for tables and terminals: θ², |θ̇|, sgn."""

    def _as_ordered_terms(self, expr: Any, order: Any = None) -> list[Any]:
        return _positive_first(super()._as_ordered_terms(expr, order))

    def _print_Float(self, expr: Any) -> str:
        return f"{float(expr):.4g}"

    def _print_Abs(self, expr: Any) -> str:
        return f"|{self._print(expr.args[0])}|"

    def _print_sign(self, expr: Any) -> str:
        return f"sgn({self._print(expr.args[0])})"

    def _print_Pow(self, expr: Any, rational: bool = False) -> str:
        base, exponent = expr.args
        if exponent.is_Integer and exponent.is_positive:
            return self.parenthesize(base, precedence(expr)) + str(int(exponent)).translate(_SUPERSCRIPTS)
        return super()._print_Pow(expr, rational=rational)

    def _print_Mul(self, expr: Any) -> str:
        return re.sub(r"(?<!\*)\*(?!\*)", " ", super()._print_Mul(expr))


class LatexLine(LatexPrinter):
    """LaTeX of a formula: numbers to six digits."""

    def _as_ordered_terms(self, expr: Any, order: Any = None) -> list[Any]:
        return _positive_first(super()._as_ordered_terms(expr, order))

    def _print_Float(self, expr: Any) -> str:
        mantissa, _, exponent = f"{float(expr):.6g}".partition("e")
        return rf"{mantissa} \cdot 10^{{{int(exponent)}}}" if exponent else mantissa

    def _print_Heaviside(self, expr: Any, exp: Any = None) -> str:
        # sympy writes the step as a theta, which here is the angle.
        text = rf"H{{\left({self._print(expr.args[0])} \right)}}"
        return rf"{text}^{{{exp}}}" if exp is not None else text


def renamed(expression: Any, motion: str) -> tuple[Any, dict[Any, str]]:
    """Return the expression over the letters of the motion, and the LaTeX of those."""
    latex = {Symbol(name, real=True): text for name, text in _NAMES[motion].items()}
    return expression.xreplace(dict(zip(variable_symbols(), latex, strict=True))), latex
