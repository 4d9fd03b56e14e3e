"""Internal states along a measured motion, for any formula, without compiling it.

A formula is a short list of numbered operations (:class:`~sindyjoint.equation.evaluation.TermFunction`); one small
interpreter, compiled once and kept on disk, steps the rates of all states through the samples. The step is the
exponential Rosenbrock-Euler rule z⁺ = z + h·f·(eˣ − 1)/x, x = h·∂f/∂z, state by state, at the motion of the middle of
the step: exact where the rate is linear in its state, and stable however short the distance or time in which it forgets
(Hochbruck and Ostermann 2010, Acta Numerica 19, section 2.4).
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from numba import njit
from numpy.typing import NDArray

if TYPE_CHECKING:
    from sindyjoint.equation.evaluation import TermFunction

Array = NDArray[np.float64]

CODES = {
    name: code
    for code, name in enumerate(
        (
            "abs", "sign", "sqrt", "exp", "log", "sin", "cos", "tan", "tanh", "atan",
            "add", "subtract", "multiply", "divide", "power", "minimum", "maximum", "heaviside",
        )
    )
}  # fmt: skip


def program(function: TermFunction) -> tuple[Array, NDArray[np.int64], NDArray[np.int64]]:
    """Return constants, operations (code, first, second) and output registers as arrays."""
    operations = np.array(
        [(CODES[name], first, second) for name, first, second in function.operations], dtype=np.int64
    ).reshape(-1, 3)
    return (
        np.array(function.constants, dtype=np.float64),
        operations,
        np.array(function.outputs, dtype=np.int64),
    )


def dependent_rows(
    function: TermFunction, states: int
) -> tuple[NDArray[np.int64], NDArray[np.int64], NDArray[np.int64]]:
    """Return the operations that rest on parameters alone, those on motion or states, and of these those on states."""
    first = len(function.arguments) + len(function.constants)
    moved, by_state = set(range(2 + states)), set(range(2, 2 + states))
    for number, (_, *operands) in enumerate(function.operations):
        for known in (moved, by_state):
            if known & set(operands):
                known.add(first + number)
    rows = range(len(function.operations))
    fixed = [row for row in rows if first + row not in moved]
    moving, stateful = ([row for row in rows if first + row in known] for known in (moved, by_state))
    return (
        np.array(fixed, dtype=np.int64),
        np.array(moving, dtype=np.int64),
        np.array(stateful, dtype=np.int64),
    )


@njit(cache=True, error_model="numpy", inline="always")
def _operated(code, a, b):
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
def run_program(registers, start, operations):
    """Fill the registers of the operations from those of arguments and constants."""
    for row in range(operations.shape[0]):
        a = registers[operations[row, 1]]
        b = registers[operations[row, 2]] if operations[row, 2] >= 0 else 0.0
        registers[start + row] = _operated(operations[row, 0], a, b)


@njit(cache=True, error_model="numpy")
def run_rows(registers, start, operations, rows):
    """Do the same for some of the operations, in their order."""
    for row in rows:
        a = registers[operations[row, 1]]
        b = registers[operations[row, 2]] if operations[row, 2] >= 0 else 0.0
        registers[start + row] = _operated(operations[row, 0], a, b)


@njit(cache=True, error_model="numpy", nogil=True)
def integrate_states(
    states,
    angle,
    rate,
    dt,
    passes,
    substeps,
    parameters,
    limits,
    constants,
    operations,
    outputs,
    fixed,
    moving,
    stateful,
):
    """Fill in the states at every sample, shape (n_states, n).

    Arguments of the program are theta, omega, the states, then the parameters. Between samples the motion is
    interpolated linearly. With ``passes`` > 1 the record is one period and is run through that many times. Operations
    on parameters alone are done once, and for a changed state only those that rest on states.
    """
    n, k = angle.size, outputs.size
    # At rest at zero angle a slider is in its middle; where it never slips it stays about there.
    start = np.empty(k)
    for j in range(k):
        start[j] = angle[0] if np.isfinite(limits[j]) else 0.0
    z = start.copy()
    registers = np.empty(2 + k + parameters.size + constants.size + operations.shape[0])
    first = 2 + k + parameters.size
    registers[2 + k : first] = parameters
    registers[first : first + constants.size] = constants
    base = first + constants.size
    run_rows(registers, base, operations, fixed)
    h = dt / substeps
    slope = np.empty(k)
    last = start.copy()
    for turn in range(passes):
        for i in range(n):
            if i == 0 and turn == 0:
                states[:, 0] = z
                continue
            before = i - 1 if i > 0 else n - 1
            for s in range(substeps):
                part = (s + 0.5) / substeps
                registers[0] = angle[before] + part * (angle[i] - angle[before])
                registers[1] = rate[before] + part * (rate[i] - rate[before])
                registers[2 : 2 + k] = z
                run_rows(registers, base, operations, moving)
                for j in range(k):
                    slope[j] = registers[outputs[j]]
                for j in range(k):
                    # ∂f_j/∂z_j by a small step: the states of the shipped effects do not feed each other.
                    step = 1e-6 * (abs(z[j]) + abs(h * slope[j]) + 1e-300)
                    registers[2 + j] = z[j] + step
                    run_rows(registers, base, operations, stateful)
                    stiffness = (registers[outputs[j]] - slope[j]) / step
                    registers[2 + j] = z[j]
                    if stiffness > 0.0:
                        stiffness = 0.0
                    x = h * stiffness
                    value = z[j] + h * slope[j] * (np.expm1(x) / x if x < -1e-9 else 1.0)
                    z[j] = min(max(value, -limits[j]), limits[j])
            states[:, i] = z
        # A state that forgets within a period needs two passes, not all of them.
        settled = True
        for j in range(k):
            largest = np.max(np.abs(states[j]))
            if abs(z[j] - last[j]) > 1e-7 * largest:
                settled = False
            last[j] = z[j]
        if settled and turn > 0:
            break


@njit(cache=True, error_model="numpy", nogil=True)
def integrate_runs(
    angle,
    rate,
    ends,
    dt,
    passes,
    substeps,
    parameters,
    limits,
    constants,
    operations,
    outputs,
    fixed,
    moving,
    stateful,
):
    """Return the states at every sample of several runs, one after the other, shape (n_states, n)."""
    states = np.empty((outputs.size, angle.size))
    begin = 0
    for run in range(ends.size):
        end = ends[run]
        integrate_states(
            states[:, begin:end],
            angle[begin:end],
            rate[begin:end],
            dt[run],
            passes[run],
            substeps[run],
            parameters,
            limits,
            constants,
            operations,
            outputs,
            fixed,
            moving,
            stateful,
        )
        begin = end
    return states
