"""Formulas of candidate terms: text in, a sympy expression out, and nothing else reachable on the way.

The text is parsed into Python's syntax tree and rebuilt node by node from an allow-list; nothing is
evaluated. From the one expression come the NumPy function (:func:`compile_terms`), the unit check
(:func:`formula_unit`), the LaTeX and the plain text of reports, and the code of exports.
"""

from __future__ import annotations

import re
from collections.abc import Sequence
from typing import TYPE_CHECKING

from sindyjoint.discovery.dimensions import formula_unit
from sindyjoint.discovery.evaluation import TermFunction, compile_terms
from sindyjoint.discovery.parsing import FUNCTIONS, build_expression
from sindyjoint.errors import FormulaError

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
    "parameter_symbol",
    "parse_formula",
    "state_symbol",
    "variable_symbols",
]

VARIABLES = ("theta", "omega", "alpha")
"""Angle, rate and acceleration, in this order everywhere."""

ALIASES = {"x": "theta", "v": "omega", "a": "alpha"}
"""The names a translational joint uses for the same three."""


def variable_symbols() -> tuple[sympy.Symbol, sympy.Symbol, sympy.Symbol]:
    """Return the sympy symbols of angle, rate and acceleration (all real)."""
    from sympy import Symbol

    theta, omega, alpha = (Symbol(name, real=True) for name in VARIABLES)
    return theta, omega, alpha


def parameter_symbol(name: str) -> sympy.Symbol:
    """Return the sympy symbol of an inner parameter, a positive number.

    Raises
    ------
    FormulaError
        If the name is not a plain identifier or already means something in a formula.
    """
    from sympy import Symbol

    return Symbol(_checked_name(name), positive=True)


def state_symbol(name: str) -> sympy.Symbol:
    """Return the sympy symbol of a further variable, of either sign; raises as :func:`parameter_symbol`."""
    from sympy import Symbol

    return Symbol(_checked_name(name), real=True)


def _checked_name(name: str) -> str:
    if not re.fullmatch(r"[A-Za-z][A-Za-z0-9_]{0,31}", str(name), re.ASCII):
        raise FormulaError(f"parameter name {name!r}: a letter followed by letters, digits or _ is wanted")
    if name in (*VARIABLES, *ALIASES, *FUNCTIONS, "pi"):
        raise FormulaError(f"parameter name {name!r} already means something in a formula; take another name")
    return name


def parse_formula(text: str, parameters: Sequence[str] = (), states: Sequence[str] = ()) -> sympy.Expr:
    """Turn the text of a formula into a sympy expression.

    Parameters
    ----------
    text : str
        Python syntax over the angle ``theta``, the rate ``omega``, the acceleration ``alpha`` (for
        translation ``x``, ``v``, ``a``), the named parameters and states, numbers, ``pi``, ``+ - * / **`` and
        :data:`FUNCTIONS`. ``sign(0)`` is 0 and ``heaviside(0)`` is 1/2.
    parameters : sequence of str
        Names of inner parameters that the formula may use; they stand for positive numbers.
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
    from sindyjoint.discovery.rendering import text_line

    return text_line(expression, motion)


def formula_pretty(expression: sympy.Expr, motion: str = "rotation") -> str:
    """Return the expression as a line to read: θ² θ̇, or x² ẋ for translation.

    Examples
    --------
    >>> formula_pretty(parse_formula("theta**2*omega"))
    'θ² θ̇'
    """
    from sindyjoint.discovery.rendering import pretty_line

    return pretty_line(expression, motion)


def formula_latex(expression: sympy.Expr, motion: str = "rotation") -> str:
    r"""Return the expression as LaTeX, with \theta, \dot{\theta}, \ddot{\theta} or x, \dot{x}, \ddot{x}.

    Examples
    --------
    >>> formula_latex(parse_formula("sign(omega)"))
    '\\operatorname{sign}{\\left(\\dot{\\theta} \\right)}'
    """
    from sindyjoint.discovery.rendering import latex_line

    return latex_line(expression, motion)
