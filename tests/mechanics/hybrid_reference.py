"""An independent stick–slip solver on scipy's ``solve_ivp`` with events, for tests and benchmarks."""

from __future__ import annotations

import numpy as np
from scipy.integrate import solve_ivp
from scipy.optimize import brentq


def solve_stick_slip(law, moment, duration, time, rtol=1e-10, method="DOP853", inertia=None):
    """Angle and rate at `time` of inertia·θ̈ + law = moment(t), from standstill; the law has no internal state."""
    inertia = law.inertia if inertia is None else inertia
    parameters = law.parameters
    k1, k2, k3, c1, friction = (float(p) for p in parameters)
    angle, rate = np.empty(time.size), np.empty(time.size)
    t, x, v, sample = 0.0, 0.0, 0.0, 0

    def elastic(x):
        return x * (k1 + x * (k2 + x * k3))

    while t < duration:
        held = elastic(x)
        excess = moment(t) - held
        if v == 0 and abs(excess) <= friction * (1 + 1e-13):
            # scan for breakaway, then bisect
            grid = np.linspace(t, duration, int((duration - t) * 4000) + 2)
            out = np.flatnonzero(np.abs(moment(grid) - held) > friction * (1 + 1e-12))
            end = duration
            if out.size:
                i = max(out[0], 1)
                end = (
                    brentq(
                        lambda s, held=held: abs(moment(s) - held) - friction,
                        grid[i - 1],
                        grid[i],
                        xtol=1e-15,
                    )
                    if i
                    else t
                )
            inside = (time >= t) & (time <= end)
            angle[inside], rate[inside] = x, 0.0
            t = end
            if end >= duration:
                break
            direction = np.sign(moment(t + 1e-9) - held)
        else:
            direction = np.sign(v) if v else np.sign(excess)

        def slip(s, y, direction=direction):
            force = moment(s) - elastic(y[0]) - c1 * y[1] - friction * direction
            return [y[1], force / inertia]

        def reversal(s, y, direction=direction):
            return y[1] * direction

        reversal.terminal, reversal.direction = True, -1
        # Older SciPy tries a first step so long that the force overflows, and takes it back.
        with np.errstate(over="ignore"):
            solution = solve_ivp(
                slip, (t, duration), [x, v], method=method, rtol=rtol, atol=[rtol * 1e-4, rtol * 1e-2],
                events=reversal, dense_output=True,
            )  # fmt: skip
        inside = (time >= t) & (time <= solution.t[-1])
        if inside.any():
            angle[inside], rate[inside] = solution.sol(time[inside])
        t, x, v = solution.t[-1], solution.y[0, -1], 0.0
        sample += 1
    return angle, rate
