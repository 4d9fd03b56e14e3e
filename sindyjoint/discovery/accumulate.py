"""The factor of rows that pass by once, at the speed of a Gram matrix and with the accuracy of a QR decomposition.

A Gram matrix squares the condition number: at 1e6 it leaves four digits. The Gram matrix of *preconditioned* columns
X·P⁻¹, P a triangular factor of the rows so far, does not: it is near the identity, and with H = P⁻ᵀXᵀX P⁻¹ = R̃ᵀR̃ the
factor of X is R̃·P. Solving with P and multiplying is done in one sweep over rows that stay in the cache. Rows that P
does not suit (they excite what the rows so far did not) are decomposed by themselves, and P is renewed.

Reference: the Cholesky QR with preconditioning of Fukaya, Kannan, Nakatsukasa, Yamamoto and Yanagisawa, SIAM J. Sci.
Comput. 42(1), 2020, with the factor of the first rows in the place of a shifted one.
"""

from __future__ import annotations

from collections.abc import Sequence
from functools import cache
from typing import Any

import numpy as np
from numpy.typing import NDArray

from sindyjoint.discovery.evaluation import TermFunction
from sindyjoint.discovery.factors import Factor, merge
from sindyjoint.errors import InputError

Array = NDArray[np.float64]

# Rows worked on at once: twenty columns of these are two thirds of a megabyte.
TILE = 4096
# Rows that the compiled sweep takes together: within the first level of the cache.
SWEEP = 256
# Rounding of the Gram matrix, relative to its weakest direction, beyond which rows are decomposed instead.
TOLERANCE = 1e-11
# A column that is so dependent on those before it is told from them by nobody.
DEPENDENT = 1e-9


class FactorSum:
    """Adds rows to a factor.

    Parameters
    ----------
    columns : int
        Number of columns, the target not counted.
    """

    def __init__(self, columns: int):
        self.size = columns + 1
        self.rows = 0
        self._triangle = np.zeros((self.size, self.size))  # of all rows up to the last renewal
        self._base: Array | None = None  # P
        self._gram = np.zeros((self.size, self.size))  # upper half of H of all rows, in the coordinates of P
        self._weakest, self._weight = 0.0, 0.0
        self._free = np.zeros(self.size)
        self._scratch = np.empty((self.size, SWEEP))

    def add(self, block: Array) -> None:
        """Add rows.

        Parameters
        ----------
        block : ndarray, shape (p + 1, n)
            Columns and target as the rows of a C-ordered array.

        Raises
        ------
        InputError
            For a value that is not finite.
        """
        n = block.shape[1]
        if self._base is None or n < self.size:
            self._renew(block)
            return
        gram = np.zeros((self.size, self.size))
        _sweep()(block, self._base, self._scratch, gram)
        weight = self._weight + float(gram.trace())
        if not np.isfinite(weight):
            raise _not_finite(block)
        if not self._accurate(weight):
            # More rows have come since: the weakest direction can only have grown.
            total = _symmetric(self._gram + gram) + np.diag(self._free)
            self._weakest = float(np.linalg.eigvalsh(total)[0])
            if not self._accurate(weight):
                self._renew(block)
                return
        self.rows += n
        self._gram += gram
        self._weight = weight

    def factor(self) -> Factor:
        """Return the factor of all rows so far."""
        return Factor(self._current(), float(self.rows))

    def _accurate(self, weight: float) -> bool:
        return bool(np.finfo(float).eps * weight <= TOLERANCE * self._weakest)

    def _current(self) -> Array:
        if self._base is None:
            return self._triangle
        values, vectors = np.linalg.eigh(_symmetric(self._gram))
        root = np.linalg.qr(np.sqrt(np.maximum(values, 0.0))[:, None] * vectors.T, mode="r")
        return np.triu(root @ self._base)

    def _renew(self, block: Array) -> None:
        """Decompose rows by themselves, and take what is known now for the base."""
        if not np.isfinite(block).all():
            raise _not_finite(block)
        known = Factor(self._current(), 1.0)
        self.rows += block.shape[1]
        self._triangle = merge([known, Factor.of(block[:-1].T, block[-1])]).triangle
        if self.rows < 2 * self.size:
            return
        norms = np.linalg.norm(self._triangle, axis=0)
        least = np.where(norms > 0, DEPENDENT * norms, 1.0)
        diagonal = np.diag(self._triangle)
        weak = np.abs(diagonal) < least
        base = self._triangle / np.sqrt(self.rows)
        base[weak, weak.nonzero()[0]] = least[weak] / np.sqrt(self.rows)
        root = _divided(self._triangle, base)
        self._base, self._gram = np.ascontiguousarray(base), root.T @ root
        # Directions in which the rows say nothing set no standard.
        self._free = np.where(weak, float(self.rows), 0.0)
        self._weakest = float(np.linalg.eigvalsh(self._gram + np.diag(self._free))[0])
        self._weight = float(np.trace(self._gram))


class TermSum:
    """Adds force states to the factor of some terms and a target: evaluation and accumulation, tile by tile.

    Parameters
    ----------
    function : TermFunction
        Of (θ, θ̇, θ̈).
    """

    def __init__(self, function: TermFunction):
        self.function = function
        p = len(function.outputs)
        self._sum = FactorSum(p)
        self._scratch = np.empty((len(function.operations), TILE))
        self._block = np.empty((p + 1, TILE))

    def add(self, states: Sequence[Array], target: Array) -> None:
        """Add rows.

        Parameters
        ----------
        states : sequence of ndarray, shape (n,)
            θ, θ̇ and, where a term needs it, θ̈.
        target : ndarray, shape (n,)

        Raises
        ------
        InputError
            If a term or the target has no finite value somewhere.
        """
        inputs = [np.ascontiguousarray(s, dtype=np.float64) for s in states]
        extra: list[Any] = [np.nan] * (len(self.function.arguments) - len(inputs))
        for start in range(0, target.size, TILE):
            stop = min(start + TILE, target.size)
            block = self._block if stop - start == TILE else np.empty((self._block.shape[0], stop - start))
            self.function.tile(
                [*(s[start:stop] for s in inputs), *extra], self._scratch[:, : stop - start], block
            )
            block[-1] = target[start:stop]
            try:
                self._sum.add(block)
            except InputError as error:
                raise InputError(f"rows from {start} of this stretch: {error}") from None

    def factor(self) -> Factor:
        """Return the factor of all rows so far."""
        return self._sum.factor()


def _symmetric(matrix: Array) -> Array:
    """Return the symmetric matrix that has the upper half of another."""
    return np.triu(matrix) + np.triu(matrix, 1).T


def _not_finite(block: Array) -> InputError:
    """Say where a block has no finite value; looked for only once its products have shown that it has."""
    row, column = (int(places[0]) for places in np.nonzero(~np.isfinite(block.T)))
    what = "the target" if column == block.shape[0] - 1 else f"column {column + 1} (of {block.shape[0] - 1})"
    return InputError(f"{what} has no finite value at row {row}; leave the term out or repair the row")


def _divided(matrix: Array, triangle: Array) -> Array:
    """Return matrix · triangle⁻¹ for an upper triangle, column by column."""
    result = np.empty_like(matrix)
    for j in range(triangle.shape[0]):
        result[:, j] = (matrix[:, j] - result[:, :j] @ triangle[:j, j]) / triangle[j, j]
    return result


@cache
def _sweep() -> Any:
    """Return the compiled sweep: solve the rows of a block with P, add their products to the upper half of a matrix."""
    import numba

    @numba.njit(cache=True, nogil=True, fastmath={"reassoc", "contract", "nsz"})
    def sweep(block, base, scratch, gram):  # pragma: no cover
        size, rows = block.shape
        width = scratch.shape[1]
        for start in range(0, rows, width):
            n = min(width, rows - start)
            for j in range(size):
                x, source = scratch[j], block[j]
                for r in range(n):
                    x[r] = source[start + r]
                i = 0
                # Four columns at a time: each is loaded once, the result stored a quarter as often.
                while i + 4 <= j:
                    c0, c1, c2, c3 = base[i, j], base[i + 1, j], base[i + 2, j], base[i + 3, j]
                    x0, x1, x2, x3 = scratch[i], scratch[i + 1], scratch[i + 2], scratch[i + 3]
                    for r in range(n):
                        x[r] -= (c0 * x0[r] + c1 * x1[r]) + (c2 * x2[r] + c3 * x3[r])
                    i += 4
                while i < j:
                    c0, x0 = base[i, j], scratch[i]
                    for r in range(n):
                        x[r] -= c0 * x0[r]
                    i += 1
                inverse = 1.0 / base[j, j]
                for r in range(n):
                    x[r] *= inverse
            j = 0
            while j + 1 < size:
                a, b = scratch[j], scratch[j + 1]
                # Two by two: four products for four loads.
                for i in range(0, j + 1, 2):
                    c, d = scratch[i], scratch[i + 1]
                    s0 = s1 = s2 = s3 = 0.0
                    for r in range(n):
                        s0 += a[r] * c[r]
                        s1 += a[r] * d[r]
                        s2 += b[r] * c[r]
                        s3 += b[r] * d[r]
                    gram[i, j] += s0
                    gram[i + 1, j] += s1
                    gram[i, j + 1] += s2
                    gram[i + 1, j + 1] += s3
                j += 2
            if j < size:
                a = scratch[j]
                for i in range(size):
                    c = scratch[i]
                    s0 = 0.0
                    for r in range(n):
                        s0 += a[r] * c[r]
                    gram[i, j] += s0

    return sweep
