"""The error of the processing: what it leaves of a model's own simulation, at the rows of runs that do not repeat.

Smoothing rounds off the motion at every reversal, and what it takes looks like an inertia or a fast Maxwell branch. The
model is simulated under the measured moment, its angle goes through the same kernel, and what the model then leaves of
itself is taken off what it leaves of the measurement. Where runs repeat, the harmonics that are kept see to that.
"""

from collections.abc import Sequence
from contextlib import suppress
from dataclasses import replace

import numpy as np

from sindyjoint.diagnosis.campaign.gap_rows import along_replicate
from sindyjoint.diagnosis.campaign.repair import as_recorded, modelled, simulated
from sindyjoint.diagnosis.campaign.rows import GapRun
from sindyjoint.diagnosis.effects.fitted import Corrections, FittedEffect
from sindyjoint.diagnosis.policy import CAMPAIGN, DiagnosisPolicy
from sindyjoint.equation.model import JointModel
from sindyjoint.errors import InputError, SindyJointError
from sindyjoint.limits import RESPONSE
from sindyjoint.numeric import Array, convolve, delayed
from sindyjoint.record import Run
from sindyjoint.response.completion import completed_states
from sindyjoint.states import ForceStates, force_states, smoothing_kernels


def processing_errors(
    runs: Sequence[Run],
    states: Sequence[ForceStates],
    rows: Sequence[GapRun],
    model: JointModel,
    effects: Sequence[FittedEffect],
    policy: DiagnosisPolicy = CAMPAIGN,
) -> list[Array | None]:
    """Return what the processing leaves of the simulation at the rows of each run, N·m.

    None where a run repeats or is free, where the simulation does not follow it, or where what the model leaves of the
    measurement is clearly larger without it: the simulation then moves another way at the reversals, or sticks
    elsewhere.
    """
    errors = [
        None if row.folded or row.half_cycles is not None else _error(run, state, row, model, effects, policy)
        for run, state, row in zip(runs, states, rows, strict=True)
    ]
    return [
        error if error is None or is_seen(error, row, model, effects) else None
        for error, row in zip(errors, rows, strict=True)
    ]


def is_seen(error: Array, row: GapRun, model: JointModel, effects: Sequence[FittedEffect]) -> bool:
    """Return whether the measurement may hold an error of the processing, and does not clearly deny it.

    What the model leaves then grows without it by no more than chance does: with rows r of unit noise and the error e
    in their units, (r − e)² − r² has a standard deviation of 2·|e|.
    """
    left = row.target - modelled(row, model, effects)
    with_it, without_it = row.white(left), row.white(left - error)
    chance = CAMPAIGN.likely * 2 * float(np.linalg.norm(with_it - without_it))
    return bool(without_it @ without_it - with_it @ with_it < chance)


def without_processing(rows: Sequence[GapRun], errors: Sequence[Array | None]) -> tuple[GapRun, ...]:
    """Return the rows less what the processing leaves of the simulation."""
    return tuple(
        row if part is None else replace(row, target=row.target - part, processing=part)
        for row, part in zip(rows, errors, strict=True)
    )


def _error(
    run: Run,
    states: ForceStates,
    row: GapRun,
    model: JointModel,
    effects: Sequence[FittedEffect],
    policy: DiagnosisPolicy,
) -> Array | None:
    replicate = _replicate(run, states, model, effects, policy)
    if replicate is None:
        return None
    there = along_replicate(row, states, replicate, model)
    error = there.target - modelled(there, model, effects)
    # Where the replicate sticks its friction is not determined.
    places = np.round((row.motion.time[row.motion.keep] - states.time[0]) * states.sample_rate).astype(int)
    return np.where(replicate.moving[places], error, 0.0)


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
