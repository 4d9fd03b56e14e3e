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
from numpy.typing import NDArray

from sindyjoint.equation.evaluation import program
from sindyjoint.machine_code import Entry
from sindyjoint.numeric import Array

if TYPE_CHECKING:
    from sindyjoint.equation.evaluation import TermFunction

Integers = NDArray[np.int64]
_RUNS = Entry("states of runs", *[None] * 20)


class StateProgram(NamedTuple):
    """The rates of internal states as a program whose arguments are theta, omega, the states, then the parameters.

    Parameters
    ----------
    constants, operations, outputs : ndarray
        See :func:`sindyjoint.equation.evaluation.program`.
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


def integrate_runs(
    angle: Array,
    rate: Array,
    ends: Integers,
    timing: tuple[Array, Integers, Integers, Array],
    parameters: Array,
    limits: Array,
    program: StateProgram,
) -> Array:
    """Return the states at every sample of several runs, one after the other, shape (n_states, n).

    ``timing`` holds the step, the passes, the substeps and the first state of a slider of each run. Between samples the
    motion is interpolated linearly. With more than one pass a run is one period, and is run through that many times.

    Runs of as many substeps go side by side, each a lane of the registers; one that is done gives up its lane.
    """
    runs, k, operations = len(ends), len(program.outputs), len(program.operations)
    states = np.empty((k, angle.size))
    sizes = [angle.size, runs, len(parameters), *map(len, program)]
    registers = 2 + k + len(parameters) + len(program.constants) + operations
    steps, passes, substeps, first = timing
    _RUNS(
        *(np.ascontiguousarray(each, dtype=np.int64) for each in (sizes, ends, passes, substeps)),
        *(np.ascontiguousarray(each, dtype=np.float64) for each in (angle, rate, steps, first, parameters, limits)),
        *map(np.ascontiguousarray, program), states,
        np.empty(runs * (4 * k + 1 + registers)), np.empty(8 * runs, dtype=np.int64),
    )  # fmt: skip
    return states
