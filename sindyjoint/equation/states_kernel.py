"""The compiled stepping of internal states; see :mod:`sindyjoint.equation.internal_states`."""

from typing import Any

import numpy as np
from numba import carray, njit, types

from sindyjoint.equation.internal_states import StateProgram
from sindyjoint.equation.operations import pointer, run_lanes, shifted

# Only the entries are called from Python: wrappers of the others would be compiled for nobody.
_options = {"cache": True, "error_model": "numpy", "nogil": True, "no_cfunc_wrapper": True}
_inner = njit(**_options, no_cpython_wrapper=True)


def _states_of_runs(
    sizes, ends, passes, substeps, angle, rate, steps, first, parameters, limits, constants, operations, outputs,
    fixed, moving, by_state, state_ends, states, room, integer_room,
):  # fmt: skip
    samples, runs, n_parameters, n_constants, n_operations, k = (
        sizes[0], sizes[1], sizes[2], sizes[3], sizes[4], sizes[5],
    )  # fmt: skip
    program = StateProgram(
        carray(constants, (n_constants,)), carray(operations, (n_operations, 3)), carray(outputs, (k,)),
        carray(fixed, (sizes[6],)), carray(moving, (sizes[7],)), carray(by_state, (sizes[8],)),
        carray(state_ends, (k,)),
    )  # fmt: skip
    motion = carray(angle, (samples,)), carray(rate, (samples,)), carray(ends, (runs,))
    alike, begun = carray(integer_room, (runs,)), carray(shifted(integer_room, runs), (runs,))
    rooms = room, shifted(integer_room, 2 * runs)
    given, all_states = carray(parameters, (n_parameters,)), carray(states, (k, samples))
    for run in range(runs):
        begun[run] = 0
    # Number by number, here and below: masks and the assignment of slices take seconds to compile.
    for run in range(runs):
        if begun[run] == 0:
            count = 0
            for other in range(run, runs):
                if substeps[other] == substeps[run]:
                    alike[count], begun[other] = other, 1
                    count += 1
            timing = steps, passes, substeps, first
            _side_by_side(
                all_states, alike[:count], motion, timing, given, carray(limits, (k,)), program, rooms
            )


@_inner
def _side_by_side(states, runs, motion, timing, parameters, limits, program, rooms):
    """Fill in the states of some runs of as many substeps."""
    angle, rate, ends = motion
    steps, passes, substeps, first = timing
    k, lanes, parts = program.outputs.size, runs.size, substeps[runs[0]]
    room, integer_room = rooms
    # State now, at the end of the last pass and of that before it, and its rate, for each state and lane; the steps.
    size = k * lanes
    z, last = carray(room, (k, lanes)), carray(shifted(room, size), (k, lanes))
    older, slope = carray(shifted(room, 2 * size), (k, lanes)), carray(shifted(room, 3 * size), (k, lanes))
    h = carray(shifted(room, 4 * size), (lanes,))
    registers, base = _registers(lanes, parameters, program, shifted(room, 4 * size + lanes))
    # First sample, that before the step, that after it, the one past the last, pass and passes of each lane.
    whole = carray(integer_room, (6, lanes))
    begin, before, now, end, turn, most = whole[0], whole[1], whole[2], whole[3], whole[4], whole[5]
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
            for each in (z, last, older):
                for j in range(k):
                    each[j, lane] = each[j, active]


@_inner
def _registers(lanes, parameters, program, room):
    """Return registers with parameters and constants in every lane, and the first one of the operations."""
    k, known = program.outputs.size, parameters.size + program.constants.size
    base = 2 + k + known
    registers = carray(room, (base + program.operations.shape[0], lanes))
    for i in range(known):
        given = i < parameters.size
        value = parameters[i] if given else program.constants[i - parameters.size]
        for lane in range(lanes):
            registers[2 + k + i, lane] = value
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


def _stop_operators(sizes, angle, thresholds, states, z):
    samples, count, turns = sizes[0], sizes[1], sizes[2]
    for j in range(count):
        z[j] = 0.0
    for turn in range(turns):
        for i in range(samples):
            before = i - 1 if i > 0 else samples - 1
            change = angle[i] - angle[before] if i > 0 or turn > 0 else 0.0
            for j in range(count):
                z[j] = min(max(z[j] + change, -thresholds[j]), thresholds[j])
                states[i * count + j] = z[j]


def _relaxations(sizes, angle, step, times, states, z):
    samples, count, turns = sizes[0], sizes[1], sizes[2]
    for j in range(count):
        z[j] = 0.0
    for turn in range(turns):
        for i in range(samples):
            before = i - 1 if i > 0 else samples - 1
            change = angle[i] - angle[before] if i > 0 or turn > 0 else 0.0
            for j in range(count):
                kept = np.exp(-step / times[j])
                z[j] = kept * z[j] + change * (1 - kept) * times[j] / step
                states[i * count + j] = z[j]


_whole, _number = types.CPointer(types.int64), types.CPointer(types.float64)
ENTRIES: dict[str, Any] = {
    "states of runs": (
        _states_of_runs,
        types.void(*[_whole] * 4, *[_number] * 7, *[_whole] * 6, _number, _number, _whole),
        {},
    ),
    "stop operators": (_stop_operators, types.void(_whole, *[_number] * 4), {}),
    "relaxations": (_relaxations, types.void(_whole, _number, types.float64, *[_number] * 3), {}),
}
