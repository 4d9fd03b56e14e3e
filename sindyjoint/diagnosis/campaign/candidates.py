"""The search for variant and nonlinear parameters of every candidate effect: a grid, Nelder-Mead, refinement."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from sindyjoint.diagnosis.campaign.regression import PER_TRIAL, GapRegression, wrong_signs
from sindyjoint.diagnosis.campaign.rows.run import GapRun
from sindyjoint.diagnosis.effects.catalogue import Effect, Variant
from sindyjoint.diagnosis.effects.fitted import FittedEffect
from sindyjoint.numeric import Array
from sindyjoint.parallel import side_by_side

# Per number of nonlinear parameters: points of a grid, and from how many of the best a search starts.
GRID = {1: (17,), 2: (8, 5), 3: (5, 3, 3)}
STARTS = {1: 1, 2: 3}
# Nonlinear parameters are refined until their gain rises by less than this, or this share of it; the search is coarser.
LEAST_RISE, SHARE_OF_RISE = 0.02, 1e-5
MOST_TRIALS = 80  # of nonlinear parameters, per parameter; a ridge is followed slowly
USUAL_TRIALS = 30
FOLLOWED = 4  # samples in one step of a rough motion, about
# Nonlinear parameters are refined where the search came within this share of the best gain, and searched where the grid
# did; a search raises the gain of a grid threefold at most, and nothing is left out that noise could make the best.
WORTH_REFINING = 0.3
WORTH_SEARCHING, LEAST_LEAD = 0.1, 40.0
# An effect with a sign that the catalogue denies is searched where the grid came within this share of the best.
WORTH_DENIED = 0.7


def fit_effect(problem: GapRegression, effect: Effect) -> FittedEffect:
    """Return the variant and nonlinear parameters of an effect that lower χ² most."""
    rough = problem.rough()
    return refine_effect(problem, _searched(problem, rough, -np.inf, (effect, _gridded(rough, effect))))


def fit_effects(problem: GapRegression, effects: Sequence[Effect]) -> list[FittedEffect]:
    """Fit several effects, side by side, in their order.

    Nonlinear parameters are looked for on a grid along a roughly followed motion, searched from there, and refined
    along the motion itself: each for those that came near the best.
    """
    return _fitted(problem, effects)[0]


def fit_with_any_sign(
    problem: GapRegression, effects: Sequence[Effect]
) -> tuple[list[FittedEffect], FittedEffect | None]:
    """Return the effects fitted, and one with a sign that the catalogue denies if its gain is the largest.

    Grids have the gain of either sign; of those denied the best variant of all is searched, if it comes near.
    """
    fitted, grids = _fitted(problem, effects)
    tried = [
        (points._replace(gains=points.denied), effect, variant)
        for effect, own in zip(effects, grids, strict=True)
        for variant, points in zip(effect.variants, own, strict=True)
    ]
    least = max((f.gain for f in fitted), default=0.0)
    best = max(tried, key=lambda each: each[0].best, default=None)
    if best is None or best[0].best <= WORTH_DENIED * least:
        return fitted, None
    points, effect, variant = best
    free = replace(problem, any_sign=True)
    values = _search(free.rough(), variant, points)
    gain, coefficients = free.gain(variant, values)
    denied = gain > least and wrong_signs(variant, coefficients)
    return fitted, FittedEffect(effect, variant, values, coefficients, gain) if denied else None


def _fitted(
    problem: GapRegression, effects: Sequence[Effect]
) -> tuple[list[FittedEffect], list[list[_Grid]]]:
    rough = problem.rough()
    grids = side_by_side(_gridded, effects, [rough])
    best = max((points.best for grid in grids for points in grid), default=0.0)
    least = min(WORTH_SEARCHING * best, best - LEAST_LEAD)
    found = side_by_side(_searched, list(zip(effects, grids, strict=True)), [problem, rough, least])
    worth = WORTH_REFINING * max((f.gain for f in found), default=0.0)
    tasks = [(f, bool(f.variant.states) and f.gain >= worth) for f in found]
    return side_by_side(_refined, tasks, [problem]), grids


def _refined(problem: GapRegression, task: tuple[FittedEffect, bool]) -> FittedEffect:
    return refine_effect(problem, task[0]) if task[1] else task[0]


class _Grid(NamedTuple):
    """Logarithms of the nonlinear parameters of a variant on a grid, shape (n, k), and the gain of each point.

    ``denied`` are the gains with a sign that the catalogue denies, zero where the sign is right.
    """

    points: Array
    gains: Array
    denied: Array

    @property
    def best(self) -> float:
        return float(self.gains.max())


def _gridded(rough: GapRegression, effect: Effect) -> list[_Grid]:
    """Return the gains of each variant of an effect on the grid of its nonlinear parameters."""
    grids, free = [], replace(rough, any_sign=True)
    for variant in effect.variants:
        bounds = variant.bounds(rough.reference)
        ends = zip(*np.log(bounds).T, _shape(len(bounds)), strict=True) if len(bounds) else ()
        axes = [np.linspace(low, high, n) for low, high, n in ends]
        points = (
            np.array(np.meshgrid(*axes, indexing="ij")).reshape(len(bounds), -1).T
            if axes
            else np.empty((1, 0))
        )
        tried = [free.gain(variant, np.exp(point)) for point in points]
        gains = np.array([gain for gain, _ in tried])
        wrong = np.array([bool(wrong_signs(variant, coefficients)) for _, coefficients in tried])
        grids.append(_Grid(points, np.where(wrong, 0.0, gains), np.where(wrong, gains, 0.0)))
    return grids


def _shape(count: int) -> tuple[int, ...]:
    return GRID.get(count, (4,) * count)


def _searched(
    problem: GapRegression, rough: GapRegression, least: float, task: tuple[Effect, Sequence[_Grid]]
) -> FittedEffect:
    """Return the best variant and nonlinear parameters that a search along the roughly followed motion finds."""
    best: FittedEffect | None = None
    effect, grids = task
    for variant, grid in zip(effect.variants, grids, strict=True):
        values = (
            _search(rough, variant, grid)
            if grid.best >= least
            else np.exp(grid.points[np.argmax(grid.gains)])
        )
        gain, coefficients = problem.gain(variant, values)
        if best is None or gain > best.gain:
            best = FittedEffect(effect, variant, values, coefficients, gain)
    assert best is not None
    return best


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
    best_point, best_gain = grid.points[int(np.argmax(grid.gains))], grid.best
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
                "fatol": max(LEAST_RISE, 100 * SHARE_OF_RISE * grid.best),
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
