"""What families of laws predict of a gap on runs that they never saw.

A loop measured at one level and one frequency is a function of (θ, θ̇) whatever made it, so runs alone are too little to
leave out: a run is predicted from runs of other levels, one of them larger, so that nothing is extrapolated in angle.
A memoryless law holds there; a memory shows, because its loops turn elsewhere.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from sindyjoint.diagnosis.campaign.regression import GapRegression, stack
from sindyjoint.diagnosis.campaign.rows.run import GapRun, row_groups
from sindyjoint.diagnosis.campaign.unnamed import families
from sindyjoint.diagnosis.policy import DiagnosisPolicy
from sindyjoint.numeric import Array

SMOOTHNESS = (1e-6, 1e-4, 1e-2, 1.0)
SHRINKAGE = (1e-6, 1e-4, 1e-2)
LEAST_SHRINKAGE = 1e-8

BASE = "base"
#: Kinds of law, and of each the sets of columns that may stand for it.
KINDS: dict[str, tuple[tuple[str, ...], ...]] = {
    "state": (("surface",),),
    "history": (("relaxations",), ("stops",), ("relaxations", "stops")),
    "run": (("frequency",), ("acceleration",), ("time",), ("frequency", "acceleration", "time")),
}


@dataclass(frozen=True)
class Fold:
    """Rows to predict, and the blocks of rows to predict them from."""

    out: int
    known: tuple[int, ...]


@dataclass(frozen=True)
class Predictor:
    """Sets of columns, and the squared error that is left with the smoothness and shrinkage that predict best."""

    columns: tuple[str, ...]
    error: float


class Prediction:
    """The held-out errors of families of laws on one gap.

    Parameters
    ----------
    problem : GapRegression
    """

    def __init__(self, problem: GapRegression) -> None:
        self.labels, self.folds = _folds(problem)
        self.blocks = [self.labels == label for label in dict.fromkeys(self.labels.tolist())]
        self._problem = problem
        self._columns = _columns(problem)
        ends = np.cumsum([0, *(c.shape[1] for c in self._columns.values())])
        self._place = {n: np.arange(a, b) for n, a, b in zip(self._columns, ends[:-1], ends[1:], strict=True)}
        self.rows = sum(int(np.count_nonzero(self.blocks[fold.out])) for fold in self.folds)

    @cached_property
    def _products(self) -> tuple[list[Array], list[Array], list[float]]:
        """Return X'X, X'y and y'y of every block."""
        columns, target = np.hstack(list(self._columns.values())), self._problem.residual
        parts = [(columns[rows], target[rows]) for rows in self.blocks]
        return [x.T @ x for x, _ in parts], [x.T @ y for x, y in parts], [float(y @ y) for _, y in parts]

    @cached_property
    def _known(self) -> dict[tuple[int, ...], tuple[Array, Array]]:
        """Return X'X and X'y of every set of blocks that others are predicted from."""
        square, product, _ = self._products
        sets = dict.fromkeys(fold.known for fold in self.folds)
        return {known: (_sum_of(square, known), _sum_of(product, known)) for known in sets}

    @cached_property
    def base(self) -> float:
        """Squared error of the model's own terms."""
        return self._error((BASE,), 0.0, LEAST_SHRINKAGE)

    def best(self, kind: str, beside: tuple[str, ...] = ()) -> Predictor:
        """Return the set of a kind's columns that predicts best, beside other columns."""
        tried = [
            Predictor((*beside, *names), self._least((BASE, *beside, *names))) for names in KINDS[kind]
            if all(self._columns[name].shape[1] for name in names)
        ]  # fmt: skip
        return min(tried, key=lambda each: each.error, default=Predictor(beside, np.inf))

    def _least(self, names: tuple[str, ...]) -> float:
        smooth = SMOOTHNESS if "surface" in names else (0.0,)
        shrink = SHRINKAGE if set(names) - {BASE, "surface"} else (LEAST_SHRINKAGE,)
        return min(self._error(names, a, b) for a in smooth for b in shrink)

    def _error(self, names: tuple[str, ...], smoothness: float, shrinkage: float) -> float:
        """Return the squared error, over all folds, of a penalised fit to the known blocks."""
        square, product, own = self._products
        use = np.concatenate([self._place[name] for name in names])
        grid = np.ix_(use, use)
        penalty = self._penalty(names, smoothness, shrinkage)
        solved = {
            known: np.linalg.solve(normal[grid] + penalty, right[use])
            for known, (normal, right) in self._known.items()
        }
        total = 0.0
        for fold in self.folds:
            c = solved[fold.known]
            total += own[fold.out] - 2 * float(c @ product[fold.out][use])
            total += float(c @ square[fold.out][grid] @ c)
        return total

    def _penalty(self, names: tuple[str, ...], smoothness: float, shrinkage: float) -> Array:
        from scipy.linalg import block_diag

        parts = []
        for name in names:
            identity = np.eye(self._place[name].size)
            if name == "surface":
                parts.append(smoothness * families.surface_roughness() + LEAST_SHRINKAGE * identity)
            else:
                parts.append((LEAST_SHRINKAGE if name == BASE else shrinkage) * identity)
        penalty: Array = block_diag(*parts)
        return penalty


def _sum_of(arrays: Sequence[Array], places: Sequence[int]) -> Array:
    """Return the sum of some of several arrays of one shape."""
    total = np.zeros_like(arrays[0])
    for place in places:
        total += arrays[place]
    return total


def _columns(problem: GapRegression) -> dict[str, Array]:
    """Return the whitened columns of every set, each set of unit norm on the whole; a set that is zero is empty."""
    runs, reference = problem.runs, problem.reference
    pulse = families.own_pulse(runs)
    frequency = float(np.mean([run.motion.frequency for run in runs]))
    time = float(np.mean([np.mean(run.motion.time) for run in runs]))
    sets = {
        "surface": stack(runs, lambda run: families.surface_columns(run, reference)),
        "relaxations": stack(runs, lambda run: families.relaxation_columns(run, pulse)),
        "stops": stack(runs, lambda run: families.stop_columns(run, reference.angle or 1.0)),
        "frequency": stack(runs, lambda run: families.frequency_columns(run, frequency)),
        "acceleration": stack(runs, families.inertial_columns),
        "time": stack(runs, lambda run: families.time_columns(run, time)),
    }
    # The surface's columns keep their ratio, on which its smoothness rests.
    own = {
        name: columns / float(np.sqrt(np.mean(np.sum(columns**2, axis=0))))
        if name == "surface"
        else _normed(columns)
        for name, columns in sets.items()
    }
    return {BASE: _normed(problem.base), **own}


def _normed(columns: Array) -> Array:
    """Return columns of unit norm; those that are zero are left out."""
    norm = np.linalg.norm(columns, axis=0)
    kept = norm > 0
    return columns[:, kept] / norm[kept]


def _folds(problem: GapRegression) -> tuple[NDArray[np.object_], tuple[Fold, ...]]:
    """Return the block of every row, and which blocks predict which.

    Of periodic runs each is predicted from those of other levels, where one of them is larger. Where there is but one
    level, and in runs that do not repeat and pass through all levels, groups of runs predict each other.
    """
    runs = problem.runs
    if all(run.folded for run in runs) and (folds := _between_levels(runs, problem.policy)):
        return np.concatenate([np.full(r.target.size, i, dtype=object) for i, r in enumerate(runs)]), folds
    labels = row_groups(runs, white=True)
    count = len(dict.fromkeys(labels.tolist()))
    return labels, tuple(Fold(i, tuple(j for j in range(count) if j != i)) for i in range(count))


def _between_levels(runs: Sequence[GapRun], policy: DiagnosisPolicy) -> tuple[Fold, ...]:
    # To the percent, so that runs of one level are predicted from the same others.
    amplitude = np.exp(np.round(np.log([float(np.abs(run.angle).max()) for run in runs]), 2))
    folds = []
    for index, own in enumerate(amplitude):
        known = np.flatnonzero(np.abs(np.log(amplitude / own)) > np.log1p(policy.same_level))
        if known.size and amplitude[known].max() > own:
            folds.append(Fold(index, tuple(int(i) for i in known)))
    return tuple(folds)
