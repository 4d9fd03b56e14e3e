"""The gap that noise alone leaves: of the true law's own terms, fitted to noisy runs and driven by a noisy moment.

A gap on runs left out holds more than their noise: the numbers come from the other runs, and are uncertain; the law is
evaluated along a noisy motion, whose processing rounds off its reversals. So are a simulation's numbers and its drive.
Beyond what these explain a law is wrong.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from sindyjoint.diagnosis.campaign.gap import kept_rows
from sindyjoint.diagnosis.campaign.kept import kept_runs
from sindyjoint.diagnosis.campaign.numbers.whole import number_columns
from sindyjoint.diagnosis.campaign.regression import stack
from sindyjoint.diagnosis.campaign.repair import coefficients_of, modelled, whitened
from sindyjoint.diagnosis.campaign.rows.build import along_replicate
from sindyjoint.diagnosis.campaign.rows.run import GapRun, row_groups
from sindyjoint.diagnosis.campaign.simulated_run import simulated
from sindyjoint.diagnosis.campaign.start import Work
from sindyjoint.diagnosis.effects.fitted import FittedEffect
from sindyjoint.equation.model import JointModel
from sindyjoint.numeric import Array, rms
from sindyjoint.record import Run
from sindyjoint.response.model_law import with_coefficients
from sindyjoint.response.run import SimulatedRun, pooled_nrmse
from sindyjoint.states import ForceStates
from sindyjoint.states.broadband import smoothing_kernels

DRAWS = 3  # of numbers and noise, by which the response is simulated again


def left_out_error(work: Work, model: JointModel, effects: Sequence[FittedEffect]) -> float:
    """Return by how much the true law, fitted to other runs, would miss runs left out: relative RMS of the moment.

    The variance x'Cx of a prediction, C the covariance of the numbers by the noise of the rows they come from.
    """
    adding = [e for e in effects if not e.shifts]
    runs = work.rows
    if work.campaign.validation_runs:
        kept = kept_rows(work, model, effects)
        columns = np.vstack([number_columns(run, model, adding) for run in kept])
        spread = _prediction_variance(columns, _covariance(runs, model, adding))
        return float(np.sqrt(np.mean(spread) / np.mean(np.concatenate([r.target for r in kept]) ** 2)))
    plain = np.vstack([number_columns(run, model, adding) for run in runs])
    white, share = whitened(runs, plain), _shares(runs)
    labels, white_labels = row_groups(runs), row_groups(runs, white=True)
    spread = np.zeros(len(plain))
    for group in dict.fromkeys(labels.tolist()):
        out, others = labels == group, white_labels != group
        if others.any():
            spread[out] = _prediction_variance(plain[out], _noise_covariance(white[others], share[others]))
    return float(np.sqrt(np.mean(spread) / np.mean(np.concatenate([r.target for r in runs]) ** 2)))


def motion_errors(work: Work, model: JointModel, effects: Sequence[FittedEffect]) -> tuple[float, float]:
    """Return by how much the true law misses because its motion is measured, and because it is processed.

    Relative RMS of the moment, over runs that do not repeat: a mean period hardly has either. Noise of the motion
    enters by the slopes of the law, beside the inertia's moment. What the processing leaves of the law's own simulation
    is known where rows hold it.
    """
    rng = np.random.default_rng(0)
    adding = [e for e in effects if not e.shifts]
    kept = bool(work.campaign.validation_runs)
    states = work.kept_states if kept else work.states
    rows = kept_rows(work, model, effects) if kept else work.rows
    own = float(np.sum(np.concatenate([run.target for run in rows]) ** 2))
    measured = processed = 0.0
    for run, state in zip(rows, states, strict=True):
        if run.folded or run.half_cycles is not None:
            continue
        if run.processing is not None:
            processed += float(np.sum(_within(run, run.processing) ** 2))
        noisier, acceleration = _noisier_motion(state, rng)
        # Along the states as they are, too: the rows lack what the processing leaves.
        both = (along_replicate(run, state, each, model) for each in (state, noisier))
        first, last = (each.target - modelled(each, model, adding) for each in both)
        inertial = model.inertia * acceleration[_places(run, state)]
        whole, known = _within(run, last - first), _within(run, inertial)
        measured += max(float(np.sum(whole**2) - np.sum(known**2)), 0.0)
    return float(np.sqrt(measured / own)), float(np.sqrt(processed / own))


def _within(run: GapRun, part: Array) -> Array:
    return part if run.band is None else run.band.within(part)


def _places(run: GapRun, states: ForceStates) -> NDArray[np.intp]:
    """Return the samples of the states at which a run has rows."""
    return np.round((run.motion.time[run.motion.keep] - states.time[0]) * states.sample_rate).astype(int)


def _noisier_motion(states: ForceStates, rng: np.random.Generator) -> tuple[ForceStates, Array]:
    """Return states with noise added to the motion as large as what it holds already, and that of the acceleration."""
    low, first, second = smoothing_kernels(states.bandwidth, states.sample_rate)

    def smooth(size: float, *kernels: Array) -> list[Array]:
        white = size * rng.standard_normal(states.n_samples + low.size - 1)
        return [np.convolve(white, kernel, mode="valid") for kernel in kernels]

    angle, rate, acceleration = smooth(states.noise.angle, low, first, second)
    if states.rate_measured:
        rate, acceleration = smooth(states.noise.rate / float(np.linalg.norm(low)), low, first)
    later = replace(
        states,
        angle=states.angle + angle,
        rate=states.rate + rate,
        acceleration=states.acceleration + acceleration,
    )
    return later, acceleration


def response_error(work: Work, model: JointModel, effects: Sequence[FittedEffect]) -> float:
    """Return by how much simulations of the same law differ: other numbers within their errors, other noise."""
    rng = np.random.default_rng(0)
    adding = [e for e in effects if not e.shifts]
    covariance = _covariance(work.rows, model, adding)
    given = _simulations(work, model, effects)
    errors = []
    for _ in range(DRAWS):
        drawn = _drawn(model, effects, covariance, rng)
        for name, other in _simulations(_noisier(work, rng), *drawn).items():
            one = given[name].simulated_response if name in given else None
            two = other.simulated_response
            if one is None or two is None or not np.isfinite(error := rms(two - one)):
                continue
            scale = given[name].response_scale
            errors.append((given[name].channel, error / scale, scale))
    return pooled_nrmse(errors) if errors else 0.0


def _simulations(work: Work, model: JointModel, effects: Sequence[FittedEffect]) -> dict[str, SimulatedRun]:
    """Return the runs of which the response gap is reported, simulated, by name."""
    if work.campaign.validation_runs:
        return {each.run: each for each in kept_runs(work, model, effects)}
    pairs = zip(work.runs, work.states, strict=True)
    made = [simulated(run, states, model, effects) for run, states in pairs]
    return {each.run: each for each in made if each is not None}


def _noisier(work: Work, rng: np.random.Generator) -> Work:
    """Return the work with noise added to the measured moments as large as what they hold already."""
    noise = {s.run: s.noise.moment for s in (*work.states, *work.kept_states)}

    def noisier(run: Run) -> Run:
        own = float(np.nan_to_num(noise.get(run.name, 0.0)))
        return replace(run, moment=run.moment + own * rng.standard_normal(run.moment.size), source=None)

    campaign = work.campaign
    if campaign.validation_runs:
        return replace(work, campaign=campaign.with_runs(tuple(noisier(r) for r in campaign.runs)))
    return replace(work, runs=tuple(noisier(run) for run in work.runs))


def _drawn(
    model: JointModel, effects: Sequence[FittedEffect], covariance: Array, rng: np.random.Generator
) -> tuple[JointModel, list[FittedEffect]]:
    """Return the law with other numbers, as its covariance allows; nonlinear parameters stay positive."""
    adding = [e for e in effects if not e.shifts]
    values, vectors = np.linalg.eigh(covariance)
    step = vectors @ (np.sqrt(np.maximum(values, 0.0)) * rng.standard_normal(values.size))
    linear = coefficients_of(model, adding)
    size, numbers = model.coefficients.size, linear + step[: linear.size]
    block = covariance[:size, :size]
    later, at, inner = [], size, linear.size
    for each in effects:
        if each.shifts:
            later.append(each)
            continue
        width, count = len(each.variant.columns), each.values.size
        values_now = each.values * np.exp(np.clip(step[inner : inner + count] / each.values, -1.0, 1.0))
        later.append(replace(each, coefficients=numbers[at : at + width], values=values_now))
        at, inner = at + width, inner + count
    return with_coefficients(model, numbers[:size], block), later


def _covariance(runs: Sequence[GapRun], model: JointModel, adding: Sequence[FittedEffect]) -> Array:
    return _noise_covariance(stack(runs, lambda run: number_columns(run, model, adding)), _shares(runs))


def _shares(runs: Sequence[GapRun]) -> Array:
    return np.concatenate([np.full(run.white_size, run.noise_share) for run in runs])


def _noise_covariance(white: Array, share: Array) -> Array:
    """Return the covariance of numbers fitted to whitened rows of which that share of the variance is noise."""
    norm = np.linalg.norm(white, axis=0)
    norm[norm == 0] = 1.0
    inverse = np.linalg.pinv(white / norm, rcond=1e-9)
    return np.asarray((inverse * share) @ inverse.T / np.outer(norm, norm))


def _prediction_variance(columns: Array, covariance: Array) -> Array:
    return np.asarray(np.einsum("ij,jk,ik->i", columns, covariance, columns))
