"""Sequentially thresholded least squares on the unique share of each term, and the choice of its threshold.

Thresholding raw coefficients fails on a joint: θ and θ³, θ̇ and sign θ̇ are so alike on harmonic runs that a large
coefficient may carry nothing. Here the thresholded quantity is a term's *unique share*: the moment, relative to
the RMS of all of it, that no combination of the other terms can take over. The least is removed, the others are
fitted again (and each survivor exchanged for a removed term where that fits better), until none remains: a path
of models, one of each size, with the thresholds at which they change.

The threshold is then chosen by evidence: the largest model on the path of which every term is significant against
the scatter of replicate blocks, keeps its coefficient whichever group is held out, and carries more than a stated
least share, unless a smaller one predicts held-out groups as well.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from sindyjoint.discovery import (
    Evidence,
    Fit,
    fit_columns,
    group_t_ratios,
    held_out_errors,
    left_out_estimates,
)
from sindyjoint.discovery.factors import Factor
from sindyjoint.limits import DISCOVERY
from sindyjoint.numeric import Array

Parents = Mapping[int, tuple[int, ...]]


@dataclass(frozen=True, eq=False)
class Step:
    """One model of the path.

    Parameters
    ----------
    fit : Fit
    threshold : float
        Smallest unique share in the model: the model stands for every threshold up to it.
    held_out : ndarray, shape (n_runs,)
        Mean squared error of each run under the fit to the other groups; empty with one group.
    group_t_ratios : ndarray, shape (k,)
        absolute coefficient / its jackknife standard error over groups; infinite with fewer than three.
    needed : frozenset of int
        Columns without which others of the model make no sense: they need not pass.
    dependent : frozenset of int
        Those others.
    """

    fit: Fit
    threshold: float
    held_out: Array
    group_t_ratios: Array
    needed: frozenset[int] = frozenset()
    dependent: frozenset[int] = frozenset()

    @property
    def columns(self) -> tuple[int, ...]:
        """Columns of the model."""
        return self.fit.columns

    @property
    def size(self) -> int:
        """Number of terms."""
        return len(self.fit.columns)

    @property
    def held_out_rms(self) -> float:
        """Root of the mean held-out squared error over runs; NaN with one group."""
        return float(np.sqrt(np.mean(self.held_out))) if self.held_out.size else float("nan")


@dataclass(frozen=True, eq=False)
class Selection:
    """A path and the step chosen on it.

    Parameters
    ----------
    path : tuple of Step
        From the largest model to the smallest.
    chosen : int or None
        Index of the chosen step; ``None``: no model passed.
    reason : str
        Why, in one sentence.
    """

    path: tuple[Step, ...]
    chosen: int | None
    reason: str

    @property
    def step(self) -> Step | None:
        """The chosen step."""
        return None if self.chosen is None else self.path[self.chosen]


def elimination_path(
    factor: Factor, forced: Sequence[int] = (), parents: Parents | None = None, exchange_below: int = 13
) -> list[tuple[int, ...]]:
    """Return one set of columns for every size, by removing the least unique share and exchanging.

    Parameters
    ----------
    factor : Factor
        Of all candidates.
    forced : sequence of int
        Columns that are never removed.
    parents : mapping of int to tuple of int, optional
        Columns that stay as long as the one that is given with them.
    exchange_below : int
        Size below which terms are exchanged: that is worth its time only where a model is small enough to be chosen.
    """
    parents = parents or {}
    scaled, _, _ = factor.normalised()
    kept = list(range(scaled.n_columns))
    path = [tuple(kept)]
    while len(kept) > max(1, len(forced)):
        part = scaled.take(kept)
        share = np.abs(part.solve()) / np.linalg.norm(part.inverse(), axis=1)
        needed = {*forced, *(parent for column in kept for parent in parents.get(column, ()))}
        removable = [i for i, column in enumerate(kept) if column not in needed]
        if not removable:
            break
        least = min(removable, key=lambda i: share[i])
        kept = [column for i, column in enumerate(kept) if i != least]
        if len(kept) < exchange_below:
            kept = exchange(scaled, kept, forced, parents)
        path.append(tuple(kept))
    return path


def exchange(
    factor: Factor, kept: Sequence[int], forced: Sequence[int] = (), parents: Parents | None = None
) -> list[int]:
    """Return the columns after swapping single ones for outsiders as long as the fit improves.

    Parameters
    ----------
    factor : Factor
        Of all candidates, normalised.
    kept : sequence of int
    forced : sequence of int
        Columns that stay.
    parents : mapping of int to tuple of int, optional
        Columns without which the one that is given with them does not enter, and that stay beside it.
    """
    parents = parents or {}
    gram = factor.triangle.T @ factor.triangle
    kept = sorted(kept)
    error, _ = _score_additions(gram, kept)
    while True:
        # By more than rounding, too: an exact fit leaves a residual of either sign, and would be swapped for ever.
        best, best_error = None, error - max(1e-6 * error, 1e-15 * gram[-1, -1])
        needed = {*forced, *(parent for column in kept for parent in parents.get(column, ()))}
        for leaving in (column for column in kept if column not in needed):
            stay = [column for column in kept if column != leaving]
            without, gains = _score_additions(gram, stay)
            gains[kept] = -np.inf
            for column, wanted in parents.items():
                if leaving in wanted or not set(wanted) <= set(kept):
                    gains[column] = -np.inf
            entering = int(np.argmax(gains))
            if without - gains[entering] < best_error:
                best, best_error = sorted([*stay, entering]), float(without - gains[entering])
        if best is None:
            return kept
        kept, error = best, best_error


def _score_additions(gram: Array, stay: Sequence[int]) -> tuple[float, Array]:
    """Return the residual sum of squares of some columns, and by how much each one, joining them, lowers it.

    From the Gram matrix of [X | y], shape (p + 1, p + 1); the gains have shape (p,).
    """
    index = np.asarray(stay, dtype=int)
    crossed = gram[:, index]
    solved = np.linalg.lstsq(gram[np.ix_(index, index)], crossed.T, rcond=None)[0]
    residual = gram[:, -1] - crossed @ solved[:, -1]
    norm = np.diag(gram) - np.einsum("ij,ji->i", crossed, solved)
    # A column inside the span of the others has no residual; 1e-10 of its square is rounding.
    gains = np.where(norm > 1e-10, residual**2 / np.maximum(norm, 1e-10), 0.0)
    return float(residual[-1]), gains[:-1]


def path_of(evidence: Evidence, sets: Sequence[Sequence[int]]) -> tuple[Step, ...]:
    """Return the models of some column sets, each with its fit and held-out errors."""
    steps = []
    for columns in sets:
        fit = fit_columns(evidence, columns)
        estimates = left_out_estimates(evidence, columns)
        held_out = held_out_errors(evidence, columns, estimates)
        consistency = group_t_ratios(evidence, columns, estimates)
        needed = frozenset(evidence.needed(columns))
        dependent = frozenset(column for column in columns if column in evidence.parents)
        share = float(fit.unique_share.min())
        steps.append(Step(fit, share, held_out, consistency, needed, dependent))
    return tuple(steps)


def choose_by_evidence(
    path: Sequence[Step],
    significance: float = DISCOVERY.term_significance,
    least_share: float = DISCOVERY.accuracy,
    forced: Sequence[int] = (),
    signs: Mapping[int, int] | None = None,
) -> Selection:
    """Choose the step whose every term is significant and material, and that held-out groups confirm.

    Parameters
    ----------
    path : sequence of Step
        From large to small.
    significance : float
        Least ratio of a coefficient to its standard error.
    least_share : float
        Least unique share of a term.
    forced : sequence of int
        Columns that need not pass.
    signs : mapping of int to int, optional
        Column to the sign, +1 or -1, that its coefficient must have.
    """
    passing = [
        i
        for i, step in enumerate(path)
        if _passes_limits(step, significance, least_share, forced) and obeys(step, signs)
    ]
    if not passing:
        reason = f"no set of terms in which each stands {significance:g} standard errors out of the scatter"
        return Selection(tuple(path), None, reason)
    chosen = passing[0]
    for index in passing[1:]:
        # Terms that the other groups cannot confirm go: they fitted something particular to one group.
        if path[chosen].held_out.size and path[index].held_out_rms <= path[chosen].held_out_rms:
            chosen = index
    step = path[chosen]
    reason = (
        f"the largest set in which each term has a unique share of at least {least_share:.2g} and stands "
        f"{significance:g} standard errors out (here at least {step.threshold:.2g} and {step.fit.t_ratios.min():.1f})"
    )
    return Selection(tuple(path), chosen, reason)


def _passes_limits(step: Step, significance: float, least_share: float, forced: Sequence[int]) -> bool:
    judged = np.array([column not in forced and column not in step.needed for column in step.columns])
    if not judged.any():
        return True
    # Errors of sensors and processing are alike at all levels of an input: less of a dependence is to be believed.
    least = np.array(
        [
            min(least_share, DISCOVERY.least_dependence) if c in step.dependent else least_share
            for c in step.columns
        ]
    )
    return bool(
        step.fit.t_ratios[judged].min() >= significance
        and np.all((step.fit.unique_share >= least)[judged])
        and step.group_t_ratios[judged].min() >= DISCOVERY.likely
    )


def obeys(step: Step, signs: Mapping[int, int] | None) -> bool:
    """Return whether every coefficient of a model has the sign that is asked of it."""
    if not signs:
        return True
    pairs = zip(step.columns, step.fit.coefficients, strict=True)
    return all(signs.get(column, 0) * value >= 0 for column, value in pairs)


def choose_by_threshold(
    path: Sequence[Step], threshold: float, forced: Sequence[int] = (), signs: Mapping[int, int] | None = None
) -> Selection:
    """Choose the first step of which every term's unique share, forced ones aside, reaches a given threshold."""
    for index, step in enumerate(path):
        free = {*forced, *step.needed}
        judged = [s for c, s in zip(step.columns, step.fit.unique_share, strict=True) if c not in free]
        if min(judged, default=np.inf) >= threshold and obeys(step, signs):
            return Selection(tuple(path), index, f"the given threshold of {threshold:g}")
    return Selection(
        tuple(path), None, f"no term has a unique share of at least the given threshold of {threshold:g}"
    )


def choose_by_one_standard_error(path: Sequence[Step], signs: Mapping[int, int] | None = None) -> Selection:
    """Choose the smallest model whose held-out error is within one standard error of the best.

    The standard error is that of the paired difference over runs (Breiman et al., Classification and Regression
    Trees, 1984, section 3.4.3, with pairing).
    """
    if not path[0].held_out.size:
        return Selection(tuple(path), None, "one group only: nothing can be held out")
    allowed = [i for i in range(len(path)) if obeys(path[i], signs)]
    if not allowed:
        return Selection(tuple(path), None, "no set of terms with the required signs")
    best = min(allowed, key=lambda i: path[i].held_out_rms)
    chosen = best
    for index in (i for i in allowed if i > best):
        excess = path[index].held_out - path[best].held_out
        if excess.mean() <= excess.std(ddof=1) / np.sqrt(excess.size):
            chosen = index
    return Selection(
        tuple(path), chosen, "the smallest set within one standard error of the least held-out error"
    )
