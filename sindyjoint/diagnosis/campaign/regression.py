"""The regression of a gap: every candidate effect is fitted beside the model.

The nonlinear parameters of an effect are found by variable projection (Golub and Pereyra 1973): at given ones
everything else is linear and solved exactly, the model's coefficients included, so only the nonlinear ones are
searched, within bounds, from a fixed grid. Rows are in units of noise, so that a fall of χ² is twice a log-likelihood
ratio.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from functools import cached_property

import numpy as np

from sindyjoint.clock import spend
from sindyjoint.diagnosis.campaign import GapRun, reference_scales
from sindyjoint.diagnosis.campaign.gap_rows import base_columns
from sindyjoint.diagnosis.effects import Variant
from sindyjoint.diagnosis.effects.fitted import FittedEffect
from sindyjoint.diagnosis.effects.setup import JoinedMotions
from sindyjoint.diagnosis.policy import CAMPAIGN, DiagnosisPolicy
from sindyjoint.equation.model import JointModel
from sindyjoint.equation.terms import Reference
from sindyjoint.numeric import Array

# Columns of a state that grew beyond this have no square.
FARTHEST = 1e150


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
    policy : DiagnosisPolicy
    residual : ndarray, shape (N,)
        Of the target, those columns fitted.
    """

    runs: tuple[GapRun, ...]
    base: Array
    target: Array
    reference: Reference
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
    ) -> "GapRegression":
        """Return the regression of a model, with effects found before beside its terms."""
        columns = [stack(runs, lambda r: base_columns(model, r)), *(effect_rows(runs, e) for e in found)]
        base, target = np.hstack(columns), np.concatenate([run.white(run.target) for run in runs])
        basis = _orthonormal(base)
        residual = target - basis @ (basis.T @ target)
        return cls(tuple(runs), base, target, reference_scales(runs), policy, _basis=basis, residual=residual)

    @cached_property
    def _motions(self) -> JoinedMotions:
        return JoinedMotions.of([run.motion for run in self.runs])

    @property
    def chi_square(self) -> float:
        """Sum of squares of the residual, in units of noise."""
        return float(self.residual @ self.residual)

    @property
    def repeats(self) -> bool:
        """Whether every row is of a mean period, whose noise repetition has measured."""
        return all(run.folded for run in self.runs)

    @cached_property
    def samples(self) -> float:
        """Samples that a trial of nonlinear parameters goes along."""
        return float(sum(run.motion.angle.size / run.motion.follow for run in self.runs) + self.target.size)

    def gain(self, variant: Variant, values: Array) -> tuple[float, Array]:
        """Return by how much χ² falls with a variant's columns, and their coefficients."""
        # A trial costs as much as so many samples beside those that it goes along.
        spend(self.samples + 5_000.0)
        columns = variant.along(self._motions, values)
        # A state that no step of the search can follow has no column.
        if not np.all(np.abs(columns) < FARTHEST):
            return 0.0, np.zeros(len(variant.columns))
        ends = np.cumsum([run.motion.keep.size for run in self.runs])[:-1]
        parts = zip(self.runs, np.split(columns, ends), strict=True)
        columns = np.vstack([run.white(part) for run, part in parts])
        size = np.linalg.norm(columns, axis=0)
        # Onto the orthogonal complement of what is there already.
        projected = columns - self._basis @ (self._basis.T @ columns)
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
        if wrong_signs(variant, coefficients):
            return 0.0, coefficients
        return float(2 * explained @ self.residual - explained @ explained), coefficients


def wrong_signs(variant: Variant, coefficients: Array) -> list[str]:
    """Return the symbols of the coefficients that are not positive and, by the catalogue, have to be."""
    pairs = zip(variant.columns, coefficients, strict=True)
    return [column.symbol for column, value in pairs if column.positive and value <= 0]


def stack(runs: Sequence[GapRun], columns: Callable[[GapRun], Array]) -> Array:
    """Return whitened columns of all runs, one below the other."""
    return np.vstack([run.white(columns(run)) for run in runs])


def effect_rows(runs: Sequence[GapRun], fitted: FittedEffect) -> Array:
    """Return an effect's whitened columns over some runs."""
    return stack(runs, lambda run: fitted.variant.along(run.motion, fitted.values))


def _orthonormal(matrix: Array) -> Array:
    """Return an orthonormal basis of the columns, dependent ones left out."""
    scaled = matrix / np.maximum(np.linalg.norm(matrix, axis=0), 1e-300)
    left, singular, _ = np.linalg.svd(scaled, full_matrices=False)
    return left[:, singular > 1e-9 * singular[0]]
