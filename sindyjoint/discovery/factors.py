"""What regression needs of the samples: a small triangular factor per block, which merge; the exact best subset.

For a block of rows [X | y] the factor R of its QR decomposition has the same least-squares problem, at the same
conditioning, in p + 1 rows. Factors of several blocks, stacked and decomposed again, are the factor of all their
rows: leave-one-out, bootstrap, subsets and paths are merges of small matrices and never revisit samples.

The referee of every greedier way is branch and bound on the factor: of all sets of k columns, the one of least squared
error, for each k at once. A node of the search is an ordered list of columns with its factor; the leading parts of the
list are models whose errors stand in the last column of the factor, and dropping a column costs a few plane rotations.
A branch is cut when even all its columns together fit no better than what is already known for every size it can reach.

References: Golub and Van Loan, Matrix Computations, 4th ed. (2013), sections 5.2 and 5.3; merging as in the
tall-and-skinny QR of Demmel, Grigori, Hoemmen and Langou (2012). Gatu and Kontoghiorghes, Branch-and-bound algorithms
for computing the best-subset regression models, Journal of Computational and Graphical Statistics 15(1), 2006, 139-156;
the idea of the bound is of Furnival and Wilson, Technometrics 16(4), 1974.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from functools import lru_cache

import numpy as np
import scipy
from numba import njit
from numpy.typing import ArrayLike, NDArray

from sindyjoint.errors import InputError
from sindyjoint.numeric import ROUNDING, Array, chunks, norms_of
from sindyjoint.parallel import side_by_side

# Numbers of a matrix below which what NumPy does about its decomposition takes longer than the decomposition.
SMALL = 10_000


@dataclass(frozen=True, eq=False)
class Factor:
    """The triangular factor of [columns | target] of some rows.

    Parameters
    ----------
    triangle : ndarray, shape (p + 1, p + 1)
        Upper triangular R with RᵀR = [X | y]ᵀ W [X | y].
    rows : float
        Number of rows, or the sum of their weights.
    """

    triangle: Array
    rows: float

    @classmethod
    def of(cls, columns: ArrayLike, target: ArrayLike, weight: ArrayLike | None = None) -> Factor:
        """Return the factor of rows.

        Parameters
        ----------
        columns : array_like, shape (n, p)
        target : array_like, shape (n,)
        weight : array_like, shape (n,), optional
            Non-negative; a weight of two counts a row twice.
        """
        matrix = np.column_stack([columns, target])
        rows = float(matrix.shape[0])
        if weight is not None:
            weights = np.asarray(weight, dtype=np.float64)
            matrix = matrix * np.sqrt(weights)[:, None]
            rows = float(weights.sum())
        return cls(_triangle(matrix), rows)

    @property
    def n_columns(self) -> int:
        """Number of columns p, the target not counted."""
        return self.triangle.shape[0] - 1

    @property
    def squared_target(self) -> float:
        """Sum of squares of the target."""
        return float(self.triangle[:, -1] @ self.triangle[:, -1])

    @property
    def column_rms(self) -> Array:
        """Root-mean-square of each column, shape (p,)."""
        return np.linalg.norm(self.triangle[:, :-1], axis=0) / np.sqrt(self.rows)

    def scaled(self, weight: float) -> Factor:
        """Return the factor of the same rows, each counted ``weight`` times."""
        return Factor(np.sqrt(weight) * self.triangle, weight * self.rows)

    def take(self, columns: Sequence[int]) -> Factor:
        """Return the factor of some of the columns."""
        return Factor(_triangle(self.triangle[:, [*columns, self.n_columns]]), self.rows)

    def fixing(self, columns: Sequence[int], coefficients: ArrayLike) -> Factor:
        """Return the factor of the other columns, the target less these columns times given coefficients."""
        target = self.triangle[:, -1] - self.triangle[:, [*columns]] @ np.asarray(
            coefficients, dtype=np.float64
        )
        others = [column for column in range(self.n_columns) if column not in columns]
        return Factor(_triangle(np.column_stack([self.triangle[:, others], target])), self.rows)

    def normalised(self) -> tuple[Factor, Array, float]:
        """Return the factor with columns and target scaled to unit norm, and the norms that were divided by.

        A column of zeros keeps the norm 1.
        """
        norms = norms_of(self.triangle)
        return Factor(self.triangle / norms, self.rows), norms[:-1], float(norms[-1])

    def solve(self) -> Array:
        """Return the least-squares coefficients of all columns, shape (p,)."""
        if not self.n_columns:
            return np.zeros(0)
        solution, info = scipy.linalg.lapack.dtrtrs(self.triangle[:-1, :-1], self.triangle[:-1, -1])
        return _regular(solution, info)

    def inverse(self) -> Array:
        """Return R⁻¹ of the columns, shape (p, p), so that (XᵀX)⁻¹ = R⁻¹R⁻ᵀ."""
        if not self.n_columns:
            return np.zeros((0, 0))
        return _regular(*scipy.linalg.lapack.dtrtri(self.triangle[:-1, :-1]))

    def squared_error(self, coefficients: ArrayLike) -> float:
        """Return the sum of squared residuals ‖y − X·c‖² for given coefficients, shape (p,)."""
        residual = self.triangle[:, -1] - self.triangle[:, :-1] @ np.asarray(coefficients)
        return float(residual @ residual)

    def score(self, coefficients: ArrayLike) -> Array:
        """Return Xᵀ(y − X·c), shape (p,)."""
        residual = self.triangle[:, -1] - self.triangle[:, :-1] @ np.asarray(coefficients)
        return self.triangle[:, :-1].T @ residual


def merge(factors: Iterable[Factor]) -> Factor:
    """Return the factor of all rows of several factors.

    Parameters
    ----------
    factors : iterable of Factor
        With the same columns.

    Raises
    ------
    InputError
        If there is nothing to merge.
    """
    parts = list(factors)
    if not parts:
        raise InputError("no factor to merge; expected at least one block of rows")
    if len(parts) == 1:
        return parts[0]
    return Factor(_triangle(np.vstack([part.triangle for part in parts])), sum(part.rows for part in parts))


def _regular(solution: Array, info: int) -> Array:
    """Return what LAPACK gives, or raise where a triangle has a zero on its diagonal."""
    if info > 0:
        raise np.linalg.LinAlgError(f"singular matrix: nothing on the diagonal at {info - 1}")
    return solution


def _triangle(matrix: Array) -> Array:
    """Return the square upper triangular factor of a matrix, rows of zeros added where it has too few rows."""
    if 0 < matrix.size <= SMALL:
        from scipy.linalg.lapack import dgeqrf

        factored: Array = dgeqrf(matrix)[0][: matrix.shape[1]]
        triangle = factored * _upper(*factored.shape)
    else:
        triangle = np.linalg.qr(matrix, mode="r")  # type: ignore[assignment]
    missing = matrix.shape[1] - triangle.shape[0]
    return np.pad(triangle, ((0, missing), (0, 0))) if missing > 0 else triangle


@lru_cache(maxsize=64)
def _upper(rows: int, columns: int) -> Array:
    """Return a matrix of ones on and above the diagonal."""
    return np.triu(np.ones((rows, columns)))


def dependent_columns(factor: Factor) -> list[int]:
    """Return columns that are linear combinations of earlier columns."""
    scaled, _, _ = factor.normalised()
    diagonal = np.abs(np.diag(scaled.triangle))[:-1]
    return [int(index) for index in np.flatnonzero(diagonal < ROUNDING)]


# The search is exact and its worst case is 2^p: beyond this many columns it is refused.
MOST_COLUMNS = 40
# Replicates searched in one task: some tens of milliseconds.
REPLICATES = 32


@dataclass(frozen=True)
class Subset:
    """The best set of its size.

    Parameters
    ----------
    columns : tuple of int
        In rising order.
    squared_error : float
        Sum of squared residuals in the units of the factor's target.
    """

    columns: tuple[int, ...]
    squared_error: float


def best_subsets(
    factor: Factor,
    forced: Sequence[int] = (),
    signs: Mapping[int, int] | None = None,
) -> list[Subset]:
    """Return the best subset of every size, from one column (or the forced ones) up.

    Parameters
    ----------
    factor : Factor
        Of all candidates.
    forced : sequence of int
        Columns that every set holds.
    signs : mapping of int to int, optional
        Column to +1 or -1: the sign its coefficient must have. Sizes at which no set obeys are omitted.

    Raises
    ------
    InputError
        For more than 40 columns, or linearly dependent ones.
    """
    p = factor.n_columns
    if p > MOST_COLUMNS:
        raise InputError(
            f"{p} candidate terms; an exact best subset takes at most {MOST_COLUMNS}: choose a smaller library"
        )
    scaled, _, target = factor.normalised()
    order = _search_order(scaled, [*dict.fromkeys(forced)])
    start = scaled.take(order).triangle
    if np.abs(np.diag(start)[:p]).min() < 1e-12:
        raise InputError("linearly dependent candidate terms; take one of them out")
    expected = np.array(
        [0 if signs is None else int(signs.get(column, 0)) for column in order], dtype=np.int64
    )
    errors, sets = _search(start, len(set(forced)), expected, p)
    found = []
    for size in range(max(1, len(set(forced))), p + 1):
        if np.isfinite(errors[size]):
            columns = tuple(sorted(order[i] for i in np.flatnonzero(sets[size])))
            found.append(Subset(columns, float(errors[size]) * target**2))
    return found


def replicate_subsets(triangles: Array, largest: int) -> NDArray[np.bool_]:
    """Return the best subsets of many replicates of one problem, side by side.

    Parameters
    ----------
    triangles : ndarray, shape (replicates, p + 1, p + 1)
        Factors of [columns | target], columns of comparable norm.
    largest : int
        Largest size.

    Returns
    -------
    ndarray of bool, shape (replicates, largest + 1, p)
        Marks of the best set of each size; row 0 is empty.
    """
    order = _search_order(Factor(np.array(triangles[0]), 1.0), [])
    parts = [triangles[some] for some in chunks(len(triangles), REPLICATES)]
    return np.concatenate(side_by_side(_subsets_of, parts, [order, largest]))


def _subsets_of(order: list[int], largest: int, triangles: Array) -> NDArray[np.bool_]:
    """Return the best subsets of some replicates, searched in a given order of the columns."""
    replicates, p = triangles.shape[0], triangles.shape[1] - 1
    expected = np.zeros(p, dtype=np.int64)
    marks = np.zeros((replicates, largest + 1, p), dtype=bool)
    for index in range(replicates):
        start = np.linalg.qr(triangles[index][:, [*order, p]], mode="r")
        marks[index][:, order] = _search(start, 0, expected, largest)[1][: largest + 1]
    return marks


def _search_order(scaled: Factor, forced: list[int]) -> list[int]:
    """Return forced columns first, then the strongest: good models are met early and bad branches cut high up."""
    kept = [column for column in range(scaled.n_columns) if column not in forced]
    weakest: list[int] = []
    while len(kept) > 1:
        part = scaled.take([*forced, *kept])
        share = np.abs(part.solve()) / np.linalg.norm(part.inverse(), axis=1)
        weakest.append(kept.pop(int(np.argmin(share[len(forced) :]))))
    return [*forced, *kept, *reversed(weakest)]


@njit(cache=True, nogil=True, no_cpython_wrapper=True, no_cfunc_wrapper=True)
def _drop(triangle, n, index, out):
    """Factor of the n columns of ``triangle`` less one: shift left, rotate the subdiagonal away."""
    for j in range(n):  # columns of the result, the last being the target
        source = j if j < index else j + 1
        for i in range(n + 1):
            out[i, j] = triangle[i, source]
    for j in range(index, n):
        a, b = out[j, j], out[j + 1, j]
        if b == 0.0:
            continue
        radius = np.hypot(a, b)
        c, s = a / radius, b / radius
        for k in range(j, n):
            upper, lower = out[j, k], out[j + 1, k]
            out[j, k] = c * upper + s * lower
            out[j + 1, k] = c * lower - s * upper


@njit(cache=True, nogil=True, no_cpython_wrapper=True, no_cfunc_wrapper=True)
def _obeys(triangle, n, size, expected, names):
    """Whether the least-squares coefficients of the leading ``size`` columns have the expected signs."""
    needed = False
    for i in range(size):
        if expected[names[i]] != 0:
            needed = True
    if not needed:
        return True
    solved = np.empty(size)
    for i in range(size - 1, -1, -1):
        value = triangle[i, n]
        for j in range(i + 1, size):
            value -= triangle[i, j] * solved[j]
        solved[i] = value / triangle[i, i]
        if expected[names[i]] * solved[i] < 0:
            return False
    return True


@njit(cache=True, nogil=True, no_cfunc_wrapper=True)
def _search(start, fixed, expected, top):
    """Return least squared errors by size, and the sets as marks on the columns' positions."""
    p = start.shape[0] - 1
    best = np.full(p + 1, np.inf)
    sets = np.zeros((p + 1, p), dtype=np.bool_)
    # Depth-first: a node at depth d has p - d columns, so one matrix for each depth is room enough.
    triangles = np.zeros((p + 1, p + 1, p + 1))
    names = np.zeros((p + 1, p), dtype=np.int64)
    lowest = np.zeros(p + 1, dtype=np.int64)  # columns before this one are not dropped below a node
    following = np.zeros(p + 1, dtype=np.int64)  # the next column to drop at a depth
    for i in range(p + 1):  # the assignment of a slice takes seconds to compile
        for j in range(p + 1):
            triangles[0, i, j] = start[i, j]
    for i in range(p):
        names[0, i] = i
    lowest[0] = fixed
    depth, entering = 0, True
    while depth >= 0:
        n = p - depth
        here = triangles[depth]
        if entering:
            error = here[n, n] ** 2
            for size in range(n, 0, -1):
                if size < n:
                    error += here[size, n] ** 2
                # Leading parts shorter than this were met at the parent.
                if size < max(lowest[depth], 1):
                    break
                if size <= top and error < best[size] and _obeys(here, n, size, expected, names[depth]):
                    best[size] = error
                    sets[size, :] = False
                    for i in range(size):
                        sets[size, names[depth, i]] = True
            following[depth] = n - 1
            entering = False
        index = following[depth]
        if index < lowest[depth] or n <= 1:
            depth -= 1
            continue
        following[depth] = index - 1
        # Below the child that drops ``index`` lie models of max(index, 1) to n - 1 columns; none fits better than
        # all n columns here do.
        worst = 0.0
        for size in range(max(index, 1), min(n - 1, top) + 1):
            worst = max(worst, best[size])
        if here[n, n] ** 2 >= worst:
            continue
        _drop(here, n, index, triangles[depth + 1])
        child = 0
        for i in range(n):
            if i != index:
                names[depth + 1, child] = names[depth, i]
                child += 1
        lowest[depth + 1] = index
        depth += 1
        entering = True
    return best, sets
