"""A model as source code: names, numbers and the law, printed from the one sympy expression of each term.

sympy's printers are imported here at the top; import this module only when code is to be written.
"""

from __future__ import annotations

import math
import re
from collections.abc import Callable
from importlib.resources import files
from string import Template
from typing import Any

import sympy
from sympy.printing.c import C99CodePrinter
from sympy.printing.codeprinter import CodePrinter
from sympy.printing.pycode import PythonCodePrinter

from sindyjoint.equation.formula import variable_symbols
from sindyjoint.equation.model import INERTIA, JointModel, ModelTerm
from sindyjoint.export.base import Cycles, Fidelity, Represented, fidelity_table
from sindyjoint.export.parts import Parts, softening_limits, steepness
from sindyjoint.export.text import number, words_of

DIRECTION = sympy.Symbol("direction", real=True)


class CPrinter(C99CodePrinter):
    """C99 with doubles to the last digit."""

    def _print_Float(self, expr: Any) -> str:
        return number(float(expr))

    def _print_sign(self, expr: Any) -> str:
        return f"joint_sign({self._print(expr.args[0])})"


class PythonPrinter(PythonCodePrinter):
    """Plain Python over ``math``, numbers to the last digit."""

    def _print_Float(self, expr: Any) -> str:
        return number(float(expr))

    def _print_sign(self, expr: Any) -> str:
        return f"sign({self._print(expr.args[0])})"


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


def filled(
    file: str,
    model: JointModel,
    printer: CodePrinter,
    infinity: str,
    coefficient: Callable[[str, ModelTerm], str],
    **own: str,
) -> str:
    """Return the text of a template of code with the numbers and the law of a model.

    Parameters
    ----------
    file : str
        Of the template.
    model : JointModel
    printer : CodePrinter
        Of the language.
    infinity : str
        As the language writes it.
    coefficient : callable
        From the identifier of a coefficient and its term to the line that declares it.
    **own : str
        What only this template holds.
    """
    parts = Parts.of(model)
    terms = (*parts.elastic, *parts.rate, *parts.coupled)
    names = identifiers([term.symbol for term in terms])
    law = sum(
        (sympy.Symbol(name) * at_slip(term.expression) for name, term in zip(names, terms, strict=True)),
        sympy.Integer(0),
    )
    low, high = (
        number(value) if math.isfinite(value) else ("" if value > 0 else "-") + infinity
        for value in softening_limits(model)
    )
    stiffness, damping = steepness(model)
    return template(file).substitute(
        inertia=number(model.inertia),
        inertia_unit=words_of(model).inertia_unit,
        low=low,
        high=high,
        stiffness=number(stiffness),
        damping=number(damping),
        coefficients="\n".join(map(coefficient, names, terms)),
        law=printer.doprint(law),
        **own,
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
    unit = words_of(model).angle_unit
    sides = [f"{value:.6g} {unit}" for value in (low, high) if abs(value) != float("inf")]
    if not sides:
        return "the joint keeps a positive stiffness up to three times the tested range"
    return f"the stiffness falls to zero at {' and '.join(sides)}; beyond, the joint snaps through"


def exact_rows(model: JointModel, how: str) -> tuple[Fidelity, ...]:
    """Return the fidelity table of a target that computes the formulas themselves."""
    cycles, inertial = Cycles.of(model), Parts.of(model).inertial
    represented = {term.id: Represented(how, cycles.term(term)) for term in model.terms}
    for term in inertial:
        if term.id == INERTIA:
            represented[term.id] = Represented("the number INERTIA, used in steps", cycles.term(term))
        else:
            represented[term.id] = Represented("not carried: a formula of the acceleration", None)
    return fidelity_table(model, cycles, represented)


def code_notes(model: JointModel) -> tuple[str, ...]:
    """Return what a user of generated code has to know."""
    notes = [bounds(model)]
    if model.inertia == 0:
        notes.append("the moving inertia is not known: give one to step()")
    return tuple(notes)
