"""What regression needs of the samples: one small triangular factor per block, which merge.

For a block of rows [X | y] the factor R of its QR decomposition has the same least-squares problem, at the same
conditioning, in p + 1 rows. Factors of several blocks, stacked and decomposed again, are the factor of all their
rows: leave-one-out, bootstrap, subsets and paths are merges of small matrices and never revisit samples.

Reference: Golub and Van Loan, Matrix Computations, 4th ed. (2013), sections 5.2 and 5.3; merging as in the
tall-and-skinny QR of Demmel, Grigori, Hoemmen and Langou (2012).
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from functools import lru_cache

import numpy as np
import scipy
from numpy.typing import ArrayLike

from sindyjoint.errors import InputError
from sindyjoint.numeric import ROUNDING, Array, norms_of

# Numbers of a matrix below which what NumPy does about its decomposition takes longer than the decomposition.


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
        # Column after column in memory, as LAPACK takes it without a copy.
        matrix = np.vstack([np.transpose(columns), target]).T
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
    if not matrix.size:
        return np.zeros((matrix.shape[1],) * 2)
    factored: Array = scipy.linalg.lapack.dgeqrf(matrix)[0][: matrix.shape[1]]
    triangle = factored * _upper(*factored.shape)
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
