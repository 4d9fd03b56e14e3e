"""Where the simulation of a run starts: in its steady state, or from a state fitted to first samples, the law held."""

from __future__ import annotations

from typing import Any

import numpy as np

from sindyjoint.errors import SimulationError
from sindyjoint.mechanics.excitation import Excitation
from sindyjoint.mechanics.laws import Law
from sindyjoint.mechanics.stickslip import simulate
from sindyjoint.numeric import Array, rms
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


def steady_start(
    law: Law, excitation: Excitation, start: Array, reach: tuple[float, float], **options: Any
) -> tuple[Array, Array]:
    """Return angle and rate, and internal states, at the first instant of a period once the motion is steady.

    Parameters
    ----------
    law : Law
    excitation : Excitation
        That repeats.
    start : ndarray, shape (2,)
        Angle and rate as measured, rad and rad/s.
    reach : pair of float
        Angles that end the simulation. What the noise of a start makes of the first period is not the law's.
    **options
        Of :func:`~sindyjoint.mechanics.stickslip.simulate`.
    """
    nodes = len(excitation.pieces)
    rate = 1 / excitation.step
    options = options | {"limits": reach}
    settled = simulate(law, excitation, (SETTLED * nodes + 1) / rate, rate, initial=start, **options)
    return np.array([settled.angle[-1], settled.rate[-1]]), settled.state[:, -1]


def fitted_start(
    law: Law,
    excitation: Excitation,
    measured: Array,
    sample_rate: float,
    start: Array,
    size: Array,
    **options: Any,
) -> Array:
    """Return the angle and rate from which a simulation comes nearest to some measured angles.

    Parameters
    ----------
    law : Law
    excitation : Excitation
        Moment from the first of these samples on.
    measured : ndarray, shape (n,)
        Angles, rad.
    sample_rate : float
        Hz.
    start : ndarray, shape (2,)
        First guess, rad and rad/s.
    size : ndarray, shape (2,)
        RMS of angle and rate over the run: how far a start may lie from the guess is a share of it.
    **options
        Of :func:`~sindyjoint.mechanics.stickslip.simulate`.
    """
    from scipy.optimize import least_squares

    bound, found = POLICY.initial_range, np.zeros(2)
    for share in STAGES:
        count = min(max(round(share * measured.size), POLICY.fewest_initial), measured.size)

        def residual(x: Array, count: int = count) -> Array:
            try:
                motion = simulate(
                    law, excitation, count / sample_rate, sample_rate, initial=start + size * x, **options
                )
            except SimulationError:
                return np.full(count, FAR_OFF)
            return (motion.angle - measured[:count]) / size[0]

        def jacobian(x: Array, at: Any = residual) -> Array:
            here = at(x)
            return np.column_stack([(at(x + step) - here) / STEP for step in STEP * np.eye(2)])

        found = np.asarray(least_squares(residual, found, jacobian, bounds=(-bound, bound)).x)
    return start + size * found
