"""The compiled integrator of one joint: I·θ̈ + M_T(θ, θ̇, direction, z) = M(t) with exact sticking.

While the joint slips, the direction is held through a step, so the right-hand side is smooth there, and the
explicit pair of Dormand and Prince (1980) of order 5(4) with step control (Hairer, Nørsett, Wanner, Solving
Ordinary Differential Equations I, 1993, II.4 and II.5) integrates it. Between steps the motion is the quintic
through angle, rate and acceleration at both ends. Where the rate reaches zero the step is cut at that instant,
the rate is set to zero, and the joint sticks if M lies in [M_T(θ, 0, −1, z), M_T(θ, 0, +1, z)]. It stays there,
unmoved, until the instant M leaves that interval.
"""

import math

import numpy as np
from numba import njit

from sindyjoint.equation.internal_states import pointer, shifted
from sindyjoint.mechanics.kernels import call_law, copied

DONE, LIMIT, NOT_FINITE, STEP_TOO_SMALL, TOO_MANY_STEPS, ACTIVE_FRICTION = range(6)

# Only `integrate` is called from Python: wrappers of the others would cost a tenth of the compilation.
_options = {
    "cache": True,
    "nogil": True,
    "error_model": "numpy",
    "fastmath": {"contract"},
    "no_cfunc_wrapper": True,
}
_inner = njit(**_options, no_cpython_wrapper=True)
_inlined = njit(**_options, no_cpython_wrapper=True, forceinline=True)

# Butcher table of Dormand and Prince (1980) for the internal states; angle and rate have it written out below.
TABLE = np.array(
    [
        [0.0] * 6,
        [1 / 5, 0, 0, 0, 0, 0],
        [3 / 40, 9 / 40, 0, 0, 0, 0],
        [44 / 45, -56 / 15, 32 / 9, 0, 0, 0],
        [19372 / 6561, -25360 / 2187, 64448 / 6561, -212 / 729, 0, 0],
        [9017 / 3168, -355 / 33, 46732 / 5247, 49 / 176, -5103 / 18656, 0],
        [35 / 384, 0, 500 / 1113, 125 / 192, -2187 / 6784, 11 / 84],
    ]
)
ERROR = np.array([71 / 57600, 0, -71 / 16695, 71 / 1920, -17253 / 339200, 22 / 525, -1 / 40])


@_inlined
def excitation_at(t, drive):
    """Value of the piecewise cubic excitation (pieces, count, step, periodic, smooth, scale, ramp) at time t."""
    pieces, count, step, periodic, _, scale, ramp = drive
    u = t / step
    if periodic:
        u -= np.floor(u / count) * count
    i = min(int(u), count - 1)
    u = min(u - i, 1.0)
    i *= 4
    value = scale * (pieces[i] + u * (pieces[i + 1] + u * (pieces[i + 2] + u * pieces[i + 3])))
    if t < ramp:
        r = t / ramp
        value *= r * r * (3.0 - 2.0 * r)
    return value


@_inner
def _hermite(u, h, z0, r0, z1, r1):
    """Cubic through value and rate at both ends of a step, at fraction u."""
    d = z1 - z0
    return z0 + u * (h * r0 + u * (3.0 * d - h * (2.0 * r0 + r1) + u * (h * (r0 + r1) - 2.0 * d)))


@_inner
def _law_at_stage(stage, h, x, v, direction, law, states):
    """Moment of any law at a stage of the step; fills the stage's rates of the internal states."""
    address, p, _, n = law
    z0, trial, kz, out, _ = states
    for j in range(n):
        slope = 0.0
        for i in range(stage):
            slope += TABLE[stage, i] * kz[i * n + j]
        trial[j] = z0[j] + h * slope
    call_law(address, x, v, direction, trial, p, out)
    for j in range(n):
        kz[stage * n + j] = out[1 + j]
    return out[0]


@_inlined
def _acceleration(stage, force, h, x, v, direction, law, states):
    """Acceleration at a stage of the step under the moment `force`."""
    address, p, per_inertia, _ = law
    if address == 0:
        # The paper's law in line: a third of the time of a step would go into calls.
        elastic = x * (p[0] + x * (p[1] + x * p[2]))
        return (force - p[4] * direction - elastic - p[3] * v) * per_inertia
    return (force - _law_at_stage(stage, h, x, v, direction, law, states)) * per_inertia


@_inner
def _slip_step(t, h, x, v, a, direction, law, drive, states, size):
    """One step of Dormand and Prince in `direction` from angle x, rate v and acceleration a.

    Returns angle, rate and acceleration at the end, and the largest error of a variable, each relative to the
    variable's largest value so far: a rate that passes zero needs no relative accuracy there.
    """
    _, z1, kz, force, _ = states
    n = law[3]
    # Drives with jumps: the step ends at a jump, and its last stages want the value before it.
    last = 1.0 if drive[4] else 1.0 - 1e-12
    for i in range(5):
        # Behind the law's answer, which needs 1 + n places.
        force[1 + n + i] = excitation_at(t + h * (0.2, 0.3, 0.8, 8 / 9, last)[i], drive)
    f2, f3, f4, f5, f6 = force[1 + n], force[2 + n], force[3 + n], force[4 + n], force[5 + n]
    v2 = v + h * 0.2 * a
    a2 = _acceleration(np.int64(1), f2, h, x + h * 0.2 * v, v2, direction, law, states)
    v3 = v + h * (3 / 40 * a + 9 / 40 * a2)
    a3 = _acceleration(np.int64(2), f3, h, x + h * (3 / 40 * v + 9 / 40 * v2), v3, direction, law, states)
    v4 = v + h * (44 / 45 * a - 56 / 15 * a2 + 32 / 9 * a3)
    x4 = x + h * (44 / 45 * v - 56 / 15 * v2 + 32 / 9 * v3)
    a4 = _acceleration(np.int64(3), f4, h, x4, v4, direction, law, states)
    v5 = v + h * (19372 / 6561 * a - 25360 / 2187 * a2 + 64448 / 6561 * a3 - 212 / 729 * a4)
    x5 = x + h * (19372 / 6561 * v - 25360 / 2187 * v2 + 64448 / 6561 * v3 - 212 / 729 * v4)
    a5 = _acceleration(np.int64(4), f5, h, x5, v5, direction, law, states)
    v6 = v + h * (9017 / 3168 * a - 355 / 33 * a2 + 46732 / 5247 * a3 + 49 / 176 * a4 - 5103 / 18656 * a5)
    x6 = x + h * (9017 / 3168 * v - 355 / 33 * v2 + 46732 / 5247 * v3 + 49 / 176 * v4 - 5103 / 18656 * v5)
    a6 = _acceleration(np.int64(5), f6, h, x6, v6, direction, law, states)
    v7 = v + h * (35 / 384 * a + 500 / 1113 * a3 + 125 / 192 * a4 - 2187 / 6784 * a5 + 11 / 84 * a6)
    x7 = x + h * (35 / 384 * v + 500 / 1113 * v3 + 125 / 192 * v4 - 2187 / 6784 * v5 + 11 / 84 * v6)
    a7 = _acceleration(np.int64(6), f6, h, x7, v7, direction, law, states)
    c1, c3, c4, c5, c6, c7 = 71 / 57600, -71 / 16695, 71 / 1920, -17253 / 339200, 22 / 525, -1 / 40
    error_x = h * (c1 * v + c3 * v3 + c4 * v4 + c5 * v5 + c6 * v6 + c7 * v7)
    error_v = h * (c1 * a + c3 * a3 + c4 * a4 + c5 * a5 + c6 * a6 + c7 * a7)
    worst = max(abs(error_x) / max(size[0], abs(x7)), abs(error_v) / max(size[1], abs(v7)))
    for j in range(n):
        error = 0.0
        for i in range(7):
            error += ERROR[i] * kz[i * n + j]
        # What a state gains within a piece of the drive is its scale before it has a size: one that another state
        # moves starts with a high power of time, which no short step follows to a share of itself.
        gained = drive[2] * abs(kz[6 * n + j])
        worst = max(worst, abs(h * error) / max(max(size[2 + j], abs(z1[j])), gained))
    return x7, v7, a7, worst


@_inner
def _reversal(h, direction, x0, v0, a0, x1, v1, a1):
    """Return where in the step the rate first reaches zero against the direction, and the motion in it.

    The position is a fraction of the step, 2 when there is none; the motion c1 … c5 of the quintic
    x0 + c1·u + … + c5·u⁵ through angle, rate and acceleration at both ends.
    """
    c1, c2 = h * v0, 0.5 * h * h * a0
    d = x1 - x0 - c1 - c2
    e = h * v1 - c1 - 2.0 * c2
    f = h * h * a1 - 2.0 * c2
    c3, c4, c5 = 10.0 * d - 4.0 * e + 0.5 * f, 7.0 * e - 15.0 * d - f, 6.0 * d - 3.0 * e + 0.5 * f
    low, high = 0.0, 2.0
    if v1 * direction < 0.0:
        high = 1.0
    elif a0 * direction < 0.0 < a1 * direction:
        # Both ends slip the same way, but the rate dips in between: walk to its minimum.
        top = 1.0
        for _ in range(30):
            u = 0.5 * (low + top)
            if (c1 + u * (2.0 * c2 + u * (3.0 * c3 + u * (4.0 * c4 + u * 5.0 * c5)))) * direction < 0.0:
                low, high = 0.0, u
                break
            if (2.0 * c2 + u * (6.0 * c3 + u * (12.0 * c4 + u * 20.0 * c5))) * direction < 0.0:
                low = u
            else:
                top = u
    for _ in range(60 if high <= 1.0 else 0):
        u = 0.5 * (low + high)
        if u == low or u == high:
            break
        if (c1 + u * (2.0 * c2 + u * (3.0 * c3 + u * (4.0 * c4 + u * 5.0 * c5)))) * direction < 0.0:
            high = u
        else:
            low = u
    return high, (c1, c2, c3, c4, c5)


@_inner
def _friction_interval(theta, z, law, out):
    """Moments between which the joint sticks."""
    address, p, _, _ = law
    if address == 0:
        elastic = theta * (p[0] + theta * (p[1] + theta * p[2]))
        return elastic - p[4], elastic + p[4]
    call_law(address, theta, 0.0, 1.0, z, p, out)
    high = out[0]
    call_law(address, theta, 0.0, -1.0, z, p, out)
    return out[0], high


@_inner
def _holds(t, h, theta, states, law, drive, interval):
    """Whether the joint still sticks h after t; fills the states there. `interval` is right for a law without."""
    address, p, _, n = law
    z0, z1, kz, out, total = states
    low, high = interval
    if n:
        # Runge–Kutta of order 4: a resting joint is no reason for short steps.
        for j in range(n):
            total[j] = 0.0
        for stage in range(4):
            node = 0.0 if stage == 0 else (1.0 if stage == 3 else 0.5)
            for j in range(n):
                z1[j] = z0[j] + (node * h * kz[j] if stage else 0.0)
            call_law(address, theta, 0.0, 0.0, z1, p, out)
            for j in range(n):
                kz[j] = out[1 + j]
                total[j] += (1.0 if stage % 3 == 0 else 2.0) * out[1 + j]
        for j in range(n):
            z1[j] = z0[j] + h * total[j] / 6.0
            # Sticking is recorded along the chord.
            kz[j] = kz[6 * n + j] = total[j] / 6.0
        low, high = _friction_interval(theta, z1, law, out)
    return low <= excitation_at(t + h, drive) <= high


@_inner
def _record(t, h, u_end, direction, sample, sample_step, x0, curve, states, motion):
    """Fill the samples up to fraction u_end of the step; return the next sample."""
    angle, rate, acceleration, recorded, stuck, n, n_samples = motion
    c1, c2, c3, c4, c5 = curve
    z0, z1, kz, _, _ = states
    per_step, end = 1.0 / h, t + u_end * h
    while sample < n_samples and sample * sample_step <= end:
        u = (sample * sample_step - t) * per_step
        angle[sample] = x0 + u * (c1 + u * (c2 + u * (c3 + u * (c4 + u * c5))))
        rate[sample] = (c1 + u * (2.0 * c2 + u * (3.0 * c3 + u * (4.0 * c4 + u * 5.0 * c5)))) * per_step
        bend = 2.0 * c2 + u * (6.0 * c3 + u * (12.0 * c4 + u * 20.0 * c5))
        acceleration[sample] = bend * per_step * per_step
        stuck[sample] = direction == 0.0
        for j in range(n):
            recorded[j * n_samples + sample] = _hermite(u, h, z0[j], kz[j], z1[j], kz[6 * n + j])
        sample += 1
    return sample


@_inner
def _stick(t, sample, step_sizes, theta, states, law, drive, motion):
    """Stick from t until the moment breaks the joint away or the samples end, which are filled.

    Returns the time, the next sample, and the direction of slip; 0 when friction is negative.
    """
    sample_step, max_step, tiny = step_sizes
    z0, z1, _, out, _ = states
    n, n_samples = motion[5], motion[6]
    interval = _friction_interval(theta, z0, law, out)
    if interval[1] < interval[0] - 1e-12 * (abs(interval[0]) + abs(interval[1])):
        return t, sample, 0.0
    moment, holds = excitation_at(t, drive), True
    if not interval[0] <= moment <= interval[1]:
        return t, sample, 1.0 if moment > interval[1] else -1.0
    while holds and sample < n_samples:
        # Two checks per piece of the excitation find every breakaway of a resolved drive.
        h = (0.5 * np.floor(2.0 * t / drive[2] + 1e-6) + 0.5) * drive[2] - t
        h = min(max(h, tiny), max_step)
        holds = _holds(t, h, theta, states, law, drive, interval)
        if not holds:
            low, x = 0.0, 0.5 * h
            while h - low > tiny and t + low < t + x < t + h:
                if _holds(t, x, theta, states, law, drive, interval):
                    low = x
                else:
                    h = x
                x = 0.5 * (low + h)
            _holds(t, h, theta, states, law, drive, interval)
        if sample * sample_step <= t + h:
            still = (0.0, 0.0, 0.0, 0.0, 0.0)
            sample = _record(t, h, 1.0, 0.0, sample, sample_step, theta, still, states, motion)
        t += h
        copied(n, z1, z0)
        if n:
            interval = _friction_interval(theta, z0, law, out)
    return t, sample, 1.0 if excitation_at(t, drive) > interval[1] else -1.0


@njit(**_options)
def integrate(
    address, p, inertia, pieces, tone, y, sizes, room, sample_step, rtol, max_step, most_steps, limits, arrays
):
    """Integrate one run and fill its samples.

    Parameters
    ----------
    address : int
        Of the law; zero means the paper's five-term law.
    p : ndarray, shape (n_parameters,)
    inertia : float
    pieces : ndarray, shape (count, 4)
    tone : (step, periodic, smooth, scale, ramp)
    y, sizes : ndarray, shape (2 + n_states,)
        Angle, rate and states at time zero; values below which no relative accuracy is asked for (overwritten).
    room : ndarray, shape (11·n_states + 6,)
        To work in.
    arrays : (angle, rate, acceleration, states, stuck)
        Filled; states have shape (n_states, n_samples), the others (n_samples,).

    Returns
    -------
    status, time reached, steps taken
    """
    n, n_samples = arrays[3].shape[0], arrays[0].size
    step, periodic, smooth, scale, ramp = tone
    law = (address, pointer(p), 1.0 / inertia, n)
    drive = (pointer(pieces), pieces.shape[0], step, periodic, smooth, scale, ramp)
    motion = (pointer(arrays[0]), pointer(arrays[1]), pointer(arrays[2]), pointer(arrays[3]), pointer(arrays[4]),
              n, n_samples)  # fmt: skip
    # The states, their values at the end of a step, a sum, seven rates, a law's answer and five moments.
    z, size = pointer(room), pointer(sizes)
    z1, kz = shifted(z, n), shifted(z, 3 * n)
    states = (z, z1, kz, shifted(z, 10 * n), shifted(z, 2 * n))
    x, v, a = y[0], y[1], 0.0
    copied(n, shifted(pointer(y), 2), z)
    copied(n, z, z1)
    tiny = 1e-14 * n_samples * sample_step
    step_sizes = (sample_step, max_step, tiny)
    # np.int64: a literal would be another type, and every function taking it compiled twice.
    t, sample, steps, log_old = 0.0, np.int64(0), 0, -9.0
    h_next = min(0.1 * step, max_step)
    direction = 1.0 if v > 0.0 else -1.0
    at_rest, fresh = v == 0.0, True

    while sample < n_samples:
        if at_rest:
            t, sample, direction = _stick(t, sample, step_sizes, x, states, law, drive, motion)
            if direction == 0.0:
                return ACTIVE_FRICTION, t, steps
            at_rest, fresh, h_next = False, True, min(h_next, 0.1 * step)
            continue

        steps += 1
        if steps > most_steps:
            return TOO_MANY_STEPS, t, steps
        h = min(h_next, max_step)
        if not smooth:
            h = min(h, max((np.floor(t / step + 1e-9) + 1.0) * step - t, tiny))
        if fresh:
            a = _acceleration(np.int64(0), excitation_at(t, drive), h, x, v, direction, law, states)
            fresh = False
        x1, v1, a1, err = _slip_step(t, h, x, v, a, direction, law, drive, states, size)
        err /= rtol
        if not (math.isfinite(err) and math.isfinite(a1)):
            h_next = 0.1 * h
            if h_next < tiny:
                return NOT_FINITE, t, steps
            continue
        log_err = math.log(max(err, 1e-9))
        if err > 1.0:
            h_next = h * max(0.2, 0.9 * math.exp(-0.2 * log_err))
            if h_next < tiny:
                return STEP_TOO_SMALL, t, steps
            continue
        h_next = h * min(5.0, max(0.2, 0.9 * math.exp(0.04 * log_old - 0.17 * log_err)))
        log_old = max(log_err, -9.0)

        turn, curve = _reversal(h, direction, x, v, a, x1, v1, a1)
        at_rest, u_end = turn <= 1.0, min(turn, 1.0)
        if sample * sample_step <= t + u_end * h:
            sample = _record(t, h, u_end, direction, sample, sample_step, x, curve, states, motion)
        if at_rest:
            c1, c2, c3, c4, c5 = curve
            x1 = x + u_end * (c1 + u_end * (c2 + u_end * (c3 + u_end * (c4 + u_end * c5))))
            v1 = 0.0
            for j in range(n):
                z1[j] = _hermite(u_end, h, z[j], kz[j], z1[j], kz[6 * n + j])
        if x1 < limits[0] or x1 > limits[1]:
            edge = limits[0] if x1 < limits[0] else limits[1]
            return LIMIT, t + u_end * h * (edge - x) / (x1 - x), steps
        x, v, a = x1, v1, a1
        size[0], size[1] = max(size[0], abs(x)), max(size[1], abs(v))
        for j in range(n):
            z[j], kz[j] = z1[j], kz[6 * n + j]
            size[2 + j] = max(size[2 + j], abs(z[j]))
        t += u_end * h
        fresh = at_rest or not smooth
    return DONE, t, steps
