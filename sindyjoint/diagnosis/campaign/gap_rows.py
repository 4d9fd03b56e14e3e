"""The gap between a model and a measurement, row by row, in units of its own noise.

A periodic run is folded onto one mean period. What the fold cannot repeat is noise of the moment; noise of the angle
enters through the series of harmonics, each of which is uncertain by its own standard error. Both are known, so the
rows of a run have a known covariance, Σ = σ²I + B S Bᵀ with B the moment that an error of each harmonic makes, and
multiplying by the inverse of its Cholesky factor gives rows of independent unit noise: sums of squares are then
likelihoods (linearised errors in variables; Fuller, Measurement Error Models, 1987, section 1.4).
"""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from sindyjoint.diagnosis.campaign import (
    Band,
    GapRun,
    HalfCycles,
    folded_whitener,
    kernel_noise_factor,
    reversals,
)
from sindyjoint.diagnosis.effects.setup import MeasuredMotion
from sindyjoint.diagnosis.policy import CAMPAIGN, DiagnosisPolicy
from sindyjoint.equation.formula import VARIABLES, compile_terms
from sindyjoint.equation.model import JointModel
from sindyjoint.mechanics.stickslip import APPROACH
from sindyjoint.numeric import Array
from sindyjoint.response.run import released, rest_of, settling
from sindyjoint.states import ForceStates, rate_limit, smoothing_kernels, without_noise_travel

FEWEST_PHASES = 12
STRETCH = 150
LEAST_NOISE = 1e-6


def gap_runs(
    states: Sequence[ForceStates],
    model: JointModel,
    groups: Sequence[str],
    policy: DiagnosisPolicy = CAMPAIGN,
    errors: Sequence[float] | None = None,
    free: bool = False,
    most: int = 16_000,  # rows, of all runs together
) -> tuple[GapRun, ...]:
    """Return the rows of every run.

    Parameters
    ----------
    states : sequence of ForceStates
    model : JointModel
        Its slopes carry errors of the angle into the moment.
    groups : sequence of str
        What is held out together, one label per run.
    policy : DiagnosisPolicy
    errors : sequence of float, optional
        Error of the model itself per run, N·m, which counts as noise where repetition has not measured that.
    free : bool
        Whether the runs are free motion: rows are then made of half-cycles, where there are enough of them.
    most : int
        Rows of all runs together, about.
    """
    samples = sum(s.n_samples for s in states)
    # The processing itself errs (truncated series, folded phases); below that nothing is claimed.
    least = policy.processing_error * model.fitted.moment_rms
    return tuple(
        _folded(s, model, g, least)
        if s.method == "periodic"
        else (free and _free_decay(s, model, g, policy))
        or _strided(s, model, g, float(np.hypot(least, error)), most * s.n_samples // samples)
        for s, g, error in zip(states, groups, errors or [0.0] * len(states), strict=True)
    )


def _folded(states: ForceStates, model: JointModel, group: str, error: float) -> GapRun:
    """Fold a periodic run onto one mean period and whiten it."""
    assert states.frequency is not None
    motion, moment, count = _mean_period(states, model, 240)
    keep, size = motion.keep, motion.angle.size
    sigma = np.sqrt(states.noise.moment**2 / np.maximum(count, 1)[keep] + error**2)
    factor = folded_whitener(states, model, motion, sigma, np.arange(size)[keep] / size)
    target = moment[keep] - (model.joint.inertia or 0.0) * motion.acceleration[keep]
    return GapRun(states.run, group, states.level, motion, target, factor, True)


def _mean_period(
    states: ForceStates, model: JointModel, phases: int
) -> tuple[MeasuredMotion, Array, NDArray[np.intp]]:
    """Return motion and moment of the mean period of a run, and how many samples each phase has."""
    assert states.frequency is not None
    # An internal state has not settled in the first period: what is averaged over periods is what repeats.
    settled = np.arange(states.n_samples) >= (0 if states.dropped else settling(states))
    phases = min(phases, int(states.sample_rate / states.frequency))
    position = (states.time - states.time[0]) * states.frequency % 1.0
    # Samples that fall alike in every period are to lie in the middle of a bin, not on the border of two.
    bins = np.floor(position * phases + 0.5).astype(int) % phases
    bins = bins[settled]
    count = np.bincount(bins, minlength=phases)
    filled = np.maximum(count, 1)

    def mean(signal: Array) -> Array:
        return np.bincount(bins, signal[settled], phases) / filled

    angle, rate, acceleration, moment = map(
        mean, (states.angle, states.rate, states.acceleration, states.moment)
    )
    empty = np.flatnonzero(count == 0)
    if empty.size:
        full = np.flatnonzero(count)
        angle, rate, acceleration, moment = (
            np.interp(np.arange(phases), full, s[full], period=phases)
            for s in (angle, rate, acceleration, moment)
        )
    keep = _always(mean(states.moving.astype(float)), count > 0)
    # What repeats is as it is in the middle of its stretch, at every phase.
    time = np.full(phases, np.mean(states.time))
    step = 1 / (states.frequency * phases)
    motion = _motion(states, model, (angle, rate, acceleration), step, keep, True)
    inputs = {name: mean(values) for name, values in states.inputs.items()}
    # The steps of a mean period, coarser than samples, are cut into this many where internal states are integrated.
    motion = replace(motion, time=time, substeps=3, inputs=inputs)
    return motion, moment, count


def _always(share: Array, seen: NDArray[np.bool_]) -> NDArray[np.intp]:
    """Return the phases in which the joint moves in every period, or those nearest to that where there are too few."""
    keep = np.flatnonzero((share == 1) & seen)
    if keep.size >= FEWEST_PHASES:
        return keep
    return np.sort(np.argsort(-np.where(seen, share, -1.0), kind="stable")[:FEWEST_PHASES])


def _strided(states: ForceStates, model: JointModel, group: str, error: float, most: int) -> GapRun:
    """Take evenly spaced moving samples of a run that does not repeat, and whiten them.

    The smoothed motion holds nothing above its bandwidth; the moment, which is not filtered, holds little above twice.
    """
    every = _stride(states)
    rows = _stretches(np.flatnonzero(states.moving[::every]), most)
    moments, motion = _strided_motion(states, model, rows)
    record = np.where(states.moving[::every], moments, np.nan)
    sigma = np.full(rows.size, float(np.hypot(states.noise.moment, error)))
    factor, variance = (
        (sigma[None], sigma**2)
        if states.method == "path"
        else kernel_noise_factor(states, model, motion, rows * every, sigma)
    )
    noise = max(float(np.mean(variance)) - error**2, 0.0)
    kernel = smoothing_kernels(states.bandwidth, states.sample_rate / every)[0]
    band = Band(kernel, rows) if model.inertia else None
    return GapRun(
        states.run,
        group,
        states.level,
        motion,
        moments[rows],
        factor,
        False,
        noise,
        band,
        record=record,
        noise_share=noise / float(np.mean(variance)),
    )


def _stride(states: ForceStates) -> int:
    # A run that does not repeat has five rows per period of its bandwidth.
    return max(1, int(states.sample_rate / (5 * states.bandwidth)))


def _strided_motion(
    states: ForceStates, model: JointModel, rows: NDArray[np.intp]
) -> tuple[Array, MeasuredMotion]:
    """Return the moments at every strided sample of a run, and its motion with some of them as rows."""
    every = _stride(states)
    step = every / states.sample_rate
    angle, rate, acceleration = (s[::every] for s in (states.angle, states.rate, states.acceleration))
    moments = states.moment[::every] - (model.joint.inertia or 0.0) * acceleration
    coarse = _motion(states, model, (angle, rate, acceleration), step, rows, states.repeated)
    # Internal states follow a motion that is interpolated within 1e-4 of its RMS.
    between = min(int(np.ceil(coarse.steps_to_follow(1e-4))), 8)
    if between > 1:
        from scipy.interpolate import CubicHermiteSpline

        jerk = np.gradient(acceleration, step)
        place = np.arange(angle.size)
        fine = np.arange(between * (angle.size - 1) + 1) / between
        angle, rate, acceleration = (
            CubicHermiteSpline(place, values, step * slope)(fine)
            for values, slope in ((angle, rate), (rate, acceleration), (acceleration, jerk))
        )
    keep = rows * between
    angle, rate = without_noise_travel(states, angle, rate, step / between)
    motion = _motion(states, model, (angle, rate, acceleration), step / between, keep, states.repeated)
    return moments, replace(motion, lead=_lead(states, step / between))


def _lead(states: ForceStates, step: float) -> tuple[Array, Array] | None:
    """Return the motion before the first sample, every ``step`` seconds: of what is released how it was brought there.

    And that it was held there for as long, in which what relaxes within a few cycles has relaxed.
    """
    if released(states):
        phase, way = np.linspace(0.0, np.pi, APPROACH), states.angle[0] - rest_of(states)
        held, speed = np.full(APPROACH, states.angle[0]), 0.5 * way * np.pi / (APPROACH * step)
        angle = np.concatenate([held - 0.5 * way * (1 + np.cos(phase)), held])
        return angle, np.concatenate([speed * np.sin(phase), np.zeros(APPROACH)])
    if states.lead is None:
        return None
    time = np.arange(-states.lead[0].size, 1) / states.sample_rate
    wanted = step * np.arange(-int(-time[0] / step), 0)
    angle, rate = (
        np.interp(wanted, time, np.append(before, now[0]))
        for before, now in zip(states.lead, (states.angle, states.rate), strict=True)
    )
    return without_noise_travel(states, angle, rate, step)


def along_replicate(run: GapRun, states: ForceStates, replicate: ForceStates, model: JointModel) -> GapRun:
    """Return the rows of a run made of the states of its synthetic replicate; weights are the run's own."""
    if run.folded:
        motion, moment, _ = _mean_period(replicate, model, run.motion.angle.size)
        target = moment - (model.joint.inertia or 0.0) * motion.acceleration
        return replace(run, motion=_as_counted(motion, run), target=target[motion.keep])
    every = _stride(states)
    rows = np.round((run.motion.time[run.motion.keep] - states.time[0]) * states.sample_rate / every).astype(
        int
    )
    moments, motion = _strided_motion(replicate, model, rows)
    motion = replace(motion, centre=run.motion.centre)
    return replace(run, motion=_as_counted(motion, run), target=moments[rows])


def _as_counted(motion: MeasuredMotion, run: GapRun) -> MeasuredMotion:
    """Return the motion of a replicate with the run's slopes where these are the secants of a zero error."""
    slope = run.motion.moment_slope
    return replace(motion, moment_slope=slope) if run.secant and slope.size == motion.angle.size else motion


def _free_decay(states: ForceStates, model: JointModel, group: str, policy: DiagnosisPolicy) -> GapRun | None:
    """Return a free run as half-cycles up to its last reversal; None where they are few, or no inertia is known."""
    if not model.inertia > 0:
        return None
    every = _stride(states)
    limit = rate_limit(states.rate, states.noise.rate, 0.0)
    ends = reversals(states.rate[::every], limit)
    if ends.size <= policy.fewest_half_cycles:
        return None
    # The first swing of what is released is smoothed beside its image: a start in the middle is surer.
    first, size = int(ends[1]) if states.lead is None else 0, int(ends[-1])
    angle, rate, acceleration, moment = (
        s[::every][first:size] for s in (states.angle, states.rate, states.acceleration, states.moment)
    )
    step = every / states.sample_rate
    lead = _lead(states, step) or (np.empty(0), np.empty(0))
    lead = np.append(lead[0], states.angle[::every][:first]), np.append(lead[1], states.rate[::every][:first])
    low = smoothing_kernels(states.bandwidth, states.sample_rate)[0]
    # Rounding is noise, too.
    noise = (
        max(states.noise.angle * float(np.linalg.norm(low)), LEAST_NOISE * float(np.abs(angle).max())),
        max(states.noise.rate, LEAST_NOISE * float(np.abs(rate).max())),
    )
    half_cycles = HalfCycles.build(rate, step, model.slopes(angle, rate), model.inertia, limit, noise, policy)
    if half_cycles is None:
        return None
    rows = np.arange(size - first)
    motion = replace(_motion(states, model, (angle, rate, acceleration), step, rows, False), lead=lead)
    target = moment - (model.joint.inertia or 0.0) * acceleration
    kernel = smoothing_kernels(states.bandwidth, states.sample_rate / every)[0]
    return GapRun(
        states.run, group, states.level, motion, target, np.empty((0, 0)), False, 0.0,
        Band(kernel, rows), half_cycles,
    )  # fmt: skip


def _stretches(rows: NDArray[np.intp], most: int) -> NDArray[np.intp]:
    """Return at most about ``most`` rows, as whole stretches spread evenly: neighbours carry correlated noise."""
    count = rows.size // STRETCH
    keep = max(1, most // STRETCH)
    if rows.size <= most or count <= keep:
        return rows
    chosen = np.unique(np.linspace(0, count - 1, keep).astype(int))
    return np.concatenate([rows[i * STRETCH : (i + 1) * STRETCH] for i in chosen])


def _motion(
    states: ForceStates,
    model: JointModel,
    signals: tuple[Array, Array, Array],
    step: float,
    keep: NDArray[np.intp],
    repeats: bool,
) -> MeasuredMotion:
    """Return a motion of some angles, rates and accelerations, of which some are rows."""
    angle, rate, acceleration = signals
    means = {name: float(np.mean(values)) for name, values in states.inputs.items()}
    held = model.at(**{each.name: means[each.name] for each in model.inputs if each.name in means})
    stiffness, damping = held.slopes(angle, rate)
    instants = states.time[0] + step * np.arange(angle.size)
    return MeasuredMotion(
        angle=angle,
        rate=rate,
        acceleration=acceleration,
        step=step,
        time=instants,
        frequency=states.frequency or 0.0,
        moment_rate=stiffness * rate + damping * acceleration,
        moment_slope=stiffness,
        keep=keep,
        repeats=repeats,
        began=states.began,
        centre=rest_of(states),
        inputs={name: np.interp(instants, states.time, values) for name, values in states.inputs.items()},
    )


def base_columns(model: JointModel, run: GapRun) -> Array:
    """Return the columns of the model's own terms at the kept samples, shape (m, p)."""
    inputs = model.input_arrays(run.inputs, run.angle.shape)
    function = compile_terms([term.expression for term in model.terms], (*VARIABLES, *inputs))
    return function(run.angle, run.rate, run.acceleration, *inputs.values())
