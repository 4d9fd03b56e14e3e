"""What the noise of the channels does to numbers that make replicates like the measurement.

Rows are weighted by noise that a fit of their moment has. Beside replicates some of it does not count: what a moment
that drives has beyond the harmonics of the angle is in both, and a prescribed motion has no harmonics that were cut.
The covariance of numbers is therefore that of the noise as it was measured, carried through the weights as they are
(sandwich of a working covariance; White, Econometrica 50, 1, 1982).
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from sindyjoint.diagnosis.campaign.numbers.replicates import Replicates
from sindyjoint.diagnosis.campaign.repair import Repaired, least_squares, modelled
from sindyjoint.diagnosis.campaign.rows.run import GapRun
from sindyjoint.numeric import Array

# Draws of noise, each used with both signs: what is linear in it then leaves the mean.
PAIRS = 4


def left_in_all(rows: Sequence[GapRun], fitted: Repaired) -> Array:
    """Return what a repaired model leaves of rows, in units of their noise."""
    return np.concatenate([left_in(row, fitted) for row in rows])


def left_in(row: GapRun, fitted: Repaired) -> Array:
    """Return what a repaired model leaves of the rows of one run, in units of their noise."""
    return row.white(row.target - modelled(row, fitted.model, fitted.effects))


def noise_covariance(
    there: Replicates, fitted: Repaired, slopes: Array, misfit: Array
) -> tuple[Array, float]:
    """Return the covariance of numbers found by least squares, and by how much the misfit, squared, is beyond noise.

    S⁺ΣS⁺ᵀ·max(1, |r|²/E|r|²), S the slopes, Σ the covariance of the noise and r the misfit; and that ratio.

    Parameters
    ----------
    there : Replicates
    fitted : Repaired
        What leaves the rows.
    slopes : ndarray, shape (m, p)
        Of what it leaves of replicates, by each number.
    misfit : ndarray, shape (m,)
        What it leaves of the measurement beyond that.
    """
    scale = np.linalg.norm(slopes, axis=0)
    scale[scale == 0] = 1.0
    along, singular, right = np.linalg.svd(slopes / scale, full_matrices=False)
    usable = singular > 1e-9 * singular[0]
    along, inverse = along[:, usable], (right[usable].T / singular[usable]) / scale[:, None]
    covariance, beyond, first = np.zeros((slopes.shape[1],) * 2), 0.0, 0
    for sources in _noise_in_rows(there, fitted):
        within = along[first : first + len(sources)].T @ sources
        first += len(sources)
        covariance += (inverse @ within) @ (inverse @ within).T
        # Runs are independent: squares add.
        beyond += float(np.sum(sources**2) - np.sum(within**2))
    rest = misfit - along @ (along.T @ misfit)
    ratio = float(rest @ rest) / max(beyond, 1e-300)
    return covariance * max(1.0, ratio), ratio


def _noise_in_rows(there: Replicates, fitted: Repaired) -> list[Array]:
    """Return what each source of noise, by its standard error, adds to what is left of the rows of each run.

    Shape (m, sources) per run: of a moment that was not the drive all its noise, of one that was the harmonics of the
    angle and what the processing errs by; of the angle its mean and harmonics.
    """
    made = []
    for place, (row, state) in enumerate(zip(there.work.rows, there.work.states, strict=True)):
        orders, errors = state.series[0].orders, state.series[0].standard_error
        white, columns = row.sigma, []
        if there.driven[place]:
            phase = 2 * np.pi * np.outer(row.motion.keep / row.motion.angle.size, orders)
            size = state.noise.moment * np.sqrt(2 / state.n_samples)
            columns += [row.white(size * np.cos(phase)), row.white(size * np.sin(phase))]
            white = np.full_like(white, there.work.policy.processing_error * fitted.model.fitted.moment_rms)
        columns.append(row.white(np.diag(white)))
        basis = there.moving[place]
        size = errors[: basis.angular.size]
        mean = np.full((state.n_samples, 1), state.noise.angle / np.sqrt(state.n_samples))
        plain = left_in(there.row(place), fitted)
        for angle in np.hstack([mean, basis.cosine * size, basis.sine * size]).T:
            columns.append((left_in(there.row(place, angle=angle), fitted) - plain)[:, None])
        made.append(np.hstack(columns))
    return made


def mean_by_noise(there: Replicates, fitted: Repaired, slopes: Array) -> Array:
    """Return by how much noise moves numbers on average: the mean over pairs of opposite noise."""
    rng = np.random.default_rng(0)
    own = left_in_all(there.rows(), fitted)
    total = np.zeros(own.size)
    for _ in range(PAIRS):
        noise = there.draw_noise(rng)
        for sign in (1.0, -1.0):
            total += left_in_all(there.rows([(sign * m, sign * a) for m, a in noise]), fitted) - own
    return least_squares(slopes, total / (2 * PAIRS))[0]
