"""The regression of a gap: every candidate effect is fitted beside the model.

The nonlinear parameters of an effect are found by variable projection (Golub and Pereyra 1973): at given ones
everything else is linear and solved exactly, the model's coefficients included, so only the nonlinear ones are
searched, within bounds, from a fixed grid. Rows are in units of noise, so that a fall of χ² is twice a log-likelihood
ratio.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from sindyjoint.diagnosis.campaign.rows.build import base_columns
from sindyjoint.diagnosis.campaign.rows.excerpt import excerpt
from sindyjoint.diagnosis.campaign.rows.half_cycles import correlation
from sindyjoint.diagnosis.campaign.rows.run import GapRun, reference_scales
from sindyjoint.diagnosis.effects.catalogue import Effect, Variant
from sindyjoint.diagnosis.effects.fitted import FittedEffect
from sindyjoint.diagnosis.effects.motion import JoinedMotions
from sindyjoint.diagnosis.policy import CAMPAIGN, DiagnosisPolicy
from sindyjoint.diagnosis.ranking import EvidenceScale, Ranking, rank
from sindyjoint.equation.model import JointModel
from sindyjoint.equation.terms import Reference
from sindyjoint.parallel import side_by_side

Array = NDArray[np.float64]

# Per number of nonlinear parameters: points of a grid, and from how many of the best a search starts.
GRID = {1: (17,), 2: (8, 5), 3: (5, 3, 3)}
STARTS = {1: 1, 2: 3}
# Nonlinear parameters are refined until their gain rises by less than this, or this share of it; the search is coarser.
LEAST_RISE, SHARE_OF_RISE = 0.02, 1e-5
MOST_TRIALS = 80  # of nonlinear parameters, per parameter; a ridge is followed slowly
USUAL_TRIALS = 30
PER_TRIAL = 5_000.0  # samples that a trial costs beside those that it goes along
FOLLOWED = 4  # samples in one step of a rough motion, about
# Steps of integration over all runs for one trial of nonlinear parameters.
ROUGH_STEPS = 30_000
# Nonlinear parameters are refined where the search came within this share of the best gain, and searched where the grid
# did; a search raises the gain of a grid threefold at most, and nothing is left out that noise could make the best.
WORTH_REFINING = 0.3
WORTH_SEARCHING, LEAST_LEAD = 0.1, 40.0


@dataclass(frozen=True, eq=False)
class GapRegression:
    """Rows of all runs in units of noise, and the columns that are fitted in any case.

    Parameters
    ----------
    runs : tuple of GapRun
    base : ndarray, shape (N, p)
        Whitened columns of the model's terms and of effects already found.
    target : ndarray, shape (N,)
    reference : Reference
    explained : float
        Fall of χ² that the effects already found have brought.
    policy : DiagnosisPolicy
    residual : ndarray, shape (N,)
        Of the target, those columns fitted.
    """

    runs: tuple[GapRun, ...]
    base: Array
    target: Array
    reference: Reference
    explained: float = 0.0
    policy: DiagnosisPolicy = CAMPAIGN
    _basis: Array = field(repr=False, default_factory=lambda: np.empty((0, 0)))
    residual: Array = field(repr=False, default_factory=lambda: np.empty(0))

    @classmethod
    def build(
        cls,
        runs: Sequence[GapRun],
        model: JointModel,
        found: Sequence[FittedEffect] = (),
        policy: DiagnosisPolicy = CAMPAIGN,
    ) -> GapRegression:
        """Return the regression of a model, with effects found before beside its terms."""
        columns = [stack(runs, lambda run: base_columns(model, run))]
        for each in found:
            columns.append(stack(runs, lambda run, e=each: e.variant.along(run.motion, e.values)))  # type: ignore[misc]
        base = np.hstack(columns)
        target = np.concatenate([run.white(run.target) for run in runs])
        return cls.of_columns(runs, base, target, sum(each.gain for each in found), policy)

    @classmethod
    def of_columns(
        cls,
        runs: Sequence[GapRun],
        base: Array,
        target: Array,
        explained: float = 0.0,
        policy: DiagnosisPolicy = CAMPAIGN,
    ) -> GapRegression:
        """Return the regression of whitened columns and target, of whatever they are the rows."""
        basis = _orthonormal(base)
        residual = target - basis @ (basis.T @ target)
        return cls(tuple(runs), base, target, reference_scales(runs), explained, policy, basis, residual)

    @cached_property
    def _motions(self) -> JoinedMotions:
        return JoinedMotions.of([run.motion for run in self.runs])

    @property
    def chi_square(self) -> float:
        """Sum of squares of the residual, in units of noise."""
        return float(self.residual @ self.residual)

    @property
    def degrees(self) -> int:
        """Rows less fitted columns."""
        return self.target.size - self._basis.shape[1]

    @property
    def free(self) -> bool:
        """Whether rows are half-cycles of free motion."""
        return any(run.half_cycles for run in self.runs)

    @property
    def repeats(self) -> bool:
        """Whether every row is of a mean period, whose noise repetition has measured."""
        return all(run.folded for run in self.runs)

    @property
    def correlated(self) -> float:
        """How many neighbouring rows say the same thing: one, but for the half-cycles of free motion."""
        if not self.free:
            return 1.0
        ends = np.cumsum([run.white_size for run in self.runs])[:-1]
        parts = zip(self.runs, np.split(self.residual, ends), strict=True)
        return max(correlation(part, self.policy) for run, part in parts if run.half_cycles)

    def choices(self, variant: Variant) -> int:
        """Numbers that a fit chooses; what repeats does not depend on the states it began with, a decay does."""
        return variant.degrees + (len(variant.states) if self.free else 0)

    def rough(self) -> GapRegression:
        """Return the regression for searching: states follow the motion roughly, and windows of long records only."""
        runs = [run.rough() for run in self.runs]
        share = _share(runs)
        if share >= 1:
            return replace(self, runs=tuple(runs))
        parts = [excerpt(run, share) for run in runs]
        starts = np.cumsum([0, *(run.target.size for run in runs[:-1])])
        rows = np.concatenate([start + kept for start, (_, kept) in zip(starts, parts, strict=True)])
        return GapRegression.of_columns(
            [run for run, _ in parts], self.base[rows], self.target[rows], self.explained, self.policy
        )

    def projected(self, columns: Array) -> Array:
        """Return whitened columns projected onto the orthogonal complement of those that are there already."""
        return columns - self._basis @ (self._basis.T @ columns)

    def gain(self, variant: Variant, values: Array) -> tuple[float, Array]:
        """Return by how much χ² falls with a variant's columns, and their coefficients."""
        columns = variant.along(self._motions, values)
        # A state that no step of the search can follow has no column.
        if not np.isfinite(columns).all():
            return 0.0, np.zeros(len(variant.columns))
        ends = np.cumsum([run.motion.keep.size for run in self.runs])[:-1]
        parts = zip(self.runs, np.split(columns, ends), strict=True)
        return self.gain_of(variant, np.vstack([run.white(part) for run, part in parts]))

    def gain_of(self, variant: Variant, columns: Array) -> tuple[float, Array]:
        """Return the same for whitened columns, shape (N, n_columns)."""
        if not np.all(np.isfinite(columns)):
            return 0.0, np.zeros(columns.shape[1])
        size = np.linalg.norm(columns, axis=0)
        projected = self.projected(columns)
        norm = np.linalg.norm(projected, axis=0)
        # A column inside the span of what is there already explains nothing, only rounding.
        if np.any(norm <= 1e-6 * size) or np.any(size == 0):
            return 0.0, np.zeros(columns.shape[1])
        unit = projected / norm
        if unit.shape[1] == 1:
            coefficients = unit.T @ self.residual
        else:
            coefficients, *_ = np.linalg.lstsq(unit, self.residual, rcond=None)
        explained = unit @ coefficients
        coefficients = coefficients / norm
        for column, value in zip(variant.columns, coefficients, strict=True):
            if column.positive and value <= 0:
                return 0.0, coefficients
        # What is larger than the moment itself must be cancelled by the other terms, and is no effect.
        if np.any(np.abs(coefficients) * size > self.policy.cancelled * np.linalg.norm(self.target)):
            return 0.0, coefficients
        return float(2 * explained @ self.residual - explained @ explained), coefficients


def fit_effect(problem: GapRegression, effect: Effect) -> FittedEffect:
    """Return the variant and nonlinear parameters of an effect that lower χ² most."""
    rough = problem.rough()
    return refine_effect(problem, _searched(problem, rough, -np.inf, (effect, _gridded(rough, effect))))


def fit_effects(problem: GapRegression, effects: Sequence[Effect]) -> list[FittedEffect]:
    """Fit several effects, side by side, in their order.

    Nonlinear parameters are looked for on a grid along a roughly followed motion, searched from there, and refined
    along the motion itself: each for those that came near the best.
    """
    rough = problem.rough()
    grids = side_by_side(_gridded, effects, [rough])
    best = max((points.best for grid in grids for points in grid), default=0.0)
    least = min(WORTH_SEARCHING * best, best - LEAST_LEAD)
    found = side_by_side(_searched, list(zip(effects, grids, strict=True)), [problem, rough, least])
    worth = WORTH_REFINING * max((f.gain for f in found), default=0.0)
    return side_by_side(_refined, [(f, bool(f.variant.states) and f.gain >= worth) for f in found], [problem])


def _refined(problem: GapRegression, task: tuple[FittedEffect, bool]) -> FittedEffect:
    return refine_effect(problem, task[0]) if task[1] else task[0]


class _Grid(NamedTuple):
    """Logarithms of the nonlinear parameters of a variant on a grid, shape (n, k), and the gain of each point."""

    points: Array
    gains: Array

    @property
    def best(self) -> float:
        return float(self.gains.max())


def _gridded(rough: GapRegression, effect: Effect) -> list[_Grid]:
    """Return the gains of each variant of an effect on the grid of its nonlinear parameters."""
    grids = []
    for variant in effect.variants:
        bounds = variant.bounds(rough.reference)
        ends = zip(*np.log(bounds).T, _shape(len(bounds)), strict=True) if len(bounds) else ()
        axes = [np.linspace(low, high, n) for low, high, n in ends]
        points = (
            np.array(np.meshgrid(*axes, indexing="ij")).reshape(len(bounds), -1).T
            if axes
            else np.empty((1, 0))
        )
        grids.append(_Grid(points, np.array([rough.gain(variant, np.exp(point))[0] for point in points])))
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

    bounds = np.log(fitted.variant.bounds(problem.reference)).T
    start = np.clip(np.log(fitted.values), *bounds)
    found = minimize(
        lambda p: -problem.gain(fitted.variant, np.exp(np.clip(p, *bounds)))[0],
        start,
        method="Nelder-Mead",
        options={
            "initial_simplex": np.vstack([start, start + 0.1 * np.eye(start.size)]),
            "xatol": 1e-3,
            "fatol": max(LEAST_RISE, SHARE_OF_RISE * fitted.gain),
            "maxfev": MOST_TRIALS * start.size,
        },
    )
    values = np.exp(np.clip(found.x, *bounds))
    gain, coefficients = problem.gain(fitted.variant, values)
    return replace(fitted, values=values, gain=gain, coefficients=coefficients)


def rank_effects(problem: GapRegression, fitted: Sequence[FittedEffect]) -> Ranking[FittedEffect]:
    """Return the candidates in order of probability."""
    policy, correlated = problem.policy, problem.correlated
    scale = EvidenceScale(
        problem.chi_square,
        problem.degrees,
        problem.target.size / correlated,
        column_error(fitted, problem.repeats, policy),
        problem.explained,
        correlated,
    )
    return rank(fitted, [problem.choices(f.variant) for f in fitted], scale, policy)


def column_error(fitted: Sequence[FittedEffect], repeats: bool, policy: DiagnosisPolicy) -> float:
    """Return the relative error of the candidates' columns, by the best of them."""
    if repeats:
        return policy.column_error
    best = max(fitted, key=lambda f: f.gain)
    return policy.state_error_once if best.variant.states else policy.column_error_once


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


def shortened(runs: Sequence[GapRun]) -> tuple[GapRun, ...]:
    """Return runs of which no more is kept than a search goes along; those that repeat, or are free, stay whole."""
    share = _share(runs)
    return tuple(runs) if share >= 1 else tuple(excerpt(run, share)[0] for run in runs)


def _share(runs: Sequence[GapRun]) -> float:
    """Return what share of some runs is searched; one where their rows are few, or belong together."""
    if any(run.folded or run.half_cycles for run in runs):
        return 1.0
    return ROUGH_STEPS / sum(run.motion.angle.size / run.motion.follow for run in runs)


def stack(runs: Sequence[GapRun], columns: Callable[[GapRun], Array]) -> Array:
    """Return whitened columns of all runs, one below the other."""
    return np.vstack([run.white(columns(run)) for run in runs])


def _orthonormal(matrix: Array) -> Array:
    """Return an orthonormal basis of the columns, dependent ones left out."""
    scaled = matrix / np.maximum(np.linalg.norm(matrix, axis=0), 1e-300)
    left, singular, _ = np.linalg.svd(scaled, full_matrices=False)
    return left[:, singular > 1e-9 * singular[0]]


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
