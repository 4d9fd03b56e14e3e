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

from sindyjoint.mechanics.kernels import call_law

DONE, LIMIT, NOT_FINITE, STEP_TOO_SMALL, TOO_MANY_STEPS, ACTIVE_FRICTION = range(6)

_OPTIONS = {"cache": True, "nogil": True, "error_model": "numpy", "fastmath": {"contract"}}

# Butcher table of Dormand and Prince (1980); the last row is the difference of the two solutions.
NODES = np.array([0.0, 1 / 5, 3 / 10, 4 / 5, 8 / 9, 1.0, 1.0])
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


@njit(**_OPTIONS)
def excitation_at(t, drive):
    """Value of the piecewise cubic excitation (pieces, step, periodic, smooth, scale, ramp) at time t."""
    pieces, step, periodic, _, scale, ramp = drive
    count = pieces.shape[0]
    u = t / step
    if periodic:
        u -= np.floor(u / count) * count
    i = min(int(u), count - 1)
    u = min(u - i, 1.0)
    value = scale * (pieces[i, 0] + u * (pieces[i, 1] + u * (pieces[i, 2] + u * pieces[i, 3])))
    if t < ramp:
        r = t / ramp
        value *= r * r * (3.0 - 2.0 * r)
    return value


@njit(**_OPTIONS)
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


@njit(**_OPTIONS)
def _hermite(u, h, z0, r0, z1, r1):
    """Cubic through value and rate at both ends of a step, at fraction u."""
    d = z1 - z0
    return z0 + u * (h * r0 + u * (3.0 * d - h * (2.0 * r0 + r1) + u * (h * (r0 + r1) - 2.0 * d)))


@njit(**_OPTIONS)
def _slip_step(t, h, first, direction, law, drive, y, y1, k, work):
    """One step of Dormand and Prince in `direction`: fill y1 and k; with `first`, k[0] too."""
    address, p, inertia = law
    trial, z, out = work
    n = y.size
    for stage in range(0 if first else 1, 7):
        for i in range(n):
            slope = 0.0
            for j in range(stage):
                slope += TABLE[stage, j] * k[j, i]
            trial[i] = y[i] + h * slope
        # Drives with jumps: the step ends at a jump, and its last stages want the value before it.
        node = min(NODES[stage], 1.0 - 1e-12) if not drive[3] else NODES[stage]
        moment = excitation_at(t + node * h, drive)
        for j in range(n - 2):
            z[j] = trial[2 + j]
        call_law(address, trial[0], trial[1], direction, z, p, out)
        k[stage, 0] = trial[1]
        k[stage, 1] = (moment - out[0]) / inertia
        for j in range(2, n):
            k[stage, j] = out[j - 1]
    for i in range(n):
        y1[i] = trial[i]


@njit(**_OPTIONS)
def _error_ratio(h, y, y1, k, size, rtol):
    """Largest error of the step over its tolerance."""
    ratio = 0.0
    for i in range(y.size):
        error = 0.0
        for j in range(7):
            error += ERROR[j] * k[j, i]
        # Against the largest value so far: a rate that passes zero needs no relative accuracy there.
        error = abs(h * error) / (rtol * max(size[i], abs(y1[i])))
        if not error <= ratio:
            ratio = error
    return ratio


@njit(**_OPTIONS)
def _reversal(h, direction, y, y1, k):
    """Fraction of the step at which the rate first reaches zero against the direction; 2 when it does not."""
    high = 2.0
    if y1[1] * direction < 0.0:
        high = 1.0
    elif k[0, 1] * direction < 0.0 and k[6, 1] * direction > 0.0:
        # Both ends slip the same way, but the rate dips in between: walk to its minimum.
        low, top = 0.0, 1.0
        for _ in range(30):
            u = 0.5 * (low + top)
            _, v, a = _quintic(u, h, y[0], y[1], k[0, 1], y1[0], y1[1], k[6, 1])
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
        _, v, _ = _quintic(u, h, y[0], y[1], k[0, 1], y1[0], y1[1], k[6, 1])
        if v * direction < 0.0:
            high = u
        else:
            low = u
    return high


@njit(**_OPTIONS)
def _breakaway_side(theta, z, moment, law, out):
    """−1 or +1 when the moment overcomes friction on that side, 0 when it does not, 2 when friction is active."""
    address, p, _ = law
    call_law(address, theta, 0.0, 1.0, z, p, out)
    high = out[0]
    call_law(address, theta, 0.0, -1.0, z, p, out)
    low = out[0]
    if high < low - 1e-12 * (abs(high) + abs(low)):
        return 2
    if moment > high:
        return 1
    if moment < low:
        return -1
    return 0


@njit(**_OPTIONS)
def _rest(t, h, theta, z0, z1, law, drive, out, rates):
    """Leave the joint at rest for h: fill the states z1 (Runge–Kutta of order 4), return the breakaway side."""
    address, p, _ = law
    n = z0.size - (out.size == 1)
    for j in range(n):
        rates[0, j] = 0.0
    if n:
        for stage in range(4):
            for j in range(n):
                node = 0.0 if stage == 0 else (1.0 if stage == 3 else 0.5)
                z1[j] = z0[j] + node * h * rates[1, j] if stage else z0[j]
            call_law(address, theta, 0.0, 0.0, z1, p, out)
            for j in range(n):
                rates[1, j] = out[1 + j]
                rates[0, j] += (1.0 if stage % 3 == 0 else 2.0) * out[1 + j]
        for j in range(n):
            z1[j] = z0[j] + h * rates[0, j] / 6.0
    return _breakaway_side(theta, z1, excitation_at(t + h, drive), law, out)


@njit(**_OPTIONS)
def _rest_until_breakaway(t, h, theta, z0, z1, law, drive, out, rates):
    """Rest for at most h; return the time rested and the breakaway side (0: still at rest)."""
    side = _rest(t, h, theta, z0, z1, law, drive, out, rates)
    if side == 0:
        return h, side
    low, high = 0.0, h
    for _ in range(80):
        middle = 0.5 * (low + high)
        if middle == low or middle == high or t + middle == t + low or t + middle == t + high:
            break
        if _rest(t, middle, theta, z0, z1, law, drive, out, rates) != 0:
            high = middle
        else:
            low = middle
    return high, _rest(t, high, theta, z0, z1, law, drive, out, rates)


@njit(**_OPTIONS)
def _record_slip(t, h, u_end, sample, sample_step, y, y1, k, motion):
    """Fill the samples up to fraction u_end of the step; return the next sample."""
    angle, rate, acceleration, states, stuck = motion
    while sample < angle.size and sample * sample_step <= t + u_end * h:
        u = (sample * sample_step - t) / h
        x, v, a = _quintic(u, h, y[0], y[1], k[0, 1], y1[0], y1[1], k[6, 1])
        angle[sample], rate[sample], acceleration[sample], stuck[sample] = x, v, a, False
        for j in range(states.shape[0]):
            states[j, sample] = _hermite(u, h, y[2 + j], k[0, 2 + j], y1[2 + j], k[6, 2 + j])
        sample += 1
    return sample


@njit(**_OPTIONS)
def _record_rest(t, h, sample, sample_step, theta, z0, z1, motion):
    """Fill the samples of a time at rest; return the next sample."""
    angle, rate, acceleration, states, stuck = motion
    while sample < angle.size and sample * sample_step <= t + h:
        angle[sample], rate[sample], acceleration[sample], stuck[sample] = theta, 0.0, 0.0, True
        u = min(max((sample * sample_step - t) / h, 0.0), 1.0)
        for j in range(states.shape[0]):
            states[j, sample] = z0[j] + u * (z1[j] - z0[j])
        sample += 1
    return sample


@njit(**_OPTIONS)
def integrate(law, drive, y, scales, sample_step, rtol, max_step, limits, motion):
    """Integrate one run and fill its samples.

    Parameters
    ----------
    law : (address, parameters, inertia)
    drive : (pieces, step, periodic, smooth, scale, ramp)
    y : ndarray, shape (2 + n_states,)
        Angle, rate and states at time zero; overwritten.
    scales : ndarray, shape (2 + n_states,)
        Values below which no relative accuracy is asked for.
    motion : (angle, rate, acceleration, states, stuck)
        Arrays to fill.

    Returns
    -------
    status, time reached, steps taken
    """
    n = y.size - 2
    step, smooth = drive[1], drive[3]
    k, y1, size = np.zeros((7, y.size)), np.zeros(y.size), scales.copy()
    z, z1, out, rates = np.zeros(max(n, 1)), np.zeros(max(n, 1)), np.zeros(1 + n), np.zeros((2, max(n, 1)))
    work = (np.zeros(y.size), np.zeros(max(n, 1)), out)
    n_samples = motion[0].size
    t_end = (n_samples - 1) * sample_step
    tiny = 1e-14 * (t_end + sample_step)
    t, sample, steps, err_old = 0.0, 0, 0, 1e-4
    h_next = min(0.1 * step, max_step)
    direction = np.sign(y[1])
    at_rest, fresh = y[1] == 0.0, True

    while sample < n_samples:
        if at_rest:
            # Two checks per piece of the excitation find every breakaway of a resolved drive; bisection dates it.
            h = (0.5 * np.floor(2.0 * t / step + 1e-6) + 0.5) * step - t
            h = min(max(h, tiny), max_step)
            for j in range(n):
                z[j] = y[2 + j]
                z1[j] = z[j]
            side = _breakaway_side(y[0], z, excitation_at(t, drive), law, out)
            if side == 0:
                h, side = _rest_until_breakaway(t, h, y[0], z, z1, law, drive, out, rates)
                sample = _record_rest(t, h, sample, sample_step, y[0], z, z1, motion)
                t += h
                for j in range(n):
                    y[2 + j] = z1[j]
            if side == 2:
                return ACTIVE_FRICTION, t, steps
            if side != 0:
                direction, at_rest, fresh = float(side), False, True
                h_next = min(h_next, 0.1 * step)
            continue

        steps += 1
        if steps > 20_000_000:
            return TOO_MANY_STEPS, t, steps
        h = min(h_next, max_step)
        if not smooth:
            h = min(h, max((np.floor(t / step + 1e-9) + 1.0) * step - t, tiny))
        _slip_step(t, h, fresh, direction, law, drive, y, y1, k, work)
        fresh = False
        err = _error_ratio(h, y, y1, k, size, rtol)
        if not err <= 1.0:
            h_next = h * max(0.2, 0.9 * err**-0.2) if np.isfinite(err) else 0.1 * h
            if h_next < tiny:
                return (STEP_TOO_SMALL if np.isfinite(err) else NOT_FINITE), t, steps
            continue
        h_next = h * min(5.0, max(0.2, 0.9 * max(err, 1e-10) ** -0.17 * err_old**0.04))
        err_old = max(err, 1e-4)

        u_end = _reversal(h, direction, y, y1, k)
        at_rest = u_end <= 1.0
        u_end = min(u_end, 1.0)
        sample = _record_slip(t, h, u_end, sample, sample_step, y, y1, k, motion)
        if at_rest:
            y1[0], _, _ = _quintic(u_end, h, y[0], y[1], k[0, 1], y1[0], y1[1], k[6, 1])
            y1[1] = 0.0
            for j in range(2, y.size):
                y1[j] = _hermite(u_end, h, y[j], k[0, j], y1[j], k[6, j])
        if y1[0] < limits[0] or y1[0] > limits[1]:
            edge = limits[0] if y1[0] < limits[0] else limits[1]
            return LIMIT, t + u_end * h * (edge - y[0]) / (y1[0] - y[0]), steps
        for i in range(y.size):
            y[i] = y1[i]
            size[i] = max(size[i], abs(y[i]))
            k[0, i] = k[6, i]
        t += u_end * h
        fresh = at_rest or not smooth
    return DONE, t, steps


@njit(**_OPTIONS)
def integrate_batch(
    runs,
    address,
    p,
    inertia,
    pieces,
    first,
    count,
    step,
    periodic,
    smooth,
    scale,
    ramp,
    y,
    scales,
    sample_step,
    rtol,
    max_step,
    limits,
    motion,
    outcome,
):
    """Integrate the runs whose numbers are in `runs`; all other arrays are indexed by run."""
    angle, rate, acceleration, states, stuck = motion
    status, time, steps = outcome
    for r in runs:
        drive = (pieces[first[r] : first[r] + count[r]], step[r], periodic[r], smooth[r], scale[r], ramp[r])
        status[r], time[r], steps[r] = integrate(
            (address, p[r], inertia[r]), drive, y[r], scales[r], sample_step, rtol, max_step, limits[r],
            (angle[r], rate[r], acceleration[r], states[r], stuck[r]))  # fmt: skip
