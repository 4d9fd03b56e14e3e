"""The evidence expected of a run with the rivals as they were found: only what is linear is fitted.

The measured rows are the same for every run that is tried. Their columns go into one triangular factor, under which
those of the run are laid (updating of a QR factorisation; Golub and Van Loan, Matrix Computations, chapter 6).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from sindyjoint.diagnosis.campaign.regression import (
    GapRegression,
    column_error,
    effect_rows,
    exact_first,
    stack,
)
from sindyjoint.diagnosis.campaign.rows.build import base_columns
from sindyjoint.diagnosis.campaign.rows.run import GapRun
from sindyjoint.diagnosis.effects.fitted import FittedEffect
from sindyjoint.diagnosis.policy import DiagnosisPolicy
from sindyjoint.diagnosis.ranking import EvidenceScale, rank
from sindyjoint.equation.model import JointModel
from sindyjoint.numeric import Array


@dataclass(frozen=True, eq=False)
class CoarseRows:
    """The measured rows, condensed: columns of the model and effects found, then those of the members of a class.

    Parameters
    ----------
    factor : ndarray, shape (k, k)
        Triangular; the same products as the rows.
    base : int
        Number of columns that are fitted in any case.
    rows : int
        How many rows there were.
    choices : tuple of int
        Numbers that each member chooses.
    inherited, correlated : float
        As in :class:`~sindyjoint.diagnosis.ranking.EvidenceScale`.
    repeats : bool
        Whether every row is of a mean period.
    """

    factor: Array
    base: int
    rows: int
    choices: tuple[int, ...]
    inherited: float
    correlated: float
    repeats: bool
    runs: tuple[GapRun, ...]
    model: JointModel
    others: tuple[FittedEffect, ...]
    policy: DiagnosisPolicy

    @classmethod
    def build(
        cls,
        runs: Sequence[GapRun],
        model: JointModel,
        others: Sequence[FittedEffect],
        members: Sequence[FittedEffect],
        policy: DiagnosisPolicy,
    ) -> CoarseRows:
        """Condense the rows of some runs."""
        problem = GapRegression.build(runs, model, others, policy)
        columns = np.hstack([problem.base, _columns(runs, members)])
        return cls(
            factor=np.asarray(np.linalg.qr(columns, mode="r")),
            base=problem.base.shape[1],
            rows=len(columns),
            choices=tuple(problem.choices(each.variant) for each in members),
            inherited=problem.inherited,
            correlated=problem.correlated,
            repeats=problem.repeats,
            runs=tuple(runs),
            model=model,
            others=tuple(others),
            policy=policy,
        )

    def evidence(self, added: Sequence[GapRun], members: Sequence[FittedEffect]) -> list[Array]:
        """Return, with each member in turn taken for true, the logarithms of all their probabilities."""
        base = [
            stack(added, lambda run: base_columns(self.model, run)),
            _columns(added, exact_first(self.others)),
        ]
        more = np.hstack([*base, _columns(added, members)])
        both = np.vstack([self.factor, more])
        ends = self.base + np.cumsum([0, *(len(each.coefficients) for each in members)])
        parts = [both[:, first:last] for first, last in zip(ends[:-1], ends[1:], strict=True)]
        repeats = self.repeats and all(run.folded for run in added)
        found = []
        for true, columns in zip(members, parts, strict=True):
            target = columns @ true.coefficients
            problem = GapRegression.of_columns(
                (*self.runs, *added), both[:, : self.base], target, self.inherited, self.policy
            )
            fitted = []
            for each, own in zip(members, parts, strict=True):
                gain, coefficients = problem.gain_of(each.variant, own)
                fitted.append(replace(each, gain=gain, coefficients=coefficients))
            rows = self.rows + len(more)
            scale = EvidenceScale(
                problem.chi_square,
                rows - self.base,
                rows / self.correlated,
                column_error(fitted, repeats, self.policy),
                self.inherited,
                self.correlated,
            )
            ranking = rank(fitted, self.choices, scale, self.policy)
            known = {f.name: p for f, p in zip(ranking.fitted, ranking.probabilities, strict=True)}
            found.append(np.array([np.log(max(known[each.name], 1e-300)) for each in members]))
        return found


def _columns(runs: Sequence[GapRun], effects: Sequence[FittedEffect]) -> Array:
    """Return whitened columns of some effects along some runs."""
    columns = [effect_rows(runs, each) for each in effects]
    rows = sum(run.white_size for run in runs)
    return np.hstack([np.empty((rows, 0)), *columns])
