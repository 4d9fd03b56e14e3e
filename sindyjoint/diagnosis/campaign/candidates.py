"""The search for variant and nonlinear parameters of every candidate effect: a grid, Nelder-Mead, refinement."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from sindyjoint.diagnosis.campaign.regression import PER_TRIAL, GapRegression
from sindyjoint.diagnosis.campaign.rows.run import GapRun
from sindyjoint.diagnosis.effects.catalogue import Effect, Variant
from sindyjoint.diagnosis.effects.fitted import FittedEffect
from sindyjoint.numeric import Array

# Per number of nonlinear parameters: points of a grid, and from how many of the best a search starts.
GRID = {1: (17,), 2: (8, 5), 3: (5, 3, 3)}
STARTS = {1: 1, 2: 3}
# Nonlinear parameters are refined until their gain rises by less than this, or this share of it; the search is coarser.
LEAST_RISE, SHARE_OF_RISE = 0.02, 1e-5
MOST_TRIALS = 80  # of nonlinear parameters, per parameter; a ridge is followed slowly
USUAL_TRIALS = 30
FOLLOWED = 4  # samples in one step of a rough motion, about


def fit_effect(problem: GapRegression, effect: Effect) -> FittedEffect:
    """Return the variant and nonlinear parameters of an effect that lower χ² most."""
    rough = problem.rough()
    return refine_effect(problem, _searched(problem, rough, effect))


class _Grid(NamedTuple):
    """Logarithms of the nonlinear parameters of a variant on a grid, shape (n, k), and the gain of each point."""

    points: Array
    gains: Array


def _gridded(rough: GapRegression, variant: Variant) -> _Grid:
    """Return the gains of a variant on the grid of its nonlinear parameters."""
    bounds = variant.bounds(rough.reference)
    ends = zip(*np.log(bounds).T, _shape(len(bounds)), strict=True) if len(bounds) else ()
    axes = [np.linspace(low, high, n) for low, high, n in ends]
    points = (
        np.array(np.meshgrid(*axes, indexing="ij")).reshape(len(bounds), -1).T if axes else np.empty((1, 0))
    )
    return _Grid(points, np.array([rough.gain(variant, np.exp(point))[0] for point in points]))


def _shape(count: int) -> tuple[int, ...]:
    return GRID.get(count, (4,) * count)


def _searched(problem: GapRegression, rough: GapRegression, effect: Effect) -> FittedEffect:
    """Return the best variant and nonlinear parameters that a search along the roughly followed motion finds."""
    found = []
    for variant in effect.variants:
        values = _search(rough, variant, _gridded(rough, variant))
        gain, coefficients = problem.gain(variant, values)
        found.append(FittedEffect(effect, variant, values, coefficients, gain))
    return max(found, key=lambda each: each.gain)


def refine_effect(problem: GapRegression, fitted: FittedEffect) -> FittedEffect:
    """Return an effect with its nonlinear parameters refitted near where they were."""
    if not fitted.values.size:
        return fitted
    from scipy.optimize import minimize

    within = fitted.variant.bounds(problem.reference) if fitted.within is None else fitted.within
    bounds = np.log(within).T
    start = np.clip(np.log(fitted.values), *bounds)
    found = minimize(
        lambda p: -problem.gain(fitted.variant, np.exp(np.clip(p, *bounds)))[0],
        start,
        method="Nelder-Mead",
        options={
            "initial_simplex": np.vstack(
                [start, start + np.diag(np.where(start + 0.1 < bounds[1], 0.1, -0.1))]
            ),
            "xatol": 1e-3,
            "fatol": max(LEAST_RISE, SHARE_OF_RISE * fitted.gain),
            "maxfev": MOST_TRIALS * start.size,
        },
    )
    values = np.exp(np.clip(found.x, *bounds))
    gain, coefficients = problem.gain(fitted.variant, values)
    return replace(fitted, values=values, gain=gain, coefficients=coefficients)


def _search(rough: GapRegression, variant: Variant, grid: _Grid) -> Array:
    """Return the best nonlinear parameters: Nelder–Mead in their logarithms from the best points of the grid."""
    count = grid.points.shape[1]
    if not count:
        return np.empty(0)
    from scipy.optimize import minimize

    low, high = np.log(variant.bounds(rough.reference)).T
    spacing = (high - low) / np.maximum(np.array(_shape(count)) - 1, 1)
    best_point, best_gain = grid.points[int(np.argmax(grid.gains))], float(grid.gains.max())
    for place in np.argsort(-grid.gains, kind="stable")[: STARTS.get(count, 2)]:
        start = grid.points[place]
        simplex = np.vstack([start, start + np.diag(np.where(start < high, 0.5, -0.5) * spacing)])
        found = minimize(
            lambda p: -rough.gain(variant, np.exp(np.clip(p, low, high)))[0],
            start,
            method="Nelder-Mead",
            options={
                "initial_simplex": simplex,
                "xatol": 1e-2,
                "fatol": max(LEAST_RISE, 100 * SHARE_OF_RISE * best_gain),
                "maxfev": MOST_TRIALS * count,
            },
        )
        if -found.fun > best_gain:
            best_point, best_gain = np.clip(found.x, low, high), float(-found.fun)
    return np.exp(best_point)


def trials_of(runs: Sequence[GapRun], effect: Effect) -> float:
    """Return about how many samples a search for an effect's nonlinear parameters goes along, over all its trials."""
    whole = sum(run.motion.angle.size + run.target.size for run in runs)
    rough = sum(run.motion.angle.size / run.motion.follow / FOLLOWED + run.target.size for run in runs)
    trials = 0.0
    for variant in effect.variants:
        count = len(variant.parameters)
        grid = int(np.prod(GRID.get(count, (4,) * count))) if count else 1
        trials += (grid + STARTS.get(count, 2) * USUAL_TRIALS * count) * (rough + PER_TRIAL)
    most = max(len(variant.parameters) for variant in effect.variants)
    return trials + USUAL_TRIALS * most * (whole + PER_TRIAL)
