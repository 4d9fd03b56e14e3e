"""Internal states along a measured motion, for any formula, without compiling it.

A formula is a short list of numbered operations (:class:`~sindyjoint.equation.evaluation.TermFunction`); one small
interpreter, compiled once and kept on disk, steps the rates of all states through the samples. The step is the
exponential Rosenbrock-Euler rule z⁺ = z + h·f·(eˣ − 1)/x, x = h·∂f/∂z, state by state, at the motion of the middle of
the step: exact where the rate is linear in its state, and stable however short the distance or time in which it forgets
(Hochbruck and Ostermann 2010, Acta Numerica 19, section 2.4).
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from numba import njit
from numpy.typing import NDArray

from sindyjoint.equation.operations import program, run_rows
from sindyjoint.equation.pointers import pointer, stacked

if TYPE_CHECKING:
    from sindyjoint.equation.evaluation import TermFunction

Array = NDArray[np.float64]
Integers = NDArray[np.int64]


class StateProgram(NamedTuple):
    """The rates of internal states as a program whose arguments are theta, omega, the states, then the parameters.

    Parameters
    ----------
    constants, operations, outputs : ndarray
        See :func:`sindyjoint.equation.operations.program`.
    fixed, moving : ndarray of int
        Operations that rest on parameters alone; those that rest on motion or states.
    by_state, ends : ndarray of int
        Operations that rest on the first state, on the second one, …, and where those of each state end.
    """

    constants: Array
    operations: Integers
    outputs: Integers
    fixed: Integers
    moving: Integers
    by_state: Integers
    ends: Integers


def state_program(function: TermFunction, states: int) -> StateProgram:
    """Return the program of the rates of so many states."""
    moved = _resting_on(function, range(2 + states))
    own = [_resting_on(function, [2 + state]) for state in range(states)]
    if len({row for rows in own for row in rows}) < sum(map(len, own)):
        # An operation of two states is left over from the one when the other is varied: each then varies all.
        own = [_resting_on(function, range(2, 2 + states))] * states
    fixed = [row for row in range(len(function.operations)) if row not in moved]

    def integers(rows: Sequence[int]) -> Integers:
        return np.array(rows, dtype=np.int64)

    return StateProgram(
        *program(function), integers(fixed), integers(moved), integers([row for rows in own for row in rows]),
        np.cumsum([len(rows) for rows in own], dtype=np.int64),
    )  # fmt: skip


def _resting_on(function: TermFunction, registers: Iterable[int]) -> list[int]:
    """Return the operations that rest on some arguments."""
    first = len(function.arguments) + len(function.constants)
    known, rows = set(registers), []
    for row, (_, *operands) in enumerate(function.operations):
        if known & set(operands):
            known.add(first + row)
            rows.append(row)
    return rows


@njit(cache=True, error_model="numpy", nogil=True)
def integrate_runs(angle, rate, ends, timing, parameters, limits, program):
    """Return the states at every sample of several runs, one after the other, shape (n_states, n).

    ``timing`` holds the step, the passes, the substeps and the first state of a slider of each run. Between samples the
    motion is interpolated linearly. With more than one pass a run is one period, and is run through that many times.
    """
    steps, passes, substeps, first = timing
    states = np.empty((program.outputs.size, angle.size))
    begin = 0
    for run in range(ends.size):
        end = ends[run]
        motion = (
            angle[begin:end],
            rate[begin:end],
            steps[run] / substeps[run],
            passes[run],
            substeps[run],
            first[run],
        )
        _integrate_run(states[:, begin:end], motion, parameters, limits, program)
        begin = end
    return states


@njit(cache=True, error_model="numpy", nogil=True)
def _integrate_run(states, motion, parameters, limits, program):
    """Fill in the states of one run; operations on parameters alone are done once."""
    angle, rate, h, passes, substeps, first = motion
    n, k = angle.size, program.outputs.size
    # What has no limit begins at zero.
    z, slope, last, older = np.empty(k), np.empty(k), np.empty(k), np.empty(k)
    for j in range(k):
        z[j] = last[j] = older[j] = first if np.isfinite(limits[j]) else 0.0
    known = parameters.size + program.constants.size
    base = 2 + k + known
    registers = stacked(base + program.operations.shape[0])
    for i in range(known):
        given = i < parameters.size
        registers[2 + k + i] = parameters[i] if given else program.constants[i - parameters.size]
    operations, moving, by_state = (
        pointer(program.operations),
        pointer(program.moving),
        pointer(program.by_state),
    )
    run_rows(registers, base, operations, pointer(program.fixed), 0, program.fixed.size)
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
                for j in range(k):
                    registers[2 + j] = z[j]
                run_rows(registers, base, operations, moving, 0, program.moving.size)
                for j in range(k):
                    slope[j] = registers[program.outputs[j]]
                for j in range(k):
                    # ∂f_j/∂z_j by a small step: the states of the shipped effects do not feed each other.
                    step = 1e-6 * (abs(z[j]) + abs(h * slope[j]) + 1e-300)
                    registers[2 + j] = z[j] + step
                    begin = program.ends[j - 1] if j > 0 else 0
                    run_rows(registers, base, operations, by_state, begin, program.ends[j])
                    stiffness = (registers[program.outputs[j]] - slope[j]) / step
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
        if settled and turn > 0:
            break
        # Of one that forgets slowly three ends of passes tell the limit, as of a geometric series (Aitken 1926).
        for j in range(k):
            came, comes = last[j] - older[j], z[j] - last[j]
            older[j], last[j] = last[j], z[j]
            if turn % 3 == 2 and abs(comes) < abs(came):
                value = z[j] + comes * comes / (came - comes)
                z[j] = last[j] = min(max(value, -limits[j]), limits[j])
