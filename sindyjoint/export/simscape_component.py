"""A custom component of Simscape with the elements of a model: internal states as variables, rates as equations."""

from __future__ import annotations

import math
from typing import Any

import sympy
from sympy.printing.str import StrPrinter

from sindyjoint.equation.formula import variable_symbols
from sindyjoint.equation.model import JointModel
from sindyjoint.export.code import DIRECTION, law_of_elements, template
from sindyjoint.export.text import ascii_line, number


class SimscapePrinter(StrPrinter):
    """Formulas in the language of Simscape: powers by ^, max and min of two."""

    def _print_Float(self, expr: Any) -> str:
        return number(float(expr))

    def _print_Abs(self, expr: Any) -> str:
        return f"abs({self._print(expr.args[0])})"

    def _two(self, name: str, args: Any) -> str:
        first, *rest = args
        return f"{name}({self._print(first)}, {self._two(name, rest)})" if rest else self._print(first)

    def _print_Max(self, expr: Any) -> str:
        return self._two("max", expr.args)

    def _print_Min(self, expr: Any) -> str:
        return self._two("min", expr.args)

    def _print_Heaviside(self, expr: Any) -> str:
        return f"(1 + sign({self._print(expr.args[0])}))/2"


def component(model: JointModel, name: str, head: str) -> str:
    """Return the file of the component.

    Parameters
    ----------
    model : JointModel
        With elements.
    name : str
        Of the component, and of its file.
    head : str
        Comment at the head of the file.
    """
    rotation = model.joint.motion == "rotation"
    law = law_of_elements(model)
    load, unit, angle, rate = ("t", "N*m", "rad", "w") if rotation else ("f", "N", "m", "v")
    states = [f"z{index + 1}" for index in range(len(law.states))]
    return template("elements.ssc.txt").substitute(
        name=name,
        head=head.rstrip("\n"),
        domain="rotational.rotational" if rotation else "translational.translational",
        load=load,
        unit=unit,
        angle=angle,
        rate=rate,
        parameters="\n".join(
            f"    {constant} = {{{number(value)}, '1'}}; % {what}" for constant, value, what in law.numbers
        ),
        states="\n".join(
            f"    {z} = {{value = {{0, '1'}}, priority = priority.high}}; % {ascii_line(what)}"
            for z, what in zip(states, law.states, strict=True)
        ),
        rates="\n".join(
            f"        {line}"
            for z, formula, limit in zip(states, law.rates, law.limits, strict=True)
            for line in _rate(z, _written(formula), limit)
        ),
        moment=_written(law.moment),
    )


def _rate(state: str, formula: str, limit: float) -> list[str]:
    """Return the equation of a state, which stops at its limit."""
    free = f"der({state}) == ({formula})*{{1, '1/s'}};"
    if not math.isfinite(limit):
        return [free]
    full = f"if abs({state}) >= {number(limit)} && {state}*omega > 0"
    return [full, f"    der({state}) == {{0, '1/s'}};", "else", f"    {free}", "end"]


def _written(expression: Any) -> str:
    """Return an expression of the law with z1 for z[0], and the sign of the rate for the direction of slip."""
    renamed = {DIRECTION: sympy.sign(variable_symbols()[1])}
    for symbol in expression.free_symbols:
        if symbol.name.startswith("z["):
            renamed[symbol] = sympy.Symbol(f"z{int(symbol.name[2:-1]) + 1}", real=True)
    return SimscapePrinter().doprint(expression.xreplace(renamed)).replace("**", "^")
