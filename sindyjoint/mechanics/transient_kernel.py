"""The compiled stepper of a structure with joints: implicit midpoint, Newton on the joint angles only.

M·q̈ + C·q̇ + K·q + m(θ, θ̇, direction, z) = f, the joint angles θ being the first coordinates. A stuck joint's
coordinate stands still; a slipping one keeps its direction through a step. Who sticks changes between steps only.
"""

import math

import numpy as np
from numba import njit

from sindyjoint.equation.internal_states import shifted
from sindyjoint.mechanics.kernels import call_law, copied

# All of it works on pointers and is called from compiled code only: bounds, strides and wrappers of arrays would take
# longer to compile than the arithmetic.
OPTIONS = {"cache": True, "nogil": True, "error_model": "numpy", "no_cfunc_wrapper": True}
inner = njit(**OPTIONS, no_cpython_wrapper=True)


def room_of_step(coordinates, joints, states):
    """Numbers of working space that a step wants."""
    return 2 * coordinates + joints * (joints + 8 + states) + 3 * states + 1


@inner
def _midpoint_states(address, theta, omega, direction, h, p, n, z, middle, out):
    """Find z_mid = z + h/2·ż(z_mid), each state by Newton with the others as they are; whether that worked."""
    for _ in range(15):
        worst = 0.0
        for i in range(n):
            call_law(address, theta, omega, direction, middle, p, out)
            here, rate = middle[i], out[1 + i]
            residual = here - z[i] - 0.5 * h * rate
            nudge = 1e-7 * (abs(here) + abs(0.5 * h * rate) + 1e-12)
            middle[i] = here + nudge
            call_law(address, theta, omega, direction, middle, p, out)
            slope = 1.0 - 0.5 * h * (out[1 + i] - rate) / nudge
            middle[i] = here - residual / slope
            worst = max(worst, abs(residual) / (abs(here) + abs(h * rate) + 1e-300))
        if worst < 1e-10:
            return True
    return False


@inner
def _bisected_states(address, theta, omega, direction, h, p, n, z, answer, out):
    """Find y = z + h·ż(y) by bisection and leave it in `answer`; whether that worked.

    A slider's rate jumps to zero where it yields. The answer is then the yield itself, which bisection finds as the
    position of the jump (the return mapping of plasticity).
    """
    copied(n, z, answer)
    good = True
    for _ in range(3 if n > 1 else 1):
        for i in range(n):
            answer[i] = z[i]
            call_law(address, theta, omega, direction, answer, p, out)
            low, high = z[i], z[i] + h * out[1 + i]
            for _ in range(60):
                answer[i] = 0.5 * (low + high)
                call_law(address, theta, omega, direction, answer, p, out)
                if (z[i] + h * out[1 + i] - answer[i]) * (high - low) > 0.0:
                    low = answer[i]
                else:
                    high = answer[i]
            # The far side: a slider that yields is seen to yield in the next step, too.
            answer[i] = high
            good = good and math.isfinite(high)
    return good


@inner
def _end_states(law, theta, omega, direction, h, z, z_mid, z_end, out):
    """Fill the states at the end of a step: 2·z_mid − z, or the yield where a slider yielded on the way."""
    address, p, n = law
    for i in range(n):
        z_end[i] = 2.0 * z_mid[i] - z[i]
    if n == 0 or omega == 0.0:
        return
    call_law(address, theta, omega, direction, z_end, p, out)
    for i in range(n):
        if out[1 + i] * (z_end[i] - z[i]) <= 0.0 and z_end[i] != z[i]:
            _bisected_states(address, theta, omega, direction, h, p, n, z, z_end, out)
            return


@inner
def _joint_moment(law, theta, omega, direction, h, z, z_mid, out):
    """Moment of a joint at the middle of a step, with the states there in z_mid; NaN when there is no answer."""
    address, p, n = law
    if (
        n
        and not _midpoint_states(address, theta, omega, direction, h, p, n, z, z_mid, out)
        and not _bisected_states(address, theta, omega, direction, 0.5 * h, p, n, z, z_mid, out)
    ):
        return np.nan
    call_law(address, theta, omega, direction, z_mid, p, out)
    return out[0]


@inner
def _solve_small(matrix, right, n):
    """Solve matrix·x = right in place by elimination; the answer is in `right`.

    Without exchange of rows: the matrix is the identity plus a positive definite one times the joints' slopes.
    """
    for c in range(n):
        for r in range(c + 1, n):
            factor = matrix[r * n + c] / matrix[c * n + c]
            for k in range(c, n):
                matrix[r * n + k] -= factor * matrix[c * n + k]
            right[r] -= factor * right[c]
    for c in range(n - 1, -1, -1):
        for k in range(c + 1, n):
            right[c] -= matrix[c * n + k] * right[k]
        right[c] /= matrix[c * n + c]


@inner
def _invert_moving(matrix, n, joints, direction):
    """Replace a positive definite matrix by its inverse over what moves, zero elsewhere; the joints come first.

    By Gauss and Jordan, without exchange of rows.
    """
    for k in range(joints):
        if direction[k] == 0.0:
            for i in range(n):
                matrix[i * n + k] = matrix[k * n + i] = 0.0
    for k in range(n):
        pivot = matrix[k * n + k]
        if k < joints and direction[k] == 0.0:
            continue
        matrix[k * n + k] = 1.0
        for i in range(n):
            matrix[k * n + i] /= pivot
        for i in range(n):
            factor = matrix[i * n + k]
            if i != k and factor != 0.0:
                matrix[i * n + k] = 0.0
                for c in range(n):
                    matrix[i * n + c] -= factor * matrix[k * n + c]


@inner
def _pushed(n, system, force, h, q, v, right):
    """Fill b·f − C·v − K·(q + h/2·v)."""
    _, _, _, damping, stiffness, load = system
    for i in range(n):
        total = force * load[i]
        for k in range(n):
            total -= damping[i * n + k] * v[k] + stiffness[i * n + k] * (q[k] + 0.5 * h * v[k])
        right[i] = total


@inner
def _applied(n, matrix, vector, answer):
    """Fill the product of a matrix and a vector."""
    for i in range(n):
        total = 0.0
        for k in range(n):
            total += matrix[i * n + k] * vector[k]
        answer[i] = total


@inner
def _law_of(j, laws):
    """Address, parameters and number of states of joint j."""
    addresses, parameters, width, counts = laws
    return addresses[j], shifted(parameters, j * width), counts[j]


@inner
def prepare(h, sizes, system, direction):
    """Fill the inverse of M + h/2·C + h²/4·K over the coordinates that move."""
    n, joints, _ = sizes
    inverse, _, mass, damping, stiffness, _ = system
    for i in range(n * n):
        inverse[i] = mass[i] + 0.5 * h * damping[i] + 0.25 * h * h * stiffness[i]
    _invert_moving(inverse, n, joints, direction)


@inner
def prepare_holding(sizes, system, direction):
    """Fill the inverse of M over the coordinates that move; whether a joint sticks, and it is of use."""
    n, joints, _ = sizes
    _, inverse, mass, _, _, _ = system
    sticks = False
    for j in range(joints):
        sticks = sticks or direction[j] == 0.0
    if sticks:
        copied(n * n, mass, inverse)
        _invert_moving(inverse, n, joints, direction)
    return sticks


@inner
def step(h, sizes, system, laws, direction, force, q, v, z, q1, v1, z1, work, room):
    """One step of the implicit midpoint rule under the step's mean `force`; returns whether Newton converged.

    The inverse is prepared for it. `work` is filled with the work done on each joint's elastic part (its moment at
    standstill with its states at zero) and on the remainder.
    """
    n, joints, most = sizes
    inverse = system[0]
    right, a = room, shifted(room, n)
    moment, slope, trial = shifted(a, n), shifted(a, n + joints), shifted(a, n + 2 * joints)
    residual, before, change = shifted(trial, joints), shifted(trial, 2 * joints), shifted(trial, 3 * joints)
    jacobian, z_mid = shifted(change, joints), shifted(change, joints + joints * joints)
    keep = shifted(z_mid, joints * most)
    zeros, out = shifted(keep, most), shifted(keep, 2 * most)
    _pushed(n, system, force, h, q, v, right)
    _applied(n, inverse, right, a)
    for j in range(joints):
        trial[j] = before[j] = a[j]
        slope[j] = change[j] = 0.0
    copied(joints * most, z, z_mid)
    smallest, converged = np.inf, False
    for iteration in range(200):
        for j in range(joints):
            law, z_j, mid_j = _law_of(j, laws), shifted(z, j * most), shifted(z_mid, j * most)
            theta = q[j] + 0.5 * h * v[j] + 0.25 * h * h * trial[j]
            omega = v[j] + 0.5 * h * trial[j]
            nudge = 1e-6 * (abs(trial[j]) + abs(v[j]) / h + 1e-9)
            if direction[j] == 0.0:
                theta, omega, nudge = q[j], 0.0, 0.0
            moment[j] = _joint_moment(law, theta, omega, direction[j], h, z_j, mid_j, out)
            if nudge > 0.0:
                copied(most, mid_j, keep)
                theta, omega = theta + 0.25 * h * h * nudge, omega + 0.5 * h * nudge
                ahead = _joint_moment(law, theta, omega, direction[j], h, z_j, mid_j, out)
                slope[j] = (ahead - moment[j]) / nudge
                copied(most, keep, mid_j)
        largest, done = 0.0, True
        for j in range(joints):
            total, size = trial[j] - a[j], abs(trial[j]) + abs(a[j])
            for k in range(joints):
                total += inverse[j * n + k] * moment[k]
                size += abs(inverse[j * n + k] * moment[k])
                jacobian[j * joints + k] = inverse[j * n + k] * slope[k]
            jacobian[j * joints + j] += 1.0
            residual[j] = total
            largest = max(largest, abs(total))
            done = done and abs(total) <= (1e-11 if iteration < 30 else 1e-8) * size
        if done:
            converged = True
            break
        if largest >= smallest or not math.isfinite(largest):
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
                a[i] -= inverse[i * n + j] * moment[j]
    for i in range(n):
        v1[i] = v[i] + h * a[i]
        q1[i] = q[i] + 0.5 * h * (v[i] + v1[i])
    for j in range(joints):
        if direction[j] == 0.0:
            v1[j], q1[j] = 0.0, q[j]
        law, mid_j = _law_of(j, laws), shifted(z_mid, j * most)
        middle, travel = 0.5 * (q[j] + q1[j]), q1[j] - q[j]
        _end_states(
            law, middle, travel / h, direction[j], h, shifted(z, j * most), mid_j, shifted(z1, j * most), out
        )
        for i in range(most):
            zeros[i] = 0.0
        call_law(law[0], middle, 0.0, 0.0, zeros, law[1], out)
        work[2 * j] = out[0] * travel
        work[2 * j + 1] = (moment[j] - out[0]) * travel
    return converged


@inner
def holding_moments(sticks, sizes, system, laws, direction, force, q, v, z, moments, room):
    """Fill what each joint transfers now, and the bounds of its friction interval at standstill.

    A slipping joint transfers its law's moment, a sticking one what holds it: where one `sticks` the inverse of M is
    prepared.
    """
    n, joints, most = sizes
    _, inverse_mass, mass, _, _, _ = system
    right, a, out = room, shifted(room, n), shifted(room, 2 * n)
    if sticks:
        _pushed(n, system, force, 0.0, q, v, right)
    for j in range(joints):
        row, answer = shifted(z, j * most), shifted(moments, 3 * j)
        address, p, _ = _law_of(j, laws)
        call_law(address, q[j], 0.0, -1.0, row, p, out)
        answer[1] = out[0]
        call_law(address, q[j], 0.0, 1.0, row, p, out)
        answer[2] = out[0]
        if direction[j] != 0.0:
            call_law(address, q[j], v[j], direction[j], row, p, out)
            answer[0] = out[0]
            if sticks:
                right[j] -= out[0]
    if not sticks:
        return
    _applied(n, inverse_mass, right, a)
    for j in range(joints):
        if direction[j] == 0.0:
            total = right[j]
            for k in range(n):
                total -= mass[j * n + k] * a[k]
            moments[3 * j] = total
