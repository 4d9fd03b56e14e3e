"""A run simulated under its measured moment without restart, from a state estimated on its first samples."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from sindyjoint.errors import InputError, SimulationError
from sindyjoint.mechanics.excitation import sampled
from sindyjoint.mechanics.laws import Law
from sindyjoint.mechanics.stickslip import Motion, simulate, transfer_moment
from sindyjoint.numeric import Array
from sindyjoint.record import Run
from sindyjoint.response.drive import choose_drive
from sindyjoint.response.policy import POLICY
from sindyjoint.response.run import RTOL, SimulatedRun, angle_limits, cut_states, rest_of, span_of
from sindyjoint.states import ForceStates, force_states

# Step of the differences by an initial angle or rate, in RMS of the signal.
STEP = 1e-4


def free_run_states(run: Run) -> ForceStates:
    """Return the force states of all of a run, whether it repeats or not."""
    return force_states(run, "broadband")


def simulate_free(law: Law, run: Run, states: ForceStates, samples: int, by_motion: bool) -> SimulatedRun:
    """Simulate a run without restart from a state estimated from its first samples, and compare the rest.

    Internal states of the law settle along the first half of these samples; angle and rate where the second half
    begins are those whose simulation comes nearest to the angles of that half. A law without internal states has the
    whole of them for that. Where the motion is the drive, there is nothing to estimate but internal states.

    Parameters
    ----------
    law : Law
        Of these states: moments of one test depend on the time at which they begin.
    run : Run
    states : ForceStates
        :func:`free_run_states` of the run.
    samples : int
        From which the initial state is estimated.
    by_motion : bool
        Whether the motion was the drive, whatever the joint's inertia is.

    Returns
    -------
    SimulatedRun
        From the first sample after them to the end of the states.

    Raises
    ------
    InputError
        For samples that are too few, or leave too little of the run.
    """
    first = span_of(run, states).start
    settled = samples - first  # samples of the states that the initial state may use
    _check_samples(run, samples, first, states.n_samples)
    motion_drives = by_motion or not law.inertia > 0
    failure, moment, motion = "", np.full(states.n_samples, np.nan), None
    begin = settled // 2 if law.n_states else 0
    try:
        moment, internal = transfer_moment(
            law, states.angle, states.rate, run.sample_rate, acceleration=states.acceleration,
            rest=rest_of(states),
        )  # fmt: skip
        if not motion_drives:
            motion = _simulate_from(law, run, states, begin, settled, internal[:, begin])
    except SimulationError as error:
        failure = str(error)
    kept = slice(first + settled, first + states.n_samples)
    return SimulatedRun(
        run=run.name,
        drive="motion" if motion_drives else "free run",
        sample_rate=run.sample_rate,
        frequency=run.frequency,
        time=run.time[kept],
        angle=run.angle[kept],
        moment=run.moment[kept],
        simulated_angle=None if motion is None else motion.angle[settled - begin :],
        simulated_rate=None if motion is None else motion.rate[settled - begin :],
        simulated_moment=moment[settled:],
        states=cut_states(states, settled),
        inertia=law.inertia,
        failure=failure,
    )


def _check_samples(run: Run, samples: int, first: int, known: int) -> None:
    least = first + 2 * POLICY.fewest_initial
    most = first + known - 2 * POLICY.fewest_initial
    if not least <= samples <= most:
        raise InputError(
            f"{run.label}: free_run is {samples} samples; expected {least} to {most}: the motion is known from sample "
            f"{first} on, and something must be left to compare"
        )


def _simulate_from(law: Law, run: Run, states: ForceStates, begin: int, end: int, internal: Array) -> Motion:
    """Return the motion from sample ``begin`` of the states to their end, its start fitted on those up to ``end``."""
    span = span_of(run, states)
    stretch = slice(span.start + begin, span.stop)
    moment, measured = run.moment[stretch], run.angle[stretch]
    drive = choose_drive(law, states)
    # What nothing pulls back may drift as far as it will: that is what a free run is to show.
    limits = angle_limits(law, states, drive) if drive == "moment" else None
    size = np.array([np.std(states.angle), np.sqrt(np.mean(states.rate**2))])
    start = np.array([states.angle[begin], states.rate[begin]])
    excitation = sampled(moment, run.sample_rate)

    def motion(x: Array, count: int) -> Motion:
        return simulate(
            law, excitation, count / run.sample_rate, run.sample_rate, initial=start + size * x,
            initial_state=internal, limits=limits, rtol=RTOL,
        )  # fmt: skip

    count = end - begin

    def residual(x: Array) -> Array:
        return (motion(x, count).angle - measured[:count]) / size[0]

    return motion(_best_start(residual), measured.size)


def _best_start(residual: Callable[[Array], Array]) -> Array:
    """Return the correction of the measured angle and rate, in their RMS, with the smallest sum of squares."""
    from scipy.optimize import least_squares

    def jacobian(x: Array) -> Array:
        at = residual(x)
        return np.column_stack([(residual(x + step) - at) / STEP for step in STEP * np.eye(2)])

    bound = POLICY.initial_range
    return np.asarray(least_squares(residual, np.zeros(2), jacobian, bounds=(-bound, bound)).x)
