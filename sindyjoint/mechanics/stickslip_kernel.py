"""The compiled integrator of one joint: I·θ̈ + M_T(θ, θ̇, direction, z) = M(t) with exact sticking.

While the joint slips, the direction is held through a step, so the right-hand side is smooth there, and the
explicit pair of Dormand and Prince (1980) of order 5(4) with step control (Hairer, Nørsett, Wanner, Solving
Ordinary Differential Equations I, 1993, II.4 and II.5) integrates it. Between steps the motion is the quintic
through angle, rate and acceleration at both ends. Where the rate reaches zero the step is cut at that instant,
the rate is set to zero, and the joint sticks if M lies in [M_T(θ, 0, −1, z), M_T(θ, 0, +1, z)]. It stays there,
unmoved, until the instant M leaves that interval.
"""

from __future__ import annotations

import numpy as np
from numba import njit

from sindyjoint.mechanics.kernels import call_law, pointer, shifted

DONE, LIMIT, NOT_FINITE, STEP_TOO_SMALL, TOO_MANY_STEPS, ACTIVE_FRICTION = range(6)

_compiled = njit(cache=True, nogil=True, error_model="numpy", fastmath={"contract"})
_inlined = njit(cache=True, nogil=True, error_model="numpy", fastmath={"contract"}, forceinline=True)

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


@_inlined
def _quintic(u, h, x0, v0, a0, x1, v1, a1):
    """Value, first and second derivative at fraction u of the quintic through (x, v, a) at both ends of a step."""
    d = x1 - x0 - h * (v0 + 0.5 * h * a0)
    e = h * (v1 - v0 - h * a0)
    f = h * h * (a1 - a0)
    c3 = 10.0 * d - 4.0 * e + 0.5 * f
    c4 = -15.0 * d + 7.0 * e - f
    c5 = 6.0 * d - 3.0 * e + 0.5 * f
    x = x0 + u * (h * v0 + u * (0.5 * h * h * a0 + u * (c3 + u * (c4 + u * c5))))
    v = v0 + u * (h * a0 + u * (3.0 * c3 + u * (4.0 * c4 + u * 5.0 * c5)) / h)
    a = a0 + u * (6.0 * c3 + u * (12.0 * c4 + u * 20.0 * c5)) / (h * h)
    return x, v, a


@_compiled
def _hermite(u, h, z0, r0, z1, r1):
    """Cubic through value and rate at both ends of a step, at fraction u."""
    d = z1 - z0
    return z0 + u * (h * r0 + u * (3.0 * d - h * (2.0 * r0 + r1) + u * (h * (r0 + r1) - 2.0 * d)))


@_compiled
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
def _acceleration(stage, t, h, x, v, direction, law, drive, states):
    """Acceleration at a stage of the step."""
    address, p, per_inertia, _ = law
    if address == 0:
        # The paper's law in line: a third of the time of a step would go into calls.
        elastic = x * (p[0] + x * (p[1] + x * p[2]))
        return (excitation_at(t, drive) - p[4] * direction - elastic - p[3] * v) * per_inertia
    return (excitation_at(t, drive) - _law_at_stage(stage, h, x, v, direction, law, states)) * per_inertia


@_compiled
def _slip_step(t, h, x, v, a, direction, law, drive, states):
    """One step of Dormand and Prince in `direction` from angle x, rate v and acceleration a.

    Returns angle, rate and acceleration at the end and the errors of angle and rate.
    """
    # Drives with jumps: the step ends at a jump, and its last stages want the value before it.
    end = t + h if drive[4] else t + h * (1.0 - 1e-12)
    v2 = v + h * 0.2 * a
    a2 = _acceleration(np.int64(1), t + 0.2 * h, h, x + h * 0.2 * v, v2, direction, law, drive, states)
    v3 = v + h * (3 / 40 * a + 9 / 40 * a2)
    a3 = _acceleration(
        np.int64(2), t + 0.3 * h, h, x + h * (3 / 40 * v + 9 / 40 * v2), v3, direction, law, drive, states
    )
    v4 = v + h * (44 / 45 * a - 56 / 15 * a2 + 32 / 9 * a3)
    x4 = x + h * (44 / 45 * v - 56 / 15 * v2 + 32 / 9 * v3)
    a4 = _acceleration(np.int64(3), t + 0.8 * h, h, x4, v4, direction, law, drive, states)
    v5 = v + h * (19372 / 6561 * a - 25360 / 2187 * a2 + 64448 / 6561 * a3 - 212 / 729 * a4)
    x5 = x + h * (19372 / 6561 * v - 25360 / 2187 * v2 + 64448 / 6561 * v3 - 212 / 729 * v4)
    a5 = _acceleration(np.int64(4), t + 8 / 9 * h, h, x5, v5, direction, law, drive, states)
    v6 = v + h * (9017 / 3168 * a - 355 / 33 * a2 + 46732 / 5247 * a3 + 49 / 176 * a4 - 5103 / 18656 * a5)
    x6 = x + h * (9017 / 3168 * v - 355 / 33 * v2 + 46732 / 5247 * v3 + 49 / 176 * v4 - 5103 / 18656 * v5)
    a6 = _acceleration(np.int64(5), end, h, x6, v6, direction, law, drive, states)
    v7 = v + h * (35 / 384 * a + 500 / 1113 * a3 + 125 / 192 * a4 - 2187 / 6784 * a5 + 11 / 84 * a6)
    x7 = x + h * (35 / 384 * v + 500 / 1113 * v3 + 125 / 192 * v4 - 2187 / 6784 * v5 + 11 / 84 * v6)
    a7 = _acceleration(np.int64(6), end, h, x7, v7, direction, law, drive, states)
    c1, c3, c4, c5, c6, c7 = 71 / 57600, -71 / 16695, 71 / 1920, -17253 / 339200, 22 / 525, -1 / 40
    error_x = h * (c1 * v + c3 * v3 + c4 * v4 + c5 * v5 + c6 * v6 + c7 * v7)
    error_v = h * (c1 * a + c3 * a3 + c4 * a4 + c5 * a5 + c6 * a6 + c7 * a7)
    return x7, v7, a7, error_x, error_v


@_inlined
def _state_error(h, n, states, size):
    """Largest error of the internal states, each relative to its largest value so far."""
    _, z1, kz, _, _ = states
    worst = 0.0
    for j in range(n):
        error = 0.0
        for i in range(7):
            error += ERROR[i] * kz[i * n + j]
        worst = max(worst, abs(h * error) / max(size[2 + j], abs(z1[j])))
    return worst


@_compiled
def _reversal(h, direction, x0, v0, a0, x1, v1, a1):
    """Fraction of the step at which the rate first reaches zero against the direction; 2 when it does not."""
    high = 2.0
    if v1 * direction < 0.0:
        high = 1.0
    elif a0 * direction < 0.0 and a1 * direction > 0.0:
        # Both ends slip the same way, but the rate dips in between: walk to its minimum.
        low, top = 0.0, 1.0
        for _ in range(30):
            u = 0.5 * (low + top)
            _, v, a = _quintic(u, h, x0, v0, a0, x1, v1, a1)
            if v * direction < 0.0:
                high = u
                break
            if a * direction < 0.0:
                low = u
            else:
                top = u
    if high > 1.0:
        return 2.0
    low = 0.0
    for _ in range(60):
        u = 0.5 * (low + high)
        if u == low or u == high:
            break
        _, v, _ = _quintic(u, h, x0, v0, a0, x1, v1, a1)
        if v * direction < 0.0:
            high = u
        else:
            low = u
    return high


@_compiled
def _friction_interval(theta, z, law, out):
    """Moments between which the joint stays at rest."""
    address, p, _, _ = law
    if address == 0:
        elastic = theta * (p[0] + theta * (p[1] + theta * p[2]))
        return elastic - p[4], elastic + p[4]
    call_law(address, theta, 0.0, 1.0, z, p, out)
    high = out[0]
    call_law(address, theta, 0.0, -1.0, z, p, out)
    return out[0], high


@_compiled
def _rest(h, theta, law, states):
    """Fill the internal states after a rest of h (Runge–Kutta of order 4)."""
    address, p, _, n = law
    z0, z1, kz, out, total = states
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


@_compiled
def _holds(t, h, theta, states, law, drive, interval):
    """Whether the joint still rests h after t; fills the states there. `interval` is right for a law without."""
    _, z1, _, out, _ = states
    low, high = interval
    if law[3]:
        _rest(h, theta, law, states)
        low, high = _friction_interval(theta, z1, law, out)
    return low <= excitation_at(t + h, drive) <= high


@_compiled
def _rest_until_breakaway(t, h, theta, states, law, drive, interval):
    """Rest for at most h; return the time rested and whether the joint broke away at its end."""
    if _holds(t, h, theta, states, law, drive, interval):
        return h, False
    low, high = 0.0, h
    for _ in range(80):
        middle = 0.5 * (low + high)
        if t + middle == t + low or t + middle == t + high:
            break
        if _holds(t, middle, theta, states, law, drive, interval):
            low = middle
        else:
            high = middle
    _holds(t, high, theta, states, law, drive, interval)
    return high, True


@_compiled
def _record_slip(t, h, u_end, sample, sample_step, x0, v0, a0, x1, v1, a1, states, motion):
    """Fill the samples up to fraction u_end of the step; return the next sample."""
    angle, rate, acceleration, recorded, stuck, n, n_samples = motion
    z0, z1, kz, _, _ = states
    while sample < n_samples and sample * sample_step <= t + u_end * h:
        u = (sample * sample_step - t) / h
        x, v, a = _quintic(u, h, x0, v0, a0, x1, v1, a1)
        angle[sample], rate[sample], acceleration[sample], stuck[sample] = x, v, a, 0
        for j in range(n):
            recorded[j * n_samples + sample] = _hermite(u, h, z0[j], kz[j], z1[j], kz[6 * n + j])
        sample += 1
    return sample


@_compiled
def _record_rest(t, h, sample, sample_step, theta, states, motion):
    """Fill the samples of a time at rest; return the next sample."""
    angle, rate, acceleration, recorded, stuck, n, n_samples = motion
    z0, z1, _, _, _ = states
    while sample < n_samples and sample * sample_step <= t + h:
        angle[sample], rate[sample], acceleration[sample], stuck[sample] = theta, 0.0, 0.0, 1
        u = min(max((sample * sample_step - t) / h, 0.0), 1.0)
        for j in range(n):
            recorded[j * n_samples + sample] = z0[j] + u * (z1[j] - z0[j])
        sample += 1
    return sample


@_compiled
def integrate(address, p, inertia, pieces, tone, y, sizes, sample_step, rtol, max_step, limits, arrays):
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
    # Room for the states, their values at the end of a step, a law's answer, a sum, and seven rates.
    room, size = np.zeros(11 * (n + 1)), pointer(sizes)
    z, z1, out = pointer(room), shifted(pointer(room), n + 1), shifted(pointer(room), 2 * (n + 1))
    kz = shifted(pointer(room), 4 * (n + 1))
    states = (z, z1, kz, out, shifted(pointer(room), 3 * (n + 1)))
    x, v, a = y[0], y[1], 0.0
    for j in range(n):
        z[j] = y[2 + j]
        z1[j] = z[j]
    tiny = 1e-14 * n_samples * sample_step
    # np.int64: a literal would be a type of its own, and every function taking it compiled twice.
    t, sample, steps, log_old = 0.0, np.int64(0), 0, -9.0
    h_next = min(0.1 * step, max_step)
    direction = np.sign(v)
    at_rest, fresh = v == 0.0, True

    while sample < n_samples:
        if at_rest:
            low, high = _friction_interval(x, z, law, out)
            if high < low - 1e-12 * (abs(high) + abs(low)):
                return ACTIVE_FRICTION, t, steps
            moment = excitation_at(t, drive)
            while low <= moment <= high and sample < n_samples:
                # Two checks per piece of the excitation find every breakaway of a resolved drive.
                h = (0.5 * np.floor(2.0 * t / step + 1e-6) + 0.5) * step - t
                h = min(max(h, tiny), max_step)
                h, broke = _rest_until_breakaway(t, h, x, states, law, drive, (low, high))
                if sample * sample_step <= t + h:
                    sample = _record_rest(t, h, sample, sample_step, x, states, motion)
                t += h
                for j in range(n):
                    z[j] = z1[j]
                if n:
                    low, high = _friction_interval(x, z, law, out)
                if broke:
                    moment = excitation_at(t, drive)
            direction, at_rest, fresh = 1.0 if moment > high else -1.0, False, True
            h_next = min(h_next, 0.1 * step)
            continue

        steps += 1
        if steps > 20_000_000:
            return TOO_MANY_STEPS, t, steps
        h = min(h_next, max_step)
        if not smooth:
            h = min(h, max((np.floor(t / step + 1e-9) + 1.0) * step - t, tiny))
        if fresh:
            a = _acceleration(np.int64(0), t, h, x, v, direction, law, drive, states)
            fresh = False
        x1, v1, a1, error_x, error_v = _slip_step(t, h, x, v, a, direction, law, drive, states)
        # Against the largest value so far: a rate that passes zero needs no relative accuracy there.
        err = max(abs(error_x) / max(size[0], abs(x1)), abs(error_v) / max(size[1], abs(v1)))
        err = max(err, _state_error(h, n, states, size)) / rtol
        if not (np.isfinite(err) and np.isfinite(a1)):
            h_next = 0.1 * h
            if h_next < tiny:
                return NOT_FINITE, t, steps
            continue
        log_err = np.log(max(err, 1e-9))
        if err > 1.0:
            h_next = h * max(0.2, 0.9 * np.exp(-0.2 * log_err))
            if h_next < tiny:
                return STEP_TOO_SMALL, t, steps
            continue
        h_next = h * min(5.0, max(0.2, 0.9 * np.exp(0.04 * log_old - 0.17 * log_err)))
        log_old = max(log_err, -9.0)

        u_end = _reversal(h, direction, x, v, a, x1, v1, a1)
        at_rest = u_end <= 1.0
        u_end = min(u_end, 1.0)
        if sample * sample_step <= t + u_end * h:
            sample = _record_slip(t, h, u_end, sample, sample_step, x, v, a, x1, v1, a1, states, motion)
        if at_rest:
            x1, _, _ = _quintic(u_end, h, x, v, a, x1, v1, a1)
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
