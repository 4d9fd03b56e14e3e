"""Formulas of candidate terms: text in, a sympy expression and its unit out, and nothing else reachable on the way.

The text is parsed into Python's syntax tree and rebuilt node by node from an allow-list; nothing is
evaluated. From the one expression come the NumPy function (:func:`compile_terms`), the unit check
(:func:`formula_unit`), the LaTeX and the plain text of reports, and the code of exports.

Units keep the radian as a dimension of its own. To most unit libraries a radian is 1, and N·m/rad, N·m/rad² and N·m are
all the same. A catalogue of stiffnesses needs them distinguished, so the registry here knows SI and the angle, and
nothing else.
"""

from __future__ import annotations

import math
import re
import unicodedata
from collections.abc import Mapping, Sequence
from functools import lru_cache
from typing import TYPE_CHECKING, Any

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
from sindyjoint.errors import FormulaError, UnitError

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
    motion = dict(zip(VARIABLES, variable_symbols(), strict=True))
    names = {
        **motion,
        **{alias: motion[name] for alias, name in ALIASES.items()},
        **{name: state_symbol(name) for name in states},
        **{name: parameter_symbol(name) for name in parameters},
    }
    return build_expression(text, names, tuple(parameters))


def formula_text(expression: sympy.Expr, motion: str = "rotation") -> str:
    """Return a formula that :func:`parse_formula` reads back as the same expression, numbers in full.

    For translation it is written with x, v, a.

    Examples
    --------
    >>> formula_text(parse_formula("max(abs(theta) - 0.1, 0)*sign(theta)"))
    'sign(theta)*max(0, abs(theta) - 0.1)'
    """
    from sindyjoint.equation.rendering import FormulaPrinter

    if motion == "translation":
        from sympy import Symbol

        letters = (Symbol(name, real=True) for name in ALIASES)
        expression = expression.xreplace(dict(zip(variable_symbols(), letters, strict=True)))
    return FormulaPrinter().doprint(expression)


def formula_pretty(expression: sympy.Expr, motion: str = "rotation") -> str:
    """Return the expression as a line to read: θ² θ̇, or x² ẋ for translation.

    Examples
    --------
    >>> formula_pretty(parse_formula("theta**2*omega"))
    'θ² θ̇'
    """
    from sindyjoint.equation.rendering import PrettyLine, renamed

    return unicodedata.normalize("NFC", PrettyLine().doprint(renamed(expression, motion)[0]))


def formula_latex(expression: sympy.Expr, motion: str = "rotation") -> str:
    r"""Return the expression as LaTeX, with \theta, \dot{\theta}, \ddot{\theta} or x, \dot{x}, \ddot{x}.

    Examples
    --------
    >>> formula_latex(parse_formula("sign(omega)"))
    '\\operatorname{sign}{\\left(\\dot{\\theta} \\right)}'
    """
    from sindyjoint.equation.rendering import LatexLine, renamed

    lettered, names = renamed(expression, motion)
    return LatexLine({"symbol_names": names}).doprint(lettered)


_DEFINITIONS = """
micro- = 1e-6 = µ- = u-
milli- = 1e-3 = m-
kilo- = 1e3 = k-
mega- = 1e6 = M-
meter = [length] = m = metre
kilogram = [mass] = kg
gram = 1e-3 * kilogram = g
second = [time] = s
kelvin = [temperature] = K
radian = [angle] = rad
hertz = 1 / second = Hz
newton = kilogram * meter / second ** 2 = N
degree = 3.141592653589793 / 180 * radian = deg
pascal = newton / meter ** 2 = Pa
volt = [voltage] = V
ampere = [current] = A
""".strip().splitlines()

_ORDER = ("N", "kg", "m", "s", "rad")

VARIABLE_UNITS: dict[str, dict[str, str]] = {
    "rotation": {"theta": "rad", "omega": "rad/s", "alpha": "rad/s^2"},
    "translation": {"theta": "m", "omega": "m/s", "alpha": "m/s^2"},
}
"""Units of the variables for the two kinds of motion."""

MOMENT_UNITS = {"rotation": "N*m", "translation": "N"}
"""Unit of what a term adds to the law."""

# A number under a power (10**10, m**9**9, (m^9)^9), or a power of three digits.
_TOWER = r"\d\s*\)*\s*(?:\*\*|\^)|(?:\*\*|\^)[\s(-]*\d{3}"


@lru_cache(maxsize=1)
def unit_registry() -> Any:
    """Return the pint registry: SI with prefixes µ, m, k, M, and the radian as a base unit."""
    import pint

    return pint.UnitRegistry(_DEFINITIONS)


def parse_unit(text: str) -> Any:
    """Return the pint unit of a text such as ``N*m/rad^2`` or ``1``.

    Raises
    ------
    UnitError
        If pint cannot read it or it is not known here.
    """
    if not isinstance(text, str) or not re.fullmatch(r"[A-Za-zµ0-9*/^(). -]{1,64}", text.strip()):
        raise UnitError(
            f"unit {str(text)[:64]!r}: expected a text such as 'N*m/rad', or '1' for a plain number"
        )
    # pint works numbers out while it parses: a tower of powers in a downloaded catalogue would run for ever.
    if re.search(_TOWER, text):
        raise UnitError(
            f"unit {text!r} has a power that no unit has; expected powers up to 99, of units, one each"
        )
    try:
        return unit_registry().parse_units("dimensionless" if text.strip() == "1" else text)
    # pint fails on unknown spellings with whatever its parser meets.
    except Exception as error:
        line = str(error).partition("\n")[0] or type(error).__name__
        raise UnitError(
            f"unit {text!r} cannot be read ({line}); known are m, kg, s, rad, N, Hz, deg, K, Pa, V, A with the "
            "prefixes u, m, k, M, written like N*m*s/rad^2"
        ) from None


def _powers(unit: Any) -> dict[str, float]:
    """Return the power of each unit by its short name, e.g. {"N": 1, "m": 1, "rad": -2}."""
    registry = unit_registry()
    items = registry.Quantity(1.0, unit).unit_items()
    return {registry.get_symbol(str(name)): power for name, power in items}


def _written(powers: Mapping[str, float]) -> str:
    ordered = sorted(powers, key=lambda name: (_ORDER.index(name) if name in _ORDER else len(_ORDER), name))
    above, below = (
        [
            name if abs(powers[name]) == 1 else f"{name}^{abs(powers[name]):g}"
            for name in ordered
            if sign * powers[name] > 0
        ]
        for sign in (1, -1)
    )
    top = "*".join(above) or "1"
    if not below:
        return top
    return f"{top}/{below[0]}" if len(below) == 1 else f"{top}/({'*'.join(below)})"


def unit_text(unit: Any) -> str:
    """Write a unit as catalogues do: force, mass, length, time, angle, as in ``N*m*s/rad^2``."""
    return _written(_powers(unit))


def unit_for(unit: str, motion: str) -> str:
    """Return a unit of one kind of motion as that of the other: rad ↔ m, N·m ↔ N, kg·m² ↔ kg.

    Examples
    --------
    >>> unit_for("N*m*s/rad^2", "translation"), unit_for("kg*m^2", "translation")
    ('N*s/m^2', 'kg')
    >>> unit_for("N*s/m^2", "rotation")
    'N*m*s/rad^2'
    """
    powers = _powers(parse_unit(unit))
    # Lever arms: each newton of a moment comes with one metre, each kilogram of an inertia with two.
    arms = powers.get("N", 0) + 2 * powers.get("kg", 0)
    if motion == "translation":
        return _written({**powers, "m": powers.get("m", 0) - arms + powers.get("rad", 0), "rad": 0})
    return _written({**powers, "m": arms, "rad": powers.get("m", 0)})


def is_coherent(unit: str) -> bool:
    """Whether a unit is made of SI base units and newtons without a factor (N*m/rad is, N*mm/rad is not)."""
    return abs(to_si(1.0, unit) - 1.0) < 1e-12


def coefficient_unit(expression: sympy.Expr, units: Mapping[str, str], motion: str) -> str:
    """Return the unit that a formula's coefficient must have for the term to be a moment (a force).

    Parameters
    ----------
    expression : sympy.Expr
    units : mapping of str to str
        Unit of each nonlinear parameter.
    motion : {"rotation", "translation"}

    Returns
    -------
    str
        For a moment of inertia the customary kg·m², without the "per radian" that N·m·s²/rad would show.

    Raises
    ------
    UnitError
        If the formula does not fit together in itself.
    """
    given = formula_unit(expression, {**VARIABLE_UNITS[motion], **units})
    wanted = parse_unit(MOMENT_UNITS[motion]) / given
    inertia = parse_unit("N*m*s^2/rad" if motion == "rotation" else "N*s^2/m")
    if wanted.dimensionality == inertia.dimensionality:
        return "kg*m^2" if motion == "rotation" else "kg"
    return unit_text(wanted)


def same_dimension(one: str, other: str) -> bool:
    """Whether two units measure the same kind of quantity, the radian counted as a separate one."""
    return bool(parse_unit(one).dimensionality == parse_unit(other).dimensionality)


def to_si(value: float, unit: str) -> float:
    """Convert a value to the SI unit of its dimension (rad for angles)."""
    return float(unit_registry().Quantity(value, parse_unit(unit)).to_base_units().magnitude)


def formula_unit(expression: sympy.Expr, units: Mapping[str, Any]) -> Any:
    """Work out the unit of a formula from the units of its variables and parameters.

    Parameters
    ----------
    expression : sympy.Expr
    units : mapping of str to unit
        Unit, as text or pint unit, of each symbol by name.

    Returns
    -------
    pint.Unit
        In a registry in which the radian is a base unit.

    Raises
    ------
    UnitError
        If unlike units are added or compared, or a function that needs a plain number is given something
        else.
        ``sin``, ``cos`` and ``tan`` take an angle or a plain number.

    Examples
    --------
    >>> from sindyjoint.equation.formula import parse_formula
    >>> unit_text(formula_unit(parse_formula("theta**2*omega"), {"theta": "rad", "omega": "rad/s"}))
    'rad^3/s'
    """
    known = {name: parse_unit(unit) if isinstance(unit, str) else unit for name, unit in units.items()}
    return _unit(expression, known)


def _unit(expression: Any, units: Mapping[str, Any]) -> Any:
    one = unit_registry().Unit("")
    if expression.is_Symbol:
        if expression.name not in units:
            raise FormulaError(f"the formula holds {expression.name}, whose unit is not known")
        return units[expression.name]
    if expression.is_number:
        return one
    if expression.is_Mul:
        return math.prod((_unit(factor, units) for factor in expression.args), start=one)
    if expression.is_Pow:
        base, exponent = expression.args
        return _power_unit(base, exponent, units)
    kind = type(expression).__name__
    if kind in ("Add", "Max", "Min"):
        return _common_unit(expression, units)
    argument = _unit(expression.args[0], units)
    if kind == "Abs":
        return argument
    if kind in ("sign", "Heaviside"):
        return one
    angle = unit_registry().Unit("rad")
    plain = argument.dimensionless or (
        kind in ("sin", "cos", "tan") and argument.dimensionality == angle.dimensionality
    )
    if not plain:
        raise UnitError(
            f"{kind}({formula_text(expression.args[0])}) is given {unit_text(argument)}; expected a plain number: "
            "divide by a parameter of that unit"
        )
    return one


def _power_unit(base: Any, exponent: Any, units: Mapping[str, Any]) -> Any:
    unit = _unit(base, units)
    if exponent.is_number:
        return unit ** float(exponent)
    for part, role in ((unit, "base"), (_unit(exponent, units), "exponent")):
        if not part.dimensionless:
            raise UnitError(
                f"the {role} of {formula_text(base)}**{formula_text(exponent)} has the unit {unit_text(part)}; "
                "with a parameter as exponent both must be plain numbers"
            )
    return unit


def _common_unit(expression: Any, units: Mapping[str, Any]) -> Any:
    """Return the unit of a sum, a minimum or a maximum; zero fits every unit."""
    (first, common), *others = [(part, _unit(part, units)) for part in expression.args if not part.is_zero]
    for part, unit in others:
        if common.dimensionality != unit.dimensionality:
            raise UnitError(
                f"{formula_text(expression)} combines {formula_text(first)} in {unit_text(common)} with "
                f"{formula_text(part)} in {unit_text(unit)}; expected equal units"
            )
    return common
