"""Runs that do not repeat: cut into segments where the joint changes, and what processing leaves of a model in them.

A mean period shows nothing of a stiffness that drifts: it shows the mean stiffness. Where what repeats changes along
the runs, each run is cut into segments of whole periods with force states of their own, so that columns with ``time``
carry what differs between them.

Smoothing rounds off the motion at every reversal, and what it takes looks like an inertia or a fast Maxwell branch. The
model is simulated under the measured moment, its angle goes through the same kernel, and what the model then leaves of
itself is taken off what it leaves of the measurement. Where runs repeat, the harmonics that are kept see to that.
"""

from collections.abc import Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from sindyjoint.diagnosis.campaign import GapRun
from sindyjoint.diagnosis.campaign.gap_rows import along_replicate
from sindyjoint.diagnosis.campaign.repair import as_recorded, modelled, simulated
from sindyjoint.diagnosis.effects.fitted import Corrections, FittedEffect
from sindyjoint.diagnosis.policy import CAMPAIGN, DiagnosisPolicy
from sindyjoint.equation.model import JointModel
from sindyjoint.errors import InputError, SindyJointError
from sindyjoint.limits import RESPONSE, STATES
from sindyjoint.numeric import Array, convolve, delayed
from sindyjoint.policy import SHARED
from sindyjoint.record import Run
from sindyjoint.response.completion import completed_states
from sindyjoint.states import ForceStates, force_states, smoothing_kernels

SEGMENTS = 4
LEAST_PERIODS = 4  # of a segment
MEMBER = " part "  # between the name of a run and the number of its segment


def changes(runs: Sequence[Run], states: Sequence[ForceStates], policy: DiagnosisPolicy = CAMPAIGN) -> bool:
    """Return whether the first-harmonic stiffness of periodic runs changes in time, in most of them.

    Moment over angle at the excitation frequency, period by period. A channel that drifts leaves it as it is: the
    running mean over a period is taken off both channels first. A run that was steady before what was taken for its
    steady part has changed at once.
    """
    pairs = [(r, s) for r, s in zip(runs, states, strict=True) if s.method == "periodic" and s.frequency]
    if 2 * sum(steady_before(run, s, policy) is not None for run, s in pairs) > len(pairs):
        return True
    found = [stiffness_change(run, s) for run, s in pairs]
    if not found:
        return False
    ratio, share = np.median(np.array(found), axis=0)
    return bool(ratio > policy.stands_out and share > policy.accuracy)


def stiffness_change(run: Run, states: ForceStates) -> tuple[float, float]:
    """Return the largest difference of the complex stiffness between quarters of a run: in errors, and as a share."""
    stiffness = period_stiffness(run, states)
    if stiffness.size < SEGMENTS * LEAST_PERIODS:
        return 0.0, 0.0
    parts = np.array_split(stiffness, SEGMENTS)
    mean = np.array([np.mean(part) for part in parts])
    # Scatter within the quarters about a line: the change itself must not count as its own noise.
    residual = np.concatenate([_straightened(part) for part in parts])
    freedom = residual.size - 2 * SEGMENTS
    error = np.sqrt(np.sum(np.abs(residual) ** 2) / (2 * freedom) * 2 / min(p.size for p in parts))
    spread = float(np.max(np.abs(mean[:, None] - mean[None, :])))
    scale = float(np.abs(np.mean(stiffness)))
    if scale == 0:  # no moment: nothing drives it at that frequency
        return 0.0, 0.0
    return spread / (float(error) + 1e-9 * scale), spread / scale


def _straightened(values: NDArray[np.complex128]) -> NDArray[np.complex128]:
    place = np.arange(values.size) - (values.size - 1) / 2
    centred = values - np.mean(values)
    return np.asarray(centred - place * (place @ centred) / (place @ place), dtype=np.complex128)


def period_stiffness(run: Run, states: ForceStates) -> NDArray[np.complex128]:
    """Return the ratio of the first harmonics of moment and angle of each whole period, N·m/rad."""
    assert states.frequency is not None
    start = int(round(states.dropped * run.sample_rate))
    per = run.sample_rate / states.frequency
    edges = np.round(np.arange(0, states.n_samples / per + 1e-3) * per).astype(int)
    edges = edges[edges <= states.n_samples]
    if edges.size < 3:
        return np.empty(0, dtype=np.complex128)
    wave = np.exp(-2j * np.pi * states.frequency * np.arange(edges[-1]) / run.sample_rate)

    def harmonic(signal: Array) -> NDArray[Any]:
        part = signal[start : start + edges[-1]]
        means = np.add.reduceat(part, edges[:-1]) / np.diff(edges)
        slow = np.interp(np.arange(part.size), (edges[:-1] + edges[1:]) / 2, means)
        return np.add.reduceat((part - slow) * wave, edges[:-1])

    # The first and the last period have half a running mean.
    stiffness: NDArray[np.complex128] = harmonic(run.moment) / harmonic(run.angle)
    return stiffness[1:-1]


@dataclass(frozen=True, eq=False)
class Segment:
    """A stretch of a run that was made to repeat: its run, straight within the stretch, and its states."""

    run: Run
    states: ForceStates


def steady_before(run: Run, states: ForceStates, policy: DiagnosisPolicy = CAMPAIGN) -> ForceStates | None:
    """Return the states of what was left out at the start of a run, if it was long, steady, and of other stiffness.

    The motion of a joint that a moment drives changes where its stiffness does, and looks as if it had not settled.
    """
    if states.frequency is None:
        return None
    # The last period of it may hold the change.
    end = round((states.dropped - 1 / states.frequency) * run.sample_rate)
    # A start-up is over sooner. What was left out for longer, and was steady, was another joint.
    if end < policy.large_part * run.n_samples:
        return None
    early = _states_between(run, 0, end)
    if early is None:
        return None
    lasting = early.n_samples / run.sample_rate
    long = lasting * states.frequency >= 2 * LEAST_PERIODS and early.n_samples >= policy.mostly * end
    if not long or not _differ(period_stiffness(run, early), period_stiffness(run, states), policy):
        return None
    return replace(early, began=states.began)


def _differ(one: NDArray[np.complex128], other: NDArray[np.complex128], policy: DiagnosisPolicy) -> bool:
    """Return whether the means of two samples differ significantly, and by more than a trifle."""
    if min(one.size, other.size) < LEAST_PERIODS:
        return False
    apart = float(np.abs(np.mean(one) - np.mean(other)))
    error = float(np.sqrt(np.var(one) / one.size + np.var(other) / other.size))
    return apart > policy.stands_out * error and apart > policy.accuracy * float(np.abs(np.mean(other)))


def segments(run: Run, states: ForceStates, policy: DiagnosisPolicy = CAMPAIGN) -> tuple[Segment, ...]:
    """Return up to four stretches of whole periods, each with its own mean period and time.

    What changes within a stretch, in proportion to time, is taken off: it then repeats as it is in its middle. A run
    that is too short for three stretches, or that is not periodic, is returned whole. Of a run that changed at once
    there are two stretches before that and two after it.
    """
    whole = (Segment(run, states),)
    if states.method != "periodic":
        return whole
    early = steady_before(run, states, policy)
    if early is None:
        parts = _stretches(run, states, SEGMENTS)
        return parts if len(parts) >= SHARED.fewest else whole
    before = _stretches(run, early, SEGMENTS // 2)
    after = _stretches(run, states, SEGMENTS // 2, len(before))
    return (*before, *after) if before and after else whole


def _stretches(run: Run, states: ForceStates, most: int, number: int = 0) -> tuple[Segment, ...]:
    """Return stretches of the steady part of a run, numbered on; none where its processing fails."""
    assert states.frequency is not None
    per = run.sample_rate / states.frequency
    periods = int(states.n_samples / per + 1e-3)
    count = min(most, periods // LEAST_PERIODS)
    start = int(round(states.dropped * run.sample_rate))
    edges = start + np.round(np.round(np.linspace(0, periods, count + 1)) * per).astype(int)
    parts = []
    for index, (low, high) in enumerate(zip(edges[:-1], np.minimum(edges[1:], run.n_samples), strict=True)):
        name = f"{run.name}{MEMBER}{number + index + 1}"
        straight = _straight(run, low, high, states.frequency, name)
        part = _states_between(straight, low, high)
        if part is None:
            return ()
        late = low / run.sample_rate
        part = replace(part, time=part.time + late, dropped=part.dropped + late, began=states.began)
        parts.append(Segment(straight, part))
    return tuple(parts)


def _states_between(run: Run, low: int, high: int) -> ForceStates | None:
    """Return the states of a periodic run between two samples; None where these are too few, or none of it repeats."""
    known = {name: getattr(run, name) for name in ("moment", "angle", "rate", "valid")}
    cut: dict[str, Any] = {name: v[low:high] for name, v in known.items() if v is not None}
    inputs = {name: values[low:high] for name, values in run.inputs.items()}
    with suppress(SindyJointError):
        stretch = replace(run, source=None, inputs=inputs, **cut)
        return force_states(stretch, "periodic", None, STATES.passing_rate_share)
    return None


def _straight(run: Run, low: int, high: int, frequency: float, name: str) -> Run:
    """Return the run under another name with the trend taken off between two samples."""

    def straight(signal: Array) -> Array:
        middle = _without_trend(signal[low:high], frequency / run.sample_rate)
        return np.concatenate([signal[:low], middle, signal[high:]])

    rate = None if run.rate is None else straight(run.rate)
    moment, angle = straight(run.moment), straight(run.angle)
    return replace(run, name=name, moment=moment, angle=angle, rate=rate, frequency=frequency, source=None)


def _without_trend(signal: Array, cycles: float) -> Array:
    """Return a signal less what grows in proportion to time, about the middle, in its mean and first harmonics.

    ``cycles`` is the excitation frequency in cycles per sample.
    """
    place = np.arange(signal.size)
    late = (place - place.mean()) / signal.size
    phase = 2 * np.pi * cycles * np.outer(place, np.arange(1, 8))
    basis = np.column_stack([np.ones(signal.size), np.cos(phase), np.sin(phase)])
    design = np.hstack([basis, late[:, None] * basis])
    coefficients, *_ = np.linalg.lstsq(design, signal, rcond=None)
    return signal - late * (basis @ coefficients[basis.shape[1] :])


def replicates(
    runs: Sequence[Run],
    states: Sequence[ForceStates],
    rows: Sequence[GapRun],
    model: JointModel,
    effects: Sequence[FittedEffect],
    policy: DiagnosisPolicy = CAMPAIGN,
) -> list[ForceStates | None]:
    """Return the states of the model's own motion in each run; None where it repeats, is free, or goes another way."""
    return [
        None if row.folded or row.half_cycles is not None else _replicate(run, state, model, effects, policy)
        for run, state, row in zip(runs, states, rows, strict=True)
    ]


def without_processing(
    rows: Sequence[GapRun],
    states: Sequence[ForceStates],
    own: Sequence[ForceStates | None],
    model: JointModel,
    effects: Sequence[FittedEffect],
) -> tuple[GapRun, ...]:
    """Return the rows less what the processing leaves of the model's own motion, N·m.

    As they are where there is no such motion, or where what the model leaves of the measurement is clearly larger
    without it: the simulation then moves another way at the reversals, or sticks elsewhere.
    """
    later = []
    for row, state, replicate in zip(rows, states, own, strict=True):
        error = None if replicate is None else _error(row, state, replicate, model, effects)
        if error is not None and is_seen(error, row, model, effects):
            row = replace(row, target=row.target - error, processing=error)
        later.append(row)
    return tuple(later)


def is_seen(error: Array, row: GapRun, model: JointModel, effects: Sequence[FittedEffect]) -> bool:
    """Return whether the measurement may hold an error of the processing, and does not clearly deny it.

    What the model leaves then grows without it by no more than chance does: with rows r of unit noise and the error e
    in their units, (r − e)² − r² has a standard deviation of 2·|e|.
    """
    left = row.target - modelled(row, model, effects)
    with_it, without_it = row.white(left), row.white(left - error)
    chance = CAMPAIGN.likely * 2 * float(np.linalg.norm(with_it - without_it))
    return bool(without_it @ without_it - with_it @ with_it < chance)


def _error(
    row: GapRun,
    states: ForceStates,
    replicate: ForceStates,
    model: JointModel,
    effects: Sequence[FittedEffect],
) -> Array:
    there = along_replicate(row, states, replicate, model)
    error = there.target - modelled(there, model, effects)
    # Where the replicate stands, or moves the other way, its friction is not that of the row.
    same = there.motion.rate[there.motion.keep] * row.motion.rate[row.motion.keep] > 0
    return np.where(same, error, 0.0)


def _replicate(
    run: Run,
    states: ForceStates,
    model: JointModel,
    effects: Sequence[FittedEffect],
    policy: DiagnosisPolicy,
) -> ForceStates | None:
    """Return the states of the model's own motion under the measured moment; None where it goes another way."""
    # Above the band of the angle the moment's noise is none of the processing's.
    band = min(policy.drive_band * states.bandwidth, 0.45 * run.sample_rate)
    driven = replace(run, moment=_low_passed(run.moment, run.sample_rate, band), source=None)
    result = simulated(driven, states, model, effects, by="moment")
    if result is None or result.failure or result.simulated_angle is None:
        return None
    with np.errstate(over="ignore"):  # a simulation that runs away is far from the measurement
        apart = float(np.std(result.simulated_angle - result.angle))
    if not apart < RESPONSE.alike * np.std(result.angle):
        return None
    shift = Corrections.of(effects).shift
    angle = delayed(run.angle, shift * run.sample_rate) if shift else run.angle.copy()
    first = round(float(states.time[0]) * run.sample_rate)
    angle[first : first + states.n_samples] = as_recorded(
        result.simulated_angle, states.time, run.sample_rate, states, effects
    )
    try:
        replicate = force_states(replace(driven, angle=angle, rate=None), "broadband", states.bandwidth)
    except SindyJointError:
        return None
    return replace(replicate, noise=states.noise) if replicate.n_samples == states.n_samples else None


def _low_passed(moment: Array, sample_rate: float, band: float) -> Array:
    kernel = smoothing_kernels(band, sample_rate)[0]
    smooth: Array = convolve(np.pad(moment, kernel.size // 2, mode="edge"), kernel)
    return smooth


def processing_error(
    runs: Sequence[Run], states: Sequence[ForceStates], rows: Sequence[GapRun], model: JointModel
) -> float:
    """Return what the processing leaves of the model's own simulation: mean square over that of the moment.

    Rows of runs that do not repeat know it already. Elsewhere the moment of the law differs by so much along states
    that are completed by its simulated motion.
    """
    known = [row for row in rows if row.processing is not None]
    if known:
        own, part = (
            np.concatenate([getattr(row, name) for row in known]) for name in ("target", "processing")
        )
        return float(np.mean(part**2) / np.mean(own**2))
    errors = [np.zeros(1)]
    with suppress(InputError):  # of a law that an input moves within a run
        for cut, whole in zip(states, completed_states(model, runs, states), strict=True):
            one, other = (
                model.moment(s.angle, s.rate, inputs=s.inputs) + model.inertia * s.acceleration
                for s in (cut, whole)
            )
            errors.append((other - one)[cut.moving & whole.moving])
    return float(np.mean(np.concatenate(errors) ** 2)) / model.fitted.moment_rms**2
