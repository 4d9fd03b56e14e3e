"""Formulas of candidate terms: text in, a sympy expression out, and nothing else reachable on the way.

The text is parsed into Python's syntax tree and rebuilt node by node from an allow-list; nothing is
evaluated. From the one expression come the NumPy function (:func:`compile_terms`), the unit check
(:func:`formula_unit`), the LaTeX and the plain text of reports, and the code of exports.
"""

from __future__ import annotations

from collections.abc import Sequence
from functools import cache
from typing import TYPE_CHECKING

from sindyjoint.equation.dimensions import formula_unit
from sindyjoint.equation.evaluation import TermFunction, compile_terms
from sindyjoint.equation.parsing import (
    ALIASES,
    FUNCTIONS,
    VARIABLES,
    build_expression,
    parameter_symbol,
    state_symbol,
    variable_symbols,
)

if TYPE_CHECKING:
    import sympy

__all__ = [
    "FUNCTIONS",
    "VARIABLES",
    "TermFunction",
    "compile_terms",
    "formula_latex",
    "formula_pretty",
    "formula_text",
    "formula_unit",
    "made_by_shift",
    "parameter_symbol",
    "parse_formula",
    "state_symbol",
    "variable_symbols",
]


def parse_formula(text: str, parameters: Sequence[str] = (), states: Sequence[str] = ()) -> sympy.Expr:
    """Turn the text of a formula into a sympy expression.

    Parameters
    ----------
    text : str
        Python syntax over the angle ``theta``, the rate ``omega``, the acceleration ``alpha`` (for
        translation ``x``, ``v``, ``a``), the named parameters and states, numbers, ``pi``, ``+ - * / **`` and
        :data:`FUNCTIONS`. ``sign(0)`` is 0 and ``heaviside(0)`` is 1/2.
    parameters : sequence of str
        Names of nonlinear parameters that the formula may use; they stand for positive numbers.
    states : sequence of str
        Names of further variables of either sign, such as the deflection of a friction model.

    Returns
    -------
    sympy.Expr
        Over the symbols of :func:`variable_symbols` and :func:`parameter_symbol`.

    Raises
    ------
    FormulaError
        For anything outside the allow-list, and for formulas that are too long, too deep, not finite, or not
        real for every motion: roots and logarithms are taken of what cannot be negative.

    Examples
    --------
    >>> parse_formula("exp(-abs(omega)/v_s)*sign(omega)", ["v_s"])
    exp(-Abs(omega)/v_s)*sign(omega)
    >>> parse_formula("__import__('os')")
    Traceback (most recent call last):
    ...
    sindyjoint.errors.FormulaError: formula "__import__('os')": the character "'" (a text) is not allowed; ...
    """
    names = {name: symbol for name, symbol in zip(VARIABLES, variable_symbols(), strict=True)}
    names.update({alias: names[name] for alias, name in ALIASES.items()})
    names.update({name: state_symbol(name) for name in states})
    names.update({name: parameter_symbol(name) for name in parameters})
    return build_expression(text, names, tuple(parameters))


def formula_text(expression: sympy.Expr, motion: str = "rotation") -> str:
    """Return a formula that :func:`parse_formula` reads back as the same expression, numbers in full.

    For translation it is written with x, v, a.

    Examples
    --------
    >>> formula_text(parse_formula("max(abs(theta) - 0.1, 0)*sign(theta)"))
    'sign(theta)*max(0, abs(theta) - 0.1)'
    """
    from sindyjoint.equation.rendering import text_line

    return text_line(expression, motion)


def formula_pretty(expression: sympy.Expr, motion: str = "rotation") -> str:
    """Return the expression as a line to read: θ² θ̇, or x² ẋ for translation.

    Examples
    --------
    >>> formula_pretty(parse_formula("theta**2*omega"))
    'θ² θ̇'
    """
    from sindyjoint.equation.rendering import pretty_line

    return pretty_line(expression, motion)


def formula_latex(expression: sympy.Expr, motion: str = "rotation") -> str:
    r"""Return the expression as LaTeX, with \theta, \dot{\theta}, \ddot{\theta} or x, \dot{x}, \ddot{x}.

    Examples
    --------
    >>> formula_latex(parse_formula("sign(omega)"))
    '\\operatorname{sign}{\\left(\\dot{\\theta} \\right)}'
    """
    from sindyjoint.equation.rendering import latex_line

    return latex_line(expression, motion)


def made_by_shift(expressions: Sequence[sympy.Expr]) -> tuple[bool, ...]:
    """Return of each term whether another one, its angle counted from another zero, contains it.

    To first order in the shift d: f(θ − d) = f(θ) − d·f'(θ), so θ² stands in θ³ and θ in θ², and a model with θ³ and
    without θ² belongs to one zero only.
    """
    return tuple(
        any(_is_slope(term, other) for other in expressions if other is not term) for term in expressions
    )


@cache
def _is_slope(term: sympy.Expr, other: sympy.Expr) -> bool:
    """Return whether a term is proportional to the slope of another over the angle."""
    ratio = other.diff(variable_symbols()[0]) / term
    return bool(ratio.is_number and ratio != 0)
