"""Formulas in compiled loops: numbered operations, their interpreter, and internal states along a measured motion.

A formula is a short list of numbered operations (:class:`~sindyjoint.equation.evaluation.TermFunction`); one small
interpreter, compiled once and kept on disk, steps the rates of all states through the samples. The step is the
exponential Rosenbrock-Euler rule z⁺ = z + h·f·(eˣ − 1)/x, x = h·∂f/∂z, state by state, at the motion of the middle of
the step: exact where the rate is linear in its state, and stable however short the distance or time in which it forgets
(Hochbruck and Ostermann 2010, Acta Numerica 19, section 2.4).
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import Any, NamedTuple

import numpy as np
from numba import njit, types
from numba.extending import intrinsic as numba_intrinsic
from numpy.typing import NDArray

from sindyjoint.equation.evaluation import TermFunction
from sindyjoint.numeric import Array

# Its annotations describe the Python function, which takes a typing context first; callers do not give that.
intrinsic: Any = numba_intrinsic


@intrinsic
def pointer(typingctx, array):
    """Pointer to the first element of an array, which the caller keeps alive.

    The integrators work on pointers: numba counts references to arrays, and counting costs them more than the
    arithmetic does.
    """

    def codegen(context, builder, signature, args):
        return context.make_array(signature.args[0])(context, builder, args[0]).data

    return types.CPointer(array.dtype)(array), codegen


@intrinsic
def shifted(typingctx, base, count):
    """Pointer `count` elements further on."""

    def codegen(context, builder, signature, args):
        return builder.gep(args[0], [args[1]])

    return base(base, types.intp), codegen


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


@njit(cache=True, error_model="numpy", no_cpython_wrapper=True, no_cfunc_wrapper=True)
def run_lanes(registers, lanes, stride, start, operations, rows, begin, end):
    """Fill the registers of operations ``rows[begin:end]`` for several motions at once; all are pointers.

    A register holds one number for each lane, ``stride`` apart from the next register: an operation is looked up once
    for all lanes, and the plain ones are carried out several lanes at a time.
    """
    for i in range(begin, end):
        operation = shifted(operations, 3 * rows[i])
        code = operation[0]
        a = shifted(registers, stride * operation[1])
        b = shifted(registers, stride * operation[2])
        out = shifted(registers, stride * (start + rows[i]))
        if code == 12:
            for lane in range(lanes):
                out[lane] = a[lane] * b[lane]
        elif code == 10:
            for lane in range(lanes):
                out[lane] = a[lane] + b[lane]
        elif code == 11:
            for lane in range(lanes):
                out[lane] = a[lane] - b[lane]
        elif code == 13:
            for lane in range(lanes):
                out[lane] = a[lane] / b[lane]
        elif code == 0:
            for lane in range(lanes):
                out[lane] = abs(a[lane])
        else:
            for lane in range(lanes):
                out[lane] = operated(code, a[lane], b[lane])


class StateProgram(NamedTuple):
    """The rates of internal states as a program whose arguments are theta, omega, the states, then the parameters.

    Parameters
    ----------
    constants, operations, outputs : ndarray
        See :func:`sindyjoint.equation.internal_states.program`.
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


# Only `integrate_runs` is called from Python: wrappers of the others would be compiled for nobody.
_options = {"cache": True, "error_model": "numpy", "nogil": True, "no_cfunc_wrapper": True}
_inner = njit(**_options, no_cpython_wrapper=True)


@njit(**_options)
def integrate_runs(angle, rate, ends, timing, parameters, limits, program):
    """Return the states at every sample of several runs, one after the other, shape (n_states, n).

    ``timing`` holds the step, the passes, the substeps and the first state of a slider of each run. Between samples the
    motion is interpolated linearly. With more than one pass a run is one period, and is run through that many times.

    Runs of as many substeps go side by side, each a lane of the registers; one that is done gives up its lane.
    """
    states = np.empty((program.outputs.size, angle.size))
    begun = np.zeros(ends.size, dtype=np.bool_)
    substeps = timing[2]
    # Number by number, here and below: masks and the assignment of slices take seconds to compile.
    for run in range(ends.size):
        if not begun[run]:
            alike, count = np.empty(ends.size, dtype=np.int64), 0
            for other in range(run, ends.size):
                if substeps[other] == substeps[run]:
                    alike[count], begun[other] = other, True
                    count += 1
            _side_by_side(states, alike[:count], (angle, rate, ends), timing, parameters, limits, program)
    return states


@_inner
def _side_by_side(states, runs, motion, timing, parameters, limits, program):
    """Fill in the states of some runs of as many substeps."""
    angle, rate, ends = motion
    steps, passes, substeps, first = timing
    k, lanes, parts = program.outputs.size, runs.size, substeps[runs[0]]
    registers, base = _registers(lanes, parameters, program)
    # State now, at the end of the last pass and of that before it, and its rate, for each state and lane.
    z, last, older, slope = (
        np.empty((k, lanes)),
        np.empty((k, lanes)),
        np.empty((k, lanes)),
        np.empty((k, lanes)),
    )
    # First sample, that before the step, that after it, the one past the last, pass and passes of each lane.
    begin, before, now, end, turn, most = np.empty((6, lanes), dtype=np.int64)
    h = np.empty(lanes)
    for lane in range(lanes):
        run = runs[lane]
        begin[lane] = ends[run - 1] if run > 0 else 0
        end[lane], turn[lane], most[lane], h[lane] = ends[run], 0, passes[run], steps[run] / parts
        for j in range(k):
            # What has no limit begins at zero.
            z[j, lane] = first[run] if np.isfinite(limits[j]) else 0.0
            states[j, begin[lane]] = last[j, lane] = older[j, lane] = z[j, lane]
        before[lane], now[lane] = begin[lane], begin[lane] + 1
    held = (pointer(registers), pointer(z), pointer(slope), pointer(h))
    rates = (
        pointer(program.operations), pointer(program.moving), pointer(program.by_state), pointer(program.ends),
        pointer(program.outputs), pointer(limits),
    )  # fmt: skip
    sizes = (k, lanes, base, program.moving.size)
    active = lanes
    while active > 0:
        shortest = end[0] - now[0]
        for lane in range(1, active):
            shortest = min(shortest, end[lane] - now[lane])
        for _ in range(shortest):
            for s in range(parts):
                share = (s + 0.5) / parts
                for lane in range(active):
                    i, last_one = now[lane], before[lane]
                    registers[0, lane] = angle[last_one] + share * (angle[i] - angle[last_one])
                    registers[1, lane] = rate[last_one] + share * (rate[i] - rate[last_one])
                _step(held, active, sizes, rates)
            for lane in range(active):
                for j in range(k):
                    states[j, now[lane]] = z[j, lane]
                before[lane] = now[lane]
                now[lane] += 1
        lane = 0
        while lane < active:
            if now[lane] == end[lane]:
                own, mine = states[:, begin[lane] : end[lane]], (z[:, lane], last[:, lane], older[:, lane])
                turn[lane] = most[lane] if _pass_ends(own, mine, limits, turn[lane]) else turn[lane] + 1
                now[lane] = begin[lane]
            if turn[lane] < most[lane]:
                lane += 1
                continue
            active -= 1
            for each in (begin, before, now, end, turn, most):
                each[lane] = each[active]
            h[lane] = h[active]
            # The rates, too: an array that is not used any more is freed, and a pointer does not keep it.
            for each in (z, last, older, slope):
                for j in range(k):
                    each[j, lane] = each[j, active]


@_inner
def _registers(lanes, parameters, program):
    """Return registers with parameters and constants in every lane, and the first one of the operations."""
    k, known = program.outputs.size, parameters.size + program.constants.size
    base = 2 + k + known
    registers = np.empty((base + program.operations.shape[0], lanes))
    for i in range(known):
        given = i < parameters.size
        registers[2 + k + i] = parameters[i] if given else program.constants[i - parameters.size]
    # Operations on parameters alone are done once. np.int64: a literal is another type, and compiled once more.
    run_lanes(
        pointer(registers), lanes, lanes, base, pointer(program.operations), pointer(program.fixed),
        np.int64(0), program.fixed.size,
    )  # fmt: skip
    return registers, base


@_inner
def _step(held, active, sizes, rates):
    """Take the states of all active lanes over one part of a step; what is held by arrays comes as pointers."""
    registers, z, slope, h = held
    operations, moving, by_state, ends, outputs, limits = rates
    k, lanes, base, n_moving = sizes
    for j in range(k):
        for lane in range(active):
            registers[(2 + j) * lanes + lane] = z[j * lanes + lane]
    run_lanes(registers, active, lanes, base, operations, moving, np.int64(0), n_moving)
    for j in range(k):
        for lane in range(active):
            slope[j * lanes + lane] = registers[outputs[j] * lanes + lane]
    for j in range(k):
        mine, rate = shifted(registers, (2 + j) * lanes), shifted(registers, outputs[j] * lanes)
        state, slopes, limit = shifted(z, j * lanes), shifted(slope, j * lanes), limits[j]
        # ∂f_j/∂z_j by a small step: the states of the shipped effects do not feed each other.
        for lane in range(active):
            mine[lane] = state[lane] + _small(state[lane], h[lane] * slopes[lane])
        begin = ends[j - 1] if j > 0 else np.int64(0)
        run_lanes(registers, active, lanes, base, operations, by_state, begin, ends[j])
        for lane in range(active):
            stiffness = (rate[lane] - slopes[lane]) / _small(state[lane], h[lane] * slopes[lane])
            mine[lane] = state[lane]
            if stiffness > 0.0:
                stiffness = 0.0
            x = h[lane] * stiffness
            value = state[lane] + h[lane] * slopes[lane] * (np.expm1(x) / x if x < -1e-9 else 1.0)
            state[lane] = min(max(value, -limit), limit)


@njit(cache=True, error_model="numpy", inline="always")
def _small(state, change):
    return 1e-6 * (abs(state) + abs(change) + 1e-300)


@_inner
def _pass_ends(states, ends, limits, turn):
    """Return whether the states repeat; where they do not, note the end of the pass, and what it shows of the limit."""
    z, last, older = ends
    # A state that forgets within a period needs two passes, not all of them.
    settled = turn > 0
    for j in range(z.size):
        largest = 0.0
        for i in range(states.shape[1]):
            size = abs(states[j, i])
            if size > largest or size != size:  # what is no number stays
                largest = size
        if abs(z[j] - last[j]) > 1e-7 * largest:
            settled = False
    if settled:
        return True
    # Of one that forgets slowly three ends of passes give the limit, as of a geometric series (Aitken 1926).
    for j in range(z.size):
        came, comes = last[j] - older[j], z[j] - last[j]
        older[j], last[j] = last[j], z[j]
        if turn % 3 == 2 and abs(comes) < abs(came):
            value = z[j] + comes * comes / (came - comes)
            z[j] = last[j] = min(max(value, -limits[j]), limits[j])
    return False
