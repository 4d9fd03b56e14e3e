"""A model as source code: names, numbers and the law, printed from the one sympy expression of each term; C itself.

sympy's printers are imported here at the top; import this module only when code is to be written.
"""

import keyword
import math
import re
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cache
from importlib.resources import files
from itertools import chain, count
from typing import Any

import sympy
from sympy.printing.c import C99CodePrinter
from sympy.printing.codeprinter import CodePrinter
from sympy.printing.pycode import PythonCodePrinter

from sindyjoint.equation.equation_text import one_line
from sindyjoint.equation.formula import parameter_symbol, state_symbol, variable_symbols
from sindyjoint.equation.model import INERTIA, JointModel
from sindyjoint.export import Export
from sindyjoint.export.elements import speeds
from sindyjoint.export.fidelity import (
    Cycles,
    Fidelity,
    ascii_line,
    comment,
    exact_rows,
    exact_table,
    filled_in,
    left_out,
    number,
    preamble,
    words_of,
)
from sindyjoint.export.parts import Parts, corners, softening_limits, steepness
from sindyjoint.inputs import Input

DIRECTION = sympy.Symbol("direction", real=True)


class InFull:
    """What the printers of all languages have: numbers to the last digit, and a function for the sign."""

    sign = "sign"
    _print: Callable[[Any], str]

    def _print_Float(self, expr: Any) -> str:
        return number(float(expr))

    def _print_sign(self, expr: Any) -> str:
        return f"{self.sign}({self._print(expr.args[0])})"


class CPrinter(InFull, C99CodePrinter):
    """C99 with doubles."""

    sign = "joint_sign"


class PythonPrinter(InFull, PythonCodePrinter):
    """Plain Python over ``math``."""


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


@dataclass(frozen=True)
class Law:
    """A model in sympy, with the names that its numbers and states have in code.

    Parameters
    ----------
    numbers : tuple of (str, float, str)
        Name, value and meaning of each constant.
    moment : sympy.Expr
    states : tuple of str
        What each internal state is, element.state.
    rates : tuple of sympy.Expr
    limits : tuple of float
        Infinite where a state has none.
    inputs : tuple of (str, Input)
        What the moment depends on beside the motion, with their names in code.
    """

    numbers: tuple[tuple[str, float, str], ...]
    moment: sympy.Expr
    states: tuple[str, ...]
    rates: tuple[sympy.Expr, ...]
    limits: tuple[float, ...]
    inputs: tuple[tuple[str, Input], ...] = ()


def law_of(model: JointModel) -> Law:
    """Return a model as expressions of ``theta``, ``omega``, ``direction`` and the states ``z[0]``, ``z[1]``, …."""
    parts = Parts.of(model)
    terms = (*parts.elastic, *parts.rate, *parts.coupled)
    inner = [(element, number) for element in model.elements for number in element.numbers]
    names = identifiers([term.symbol for term in terms] + [number.name for _, number in inner])
    meanings = [(t.coefficient, t.unit, t.name) for t in terms]
    meanings += [(number.value, number.unit, f"{number.name} of {element.id}") for element, number in inner]
    numbers = tuple(
        (name, value, f"{ascii_line(unit)}, {ascii_line(what)}".removeprefix(", "))
        for name, (value, unit, what) in zip(names, meanings, strict=True)
    )
    moment = sum(
        (sympy.Symbol(name) * at_slip(term.expression) for name, term in zip(names, terms, strict=False)),
        sympy.Integer(0),
    )
    inputs = tuple((input_identifier(each.name), each) for each in model.used_inputs)
    moment = moment.xreplace({state_symbol(each.name): sympy.Symbol(name) for name, each in inputs})
    states: list[str] = []
    rates: list[Any] = []
    limits: list[float] = []
    rest = iter(names[len(terms) :])
    for element in model.elements:
        form = element.form
        coefficients = [sympy.Symbol(next(rest)) for _ in form.columns]
        here = {parameter_symbol(name): sympy.Symbol(next(rest), positive=True) for name in form.names}
        for state in form.states:
            here[state_symbol(state.name)] = sympy.Symbol(f"z[{len(states)}]", real=True)
            states.append(one_line(f"{element.id}.{state.name}"))
        for coefficient, column in zip(coefficients, form.columns, strict=True):
            moment += coefficient * at_slip(column.expression.xreplace(here))
        rates += [at_slip(state.rate.xreplace(here)) for state in form.states]
        limits += [float(limit) for limit in form.limits(element.values)]
    return Law(numbers, moment, tuple(states), tuple(rates), tuple(limits), inputs)


def code(file: str, model: JointModel, printer: CodePrinter, infinity: str, law: Law, **own: Any) -> str:
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
    law : Law
        Of the model.
    **own : object
        What only this template asks for.
    """
    # What bounds a step or the range does so wherever the inputs were tested.
    held = corners(model)
    below, above = zip(*map(softening_limits, held), strict=True)
    stiffness, damping = (max(values) for values in zip(*map(steepness, held), strict=True))
    cycles = Cycles.of(model)
    fast = [speeds(element, cycles) for element in model.elements]
    return filled_in(
        file,
        law=law,
        inertia=number(model.inertia),
        inertia_unit=words_of(model).inertia_unit,
        low=written(max(below), infinity),
        high=written(min(above), infinity),
        stiffness=number(stiffness + sum(k for k, _ in fast)),
        damping=number(damping),
        relaxation=number(max((decay for _, decay in fast), default=0.0)),
        # A step of the integration as a share of the fastest time constant: sliders yield inside steps, which costs an
        # order.
        share=number(0.02 if any(map(math.isfinite, law.limits)) else 0.1),
        moment=printer.doprint(law.moment),
        rates=[printer.doprint(rate) for rate in law.rates],
        limits=[written(limit, infinity) for limit in law.limits],
        **own,
    )


def input_line(name: str, each: Input) -> str:
    """Return what an input is, for a comment."""
    tested = f", tested from {number(each.tested[0])} to {number(each.tested[1])}" if each.tested else ""
    return ascii_line(f"{name}: {each.label}, {each.unit}{tested}, reference {each.shown(each.reference)}")


def input_identifier(name: str) -> str:
    """Return the name of an input in code: its own, where no language and no template uses it.

    Examples
    --------
    >>> input_identifier("temperature"), input_identifier("slope"), input_identifier("double")
    ('temperature', 'input_slope', 'input_double')
    """
    taken = name in _words_in_use() or name.upper().startswith("JOINT_")
    return f"input_{name}" if taken else name


@cache
def _words_in_use() -> frozenset[str]:
    """Return every word of the templates, and of their languages."""
    folder = files("sindyjoint.export").joinpath("templates")
    texts = [
        folder.joinpath(name).read_text(encoding="utf-8")
        for name in ("joint.h.j2", "joint.py.j2", "joint_fmu.py.j2")
    ]
    # What the templates ask for themselves is no word of the code.
    words = {
        w for text in texts for w in re.findall(r"[A-Za-z]\w*", re.sub(r"(?s)\{[{%].*?[%}]\}", " ", text))
    }
    return frozenset({*words, *keyword.kwlist, *_C_WORDS.split()})


_C_WORDS = (
    "auto break case char continue default do enum extern float goto int long register short signed sizeof struct "
    "switch typedef union unsigned volatile restrict _Bool bool true false complex I NAN INFINITY asm u"
)


def written(value: float, infinity: str) -> str:
    """Return a number that may be infinite."""
    return number(value) if math.isfinite(value) else ("" if value > 0 else "-") + infinity


def identifiers(symbols: Sequence[str]) -> list[str]:
    """Return a separate identifier for each symbol, valid in C and Python.

    Examples
    --------
    >>> identifiers(["k1", "μ a", "mu a"])
    ['JOINT_k1', 'JOINT_a', 'JOINT_mu_a']
    """
    taken: list[str] = []
    for symbol in symbols:
        base = "JOINT_" + (re.sub(r"[^A-Za-z0-9]+", "_", symbol).strip("_") or "x")
        # The names of the templates are all upper case; a coefficient of such a name steps aside.
        tried = chain([base], (f"{base}_{number}" for number in count(2)))
        taken.append(next(name for name in tried if name not in taken and name not in _RESERVED))
    return taken


_RESERVED = {
    "JOINT_" + name
    for name in (
        "H", "NAME", "REFERENCE", "INERTIA", "LOW", "HIGH", "STIFFNESS", "DAMPING", "RELAXATION", "STATES",
        "STATE_NAMES", "LIMITS",
    )
}  # fmt: skip


def bounds(model: JointModel) -> str:
    """Say in a sentence where the law stops to hold."""
    ends = zip(*map(softening_limits, corners(model)), strict=True)
    low, high = (nearest(values) for nearest, values in zip((max, min), ends, strict=True))
    unit = words_of(model).angle_unit
    sides = [f"{value:.6g} {unit}" for value in (low, high) if abs(value) != float("inf")]
    if not sides:
        return "the joint keeps a positive stiffness up to three times the tested range"
    return f"the stiffness falls to zero at {' and '.join(sides)}; beyond, the joint snaps through"


def formula_rows(model: JointModel, how: str) -> tuple[Fidelity, ...]:
    """Return the fidelity table of a target that computes the formulas themselves."""
    inertial, cycles = Parts.of(model).inertial, Cycles.of(model)
    rows = left_out(tuple(term for term in inertial if term.id != INERTIA), "a formula of the acceleration")
    rows |= exact_rows(
        (term for term in inertial if term.id == INERTIA), cycles, "the number INERTIA, used in steps"
    )
    inputs = [
        (each.name, f"parameter {name}, {each.unit}; unless given, {each.shown(each.reference)}")
        for name, each in law_of(model).inputs
    ]
    parameters = (Fidelity(name, name, words, True, 0.0, 0.0) for name, words in inputs)
    return (*parameters, *exact_table(model, how, f"{how}, internal states", rows))


def code_notes(model: JointModel) -> tuple[str, ...]:
    """Return what a user of generated code has to know."""
    states = law_of(model).states
    inner = (
        f"internal states, zero at the start: {', '.join(states)}; steps of the integration divide those of the "
        "caller"
    )
    unknown = "the moving inertia is not known: give one to step()"
    return (bounds(model), *[unknown] * (model.inertia == 0), *[inner] * bool(states))


def export_c(model: JointModel) -> Export:
    """Write ``joint.h``: a C99 header with the law and exact stick-slip steps."""
    rows, notes = formula_rows(model, "C expression"), code_notes(model)
    law = law_of(model)
    text = code(
        "joint.h.j2",
        model,
        CPrinter(),
        "HUGE_VAL",
        law,
        comment=block_comment(comment(preamble(model, "C", rows, notes), "")),
        name=string_literal(one_line(model.joint.name)),
        # Empty lists are none in C: the last entry stands for the end.
        names=[*(string_literal(one_line(state)) for state in law.states), "0"],
        block_comment=block_comment,
        input_line=input_line,
    )
    return Export("c", {"joint.h": text}, rows, notes)


def block_comment(text: str) -> str:
    """Return text as a C comment that nothing inside can end.

    Examples
    --------
    >>> block_comment("a */ b")
    '/* a * / b */'
    """
    safe = text.replace("\\", "/").replace("*/", "* /").replace("/*", "/ *").rstrip()
    return f"/* {safe.lstrip()} */" if "\n" not in safe else f"/*\n{safe}\n*/"


def string_literal(text: str) -> str:
    r"""Return text as a C string literal of UTF-8 bytes.

    Examples
    --------
    >>> print(string_literal('a "b" ü'))
    "a \042b\042 \303\274"
    """

    def byte(value: int) -> str:
        # Question marks could form trigraphs.
        plain = 32 <= value < 127 and chr(value) not in '"\\?'
        return chr(value) if plain else f"\\{value:03o}"

    return '"' + "".join(byte(value) for value in text.encode("utf-8")) + '"'
