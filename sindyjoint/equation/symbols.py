"""The names that stand in formulas, and their sympy symbols."""

from __future__ import annotations

import re
from typing import TYPE_CHECKING

from sindyjoint.equation.parsing import FUNCTIONS
from sindyjoint.errors import FormulaError

if TYPE_CHECKING:
    import sympy

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
    """Return the sympy symbol of a nonlinear parameter, a positive number.

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
        raise FormulaError(f"parameter name {name!r}: expected a letter followed by letters, digits or _")
    if name in (*VARIABLES, *ALIASES, *FUNCTIONS, "pi"):
        raise FormulaError(f"parameter name {name!r} already means something in a formula; take another name")
    return name
