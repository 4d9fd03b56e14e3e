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

from sindyjoint.mechanics.programs import run_rows

if TYPE_CHECKING:
    from sindyjoint.equation.evaluation import TermFunction

Array = NDArray[np.float64]


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
