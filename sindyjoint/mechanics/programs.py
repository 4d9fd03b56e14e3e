"""Formulas as laws without a compiler: one compiled callback interprets the operations of any formula.

A formula is a short list of numbered operations (:class:`~sindyjoint.equation.evaluation.TermFunction`), which
travels among the numbers of its law. A moment-driven run takes about as long as with machine code, internal states
along a motion three times as long; machine code takes half a second to make.
"""

from __future__ import annotations

from dataclasses import replace
from functools import lru_cache
from typing import Any

import numpy as np
from numba import cfunc
from numpy.typing import NDArray

from sindyjoint.equation.evaluation import compile_terms
from sindyjoint.equation.operations import operated, program
from sindyjoint.equation.pointers import integer_at, shifted, stacked
from sindyjoint.mechanics.compiled import CompiledLaw
from sindyjoint.mechanics.kernels import LAW_SIGNATURE
from sindyjoint.numeric import Array

Integers = NDArray[np.int64]


@lru_cache(maxsize=256)
def program_of_expressions(
    expressions: tuple, states: tuple[str, ...], parameters: tuple[str, ...]
) -> tuple[Array, Integers, Integers]:
    """Return the program of sympy expressions (moment, then state rates); ``sign(omega)`` is the direction of slip.

    Raises
    ------
    FormulaError
        For a function that formulas do not have.
    """
    from sympy import Heaviside, Symbol, sign

    direction = Symbol("direction", real=True)

    def directed(expression: Any) -> Any:
        jumps: dict[Any, Any] = {}
        for symbol in expression.free_symbols:
            if symbol.name == "omega":
                jumps |= {sign(symbol): direction, Heaviside(symbol): (1 + direction) / 2}
        return expression.xreplace(jumps)

    arguments = ("theta", "omega", "direction", *states, *parameters)
    return program(compile_terms([directed(each) for each in expressions], arguments))


# Integers in front of the program, by their bits: numbers of states, of values, of constants, of operations.
HEADER = 4


@cfunc(LAW_SIGNATURE, cache=True, error_model="numpy")
def PROGRAM_CALLBACK(theta, omega, direction, state, parameters, out):  # noqa: N802, D103
    states, values = integer_at(parameters), integer_at(shifted(parameters, 1))
    known, count = values + integer_at(shifted(parameters, 2)), integer_at(shifted(parameters, 3))
    numbers = shifted(parameters, HEADER)
    plan = shifted(numbers, known)
    start = 3 + states + known
    registers = stacked(start + count)
    registers[0], registers[1], registers[2] = theta, omega, direction
    for i in range(states):
        registers[3 + i] = state[i]
    for i in range(known):
        registers[3 + states + i] = numbers[i]
    for row in range(count):
        operation = shifted(plan, 3 * row)
        first, second = integer_at(shifted(operation, 1)), integer_at(shifted(operation, 2))
        registers[start + row] = operated(integer_at(operation), registers[first], registers[second])
    outputs = shifted(plan, 3 * count)
    for i in range(1 + states):
        out[i] = registers[integer_at(shifted(outputs, i))]


def rates_alone(program: tuple[Array, Integers, Integers], n_states: int, n_parameters: int) -> Any:
    """Return a program without the operations that only the moment needs; where the moment was, the angle is."""
    constants, operations, outputs = program
    start = 3 + n_states + n_parameters + constants.size
    needed = {0, *outputs[1:].tolist()}
    for row in range(len(operations) - 1, -1, -1):
        if start + row in needed:
            needed |= set(operations[row, 1:].tolist())
    kept = [row for row in range(len(operations)) if start + row in needed]
    # Registers of operations move down by those that went.
    renamed = np.arange(start + len(operations))
    renamed[[start + row for row in kept]] = start + np.arange(len(kept))
    left = operations[kept]
    left[:, 1:] = renamed[left[:, 1:]]
    return constants, left, np.concatenate([[0], renamed[outputs[1:]]])


def interpreted_law(
    program: tuple[Array, Integers, Integers], n_states: int, parameters: Array
) -> CompiledLaw:
    """Return a law of a program: moment and rates of its states, interpreted."""
    law = _packed(program, n_states, parameters)

    def memory(numbers: Array) -> CompiledLaw:
        given = numbers[HEADER : HEADER + parameters.size]
        return _packed(rates_alone(program, n_states, parameters.size), n_states, given)

    return replace(law, memory=memory) if n_states else law


def _packed(program: tuple[Array, Integers, Integers], n_states: int, parameters: Array) -> CompiledLaw:
    constants, operations, outputs = program
    plan = np.concatenate([operations.ravel(), outputs]).astype(np.int64)
    header = np.array([n_states, parameters.size, constants.size, len(operations)], dtype=np.int64)
    numbers = np.concatenate([header.view(np.float64), parameters, constants, plan.view(np.float64)])
    return CompiledLaw(PROGRAM_CALLBACK, numbers, n_states, HEADER + np.arange(parameters.size))
