"""The compiled stepper of a structure with joints: implicit midpoint, Newton on the joint angles only.

M·q̈ + C·q̇ + K·q + m(θ, θ̇, direction, z) = f, the joint angles θ being the first coordinates. A stuck joint's
coordinate rests; a slipping one keeps its direction through a step. Who sticks changes between steps only.
"""

from __future__ import annotations

import numpy as np
from numba import njit

from sindyjoint.mechanics.kernels import call_law, pointer, shifted

END, CHANGE, NOT_CONVERGED, PAST_LIMIT = range(4)

_compiled = njit(cache=True, nogil=True, error_model="numpy")


@_compiled
def _midpoint_states(address, theta, omega, direction, h, p, n, z, middle, out):
    """Find z_mid = z + h/2·ż(z_mid), each state by Newton with the others as they are; whether that worked."""
    state, result = pointer(middle), pointer(out)
    for _ in range(15):
        worst = 0.0
        for i in range(n):
            call_law(address, theta, omega, direction, state, p, result)
            here, rate = middle[i], out[1 + i]
            residual = here - z[i] - 0.5 * h * rate
            nudge = 1e-7 * (abs(here) + abs(0.5 * h * rate) + 1e-12)
            middle[i] = here + nudge
            call_law(address, theta, omega, direction, state, p, result)
            slope = 1.0 - 0.5 * h * (out[1 + i] - rate) / nudge
            middle[i] = here - residual / slope
            worst = max(worst, abs(residual) / (abs(here) + abs(h * rate) + 1e-300))
        if worst < 1e-10:
            return True
    return False


@_compiled
def _bisected_states(address, theta, omega, direction, h, p, n, z, answer, out):
    """Find y = z + h·ż(y) by bisection and leave it in `answer`; whether that worked.

    A slider's rate jumps to zero where it yields. The answer is then the yield itself, which bisection finds as the
    place of the jump (the return mapping of plasticity).
    """
    state, result = pointer(answer), pointer(out)
    for i in range(n):
        answer[i] = z[i]
    good = True
    for _ in range(3 if n > 1 else 1):
        for i in range(n):
            answer[i] = z[i]
            call_law(address, theta, omega, direction, state, p, result)
            low, high = z[i], z[i] + h * out[1 + i]
            for _ in range(60):
                answer[i] = 0.5 * (low + high)
                call_law(address, theta, omega, direction, state, p, result)
                if (z[i] + h * out[1 + i] - answer[i]) * (high - low) > 0.0:
                    low = answer[i]
                else:
                    high = answer[i]
            # The far side: a slider that yields is seen to yield in the next step, too.
            answer[i] = high
            good = good and np.isfinite(high)
    return good


@_compiled
def end_states(j, theta, omega, direction, h, laws, z, z_mid, z_end, out):
    """States at the end of a step: 2·z_mid − z, or the yield where a slider yielded on the way."""
    addresses, parameters, counts = laws
    address, p, n = addresses[j], shifted(pointer(parameters), j * parameters.shape[1]), counts[j]
    for i in range(z.shape[1]):
        z_end[j, i] = 2.0 * z_mid[j, i] - z[j, i]
    if n == 0 or omega == 0.0:
        return
    call_law(address, theta, omega, direction, shifted(pointer(z_end), j * z_end.shape[1]), p, pointer(out))
    for i in range(n):
        if out[1 + i] * (z_end[j, i] - z[j, i]) <= 0.0 and z_end[j, i] != z[j, i]:
            _bisected_states(address, theta, omega, direction, h, p, n, z[j], z_end[j], out)
            return


@_compiled
def joint_moment(j, theta, omega, direction, h, laws, z, z_mid, out):
    """Moment of joint j at the middle of a step, with the states there in z_mid; NaN when there is no answer."""
    addresses, parameters, counts = laws
    address, p = addresses[j], shifted(pointer(parameters), j * parameters.shape[1])
    n = counts[j]
    if n:
        good = _midpoint_states(address, theta, omega, direction, h, p, n, z[j], z_mid[j], out)
        if not good:
            good = _bisected_states(address, theta, omega, direction, 0.5 * h, p, n, z[j], z_mid[j], out)
        if not good:
            return np.nan
    call_law(address, theta, omega, direction, shifted(pointer(z_mid), j * z_mid.shape[1]), p, pointer(out))
    return out[0]


@_compiled
def _solve_small(matrix, right, n):
    """Solve matrix·x = right in place by elimination with row exchange; the answer is in `right`."""
    for c in range(n):
        pivot = c
        for r in range(c + 1, n):
            if abs(matrix[r, c]) > abs(matrix[pivot, c]):
                pivot = r
        if pivot != c:
            for k in range(n):
                matrix[c, k], matrix[pivot, k] = matrix[pivot, k], matrix[c, k]
            right[c], right[pivot] = right[pivot], right[c]
        for r in range(c + 1, n):
            factor = matrix[r, c] / matrix[c, c]
            for k in range(c, n):
                matrix[r, k] -= factor * matrix[c, k]
            right[r] -= factor * right[c]
    for c in range(n - 1, -1, -1):
        for k in range(c + 1, n):
            right[c] -= matrix[c, k] * right[k]
        right[c] /= matrix[c, c]


@_compiled
def midpoint_step(h, inverse, damping, stiffness, laws, direction, force, q, v, z, q1, v1, z1, work):
    """One step of the implicit midpoint rule; returns whether Newton converged.

    Parameters
    ----------
    inverse : ndarray, shape (n, n)
        Inverse of M + h/2·C + h²/4·K over the coordinates that move, zero elsewhere.
    direction : ndarray, shape (joints,)
        −1, 0 (stuck) or +1.
    force : ndarray, shape (n,)
        Mean over the step.
    work : ndarray, shape (joints, 2)
        Work done on each joint's elastic part (its moment at rest with its states at zero) and on the rest; added to.
    """
    joints, n = direction.size, q.size
    a = np.empty(n)
    right = np.empty(n)
    for i in range(n):
        total = force[i]
        for k in range(n):
            total -= damping[i, k] * v[k] + stiffness[i, k] * (q[k] + 0.5 * h * v[k])
        right[i] = total
    for i in range(n):
        total = 0.0
        for k in range(n):
            total += inverse[i, k] * right[k]
        a[i] = total
    out = np.empty(z.shape[1] + 1)
    moment, slope, trial = np.zeros(joints), np.zeros(joints), a[:joints].copy()
    jacobian, residual = np.empty((joints, joints)), np.empty(joints)
    z_mid, keep, rest = z.copy(), np.empty(z.shape[1]), np.zeros(z.shape[1])
    before, change, smallest = trial.copy(), np.zeros(joints), np.inf
    converged = False
    for iteration in range(200):
        for j in range(joints):
            theta = q[j] + 0.5 * h * v[j] + 0.25 * h * h * trial[j]
            omega = v[j] + 0.5 * h * trial[j]
            nudge = 1e-6 * (abs(trial[j]) + abs(v[j]) / h + 1e-9)
            if direction[j] == 0.0:
                theta, omega, nudge = q[j], 0.0, 0.0
            moment[j] = joint_moment(j, theta, omega, direction[j], h, laws, z, z_mid, out)
            if nudge > 0.0:
                theta += 0.25 * h * h * nudge
                keep[:] = z_mid[j]
                ahead = joint_moment(j, theta, omega + 0.5 * h * nudge, direction[j], h, laws, z, z_mid, out)
                slope[j] = (ahead - moment[j]) / nudge
                z_mid[j] = keep
        largest, done = 0.0, True
        for j in range(joints):
            total, size = trial[j] - a[j], abs(trial[j]) + abs(a[j])
            for k in range(joints):
                total += inverse[j, k] * moment[k]
                size += abs(inverse[j, k] * moment[k])
                jacobian[j, k] = inverse[j, k] * slope[k]
            jacobian[j, j] += 1.0
            residual[j] = total
            largest = max(largest, abs(total))
            done = done and abs(total) <= (1e-11 if iteration < 30 else 1e-8) * size
        if done:
            converged = True
            break
        if largest >= smallest or not np.isfinite(largest):
            # Two kinks of a yielding slider throw whole Newton steps to and fro: half of the last one.
            for j in range(joints):
                change[j] *= 0.5
                trial[j] = before[j] - change[j]
            continue
        smallest = largest
        _solve_small(jacobian, residual, joints)
        for j in range(joints):
            before[j], change[j] = trial[j], residual[j]
            trial[j] -= residual[j]
    for j in range(joints):
        if direction[j] != 0.0:
            for i in range(n):
                a[i] -= inverse[i, j] * moment[j]
    for i in range(n):
        v1[i] = v[i] + h * a[i]
        q1[i] = q[i] + 0.5 * h * (v[i] + v1[i])
    for j in range(joints):
        if direction[j] == 0.0:
            v1[j], q1[j] = 0.0, q[j]
        middle, travel = 0.5 * (q[j] + q1[j]), q1[j] - q[j]
        end_states(j, middle, travel / h, direction[j], h, laws, z, z_mid, z1, out)
        if travel != 0.0:
            p = shifted(pointer(laws[1]), j * laws[1].shape[1])
            call_law(laws[0][j], middle, 0.0, 0.0, pointer(rest), p, pointer(out))
            work[j, 0] += out[0] * travel
            work[j, 1] += (moment[j] - out[0]) * travel
    return converged


@_compiled
def holding_moments(mass, inverse_mass, damping, stiffness, laws, direction, force, q, v, z):
    """Moment that each joint transfers now: its law's where it slips, the one that holds it where it sticks.

    Parameters
    ----------
    inverse_mass : ndarray, shape (n, n)
        Inverse of the mass over the coordinates that move, zero elsewhere.

    Returns
    -------
    ndarray, shape (joints, 3)
        The moment, and the bounds of the friction interval at rest.
    """
    joints, n = direction.size, q.size
    right, a = np.empty(n), np.zeros(n)
    answer = np.zeros((joints, 3))
    out = np.empty(z.shape[1] + 1)
    result = pointer(out)
    for i in range(n):
        total = force[i]
        for k in range(n):
            total -= damping[i, k] * v[k] + stiffness[i, k] * q[k]
        right[i] = total
    for j in range(joints):
        row = shifted(pointer(z), j * z.shape[1])
        p = shifted(pointer(laws[1]), j * laws[1].shape[1])
        call_law(laws[0][j], q[j], 0.0, -1.0, row, p, result)
        answer[j, 1] = out[0]
        call_law(laws[0][j], q[j], 0.0, 1.0, row, p, result)
        answer[j, 2] = out[0]
        if direction[j] != 0.0:
            call_law(laws[0][j], q[j], v[j], direction[j], row, p, result)
            answer[j, 0] = out[0]
            right[j] -= out[0]
    for i in range(n):
        for k in range(n):
            a[i] += inverse_mass[i, k] * right[k]
    for j in range(joints):
        if direction[j] == 0.0:
            total = right[j]
            for k in range(n):
                total -= mass[j, k] * a[k]
            answer[j, 0] = total
    return answer


@_compiled
def frictionless(moments):
    """Whether a joint's friction interval has no width: it may reverse without coming to rest."""
    return moments[2] - moments[1] <= 1e-12 * (abs(moments[1]) + abs(moments[2]))


@_compiled
def margins(direction, moments, v1, rate_scale):
    """How far each joint is from changing: its rate along its direction, or its moment's room in the interval."""
    room = np.empty(direction.size)
    for j in range(direction.size):
        if direction[j] == 0.0:
            low, high = moments[j, 1], moments[j, 2]
            width = max(0.5 * (high - low), 1e-300)
            room[j] = min(high - moments[j, 0], moments[j, 0] - low) / width
        else:
            room[j] = np.inf if frictionless(moments[j]) else v1[j] * direction[j] / rate_scale
    return room


@_compiled
def march(
    first,
    last,
    h,
    inverse,
    inverse_mass,
    mass,
    damping,
    stiffness,
    laws,
    direction,
    limits,
    load,
    mean_force,
    force,
    q,
    v,
    z,
    moments,
    stuck,
    work,
):
    """Take whole steps from sample `first` until a joint changes, fails, or `last` is reached.

    `q`, `v`, `z` hold one row per sample; `load` says how the force acts on the coordinates.

    Returns
    -------
    sample reached, reason (a joint changes in the next step, for one), joint
    """
    joints = direction.size
    at = first
    while at < last:
        before = work.copy()
        good = midpoint_step(h, inverse, damping, stiffness, laws, direction, mean_force[at] * load,
                             q[at], v[at], z[at], q[at + 1], v[at + 1], z[at + 1], work)  # fmt: skip
        if not good:
            work[:] = before
            return at, NOT_CONVERGED, 0
        # The force just before the next sample's jump, should there be one, still belongs to this step.
        now = holding_moments(mass, inverse_mass, damping, stiffness, laws, direction, force[at + 1] * load,
                              q[at + 1], v[at + 1], z[at + 1])  # fmt: skip
        for j in range(joints):
            if direction[j] != 0.0:
                changed = v[at + 1, j] * direction[j] < 0.0 and not frictionless(now[j])
            else:
                changed = not (now[j, 1] <= now[j, 0] <= now[j, 2])
            if changed:
                work[:] = before
                return at, CHANGE, j
        for j in range(joints):
            moments[at + 1, j] = now[j, 0]
            stuck[at + 1, j] = direction[j] == 0.0
            if v[at + 1, j] * direction[j] < 0.0:
                direction[j] = -direction[j]
            if not limits[j, 0] <= q[at + 1, j] <= limits[j, 1]:
                return at + 1, PAST_LIMIT, j
        at += 1
    return at, END, 0
