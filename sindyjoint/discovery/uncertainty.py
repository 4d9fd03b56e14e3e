"""How sure terms are: found anew without some runs, or with blocks and runs resampled, and which no run tells apart.

Folds are made by scikit-learn's splitters over runs, usually one frequency or one level held out at a time.

Everything is made of the campaign's factors. A replicate draws the *scores* of the replicate blocks anew (their
pull on the coefficients about the fit), not rows: rows of one period are not independent, and blocks, not rows, are
what a repeated test would draw again. Score bootstrap: Kline and Santos, Journal of Econometric Methods 1(1), 2012;
weights of runs: Rubin, The Bayesian bootstrap, Annals of Statistics 9(1), 1981.
"""

from collections import Counter
from collections.abc import Callable, Collection, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial
from itertools import compress
from typing import Any

import numpy as np
from numpy.typing import NDArray

from sindyjoint.described import Maybe
from sindyjoint.discovery import Evidence, Fit, block_scores, fit_columns, small_sample
from sindyjoint.discovery.factors import dependent_columns
from sindyjoint.discovery.methods import column_path
from sindyjoint.discovery.selection import Selection, choose_by_evidence, path_of
from sindyjoint.errors import InputError
from sindyjoint.limits import DISCOVERY
from sindyjoint.numeric import Array
from sindyjoint.text import spelled


@dataclass(frozen=True)
class Inseparable:
    """A chosen term and a candidate that these runs do not tell apart.

    Parameters
    ----------
    chosen, candidate : str
    t_ratio : float
        Of the chosen term when the candidate has joined.
    correlation : float
        Of the two columns once the other chosen terms are taken out of both.
    """

    chosen: str
    candidate: str
    t_ratio: float
    correlation: float


def inclusion(
    evidence: Evidence,
    replicates: int = 500,
    significance: float = DISCOVERY.term_significance,
    least_share: float = DISCOVERY.accuracy,
    random_state: Any = None,
) -> tuple[Array, tuple[tuple[tuple[str, ...], float], ...]]:
    """Return the probabilities of all candidates, and each chosen set with its share, most frequent first.

    Each replicate weighs runs and draws block scores anew. Of its best subsets of every size it takes the largest in
    which each term is significant and material: the rule of choice without its checks between groups, which a
    resampled campaign would not repeat.

    Parameters
    ----------
    evidence : Evidence
    replicates : int
    significance, least_share : float
        As in :func:`~sindyjoint.discovery.selection.choose_by_evidence`.
    random_state : int, Generator or None
    """
    rng = np.random.default_rng(random_state)
    p = len(evidence.ids)
    fit = fit_columns(evidence, range(p))
    pulls = _score_draws(evidence, [*range(p)], fit, replicates, rng)
    _, norms, target = evidence.pooled.normalised()
    scale = np.append(norms, target)
    triangles = _weighted_triangles(evidence, replicates, rng) / scale
    gram: Array = triangles.transpose(0, 2, 1) @ triangles
    gram[:, :p, p] += pulls / norms / target
    scores, _ = block_scores(evidence, range(p), fit.coefficients)
    meat = scores.T @ scores / np.outer(norms, norms) / target**2
    from sindyjoint.discovery.best_subset import replicate_subsets

    subsets = replicate_subsets(triangles, min(DISCOVERY.largest_set, p))
    chosen = _largest_passing(subsets, triangles, gram, meat, fit.degrees, (significance, least_share))
    sets = Counter(tuple(compress(evidence.ids, row)) for row in chosen)
    return chosen.mean(axis=0), tuple((s, n / replicates) for s, n in sets.most_common())


def inseparable(evidence: Evidence, columns: Sequence[int]) -> tuple[Inseparable, ...]:
    """Return pairs of a chosen term and a candidate outside that could replace it, worst first.

    With both in the fit the chosen term is no longer significant: the data determine a combination of the two, not
    each.
    """
    columns = [*columns]
    found = []
    for candidate in range(len(evidence.ids)):
        if candidate in columns:
            continue
        fit = fit_columns(evidence, [*columns, candidate])
        for position in np.flatnonzero(fit.t_ratios[:-1] < DISCOVERY.significant):
            others = [c for i, c in enumerate(columns) if i != position]
            correlation = _partial_correlation(evidence, columns[position], candidate, others)
            found.append(
                Inseparable(
                    evidence.ids[columns[position]],
                    evidence.ids[candidate],
                    float(fit.t_ratios[position]),
                    correlation,
                )
            )
    return tuple(sorted(found, key=lambda pair: pair.t_ratio))


def in_words(pair: Inseparable, largest_angle: float | None = None, softening: float | None = None) -> str:
    """Return a sentence that names what two terms leave undetermined.

    Parameters
    ----------
    pair : Inseparable
    largest_angle, softening : float, optional
        Largest angle tested and angle at which the elastic moment's tangent vanishes, rad (m). Told where both terms
        are stiffnesses, for it is a larger angle that would separate them.
    """
    first, second = (spelled(name) for name in (pair.chosen, pair.candidate))
    text = (
        f"{first} and {second} are not separable on these runs: with both in the law, {first} stands only "
        f"{pair.t_ratio:.1f} standard errors out (their marks correlate to {abs(pair.correlation):.2f})"
    )
    if largest_angle is not None and softening is not None and np.isfinite(softening):
        text += f"; no run passes {100 * (largest_angle / softening):.0f} % of the softening limit"
    return text


def _score_draws(
    evidence: Evidence, columns: list[int], fit: Fit, replicates: int, rng: np.random.Generator
) -> Array:
    """Return what resampled blocks pull at the normal equations, shape (replicates, k)."""
    total = np.zeros((replicates, len(columns)))
    scores, sizes = block_scores(evidence, columns, fit.coefficients)
    for part in np.split(scores, np.cumsum(sizes))[:-1]:
        count = len(part)
        drawn = rng.multinomial(count, np.full(count, 1 / count), size=replicates) - 1.0
        total += drawn @ part
    return total * small_sample(fit.degrees, len(columns)) ** 0.5


def _weighted_triangles(evidence: Evidence, replicates: int, rng: np.random.Generator) -> Array:
    """Return the factors of replicates whose runs weigh differently, shape (replicates, p + 1, p + 1).

    Exponential weights of mean one, within each group: no replicate loses a level or a frequency altogether. The
    factors are merged as such: candidates that are nearly alike leave a Gram matrix without a Cholesky factor.
    """
    weights = np.empty((replicates, len(evidence.runs)))
    for group in evidence.groups:
        members = [i for i, run in enumerate(evidence.runs) if run.group == group]
        drawn = rng.exponential(size=(replicates, len(members)))
        weights[:, members] = drawn / drawn.mean(axis=1, keepdims=True)
    parts = np.array([run.pooled.triangle for run in evidence.runs])
    weighted = (np.vstack(np.sqrt(w)[:, None, None] * parts) for w in weights)
    return np.array([np.linalg.qr(rows, mode="r") for rows in weighted])


def _largest_passing(
    subsets: NDArray[np.bool_],
    triangles: Array,
    gram: Array,
    meat: Array,
    degrees: int,
    least: tuple[float, float],
) -> NDArray[np.bool_]:
    """Return for each replicate the largest of its subsets in which every term passes, shape (replicates, p).

    A term passes with the ``least`` t-ratio and unique share, or more.
    """
    p = gram.shape[1] - 1
    chosen = np.zeros((gram.shape[0], p), dtype=bool)
    waiting = np.arange(gram.shape[0])
    for size in range(subsets.shape[1] - 1, 0, -1):
        marks = subsets[waiting, size]
        active = np.nonzero(marks)[1].reshape(-1, size)
        t, share = _t_and_share(triangles[waiting], gram[waiting], meat, active, degrees)
        passes = (t.min(axis=1) >= least[0]) & (share.min(axis=1) >= least[1])
        chosen[waiting[passes]] = marks[passes]
        waiting = waiting[~passes]
        if not waiting.size:
            break
    return chosen


def _t_and_share(
    triangles: Array, gram: Array, meat: Array, active: NDArray[np.intp], degrees: int
) -> tuple[Array, Array]:
    """Return t-ratios and unique shares of one set of columns per replicate, each of shape (replicates, size).

    Both are zero in a set whose columns cannot be distinguished to the precision of a Gram matrix.
    """
    rows, p = np.arange(len(active))[:, None], gram.shape[1] - 1
    columns = np.take_along_axis(triangles, active[:, None, :], axis=2)
    factors = np.asarray(np.linalg.qr(columns, mode="r"), dtype=np.float64)
    # Of unit columns, the residual of one on the others: below the square root of the precision there is nothing of it
    # in a Gram matrix.
    alike = np.abs(np.einsum("bii->bi", factors)).min(axis=1) < np.finfo(float).eps ** 0.5
    factors[alike] = np.eye(active.shape[1])
    root = np.linalg.inv(factors)
    inverse = root @ root.transpose(0, 2, 1)
    solved = np.einsum("bij,bj->bi", inverse, gram[rows, active, p])
    share = np.abs(solved) / np.sqrt(np.einsum("bii->bi", inverse)) / np.sqrt(gram[:, p, p])[:, None]
    middle = meat[active[:, :, None], active[:, None, :]]
    spread = np.einsum("bij,bjk,bki->bi", inverse, middle, inverse, optimize=True)
    shrink = small_sample(degrees, active.shape[1])
    with np.errstate(divide="ignore"):
        t = np.abs(solved) / np.sqrt(spread * shrink)
    return np.where(alike[:, None], 0.0, t), np.where(alike[:, None], 0.0, share)


def _partial_correlation(evidence: Evidence, first: int, second: int, others: list[int]) -> float:
    """Return the correlation of two columns with the others projected out of both."""
    triangle = evidence.pooled.take([*others, first, second]).normalised()[0].triangle
    k = len(others)
    a, b, c = triangle[k, k], triangle[k, k + 1], triangle[k + 1, k + 1]
    size = float(np.hypot(b, c))
    return float(np.sign(a) * b / size) if size > 0 else 1.0


@dataclass(frozen=True, eq=False)
class Found:
    """What was found on some runs.

    Parameters
    ----------
    candidates : tuple of str
        Ids of the columns that the selection refers to.
    selection : Selection
    """

    candidates: tuple[str, ...]
    selection: Selection

    @property
    def law(self) -> dict[str, float]:
        """Coefficients by term, SI; empty where no set passed."""
        step = self.selection.step
        chosen = () if step is None else zip(step.columns, step.fit.coefficients.tolist(), strict=True)
        return {self.candidates[column]: value for column, value in chosen}


@dataclass(frozen=True)
class Fold:
    """One fold.

    Parameters
    ----------
    left_out : tuple of str
        Labels of the runs that were predicted.
    runs : tuple of str
        Their names.
    kept : tuple of str
        Ids of the terms found without them; empty where no model passed.
    coefficients : tuple of float
        SI.
    moment_error : float
        RMS of the held-out moment's error relative to its RMS; 1 where nothing was found.
    """

    left_out: tuple[str, ...]
    runs: tuple[str, ...]
    kept: tuple[str, ...]
    coefficients: tuple[Maybe, ...]
    moment_error: Maybe


@dataclass(frozen=True)
class CrossValidation:
    """All folds.

    Parameters
    ----------
    folds : tuple of Fold
    """

    folds: tuple[Fold, ...]

    @property
    def moment_error(self) -> float:
        """Root-mean-square of the folds' errors."""
        return pooled_error([fold.moment_error for fold in self.folds])[0]

    @property
    def unanimous(self) -> bool:
        """Whether every fold keeps the same terms."""
        return len({fold.kept for fold in self.folds}) == 1


def pooled_error(errors: Sequence[float]) -> tuple[float, float]:
    """Return the root-mean-square of errors on what was held out, and its standard error by their scatter."""
    squares = np.square(errors)
    whole = float(np.sqrt(np.mean(squares))) if squares.size else float("nan")
    if squares.size < 2:
        return whole, float("nan")
    return whole, float(np.std(squares, ddof=1) / np.sqrt(squares.size) / (2 * max(whole, 1e-300)))


def cross_validate(
    evidence: Evidence,
    labels: Sequence[Any] | None = None,
    splitter: Any = None,
    method: str = "stlsq",
    random_state: Any = None,
    **choice: Any,
) -> CrossValidation:
    """Find a model without the runs of each fold and predict their moment.

    Parameters
    ----------
    evidence : Evidence
    labels : sequence, one per run, optional
        What is held out together: frequency, level. Default: the evidence's groups.
    splitter : scikit-learn splitter, optional
        Over runs. Default: ``LeaveOneGroupOut()``.
    method : str
        One of :data:`~sindyjoint.discovery.methods.METHODS`.
    random_state : int, Generator or None
    **choice
        Of :func:`~sindyjoint.discovery.selection.choose_by_evidence`.

    Raises
    ------
    InputError
        For labels that are not one per run, or all the same.
    """
    from sklearn.model_selection import LeaveOneGroupOut

    names = [run.group for run in evidence.runs] if labels is None else [str(label) for label in labels]
    if len(names) != len(evidence.runs):
        raise InputError(f"{len(names)} label(s) for {len(evidence.runs)} runs; expected one each")
    if splitter is None and len(set(names)) < 2:
        raise InputError(
            f"all runs carry the label {names[0]!r}; expected two different ones to leave one out"
        )
    splitter = LeaveOneGroupOut() if splitter is None else splitter
    index = np.arange(len(names))
    search = partial(find, method=method, random_state=random_state, **choice)
    folds = [
        _fold(evidence, names, train, test, search)
        for train, test in splitter.split(index, groups=np.array(names))
    ]
    return CrossValidation(tuple(folds))


def _fold(
    evidence: Evidence, names: list[str], train: Any, test: Any, search: Callable[[Evidence], Found]
) -> Fold:
    law = search(replace(evidence, runs=tuple(evidence.runs[i] for i in train))).law
    runs = tuple(evidence.runs[i].name for i in test)
    labels = tuple(dict.fromkeys(names[i] for i in test))
    return Fold(labels, runs, tuple(law), tuple(law.values()), moment_error(evidence, runs, law))


def moment_error(evidence: Evidence, runs: Collection[str], law: Mapping[str, float]) -> float:
    """Return the error of the moment of some runs under a law, relative to its RMS."""
    coefficients = np.zeros(len(evidence.ids))
    coefficients[[evidence.ids.index(name) for name in law]] = list(law.values())
    factors = [run.pooled for run in evidence.runs if run.name in runs]
    total = sum(factor.squared_target for factor in factors)
    error = sum(factor.squared_error(coefficients) for factor in factors)
    return float(np.sqrt(error / total)) if total > 0 else float("nan")


def find(evidence: Evidence, method: str = "stlsq", random_state: Any = None, **choice: Any) -> Found:
    """Return what a method and the choice by evidence find.

    Candidates that these runs cannot distinguish from earlier ones (a stop that is never reached, say) are omitted.

    Parameters
    ----------
    evidence : Evidence
    method : str
    random_state : int, Generator or None
    **choice
        Of :func:`~sindyjoint.discovery.selection.choose_by_evidence`.
    """
    dependent = dependent_columns(evidence.pooled)
    possible = evidence.take([column for column in range(len(evidence.ids)) if column not in dependent])
    path = path_of(possible, column_path(method, possible, (), random_state))
    return Found(possible.ids, choose_by_evidence(path, **choice))
