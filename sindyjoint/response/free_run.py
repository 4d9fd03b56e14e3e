"""A run simulated under its measured moment without restart, from a state estimated on its first samples."""

from __future__ import annotations

import numpy as np

from sindyjoint.errors import InputError, SimulationError
from sindyjoint.mechanics.excitation import sampled
from sindyjoint.mechanics.laws import Law
from sindyjoint.mechanics.stickslip import brought_from_rest, simulate, transfer_moment
from sindyjoint.numeric import Array, rms
from sindyjoint.record import Run
from sindyjoint.response.drive import choose_drive
from sindyjoint.response.policy import POLICY
from sindyjoint.response.run import RTOL, SimulatedRun, angle_limits, cut_states, rest_of, span_of
from sindyjoint.response.start import cycle_of, fitted_start
from sindyjoint.states import ForceStates, force_states


def free_run_states(run: Run) -> ForceStates:
    """Return the force states of all of a run, whether it repeats or not."""
    return force_states(run, "broadband")


def simulate_free(law: Law, run: Run, states: ForceStates, samples: int, by_motion: bool) -> SimulatedRun:
    """Simulate a run without restart from a state estimated from its first samples, and compare the rest.

    Angle and rate at the first sample are those whose simulation comes nearest to the angles of all these samples.
    Internal states of a law settle along the first half of these samples where their motion is known, and the others
    tell angle and rate. Where the motion is the drive, there is nothing to estimate but internal states.

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
        From the first sample after them at which the force states are known to the last.

    Raises
    ------
    InputError
        For samples that are too few, or leave too little of the run.
    """
    first = span_of(run, states).start
    _check_samples(run, samples, first + states.n_samples)
    skip = max(samples - first, 0)  # samples of the states that are not compared
    motion_drives = by_motion or not law.inertia > 0
    failure, moment, simulated = "", np.full(states.n_samples, np.nan), None
    try:
        moment, internal = transfer_moment(
            law, states.angle, states.rate, run.sample_rate, acceleration=states.acceleration,
            rest=rest_of(states),
        )  # fmt: skip
        if not motion_drives:
            # Internal states settle along a motion that is known: where there is enough of it.
            settles = law.n_states > 0 and skip >= 4 * POLICY.fewest_initial
            begin = skip // 2 if settles else None
            simulated = _simulate_from(law, run, states, begin, samples, internal)
    except SimulationError as error:
        failure = str(error)
    kept = slice(first + skip, first + states.n_samples)
    return SimulatedRun(
        run=run.name,
        drive="motion" if motion_drives else "free run",
        sample_rate=run.sample_rate,
        frequency=run.frequency,
        time=run.time[kept],
        angle=run.angle[kept],
        moment=run.moment[kept],
        simulated_angle=None if simulated is None else simulated[0][kept],
        simulated_rate=None if simulated is None else simulated[1][kept],
        simulated_moment=moment[skip:],
        states=cut_states(states, skip),
        inertia=law.inertia,
        failure=failure,
    )


def _check_samples(run: Run, samples: int, end: int) -> None:
    most = end - 2 * POLICY.fewest_initial
    if not POLICY.fewest_initial <= samples <= most:
        raise InputError(
            f"{run.label}: free_run is {samples} samples; expected {POLICY.fewest_initial} to {most}: angle and rate "
            "are estimated from them, and something must be left to compare"
        )


def _simulate_from(
    law: Law, run: Run, states: ForceStates, begin: int | None, end: int, internal: Array
) -> tuple[Array, Array]:
    """Return angle and rate at every sample of a run, its start fitted on those up to ``end``, the law held.

    It starts at sample ``begin`` of the states, before which angle and rate are not a number; without one at the first
    sample of the run, where a straight line through an eighth of a cycle
    is the first guess.
    """
    first = span_of(run, states).start
    size = np.array([np.std(states.angle), rms(states.rate)])
    if begin is None:
        place = 0
        straight = min(end, max(POLICY.fewest_initial, round(cycle_of(states) / 8 * run.sample_rate)))
        slope, angle = np.polyfit(np.arange(straight) / run.sample_rate, run.angle[:straight], 1)
        start = np.array([angle, slope])
        inner = brought_from_rest(law, run.angle[:1], states.rate, rest_of(states)) if law.n_states else None
    else:
        place, inner = first + begin, internal[:, begin]
        start = np.array([states.angle[begin], states.rate[begin]])
    drive = choose_drive(law, states)
    # What nothing pulls back may drift as far as it will: that is what a free run is to show.
    limits = angle_limits(law, states, drive) if drive == "moment" else None
    excitation = sampled(run.moment[place:], run.sample_rate)
    options = {"initial_state": inner, "limits": limits, "rtol": RTOL}
    start = fitted_start(law, excitation, run.angle[place:end], run.sample_rate, start, size, **options)
    motion = simulate(
        law, excitation, (run.n_samples - place) / run.sample_rate, run.sample_rate, initial=start, **options
    )
    before = np.full(place, np.nan)
    return np.concatenate([before, motion.angle]), np.concatenate([before, motion.rate])
