"""The gap of the response that noise alone leaves: the true law's numbers are fitted, and its drive is measured."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from sindyjoint.diagnosis.campaign.gap import kept_runs
from sindyjoint.diagnosis.campaign.numbers.whole import number_columns
from sindyjoint.diagnosis.campaign.regression import stack
from sindyjoint.diagnosis.campaign.repair import coefficients_of
from sindyjoint.diagnosis.campaign.rows.run import GapRun
from sindyjoint.diagnosis.campaign.simulated_run import simulated
from sindyjoint.diagnosis.campaign.start import Work
from sindyjoint.diagnosis.effects.fitted import FittedEffect
from sindyjoint.equation.model import JointModel
from sindyjoint.numeric import Array, rms
from sindyjoint.record import Run
from sindyjoint.response.laws import with_coefficients
from sindyjoint.response.output_error import DRAWS
from sindyjoint.response.run import SimulatedRun, pooled_nrmse


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
