"""The compiled motion of a structure with joints: whole steps, and the instants at which joints change.

A step in which a joint sticks, breaks away or turns is cut at that instant. A joint's room tells how far it is from
changing: where it sticks its moment's distance from the nearer bound of its friction interval, in half its width; where
it slips its rate along its direction. A state is q, v and z one after the other.
"""

import math

import numpy as np
from numba import njit

from sindyjoint.equation.internal_states import pointer, shifted
from sindyjoint.mechanics.kernels import copied
from sindyjoint.mechanics.transient_kernel import (
    OPTIONS,
    holding_moments,
    inner,
    prepare,
    prepare_holding,
    room_of_step,
    step,
)

END, NOT_CONVERGED, PAST_LIMIT, RESTLESS = range(4)
#: Changes of joints within one step beyond which the step is too large.
CHANGES = 200

# Width of a friction interval, relative to its bounds, below which there is no friction.
FRICTIONLESS = 1e-12


def room_for(coordinates, joints, states):
    """Numbers of working space of :func:`march`: directions, states, what a crossing and what a step want."""
    state = 2 * coordinates + joints * states
    return joints + 3 * state + 7 * joints + room_of_step(coordinates, joints, states)


@inner
def _value(drive, t):
    """Force at a time t ≥ 0."""
    pieces, _, count, length = drive
    piece = min(int(t / length), count - 1)
    u, c = min(t / length - piece, 1.0), shifted(pieces, 4 * piece)
    return c[0] + u * (c[1] + u * (c[2] + u * c[3]))


@inner
def _impulse(drive, t):
    """Integral of the force from zero to a time t ≥ 0."""
    pieces, integrals, count, length = drive
    piece = min(int(t / length), count - 1)
    u, c = min(t / length - piece, 1.0), shifted(pieces, 4 * piece)
    part = u * (c[0] + u * (c[1] / 2.0 + u * (c[2] / 3.0 + u * c[3] / 4.0)))
    after = max(t / length - count, 0.0) * (c[0] + c[1] + c[2] + c[3])
    return integrals[piece] + (part + after) * length


@inner
def _moments(problem, side, force, state, moments, room):
    """Fill moments and friction bounds of the joints in a state."""
    sizes, system, laws, _ = problem
    n = sizes[0]
    sticks = prepare_holding(sizes, system, side)
    q, v, z = state, shifted(state, n), shifted(state, 2 * n)
    holding_moments(sticks, sizes, system, laws, side, force, q, v, z, moments, room)


@inner
def _side_of(moments, j):
    """Direction that joint j takes by the moment that holds it and the bounds of its friction; 0 where it holds."""
    if moments[3 * j] > moments[3 * j + 2]:
        return 1.0
    return -1.0 if moments[3 * j] < moments[3 * j + 1] else 0.0


@inner
def _rooms(sizes, side, moments, v, scale, rooms):
    """Fill how far each joint is from changing."""
    for j in range(sizes[1]):
        held, low, high = moments[3 * j], moments[3 * j + 1], moments[3 * j + 2]
        if side[j] == 0.0:
            rooms[j] = min(high - held, held - low) / max(0.5 * (high - low), 1e-300)
        elif high - low <= FRICTIONLESS * (abs(low) + abs(high)):
            rooms[j] = math.inf
        else:
            rooms[j] = v[j] * side[j] / scale


@inner
def _trial(time, x, problem, side, scale, state, ahead, moments, rooms, done, room):
    """Fill the state a time x ahead, its moments, the room of the joints there and the work; whether that worked."""
    sizes, system, laws, drive = problem
    n = sizes[0]
    mean = (_impulse(drive, time + x) - _impulse(drive, time)) / x
    prepare(x, sizes, system, side)
    good = step(
        x, sizes, system, laws, side, mean, state, shifted(state, n), shifted(state, 2 * n),
        ahead, shifted(ahead, n), shifted(ahead, 2 * n), done, room,
    )  # fmt: skip
    # A jump of the force at the end belongs to what follows.
    _moments(problem, side, _value(drive, time + x * (1.0 - 1e-9)), ahead, moments, room)
    _rooms(sizes, side, moments, shifted(ahead, n), scale, rooms)
    return good


@inner
def _accept(sizes, side, state, ahead, total, done):
    """Take a trial step; only a joint without friction gets there against its direction."""
    n, joints, most = sizes
    copied(2 * n + joints * most, ahead, state)
    for j in range(joints):
        total[2 * j] += done[2 * j]
        total[2 * j + 1] += done[2 * j + 1]
        if state[n + j] * side[j] < 0.0:
            side[j] = -side[j]


@inner
def _let(j, problem, time, side, state, moments, room):
    """Let joint j, at standstill, hold or break away."""
    side[j] = 0.0
    _moments(problem, side, _value(problem[3], time), state, moments, room)
    side[j] = _side_of(moments, j)


@inner
def _least(joints, rooms, wrong):
    """Return the least room of those joints that are wrong, and whose it is."""
    least, whose = math.inf, -1
    for j in range(joints):
        if wrong[j] != 0.0 and rooms[j] < least:
            least, whose = rooms[j], j
    return least, whose


@inner
def _first_change(time, x, problem, side, scale, state, ahead, moments, rooms, wrong, ends, done, room):
    """Step to the first change of some joints within a time x; return how far that is, and whether that worked.

    `ends` are their least rooms now and there, of different signs: bracketed inverse quadratic interpolation
    (Chandrupatla, Adv. Eng. Softw. 28, 1997).
    """
    joints = problem[0][1]
    near, at_near, far, at_far = 0.0, ends[0], 1.0, ends[1]
    last, share, good = -1.0, ends[0] / (ends[0] - ends[1]), True
    for _ in range(100):
        last = near + share * (far - near)
        good = _trial(time, last * x, problem, side, scale, state, ahead, moments, rooms, done, room)
        value = _least(joints, rooms, wrong)[0]
        if not good:
            break
        if (value > 0.0) == (at_near > 0.0):
            third, at_third = near, at_near
        else:
            third, at_third, far, at_far = far, at_far, near, at_near
        near, at_near = last, value
        best = near if abs(at_near) < abs(at_far) else far
        # Of the instant of a change, as a share of the time that is searched: relative and absolute.
        least = (2.0 * 1e-10 * abs(best) + 2.0 * 1e-12) / abs(far - near)
        if least > 0.5 or min(abs(at_near), abs(at_far)) == 0.0:
            break
        width, rise = (near - far) / (third - far), (at_near - at_far) / (at_third - at_far)
        share = 0.5
        if rise**2 < width and (1.0 - rise) ** 2 < 1.0 - width:
            share = at_near / (at_far - at_near) * at_third / (at_far - at_third)
            share += (
                (third - near) / (far - near) * at_near / (at_third - at_near) * at_far / (at_third - at_far)
            )
        share = min(1.0 - least, max(least, share))
    best = near if abs(at_near) < abs(at_far) else far
    if good and best != last:
        good = _trial(time, best * x, problem, side, scale, state, ahead, moments, rooms, done, room)
    return best * x, good


@inner
def _cross(time, h, problem, side, scale, state, space, total, done, room):
    """Advance a state by h, from change to change; return the reason to stop and the number of changes."""
    sizes, drive = problem[0], problem[3]
    n, joints, most = sizes
    ahead, moments = space, shifted(space, 2 * n + joints * most)
    now, then = shifted(moments, 3 * joints), shifted(moments, 4 * joints)
    wrong, held = shifted(moments, 5 * joints), shifted(moments, 6 * joints)
    end, changes = time + h, 0
    for j in range(joints):
        held[j] = 0.0
    for _ in range(CHANGES):
        x = end - time
        if x <= 1e-9 * h:
            return END, changes
        if not _trial(time, x, problem, side, scale, state, ahead, moments, then, done, room):
            return NOT_CONVERGED, changes
        for j in range(joints):
            wrong[j] = 1.0 if then[j] < 0.0 and held[j] == 0.0 else 0.0
        later = _least(joints, then, wrong)
        if later[1] < 0:
            _accept(sizes, side, state, ahead, total, done)
            return END, changes
        _moments(problem, side, _value(drive, time), state, moments, room)
        _rooms(sizes, side, moments, shifted(state, n), scale, now)
        first = _least(joints, now, wrong)
        if first[0] <= 0.0:
            j = 0
            while wrong[j] == 0.0 or now[j] > 0.0:
                j += 1
            before = side[j]
            _let(j, problem, time, side, state, moments, room)
            changes += 1
            if before != 0.0 or side[j] == before:
                # It broke away and would turn back at once: its moment touches the bound. It sticks in this step.
                side[j], held[j] = 0.0, 1.0
            continue
        away, good = _first_change(
            time,
            x,
            problem,
            side,
            scale,
            state,
            ahead,
            moments,
            then,
            wrong,
            (first[0], later[0]),
            done,
            room,
        )
        if not good:
            return NOT_CONVERGED, changes
        j = _least(joints, then, wrong)[1]
        if side[j] != 0.0:
            ahead[n + j] = 0.0
        _accept(sizes, side, state, ahead, total, done)
        time += away
        changes += 1
        if side[j] != 0.0:
            _let(j, problem, time, side, state, moments, room)
            continue
        _moments(problem, side, _value(drive, time), state, moments, room)
        # On the bound itself rounding decides; the nearer bound is the one it breaks.
        side[j] = 1.0 if moments[3 * j] > 0.5 * (moments[3 * j + 1] + moments[3 * j + 2]) else -1.0
    return RESTLESS, changes


@inner
def _changes(sizes, side, moments, v):
    """Whether a joint sticks, breaks away or turns within a step, by its moments and rates at the end."""
    for j in range(sizes[1]):
        held, low, high = moments[3 * j], moments[3 * j + 1], moments[3 * j + 2]
        if side[j] == 0.0 and not low <= held <= high:
            return True
        # A friction interval without width: the joint may reverse without sticking.
        if v[j] * side[j] < 0.0 and high - low > FRICTIONLESS * (abs(low) + abs(high)):
            return True
    return False


@inner
def _begin(problem, force, state, moments, side, room):
    """Give every joint its direction in the first state, and fill its moments there."""
    n, joints, _ = problem[0]
    for j in range(joints):
        side[j] = np.sign(state[n + j])
    _moments(problem, side, force, state, moments, room)
    for j in range(joints):
        if side[j] == 0.0:
            side[j] = _side_of(moments, j)
            moments[3 * j] = min(max(moments[3 * j], moments[3 * j + 1]), moments[3 * j + 2])


@njit(**OPTIONS)
def march(h, matrices, load, laws, limits, drive, forces, motion, moments, stuck, work, room):
    """Fill a motion from its first state on.

    Parameters
    ----------
    h : float
        Step, s.
    matrices : ndarray, shape (5, n, n)
        Space for the inverses of M + h/2·C + h²/4·K and of M over the coordinates that move; M, C, K.
    load : ndarray, shape (n,)
        How the force acts on the coordinates.
    laws : (addresses, parameters, counts)
        Of the joints; parameters have shape (joints, width), counts are numbers of internal states.
    limits : ndarray, shape (joints, 2)
    drive : (pieces, integrals, length)
        The force: coefficients of 1, u, u², u³ in each piece, shape (m, 4), its integral up to each, and their length.
    forces : (mean, now)
        Mean over the step that begins at each sample, and value at the sample just before a jump.
    motion : (q, v, z)
        One row per sample; z has shape (samples, joints, states).
    moments : ndarray, shape (samples, joints, 3)
        What each joint transfers, and the bounds of its friction interval at standstill.
    stuck : ndarray of bool, shape (samples, joints)
    work : ndarray, shape (2, joints, 2)
        The work of all steps on each joint's elastic part and on the rest, and that of the last step.
    room : ndarray
        Space for a step, for a state more, for directions and for crossings.

    Returns
    -------
    sample reached, reason to stop there, joint past its limit, number of changes
    """
    n, joints, most = load.size, limits.shape[0], motion[2].shape[2]
    sizes, square, base = (n, joints, most), n * n, pointer(matrices)
    system = (base, shifted(base, square), shifted(base, 2 * square), shifted(base, 3 * square),
              shifted(base, 4 * square), pointer(load))  # fmt: skip
    table = (pointer(laws[0]), pointer(laws[1]), laws[1].shape[1], pointer(laws[2]))
    problem = sizes, system, table, (pointer(drive[0]), pointer(drive[1]), drive[0].shape[0], drive[2])
    q, v, z = motion
    mean_force, force = pointer(forces[0]), pointer(forces[1])
    bound, total, answer = pointer(limits), pointer(work), pointer(moments)
    done, side = shifted(total, 2 * joints), pointer(room)
    state, ahead = shifted(side, joints), shifted(side, joints + 2 * n + joints * most)
    space = shifted(ahead, 2 * n + joints * most)
    own = shifted(space, 2 * n + joints * most + 7 * joints)
    rows_q, rows_v, rows_z, inner_states = pointer(q), pointer(v), pointer(z), joints * most
    copied(n, rows_q, state)
    copied(n, rows_v, shifted(state, n))
    copied(inner_states, rows_z, shifted(state, 2 * n))
    _begin(problem, force[0], state, answer, side, own)
    changes, at, last, fastest, fresh = 0, 0, q.shape[0] - 1, 1e-12, True
    sticks = False
    for j in range(joints):
        fastest = max(fastest, abs(state[n + j]))
        stuck[0, j] = side[j] == 0.0
    while at < last:
        if fresh:
            prepare(h, sizes, system, side)
            sticks = prepare_holding(sizes, system, side)
            fresh = False
        now = shifted(answer, 3 * joints * (at + 1))
        good = step(
            h, sizes, system, table, side, mean_force[at], state, shifted(state, n), shifted(state, 2 * n),
            ahead, shifted(ahead, n), shifted(ahead, 2 * n), done, own,
        )  # fmt: skip
        if not good:
            return at, NOT_CONVERGED, 0, changes
        # The force just before the next sample's jump, should there be one, still belongs to this step.
        holding_moments(sticks, sizes, system, table, side, force[at + 1], ahead, shifted(ahead, n),
                        shifted(ahead, 2 * n), now, own)  # fmt: skip
        if _changes(sizes, side, now, shifted(ahead, n)):
            reason, more = _cross(at * h, h, problem, side, fastest, state, space, total, done, own)
            if reason != END:
                return at, reason, 0, changes
            changes, fresh = changes + more, True
            _moments(problem, side, force[at + 1], state, now, own)
        else:
            _accept(sizes, side, state, ahead, total, done)
        at += 1
        copied(n, state, shifted(rows_q, at * n))
        copied(n, shifted(state, n), shifted(rows_v, at * n))
        copied(inner_states, shifted(state, 2 * n), shifted(rows_z, at * inner_states))
        for j in range(joints):
            stuck[at, j] = side[j] == 0.0
            fastest = max(fastest, abs(state[n + j]))
            if not bound[2 * j] <= state[j] <= bound[2 * j + 1]:
                return at, PAST_LIMIT, j, changes
    return at, END, 0, changes
