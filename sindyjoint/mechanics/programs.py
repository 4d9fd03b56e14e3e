"""Formulas as laws without a compiler: one compiled callback interprets the operations of any formula.

A formula is a short list of numbered operations (:class:`~sindyjoint.equation.evaluation.TermFunction`), which
travels among the numbers of its law. A moment-driven run takes about as long as with machine code, internal states
along a motion three times as long; machine code takes half a second to make.
"""

from __future__ import annotations

from functools import lru_cache
from typing import TYPE_CHECKING, Any

import numpy as np
from numba import cfunc, njit
from numpy.typing import NDArray

from sindyjoint.equation.evaluation import compile_terms
from sindyjoint.mechanics.compiled import CompiledLaw
from sindyjoint.mechanics.kernels import LAW_SIGNATURE, integer_at, shifted, stacked

if TYPE_CHECKING:
    from sindyjoint.equation.evaluation import TermFunction

Array = NDArray[np.float64]
Integers = NDArray[np.int64]

CODES = {
    name: code
    for code, name in enumerate(
        (
            "abs", "sign", "sqrt", "exp", "log", "sin", "cos", "tan", "tanh", "atan",
            "add", "subtract", "multiply", "divide", "power", "minimum", "maximum", "heaviside",
        )
    )
}  # fmt: skip


def program(function: TermFunction) -> tuple[Array, Integers, Integers]:
    """Return constants, operations (code, first, second) and output registers as arrays.

    Where an operation has one operand only, that stands for the second, too.
    """
    operations = np.array(
        [(CODES[name], first, first if second < 0 else second)
         for name, first, second in function.operations], dtype=np.int64,
    ).reshape(-1, 3)  # fmt: skip
    return (
        np.array(function.constants, dtype=np.float64),
        operations,
        np.array(function.outputs, dtype=np.int64),
    )


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


@njit(cache=True, error_model="numpy", inline="always")
def operated(code, a, b):
    """Return the result of one operation."""
    if code == 12:
        value = a * b
    elif code == 10:
        value = a + b
    elif code == 11:
        value = a - b
    elif code == 13:
        value = a / b
    elif code == 0:
        value = abs(a)
    elif code == 1:
        value = np.sign(a)
    elif code == 14:
        value = a**b
    elif code == 3:
        value = np.exp(a)
    elif code == 15:
        value = min(a, b)
    elif code == 16:
        value = max(a, b)
    elif code == 2:
        value = np.sqrt(a)
    elif code == 4:
        value = np.log(a)
    elif code == 5:
        value = np.sin(a)
    elif code == 6:
        value = np.cos(a)
    elif code == 7:
        value = np.tan(a)
    elif code == 8:
        value = np.tanh(a)
    elif code == 9:
        value = np.arctan(a)
    else:
        value = 1.0 if a > 0 else (0.0 if a < 0 else b)
    return value


@njit(cache=True, error_model="numpy")
def run_rows(registers, start, operations, rows, begin, end):
    """Fill the registers of operations ``rows[begin:end]``, in their order; all are pointers.

    ``start`` is the register of the first operation: behind those of arguments and constants.
    """
    for i in range(begin, end):
        operation = shifted(operations, 3 * rows[i])
        registers[start + rows[i]] = operated(operation[0], registers[operation[1]], registers[operation[2]])


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


def interpreted_law(
    program: tuple[Array, Integers, Integers], n_states: int, parameters: Array
) -> CompiledLaw:
    """Return a law of a program: moment and rates of its states, interpreted."""
    constants, operations, outputs = program
    plan = np.concatenate([operations.ravel(), outputs]).astype(np.int64)
    header = np.array([n_states, parameters.size, constants.size, len(operations)], dtype=np.int64)
    numbers = np.concatenate([header.view(np.float64), parameters, constants, plan.view(np.float64)])
    return CompiledLaw(PROGRAM_CALLBACK, numbers, n_states, HEADER + np.arange(parameters.size))
