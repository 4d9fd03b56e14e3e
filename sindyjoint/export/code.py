"""A model as source code: names, numbers and the law, printed from the one sympy expression of each term.

sympy's printers are imported here at the top; import this module only when code is to be written.
"""

from __future__ import annotations

import re
from dataclasses import dataclass
from importlib.resources import files
from string import Template
from typing import Any

import sympy
from sympy.printing.c import C99CodePrinter
from sympy.printing.pycode import PythonCodePrinter

from sindyjoint.equation.formula import variable_symbols
from sindyjoint.equation.model import JointModel
from sindyjoint.export.parts import Parts, softening_limits, steepness
from sindyjoint.export.text import number

DIRECTION = sympy.Symbol("direction", real=True)


class _CPrinter(C99CodePrinter):
    """C99 with doubles to the last digit."""

    def _print_Float(self, expr: Any) -> str:
        return number(float(expr))

    def _print_sign(self, expr: Any) -> str:
        return f"joint_sign({self._print(expr.args[0])})"


class _PythonPrinter(PythonCodePrinter):
    """Plain Python over ``math``, numbers to the last digit."""

    def _print_Float(self, expr: Any) -> str:
        return number(float(expr))

    def _print_sign(self, expr: Any) -> str:
        return f"sign({self._print(expr.args[0])})"


@dataclass(frozen=True)
class Code:
    """What the templates of code need.

    Parameters
    ----------
    coefficients : tuple of (str, float, str, str)
        Identifier, value, unit and name of each coefficient; without inertia.
    law : str
        Transfer moment as an expression over ``theta``, ``omega``, ``direction``.
    inertia : float
    limits : (float, float)
        Angles between which the joint does not soften to zero stiffness.
    stiffness, damping : float
        Largest slopes of the law over the tested range.
    """

    coefficients: tuple[tuple[str, float, str, str], ...]
    law: str
    inertia: float
    limits: tuple[float, float]
    stiffness: float
    damping: float


def at_slip(expression: sympy.Expr) -> sympy.Expr:
    """Write a formula with the direction of slip instead of the sign of the rate, so that it holds at standstill, too.

    Examples
    --------
    >>> from sindyjoint.equation.formula import parse_formula
    >>> at_slip(parse_formula("sign(omega*theta) + heaviside(omega)"))
    direction*sign(theta) + direction/2 + 1/2
    """
    omega = variable_symbols()[1]
    # heaviside(0) is 1/2 in formulas.
    expression = expression.replace(
        lambda e: isinstance(e, sympy.Heaviside), lambda e: (1 + sympy.sign(e.args[0])) / 2
    )
    expression = expression.replace(
        lambda e: isinstance(e, sympy.sign) and e.args[0].is_Mul,
        lambda e: sympy.Mul(*(sympy.sign(factor) for factor in e.args[0].args)),
    )
    return sympy.expand_mul(expression.xreplace({sympy.sign(omega): DIRECTION}))


def code_of(model: JointModel, language: str) -> Code:
    """Prepare a model for the template of a language, "c" or "python"."""
    printer = _CPrinter() if language == "c" else _PythonPrinter({"fully_qualified_modules": True})
    parts = Parts.of(model)
    terms = (*parts.elastic, *parts.rate, *parts.coupled)
    names = identifiers([term.symbol for term in terms])
    law = sum(
        (sympy.Symbol(name) * at_slip(term.expression) for name, term in zip(names, terms, strict=True)),
        sympy.Integer(0),
    )
    stiffness, damping = steepness(model)
    return Code(
        coefficients=tuple(
            (name, term.coefficient, term.unit, term.name) for name, term in zip(names, terms, strict=True)
        ),
        law=printer.doprint(law),
        inertia=model.inertia,
        limits=softening_limits(model),
        stiffness=stiffness,
        damping=damping,
    )


def identifiers(symbols: list[str]) -> list[str]:
    """Return a separate identifier for each symbol, valid in C and Python.

    Examples
    --------
    >>> identifiers(["k1", "μ a", "mu a"])
    ['JOINT_k1', 'JOINT_a', 'JOINT_mu_a']
    """
    taken: list[str] = []
    for symbol in symbols:
        base = "JOINT_" + (re.sub(r"[^A-Za-z0-9]+", "_", symbol).strip("_") or "x")
        name, count = base, 1
        # The names of the templates are all upper case; a coefficient of such a name steps aside.
        while name in taken or name in _RESERVED:
            count += 1
            name = f"{base}_{count}"
        taken.append(name)
    return taken


_RESERVED = {"JOINT_" + name for name in ("H", "NAME", "INERTIA", "LOW", "HIGH", "STIFFNESS", "DAMPING")}


def template(name: str) -> Template:
    """Return a template that ships with the package."""
    return Template(files("sindyjoint.export").joinpath("templates", name).read_text(encoding="utf-8"))


def bounds(model: JointModel) -> str:
    """Say in a sentence where the law stops to hold."""
    low, high = softening_limits(model)
    unit = "rad" if model.joint.motion == "rotation" else "m"
    sides = [f"{value:.6g} {unit}" for value in (low, high) if abs(value) != float("inf")]
    if not sides:
        return "the joint keeps a positive stiffness up to three times the tested range"
    return f"the stiffness falls to zero at {' and '.join(sides)}; beyond, the joint snaps through"
