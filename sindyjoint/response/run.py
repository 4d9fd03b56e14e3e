"""Simulated against measured response of one run: the angle under the moment, or the moment of the motion."""

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import lru_cache
from typing import Any, Literal, TypeVar

import numpy as np

from sindyjoint.errors import InputError, SimulationError
from sindyjoint.limits import RESPONSE, STATES
from sindyjoint.measurement import WIDEST, signal_end
from sindyjoint.mechanics import Law
from sindyjoint.mechanics.excitation import Excitation, repeated, sampled
from sindyjoint.mechanics.stickslip import (
    Motion,
    brought_from_rest,
    internal_states,
    simulate,
    slip_direction,
)
from sindyjoint.numeric import Array, Booleans, Integers, convolve, rms, smoothing_kernels
from sindyjoint.record import Run
from sindyjoint.response.drive import (
    Drive,
    choose_drive,
    cycle_of,
    fitted_start,
    internal_size,
    simulate_segments,
    start_on_parabola,
    steady_start,
)
from sindyjoint.response.laws import LawInRun
from sindyjoint.states import ForceStates, force_states, rate_limit, without_noise_travel

# Length of a multiple-shooting segment where the joint has no restoring moment, s.
WINDOW = 1.0
# Steps of internal states along a measured motion: most in a sample, and enough in a cycle to place a reversal.
SUBSTEPS, IN_A_CYCLE = 8, 500
# Measured moments are noisy on the grid of their samples: a smaller tolerance would resolve noise.
RTOL = 1e-6

Simulated = TypeVar("Simulated")


@dataclass(frozen=True, eq=False)
class SimulatedRun:
    """A run and its simulation, sample by sample over the compared span.

    Parameters
    ----------
    run : str
    drive : {"moment", "windows", "motion", "free run"}
        The measured moment moves the joint; the same, restarted from the measured state every so many seconds; the
        measured motion gives the moment; or the measured moment from a state estimated on the first samples.
    sample_rate : float
        Hz.
    frequency : float or None
        Excitation frequency, Hz.
    time : ndarray, shape (n,)
        s, from the first sample of the run.
    angle, moment : ndarray, shape (n,)
        As measured, rad and N·m (m and N).
    simulated_angle : ndarray, shape (n,), or None
        ``None`` where the motion is the drive, or the simulation failed.
    simulated_rate : ndarray, shape (n,), or None
    simulated_moment : ndarray, shape (n,)
        At the sensor, of the law along the measured motion.
    states : ForceStates
        Measured force states over the same span.
    inertia : float
    failure : str
        What ended the simulation; empty where it reached the end.
    """

    run: str
    drive: Drive
    sample_rate: float
    frequency: float | None
    time: Array
    angle: Array
    moment: Array
    simulated_angle: Array | None
    simulated_rate: Array | None
    simulated_moment: Array
    states: ForceStates
    inertia: float
    failure: str = ""

    @property
    def channel(self) -> Literal["angle", "moment"]:
        """What the response is."""
        return "moment" if self.drive == "motion" else "angle"

    @property
    def measured_response(self) -> Array:
        """What the simulation is to predict: the angle, or for a prescribed motion the moment."""
        return self.moment if self.drive == "motion" else self.angle

    @property
    def simulated_response(self) -> Array | None:
        """Its prediction; ``None`` where the simulation failed."""
        if self.drive == "motion":
            return None if self.failure else np.where(self._slides, self.simulated_moment, self.moment)
        return self.simulated_angle

    @property
    def _slides(self) -> Booleans:
        """Where the motion says which moment friction has: it holds any while the joint sticks, and on a reversal."""
        rate = self.states.rate
        return np.abs(rate) > rate_limit(rate, self.states.noise.rate, STATES.periodic_rate_share)

    @property
    def response_scale(self) -> float:
        """RMS of the measured response about its mean, rad (m); of a prescribed motion :attr:`moment_scale`."""
        return self.moment_scale if self.drive == "motion" else float(np.std(self.angle))

    @property
    def response_nrmse(self) -> float:
        """RMS of the response's error relative to :attr:`response_scale`; NaN if the simulation failed."""
        simulated = self.simulated_response
        if simulated is None:
            return float("nan")
        once = self.drive == "motion" and self.states.method == "broadband" and self.inertia > 0
        if self.states.method == "path" or once:
            # At a reversal a mean over both branches is no moment of either; friction jumps there, and noise says when.
            return self.moment_nrmse
        error = simulated - self.measured_response
        if self.drive == "motion":
            error = error[self._slides]
        return rms(error) / self.response_scale

    @property
    def moment_nrmse(self) -> float:
        """The same of the moment along the measured motion, over moving samples, relative to :attr:`moment_scale`."""
        return rms((self.simulated_moment - self.moment)[self.states.moving]) / self.moment_scale

    @property
    def moment_scale(self) -> float:
        """RMS of the moment, N·m; see :func:`moment_scale`."""
        return moment_scale(self.moment, self.states, self.inertia)

    @property
    def response_floor(self) -> float:
        """Noise of the measured response, relative like :attr:`response_nrmse`."""
        if self.drive == "motion":
            return self.moment_floor
        return self.states.noise.angle / float(np.std(self.angle))

    @property
    def moment_floor(self) -> float:
        """Noise of moment and acceleration, relative like :attr:`moment_nrmse`."""
        noise = self.states.noise
        return float(np.hypot(noise.moment, self.inertia * noise.acceleration)) / self.moment_scale


def moment_scale(moment: Array, states: ForceStates, inertia: float) -> float:
    """Return the RMS of the moment, N·m: at the sensor or in the joint, whichever is larger.

    A free decay has no moment at the sensor.
    """
    return max(rms(moment), rms(states.transfer_moment(inertia)))


def pooled_nrmse(errors: Sequence[tuple[str, float, float]]) -> float:
    """Return the error of several runs together: RMS of all errors over RMS of all responses.

    Parameters
    ----------
    errors : sequence of (str, float, float)
        Of each run what the response is, the NRMSE and the RMS that it is relative to. Angles and moments are pooled
        apart, and then by their number of runs. NaN without any.
    """
    kinds = {kind for kind, _, _ in errors}
    total = 0.0
    for kind in kinds:
        own = np.array([(error, scale) for each, error, scale in errors if each == kind])
        total += len(own) * float(np.sum((own[:, 0] * own[:, 1]) ** 2) / max(np.sum(own[:, 1] ** 2), 1e-300))
    return float(np.sqrt(total / len(errors))) if errors else float("nan")


def simulate_run(
    law: Law,
    run: Run,
    states: ForceStates | None = None,
    *,
    drive: Drive | None = None,
    window: float | None = WINDOW,
    free_run: int | None = None,
    substeps: int = SUBSTEPS,
    response_only: bool = False,
    **options: Any,
) -> SimulatedRun:
    """Simulate a law against a measured run.

    The simulation starts where the force states begin, after the start-up transient: of a run that repeats in its
    steady state, of another from the angle and rate with which the law follows its first cycle best. The first period
    of a periodic run is simulated and not compared. A free run starts at the first sample of the run, from the state
    (internal states, too) with which the law follows the first ``free_run`` samples best, and all others are compared.

    Parameters
    ----------
    law : Law
    run : Run
    states : ForceStates, optional
        Of the run; made here if not given.
    drive : {"moment", "windows", "motion"}, optional
        Default: :func:`choose_drive`.
    window : float or None
        Length of a multiple-shooting segment, s, for ``"windows"``; None: see :func:`window_of`.
    free_run : int, optional
        Samples to which the initial state is fitted, from which the run is simulated without restart. Where the motion
        is the drive, or inputs move the law within the run, they are only not compared.
    substeps : int
        Most steps of the internal states per sample along the measured motion.
    response_only : bool
        Leave out the moment along the measured motion where that is not the response and nothing starts from it.
    **options
        Of :func:`sindyjoint.mechanics.stickslip.simulate`, such as ``limits`` and ``rtol``.

    Returns
    -------
    SimulatedRun
        A simulation that leaves the law's range is a result, too: ``failure`` holds its message.

    Raises
    ------
    InputError
        For a free run from samples that are too few, or leave too little of the run.
    """
    states = force_states(run) if states is None else states
    drive = choose_drive(law, states) if drive is None else drive
    span = span_of(run, states)
    first = span.start + settling(states)
    if free_run is None:
        run = averaged(run, states)
    else:
        _check_samples(run, free_run, span.stop)
        drive = "motion" if drive == "motion" or not law.inertia > 0 else "free run"
        first = max(free_run, span.start)
    kept = slice(free_run, run.n_samples) if drive == "free run" else slice(first, span.stop)
    angle = rate = None
    failure, moment, inner = "", np.full(states.n_samples, np.nan), np.empty((0, 1))
    try:
        if response_only and drive == "moment" and (states.method == "periodic" or states.repeated):
            inner = brought_from_rest(law, states.angle, states.rate, rest_of(states))[:, None]
        else:
            moment, inner = along_motion(law, states, run.sample_rate, substeps)
        if drive != "motion":
            motion = simulate_motion(law, run, states, drive, window, kept.start, inner, options)
            angle, rate = (signal[-(kept.stop - kept.start) :] for signal in (motion.angle, motion.rate))
    except SimulationError as error:
        failure = str(error)
    at = np.clip(np.arange(kept.start, kept.stop) - span.start, 0, states.n_samples - 1)
    return SimulatedRun(
        run=run.name,
        drive=drive,
        sample_rate=run.sample_rate,
        frequency=states.frequency,
        time=run.time[kept],
        angle=run.angle[kept],
        moment=run.moment[kept],
        simulated_angle=angle,
        simulated_rate=rate,
        simulated_moment=moment[at],
        states=cut_states(states, kept.start - span.start, kept.stop - span.start),
        inertia=law.inertia,
        failure=failure,
    )


def attempted(simulate: Callable[[Any], Simulated], subject: Any) -> tuple[Simulated | None, str]:
    """Return what a simulation gives, and nothing to be said; or none of it, and why it failed."""
    try:
        return simulate(subject), ""
    except SimulationError as error:
        return None, str(error)


def _check_samples(run: Run, samples: int, end: int) -> None:
    most = end - 2 * RESPONSE.fewest_initial
    if not RESPONSE.fewest_initial <= samples <= most:
        raise InputError(
            f"{run.label}: free_run is {samples} samples; expected {RESPONSE.fewest_initial} to {most}: the initial "
            "state is estimated from them, and something must be left to compare"
        )


def window_of(states: ForceStates, window: float | None = None) -> float:
    """Return the length of a multiple-shooting segment, s: a mean cycle of the motion, at least :data:`WINDOW`.

    A friction that changes a little moves a joint that nothing pulls back for good: from one segment to the next that
    drift is free. Shorter than a cycle, segments would also free what friction does in either direction.
    """
    return max(WINDOW, cycle_of(states)) if window is None else window


def span_of(run: Run, states: ForceStates) -> slice:
    """Return the samples of a run that its states are of."""
    first = round(states.time[0] * run.sample_rate)
    return slice(first, first + states.n_samples)


def averaged(run: Run, states: ForceStates) -> Run:
    """Return a run whose samples in the span of its states are the mean of its periods, where these are."""
    if not states.repeated:
        return run
    span, size = span_of(run, states), states.n_samples
    end = span.start + (run.n_samples - span.start) // size * size
    angle, moment = run.angle.copy(), run.moment.copy()
    for values in (angle, moment):
        values[span] = values[span.start : end].reshape(-1, size).mean(axis=0)
    return replace(run, source=None, angle=angle, moment=moment)


def along_motion(
    law: Law, states: ForceStates, sample_rate: float, substeps: int = SUBSTEPS
) -> tuple[Array, Array]:
    """Return moment and internal states of a law along measured states, from the start of the record on."""
    before = (np.empty(0), np.empty(0)) if states.lead is None else states.lead
    size = before[0].size
    angle, rate = (
        np.concatenate([early, late]) for early, late in zip(before, (states.angle, states.rate), strict=True)
    )
    still = without_noise_travel(states, angle, rate, 1 / sample_rate) if law.n_states else (angle, rate)
    fastest = states.frequency or states.bandwidth
    substeps = max(1, min(substeps, math.ceil(IN_A_CYCLE * fastest / sample_rate)))
    inner = internal_states(
        law, still[0], still[1], sample_rate, substeps=substeps, rest=rest_of(states), held=released(states)
    )
    moment = law.moment(angle, rate, slip_direction(rate), inner)[size:] + law.inertia * states.acceleration
    return moment + (law.added if isinstance(law, LawInRun) else 0.0), inner[:, size:]


def followed_motion(states: ForceStates) -> tuple[Array, Array]:
    """Return the angle and rate that internal states follow: as measured, but straight while the joint sticks."""
    return without_noise_travel(states, states.angle, states.rate, 1 / states.sample_rate)


def released(states: ForceStates) -> bool:
    """Return whether states begin where a free motion was held."""
    free = states.method == "broadband" and not states.repeated and np.ptp(states.moment) == 0
    return bool(free and states.lead is None and states.time[0] < states.dropped + 0.5 / states.sample_rate)


def rest_of(states: ForceStates) -> float:
    """Return the angle from which a run brings its sliders, rad: they are in their middle there.

    One that never yields shows it ever after. Of a driven motion that does not repeat it is the first angle, where the
    record begins at rest; of any other the mean, about which loops that fade leave a slider.
    """
    repeats = states.method == "periodic" or states.repeated
    early = states.lead if states.lead is not None and states.lead[0].size else (states.angle, states.rate)
    # Of the largest rate: one that is smaller is no motion.
    at_rest = abs(early[1][0]) < 0.05 * float(np.max(np.abs(states.rate)))
    if at_rest and not repeats and np.ptp(states.moment) > 0:
        return float(early[0][0])
    return float(np.mean(states.angle))


def remembered(law: Law, states: ForceStates) -> Integers:
    """Return the internal states that the whole of a motion leaves where something before it brought them.

    A slider that does not yield in a run keeps what a start-up or a larger motion left. The motion is taken a tenth
    smaller: limits of sliders are not known better before a fit.
    """
    if not law.n_states:
        return np.empty(0, dtype=np.intp)
    angle, rate = (0.9 * each for each in followed_motion(states))
    ends = (float(np.mean(angle)) + side * float(np.ptp(angle)) for side in (-1, 1))
    one, other = (internal_states(law, angle, rate, states.sample_rate, rest=end) for end in ends)
    apart = np.abs(one - other)
    return np.flatnonzero(apart[:, -1] > 0.01 * apart[:, 0])


def settling(states: ForceStates) -> int:
    """Return the samples of the first period of a periodic run that has periods to spare."""
    if states.method != "periodic" or states.frequency is None:
        return 0
    period = round(states.sample_rate / states.frequency)
    return period if states.n_samples >= 3 * period else 0


def cut_states(states: ForceStates, first: int, end: int | None = None) -> ForceStates:
    """Return the states of some samples; beyond those that are known nothing moves."""
    if first == 0 and end in (None, states.n_samples):
        return states
    wanted = np.arange(first, states.n_samples if end is None else end)
    at = np.clip(wanted, 0, states.n_samples - 1)
    names = ("angle", "rate", "acceleration", "moment", "block")
    return replace(
        states,
        replicate=None,
        time=states.time[0] + wanted / states.sample_rate,
        moving=states.moving[at] & (at == wanted),
        inputs={name: values[at] for name, values in states.inputs.items()},
        **{name: getattr(states, name)[at] for name in names},
    )


def angle_limits(law: Law, states: ForceStates, drive: Drive) -> Any:
    """Return the angles that end a simulation.

    The softening limit; where the measured motion passes it, or under multiple shooting, three times the
    measured range. A stiffening law whose damping is negative has no such limit and swings ever wider and faster:
    it ends :attr:`~ResponsePolicy.runaway` ranges outside of the measured one.
    """
    if drive == "free run":
        drive = choose_drive(law, states)
        if drive != "moment":
            # What nothing pulls back may drift as far as it will: that is what a free run is to show.
            return (-np.inf, np.inf)
    low, high = law.softening_limit
    least, most = float(np.min(states.angle)), float(np.max(states.angle))
    reach = most - least
    if drive == "moment" and low < least and most < high:
        away = RESPONSE.runaway * reach
        return (
            low if np.isfinite(low) else least - away,
            high if np.isfinite(high) else most + away,
        )
    return (least - reach, most + reach)


# Cut-off for a moment, in parts of where it ends: a kernel falls from 0.8 of that on, and shall take nothing of it.
BEYOND = 1.5


def above_noise(moment: Array, sample_rate: float) -> Array:
    """Return a moment low-passed where it ends in white noise; as it is where it has no such end.

    Noise above acts on a joint as a dither: it smooths the friction's step, and the fit makes up by more friction.
    """
    end = signal_end(moment, sample_rate)
    kernel = smoothing_kernels(BEYOND * end.bandwidth, sample_rate)[0]
    half = kernel.size // 2
    if not end.flat or half >= moment.size or BEYOND * end.bandwidth > WIDEST * sample_rate:
        return moment
    return convolve(np.pad(moment, half, mode="reflect", reflect_type="odd"), kernel)


@lru_cache(maxsize=1)
def measured_drive(run: Run, states: ForceStates) -> Excitation:
    """Return the measured moment over the span of the states as an excitation.

    A run that repeats is driven by the mean of its periods: its response repeats, too, so noise of the moment
    channel does not belong in the simulation. Any other by what of the moment stands out of that noise.
    """
    moment = run.moment[span_of(run, states)]
    if states.method != "periodic" or states.frequency is None:
        return sampled(above_noise(moment, run.sample_rate), run.sample_rate)
    per = run.sample_rate / states.frequency
    nodes, periods = round(per), int((moment.size - 1) / per + 1e-9)
    positions = (np.arange(periods)[:, None] + np.arange(nodes) / nodes) * per
    return repeated(sampled(moment, 1.0)(positions).mean(axis=0), 1 / states.frequency)


def simulate_motion(
    law: Law,
    run: Run,
    states: ForceStates,
    drive: Drive,
    window: float | None,
    first: int,
    inner: Array,
    options: dict[str, Any],
) -> Motion:
    """Simulate the joint under the measured moment, from internal states along the measured motion.

    ``first`` is the first compared sample of the run.
    """
    options = {"rtol": RTOL, "limits": angle_limits(law, states, drive), **options}
    span, rate = span_of(run, states), run.sample_rate
    if drive == "windows":
        start = np.column_stack([states.angle, states.rate])
        options = {"initial_state": inner, **options}
        return simulate_segments(
            law, run.moment[span], rate, window_of(states, window), start, interpolation="cubic", **options
        )
    excitation = (
        repeated(states.moment, states.n_samples / rate) if states.repeated else measured_drive(run, states)
    )
    start, z = np.array([states.angle[0], states.rate[0]]), options.pop("initial_state", inner[:, 0])
    # What the noise of a start, or a search for it, makes of the first cycle is not the law's.
    around = options | {"limits": angle_limits(law, states, "windows")}
    if excitation.periodic and drive == "moment":
        # Many internal states settle in a period; a slider that never yields keeps where it began.
        start, z = steady_start(
            law, excitation, start, np.array(z), remembered(law, states), states, **around
        )
    else:
        size = np.array([np.std(states.angle), rms(states.rate), *np.zeros(law.n_states)])
        # A start is known little better by what comes after a cycle.
        used = max(round(cycle_of(states) * rate), RESPONSE.fewest_initial)
        if drive == "free run":
            span, used, excitation = slice(0, run.n_samples), first, sampled(run.moment, rate)
            start, size[2:] = start_on_parabola(run, states, first), internal_size(law, inner)
            z = brought_from_rest(law, run.angle[:1], states.rate, rest_of(states))
        found = np.concatenate([start, np.broadcast_to(z, law.n_states)])
        noise = states.noise.angle / size[0]
        found = fitted_start(law, excitation, run.angle[span][:used], rate, found, size, noise, **around)
        start, z = found[:2], found[2:]
    duration = (span.stop - span.start) / rate
    return simulate(law, excitation, duration, rate, initial=start, initial_state=z, **options)
