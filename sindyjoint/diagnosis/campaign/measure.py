"""A campaign as evidence: whitened rows with columns of all effects; of a free motion, what each law simulates.

Of a free motion no moment is measured, and every law is fitted to the motion that it simulates. Energies and timings
of half-cycles are linear in what is missing, and say where a fit of each effect begins; which of them the motion goes
on by, phase by phase over all its cycles, its simulation says, where half-cycles say nothing too.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
import scipy

from sindyjoint.clock import spend
from sindyjoint.diagnosis.campaign import GapRun, reference_scales
from sindyjoint.diagnosis.campaign.regression import FARTHEST
from sindyjoint.diagnosis.campaign.repair import (
    all_columns,
    sticks,
)
from sindyjoint.diagnosis.effects import Effect, Variant
from sindyjoint.diagnosis.effects.fitted import FittedEffect
from sindyjoint.diagnosis.effects.setup import JoinedMotions
from sindyjoint.diagnosis.evidence import GROUPS, Evidence, Rotated, Score
from sindyjoint.diagnosis.evidence.search import Candidate, Chosen, Search
from sindyjoint.diagnosis.policy import CAMPAIGN
from sindyjoint.equation.model import JointModel
from sindyjoint.equation.terms import Reference
from sindyjoint.numeric import Array, main_frequency

# Points of a grid of nonlinear parameters, by their number; trials of a refinement, per parameter.
GRID, TRIALS = {1: (13,), 2: (7, 5), 3: (5, 3, 3)}, 30
# The term of a model that may not push.
FRICTION = "coulomb_friction"


@dataclass(eq=False)
class CampaignEvidence:
    """The rows of a campaign, and the columns along its motions.

    Parameters
    ----------
    runs : sequence of GapRun
    model : JointModel
    effects : sequence of Effect
        Candidates.
    beside : sequence of FittedEffect
        Whose columns are there in any case, as the model's terms are.
    sticking : float
        Share of the motion beyond which a slider that sticks is no slider.
    """

    runs: Sequence[GapRun]
    model: JointModel
    effects: Sequence[Effect]
    beside: Sequence[FittedEffect] = ()
    sticking: float = CAMPAIGN.sticking_share

    def __post_init__(self) -> None:
        runs = self.runs
        size = float(np.sqrt(np.mean(np.concatenate([run.target for run in runs]) ** 2)))
        segments = -(-GROUPS // len(runs))
        self.rotated = [Rotated(run, *_along(run), size, segments) for run in runs]
        self._ends = np.cumsum([run.target.size for run in runs])[:-1]
        labels = np.concatenate([1000 * i + each.segment for i, each in enumerate(self.rotated)])
        self.evidence = Evidence(
            self.whitened(np.concatenate([run.target for run in runs])),
            np.unique(labels, return_inverse=True)[1],
            np.concatenate([each.spread for each in self.rotated]),
        )
        self.base = self.evidence.add(
            self.whitened(np.vstack([all_columns(run, self.model, self.beside) for run in runs]))
        )
        self.reference: Reference = reference_scales(runs)
        self.motions = JoinedMotions.of([run.motion for run in runs])
        self.rough = JoinedMotions.of([run.motion.rough() for run in runs])
        self.by_id = {effect.id: effect for effect in self.effects}

    def whitened(self, rows: Array) -> Array:
        """Return stacked rows of all runs, whitened and rotated."""
        parts = np.split(rows, self._ends)
        return np.concatenate([turn(part) for turn, part in zip(self.rotated, parts, strict=True)])

    def column(self, variant: Variant, values: Array, rough: bool = False) -> Array | None:
        """Return a variant's whitened columns, or None where its states cannot be followed."""
        motions = self.rough if rough else self.motions
        plain = variant.along(motions, values)
        if not np.all(np.abs(plain) < FARTHEST):
            return None
        return self.whitened(plain)

    def candidates(self) -> list[Candidate]:
        """Return all effects on the grids of their nonlinear parameters."""
        found = []
        for effect in self.effects:
            for form, variant in enumerate(effect.variants):
                points = self._grid(variant)
                spend(float(len(points) * self.rough.angle.size))
                for values in points:
                    if sticks(variant, values, self.runs, self.sticking):
                        continue
                    columns = self.column(variant, values, rough=True)
                    if columns is None or not self._independent(columns):
                        continue
                    column, mix = mixed(columns, self._residual, self._basis)
                    signs = [each.positive for each in variant.columns]
                    if len(mix) > 1 and any(
                        sign and part <= 0 for sign, part in zip(signs, mix, strict=True)
                    ):
                        continue
                    (place,) = self.evidence.add(column)
                    found.append(
                        Candidate(
                            effect.id, form, values, place, len(mix) > 1 or signs[0],
                            effect.enters != "moment", bool(variant.states), mix,
                        )
                    )  # fmt: skip
        return found

    @cached_property
    def _basis(self) -> Array:
        """An orthonormal basis of the columns that are there in any case."""
        left, singular, _ = np.linalg.svd(self.evidence.columns[:, self.base], full_matrices=False)
        return np.asarray(left[:, singular > 1e-9 * singular[0]])

    @cached_property
    def _residual(self) -> Array:
        return np.asarray(self.evidence.target - self._basis @ (self._basis.T @ self.evidence.target))

    def _independent(self, columns: Array) -> bool:
        """Return whether columns are outside the span of the model's terms."""
        norm = np.linalg.norm(columns)
        outside = columns - self._basis @ (self._basis.T @ columns)
        return bool(norm > 0 and np.linalg.norm(outside) > 1e-5 * norm)

    def _grid(self, variant: Variant) -> Array:
        bounds = variant.bounds(self.reference)
        if not len(bounds):
            return np.empty((1, 0))
        axes = [
            np.geomspace(low, high, count)
            for (low, high), count in zip(bounds, GRID.get(len(bounds), (4,) * len(bounds)), strict=True)
        ]
        return np.array(np.meshgrid(*axes, indexing="ij")).reshape(len(bounds), -1).T

    def refine(self, candidate: Candidate, beside: Sequence[int], size: float) -> Candidate:
        """Return a candidate with the nonlinear parameters that explain most beside some columns."""
        variant = self.by_id[candidate.name].variants[candidate.form]
        bounds = np.log(variant.bounds(self.reference)).T
        weight = np.sqrt(1 / (1 + size**2 * self.evidence.spread))
        basis, _ = np.linalg.qr(self.evidence.columns[:, list(beside)] * weight[:, None])
        target = self.evidence.target * weight
        residual = target - basis @ (basis.T @ target)
        slow = self.motions.angle.size > 60_000

        def loss(point: Array) -> float:
            columns = self.column(variant, np.exp(np.clip(point, *bounds)), rough=slow)
            if columns is None:
                return 0.0
            column = mixed(columns * weight[:, None], residual, basis)[0][:, 0]
            column = column - basis @ (basis.T @ column)
            return -float((column @ residual) ** 2 / max(float(column @ column), 1e-300))

        start = np.clip(np.log(candidate.values), *bounds)
        count = np.array(GRID.get(start.size, (4,) * start.size))
        step = 0.5 * (bounds[1] - bounds[0]) / np.maximum(count - 1, 1)
        simplex = np.vstack([start, start + np.diag(np.where(start + step < bounds[1], step, -step))])
        options = dict(initial_simplex=simplex, xatol=3e-3, fatol=0.05, maxfev=TRIALS * start.size)
        spend(float(TRIALS * start.size * self.motions.angle.size))
        found = scipy.optimize.minimize(loss, start, method="Nelder-Mead", options=options)
        values = np.exp(np.clip(found.x, *bounds))
        columns = self.column(variant, values)
        if columns is None or sticks(variant, values, self.runs, self.sticking):
            return candidate
        mix = mixed(columns * weight[:, None], residual, basis)[1]
        (place,) = self.evidence.add(columns @ np.array(mix)[:, None])
        return replace(candidate, values=values, place=place, mix=mix)

    def search(self, before: float = 0.0) -> Search:
        """Return the search over sets of the candidates; ``before``: what corrections have won already, nats."""
        sure = all(run.folded or run.half_cycles is not None for run in self.runs)
        friction = [
            place for place, term in zip(self.base, self.model.terms, strict=False) if term.id == FRICTION
        ]
        return Search(self.evidence, self.base, self.candidates(), self.refine, before, sure, friction)

    def fitted(self, found: Chosen) -> list[FittedEffect]:
        """Return the members of a set as effects with their numbers."""
        places = [*self.base, *(m.place for m in found.members)]
        solved = self.evidence.fit(places, found.score.size)[len(self.base) :]
        effects = []
        for value, each in zip(solved, found.members, strict=True):
            effect = self.by_id[each.name]
            variant = effect.variants[each.form]
            effects.append(FittedEffect(effect, variant, each.values, value * np.array(each.mix), 0.0))
        return effects


def score_of(runs: Sequence[GapRun], model: JointModel, effects: Sequence[FittedEffect]) -> Score:
    """Return the score of a model with effects, delays aside, all coefficients fitted together."""
    ev = CampaignEvidence(runs, model, (), [each for each in effects if not each.shifts])
    return ev.evidence.score(ev.base)


def mixed(columns: Array, residual: Array, basis: Array) -> tuple[Array, tuple[float, ...]]:
    """Return the combination of columns, (n, k) → (n, 1), that explains most of a residual beside a basis."""
    if columns.shape[1] == 1:
        return columns, (1.0,)
    mix = np.linalg.lstsq(columns - basis @ (basis.T @ columns), residual, rcond=None)[0]
    return columns @ mix[:, None], tuple(mix.tolist())


def _along(run: GapRun) -> tuple[Array, bool]:
    """Return the place of each row along the motion, in periods, and whether the rows are one period."""
    motion = run.motion
    if run.folded:
        return motion.keep / motion.angle.size, True
    frequency = motion.frequency or main_frequency(motion.angle, 1 / motion.step)
    return motion.time[motion.keep] * (frequency or 1.0), False
