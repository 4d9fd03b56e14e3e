"""What the data say of a set of terms and effects: runs as whitened rows, and the predictive score of the set.

Rows are whitened: noise of the channels, carried through the states, has unit variance and no correlation. What a law
leaves beyond that noise is the *discrepancy*: a random moment, smooth along the motion, whose covariance is
σ²·exp(−|Δ|/ℓ) along the phase of a period or along time; its size σ is estimated with the law. An orthogonal rotation
of the whitened rows makes it diagonal too, for long runs piece by piece. Row i then has the variance 1 + σ²λ_i, so that
a set of columns S has

    log p(y_g | X_g, the others) = −½ (r'(I + X_g P⁻¹ X_g')⁻¹ r + log det(I + X_g P⁻¹ X_g') + Σ log(1 + σ²λ_i))

with r the prediction error of group g and P the information that the other groups have of the coefficients. The score
of S is the sum over the groups, at the σ that makes it largest. Differences of scores are probabilities.
"""

from collections.abc import Sequence
from dataclasses import dataclass, field
from functools import cached_property
from typing import Generic, Protocol, TypeVar

import numpy as np
from numpy.typing import NDArray

from sindyjoint.numeric import Array, norms_of

# Length over which a discrepancy keeps its sign, in periods of the motion (of its main frequency).
LENGTH = 0.05


class Whitened(Protocol):
    """A run whose rows can be whitened."""

    def white(self, rows: Array) -> Array:
        """Return rows of columns, (m,) or (m, k), in units of independent noise."""


class Rotated:
    """The rows of one run, whitened and rotated to the principal axes of its discrepancy.

    Parameters
    ----------
    run : Whitened
    place : ndarray, shape (m,)
        Of each row along the motion, in periods.
    cyclic : bool
        Whether the rows are one period.
    size : float
        RMS of the moment, N·m: the discrepancy of unit size.
    segments : int
        Parts of the run that are predicted one from the others, where the rows are not one period.
    """

    def __init__(self, run: Whitened, place: Array, cyclic: bool, size: float, segments: int = 1):
        self.run = run
        rows = run.white(place).size
        if rows == place.size:
            self._edges = _edges(place.size, 1 if cyclic else segments, cyclic)
            plain = np.zeros((place.size, int(np.diff(self._edges).max())))
            for low, high in zip(self._edges[:-1], self._edges[1:], strict=True):
                kernel = _kernel(place[low:high], cyclic) + 1e-9 * np.eye(high - low)
                plain[low:high, : high - low] = np.linalg.cholesky(kernel)
            # What a piece leaks into the rows after it through the whitening is left out: pieces are far longer.
            white = run.white(size * plain)
        else:  # free motion: a row is no sample, but a sum over many
            self._edges = _edges(rows, segments, False)
            white = run.white(size * _hats(place))
        pieces = self._edges.size - 1
        parts = 1 if cyclic else min(segments, pieces)
        self.segment = np.repeat(np.arange(pieces) * parts // pieces, np.diff(self._edges))
        self._turns: list[Array] = []
        spread = []
        for low, high in zip(self._edges[:-1], self._edges[1:], strict=True):
            left, singular, _ = np.linalg.svd(white[low:high], full_matrices=True)
            self._turns.append(left.T)
            spread.append(np.pad(singular**2, (0, high - low - singular.size)))
        self.spread = np.concatenate(spread)

    def __call__(self, rows: Array) -> Array:
        """Return whitened and rotated rows of columns, shape (m', k) or (m',)."""
        white = self.run.white(rows)
        parts = zip(self._turns, self._edges[:-1], self._edges[1:], strict=True)
        return np.concatenate([turn @ white[low:high] for turn, low, high in parts])


def _edges(rows: int, segments: int, whole: bool) -> NDArray[np.intp]:
    """Return the ends of pieces of some rows, whole numbers of which are a segment."""
    # Rows that a segment has at least.
    segments = max(1, min(segments, rows // 12))
    # A long run is rotated in pieces of so many rows.
    pieces = 1 if whole else segments * max(1, round(rows / 160 / segments))
    return np.round(np.linspace(0, rows, pieces + 1)).astype(int)


def _hats(place: Array) -> Array:
    """Return hat functions as wide as a discrepancy keeps its sign, of which a smooth one is the sum."""
    width = max(LENGTH, float(np.ptp(place)) / 400)
    middles = np.arange(float(place.min()), float(place.max()) + width, width)
    return np.maximum(0.0, 1 - np.abs(place[:, None] - middles) / width)


def _kernel(place: Array, cyclic: bool) -> Array:
    apart = np.abs(place[:, None] - place)
    # Of a period, periodic and positive definite: the chord takes the place of the arc.
    return np.asarray(np.exp(-(np.abs(np.sin(np.pi * apart)) / np.pi if cyclic else apart) / LENGTH))


#: Sizes of the discrepancy that are tried, relative to the RMS of the moment. Twice as much changes little.
SIZES = np.array([0.0, *(5e-4 * 2.0 ** np.arange(12))])
Sizes = slice | NDArray[np.intp]
# Groups of rows that are predicted from the others: runs, and segments of them where runs are fewer.
GROUPS = 8
# A ridge on columns of unit norm, for those that depend on others.
RIDGE = 1e-10


@dataclass(frozen=True, eq=False)
class Score:
    """What a set of columns comes to.

    Parameters
    ----------
    by_group : ndarray, shape (g,)
        Log predictive density of each group, given the others, nats.
    chi_square : ndarray, shape (g,)
        Squared prediction errors in units of what noise alone, and the uncertainty of the coefficients, make expected.
    size : float
        Of the discrepancy, relative to the RMS of the moment.
    excess : float
        Mean square of the prediction errors in units of noise and discrepancy together: above one, there is more noise
        than was measured, or not of its kind.
    """

    by_group: Array
    chi_square: Array
    size: float
    excess: float

    @property
    def total(self) -> float:
        """Sum over the groups, nats."""
        return float(self.by_group.sum())


@dataclass(eq=False)
class Evidence:
    """Whitened rows in groups, and columns that may explain them.

    Parameters
    ----------
    target : ndarray, shape (n,)
        Whitened and rotated rows.
    group : ndarray of int, shape (n,)
    spread : ndarray, shape (n,)
        λ: variance of a discrepancy of the size of the moment, in units of the rows' noise.
    """

    target: Array
    group: NDArray[np.intp]
    spread: Array
    norms: list[float] = field(init=False, default_factory=list)
    _columns: Array = field(init=False)
    _count: int = field(init=False, default=0)
    _found: dict[tuple[int, ...], Score] = field(init=False, default_factory=dict)

    def __post_init__(self) -> None:
        self._columns = np.empty((64, self.target.size))

    @property
    def columns(self) -> Array:
        """Columns of unit norm, shape (n, p)."""
        return self._columns[: self._count].T

    def add(self, columns: Array) -> list[int]:
        """Add columns, shape (n, k), and return their places."""
        first, self._count = self._count, self._count + columns.shape[1]
        if self._count > len(self._columns):
            self._columns = np.vstack([self._columns, np.empty((self._count, self.target.size))])
        norm = norms_of(columns)
        self.norms += norm.tolist()
        self._columns[first : self._count] = (columns / norm).T
        return list(range(first, self._count))

    @cached_property
    def groups(self) -> int:
        """How many groups there are."""
        return int(self.group.max()) + 1

    @cached_property
    def _weights(self) -> Array:
        """1/(1 + σ²λ) for every size, shape (s, n)."""
        return 1 / (1 + SIZES[:, None] ** 2 * self.spread)

    @cached_property
    def _volume(self) -> Array:
        """Σ log(1 + σ²λ) per size and group, shape (s, g)."""
        order, edges = self._order
        return np.add.reduceat(-np.log(self._weights)[:, order], edges, axis=1)

    @cached_property
    def _order(self) -> tuple[NDArray[np.intp], NDArray[np.intp]]:
        order = np.argsort(self.group, kind="stable")
        return order, np.searchsorted(self.group[order], np.arange(self.groups))

    def score(self, chosen: Sequence[int]) -> Score:
        """Return the score of a set of columns."""
        key = tuple(sorted(chosen))
        if key not in self._found:
            X, y, weights = self._rows(key), self.target[self._order[0]], self._weights[:, self._order[0]]
            parts = self._parts
            product = np.array([[(X[p] * w[p, None]).T @ X[p] for p in parts] for w in weights])
            right = np.array([[X[p].T @ (w[p] * y[p]) for p in parts] for w in weights])
            square = np.array([[y[p] @ (w[p] * y[p]) for p in parts] for w in weights])
            (self._found[key],) = self._densities(product[:, :, None], right[:, :, None], square, slice(None))
        return self._found[key]

    def beside(self, chosen: Sequence[int], others: Sequence[int], most: float) -> list[Score]:
        """Return the scores of a set with each of some other columns, for discrepancies up to ``most``."""
        chosen, others = list(chosen), list(others)
        if not others:
            return []
        # By factors of four: a discrepancy twice as large scores nearly alike.
        last = int(np.searchsorted(SIZES, most))
        sizes = np.unique([0, *range(last, 0, -2)])
        k = len(chosen)
        order, _ = self._order
        X, Z, y = self._rows(chosen), self._rows(others), self.target[order]
        weights = self._weights[sizes][:, order]
        shape = (len(weights), self.groups, len(others), k + 1)
        product, right = np.empty((*shape, k + 1)), np.empty(shape)
        square = np.empty(shape[:2])
        for s, w in enumerate(weights):
            for g, part in enumerate(self._parts):
                scaled, target = X[part] * w[part, None], w[part] * y[part]
                product[s, g, :, :k, :k] = scaled.T @ X[part]
                product[s, g, :, k, :k] = product[s, g, :, :k, k] = Z[part].T @ scaled
                product[s, g, :, k, k] = w[part] @ Z[part] ** 2
                right[s, g, :, :k] = target @ X[part]
                right[s, g, :, k] = target @ Z[part]
                square[s, g] = target @ y[part]
        return self._densities(product, right, square, sizes)

    def _densities(self, product: Array, right: Array, square: Array, sizes: Sizes) -> list[Score]:
        """Return the scores of sets from X'WX (s, g, sets, k, k), X'Wy (s, g, sets, k) and y'Wy (s, g)."""
        fall, volume = _left_out(product, right)
        chi = square[:, :, None] - fall
        log_density = -0.5 * (chi + volume + self._volume[sizes][:, :, None])
        best, rows = np.argmax(log_density.sum(axis=1), axis=0), self.target.size  # per set
        return [
            Score(
                log_density[s, :, j], chi[0, :, j], float(SIZES[sizes][s]), float(chi[s, :, j].sum()) / rows
            )
            for j, s in enumerate(best.tolist())
        ]

    def _rows(self, places: Sequence[int]) -> Array:
        """Return some columns, group by group, shape (n, k)."""
        order, _ = self._order
        return self._columns[np.asarray(places, dtype=int)][:, order].T

    @cached_property
    def _parts(self) -> list[slice]:
        order, edges = self._order
        return [slice(a, b) for a, b in zip(edges, [*edges[1:], order.size], strict=True)]

    def chance_rises(self, chosen: Sequence[int], others: Sequence[int], count: int, seed: int) -> Array:
        """Return what the best of some columns wins by group where there is nothing but noise, shape (count, g)."""
        chosen, others = list(chosen), list(others)
        k = len(chosen)
        order, _ = self._order
        X, Z = self._rows(chosen), self._rows(others)
        noise = np.random.default_rng(seed).standard_normal((order.size, count))
        product = np.empty((self.groups, len(others), k + 1, k + 1))
        right = np.empty((count, self.groups, len(others), k + 1))
        for g, part in enumerate(self._parts):
            product[g, :, :k, :k] = X[part].T @ X[part]
            product[g, :, k, :k] = product[g, :, :k, k] = Z[part].T @ X[part]
            product[g, :, k, k] = np.sum(Z[part] ** 2, axis=0)
            right[:, g, :, :k] = (X[part].T @ noise[part]).T[:, None]
            right[:, g, :, k] = (Z[part].T @ noise[part]).T
        wide, narrow = _left_out(product, right), _left_out(product[:, :1, :k, :k], right[:, :, :1, :k])
        # Densities less those of the noise itself.
        rise = 0.5 * ((wide[0] - wide[1]) - (narrow[0] - narrow[1]))
        best = np.argmax(rise.sum(axis=1), axis=1)
        return rise[np.arange(count), :, best]

    def fit(self, chosen: Sequence[int], size: float) -> Array:
        """Return the coefficients of columns, from all rows weighted by a size of the discrepancy."""
        weight = np.sqrt(1 / (1 + size**2 * self.spread))
        rows = self.columns[:, list(chosen)] * weight[:, None]
        solved = np.linalg.lstsq(rows, self.target * weight, rcond=None)[0]
        return np.asarray(solved / np.array(self.norms)[list(chosen)])


def _left_out(product: Array, right: Array) -> tuple[Array, Array]:
    """Return by what χ² of each group falls under the fit to the others, and the logarithm of that prediction's volume.

    Parameters
    ----------
    product, right : ndarray, shapes (…, g, sets, k, k) and (…, g, sets, k)
        X'X and X'y of the rows of each group, whitened.
    """
    whole, ridge = product.sum(axis=-4, keepdims=True), RIDGE * np.eye(product.shape[-1])
    others, together = whole - product + ridge, whole + ridge
    inverse, wide = np.linalg.inv(others), np.linalg.inv(together)
    coefficients = np.einsum("...kl,...l->...k", inverse, right.sum(axis=-3, keepdims=True) - right)
    error = right - np.einsum("...kl,...l->...k", product, coefficients)
    fall = np.einsum("...k,...k->...", coefficients, right + error)
    fall = fall + np.einsum("...k,...kl,...l->...", error, wide, error)
    return fall, np.linalg.slogdet(together)[1] - np.linalg.slogdet(others)[1]


class Candidate(Protocol):
    """An effect with its best numbers."""

    @property
    def name(self) -> str:
        """Id of the effect."""

    @property
    def family(self) -> str:
        """Of the effect."""

    @property
    def parameters(self) -> dict[str, float]:
        """Its numbers by name, SI."""


C = TypeVar("C", bound=Candidate)


@dataclass(frozen=True)
class Ranking(Generic[C]):
    """The candidates in order of probability.

    Parameters
    ----------
    fitted : tuple of Candidate
        One for each effect.
    probabilities : tuple of float
        Of each; what is missing to one is the probability that nothing is missing.
    nothing : float
    members : tuple of Candidate
        The best one and those that the data cannot distinguish from it.
    near : tuple of Candidate
        Those that errors of processed motion may have put behind the best one, and that one.
    """

    fitted: tuple[C, ...]
    probabilities: tuple[float, ...]
    nothing: float
    members: tuple[C, ...]
    near: tuple[C, ...] = ()


def rise(later: Score, fewer: Score) -> float:
    """Return by how much a score is above another, nats; errors beyond noise count as noise."""
    return (later.total - fewer.total) / max(later.excess, 1.0)


def rank(fitted: Sequence[tuple[C, Score]], base: Score, alike: float) -> Ranking[C]:
    """Return candidates with their probabilities, the best variant of each effect alone.

    Half of the prior belief is that nothing is missing; the other half is divided among the effects.

    Parameters
    ----------
    fitted : sequence of (Candidate, Score)
        Those of fewer numbers first, which lead where two are as good.
    base : Score
        Without any of them.
    alike : float
        Nats within which the data cannot tell one from the best.
    """
    best: dict[str, tuple[C, Score]] = {}
    for each, score in fitted:
        if each.name not in best or score.total > best[each.name][1].total:
            best[each.name] = each, score
    leading = max((score for _, score in best.values()), key=lambda score: score.total)
    # Below the leading one: beside a base that no simulation follows, what tells rivals apart would be lost.
    nats = np.array([-rise(leading, score) for _, score in best.values()])
    without = -rise(leading, base) + np.log(nats.size)
    weight = np.exp(np.append(nats, without) - max(float(nats.max()), without))
    weight /= weight.sum()
    kept = [each for each, _ in best.values()]
    order = np.argsort(-np.round(nats, 2), kind="stable")
    return Ranking(
        fitted=tuple(kept[i] for i in order),
        probabilities=tuple(float(weight[i]) for i in order),
        nothing=float(weight[-1]),
        members=tuple(kept[i] for i in order if nats[i] >= nats.max() - alike),
    )
