"""Where the simulation of a run starts: in its steady state, or from a state fitted to first samples, the law held."""

from __future__ import annotations

from typing import Any

import numpy as np

from sindyjoint.errors import SimulationError
from sindyjoint.mechanics.excitation import Excitation
from sindyjoint.mechanics.laws import Law
from sindyjoint.mechanics.stickslip import simulate
from sindyjoint.numeric import Array, rms
from sindyjoint.record import Run
from sindyjoint.response.policy import POLICY
from sindyjoint.states import ForceStates

# Periods after which a run that repeats is taken for steady.
SETTLED = 3
# Step of the differences by an initial angle or rate, in RMS of the signal.
STEP = 1e-4
# Parts of the samples that a start is fitted to, one after the other: a wrong rate leads far astray only in time.
STAGES = (1 / 8, 1 / 4, 1 / 2, 1)
# Error of a start that cannot be simulated, in RMS of the angle: larger than that of any that can.
FAR_OFF = 10.0


def cycle_of(states: ForceStates) -> float:
    """Return the time of a mean cycle of a motion, s."""
    return 2 * np.pi * float(np.std(states.angle)) / max(rms(states.rate), 1e-300)


def start_on_parabola(run: Run, states: ForceStates, samples: int) -> Array:
    """Return angle and rate where a parabola through the first of some samples begins, an eighth of a cycle at most."""
    count = min(samples, max(POLICY.fewest_initial, round(cycle_of(states) / 8 * run.sample_rate)))
    return np.polyfit(np.arange(count) / run.sample_rate, run.angle[:count], 2)[:0:-1]


def internal_size(law: Law, along: Array) -> Array:
    """Return by how much the internal states of a law vary along a motion; zero for a clock, which is known."""
    zero = np.zeros(1)
    alone = (
        law.state_rate(zero, zero, np.ones(1), np.zeros((law.n_states, 1)))[:, 0]
        if law.n_states
        else zero[:0]
    )
    return np.where(alone == 0, np.std(along, axis=1), 0.0)


def steady_start(law: Law, excitation: Excitation, start: Array, **options: Any) -> tuple[Array, Array]:
    """Return angle and rate, and internal states, at the first instant of a period once the motion is steady.

    Parameters
    ----------
    law : Law
    excitation : Excitation
        That repeats.
    start : ndarray, shape (2,)
        Angle and rate as measured, rad and rad/s.
    **options
        Of :func:`~sindyjoint.mechanics.stickslip.simulate`.
    """
    duration = (SETTLED * len(excitation.pieces) + 1) * excitation.step
    settled = simulate(law, excitation, duration, 1 / excitation.step, initial=start, **options)
    return np.array([settled.angle[-1], settled.rate[-1]]), settled.state[:, -1]


def fitted_start(
    law: Law,
    excitation: Excitation,
    measured: Array,
    sample_rate: float,
    start: Array,
    size: Array,
    noise: float,
    **options: Any,
) -> Array:
    """Return the angle, rate and internal states from which a simulation comes nearest to some measured angles.

    Parameters
    ----------
    law : Law
    excitation : Excitation
        Moment from the first of these samples on.
    measured : ndarray, shape (n,)
        Angles, rad.
    sample_rate : float
        Hz.
    start : ndarray, shape (2 + n_states,)
        First guess, SI.
    size : ndarray, shape (2 + n_states,)
        RMS of each over the run: how far angle and rate may lie from the guess is a share of it, how far an internal
        state is likely to. One without a size is not fitted.
    noise : float
        Of the angle, in its RMS: by it a likely internal state is weighed against the angles.
    **options
        Of :func:`~sindyjoint.mechanics.stickslip.simulate`.
    """
    from scipy.optimize import least_squares

    free = np.flatnonzero(size)
    bound, found = np.where(free < 2, POLICY.initial_range, np.inf), np.zeros(free.size)
    for share in STAGES:
        count = min(max(round(share * measured.size), POLICY.fewest_initial), measured.size)

        def residual(x: Array, count: int = count) -> Array:
            from_here = start.copy()
            from_here[free] += size[free] * x
            begin = {"initial": from_here[:2], "initial_state": from_here[2:]}
            try:
                motion = simulate(law, excitation, count / sample_rate, sample_rate, **options | begin)
                apart = (motion.angle - measured[:count]) / size[0]
            except SimulationError:
                apart = np.full(count, FAR_OFF)
            return np.concatenate([apart, noise * x[free > 1]])

        def jacobian(x: Array, at: Any = residual) -> Array:
            here = at(x)
            return np.column_stack([(at(x + step) - here) / STEP for step in STEP * np.eye(x.size)])

        found = np.asarray(least_squares(residual, found, jacobian, bounds=(-bound, bound)).x)
    result = start.copy()
    result[free] += size[free] * found
    return result
