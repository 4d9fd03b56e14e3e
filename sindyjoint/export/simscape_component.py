"""A custom component of Simscape with the elements of a model: internal states as variables, rates as equations."""

from __future__ import annotations

import math
from typing import Any

import sympy
from sympy.printing.str import StrPrinter

from sindyjoint.equation.formula import variable_symbols
from sindyjoint.equation.model import JointModel
from sindyjoint.export.code import law_of_elements
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
    domain = "rotational.rotational" if rotation else "translational.translational"
    load, unit, angle, rate = ("t", "N*m", "rad", "w") if rotation else ("f", "N", "m", "v")
    states = [f"z{index + 1}" for index in range(len(law.states))]
    symbols = {
        sympy.Symbol(f"z[{i}]", real=True): sympy.Symbol(name, real=True) for i, name in enumerate(states)
    }
    direction = sympy.Symbol("direction", real=True)
    symbols[direction] = sympy.sign(variable_symbols()[1])

    def written(expression: Any) -> str:
        return SimscapePrinter().doprint(expression.xreplace(symbols)).replace("**", "^")

    lines = [
        f"component {name}",
        "% Elements of a joint; beside spring, damper and friction blocks",
        "",
        "nodes",
        f"    R = foundation.mechanical.{domain}; % R:right",
        f"    C = foundation.mechanical.{domain}; % C:left",
        "end",
        "",
        "parameters",
        *(
            f"    {name} = {{{number(value)}, '1'}}; % {what.replace(chr(37), '')}"
            for name, value, what in law.numbers
        ),
        "end",
        "",
        "variables",
        f"    {load} = {{0, '{unit}'}};",
        f"    x = {{value = {{0, '{angle}'}}, priority = priority.high}};",
        *(
            f"    {z} = {{value = {{0, '1'}}, priority = priority.high}}; % {ascii_line(what)}"
            for z, what in zip(states, law.states, strict=True)
        ),
        "end",
        "",
        "branches",
        f"    {load} : R.{load} -> C.{load};",
        "end",
        "",
        "equations",
        "    let",
        f"        theta = value(x, '{angle}');",
        f"        omega = value(R.{rate} - C.{rate}, '{angle}/s');",
        "    in",
        f"        der(x) == R.{rate} - C.{rate};",
    ]
    for z, formula, limit in zip(states, law.rates, law.limits, strict=True):
        free = f"der({z}) == ({written(formula)})*{{1, '1/s'}};"
        if not math.isfinite(limit):
            lines.append(f"        {free}")
            continue
        lines += [
            f"        if abs({z}) >= {number(limit)} && {z}*omega > 0",
            f"            der({z}) == {{0, '1/s'}};",
            "        else",
            f"            {free}",
            "        end",
        ]
    lines += [
        f"        {load} == ({written(law.moment)})*{{1, '{unit}'}};",
        "    end",
        "end",
        "",
        "end",
    ]
    first, *rest = lines
    # The first words of the file are the component's, its comment comes behind them.
    return "\n".join([first, head.rstrip("\n"), *rest]) + "\n"
