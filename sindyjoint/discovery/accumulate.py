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
from typing import Any

import numpy as np
from numpy.typing import NDArray

from sindyjoint.discovery.factors import Factor, merge
from sindyjoint.equation.evaluation import TermFunction
from sindyjoint.errors import InputError

Array = NDArray[np.float64]

# Rows worked on at once: twenty columns of these are two thirds of a megabyte.
TILE = 4096
# Rounding of the Gram matrix, relative to its weakest direction, beyond which rows are decomposed instead.
TOLERANCE = 1e-10
# By which the rows so far are to keep away from that, if their columns are to be multiplied as they are.
MARGIN = 2.0
# The mean square of the residual needs fewer digits than the coefficients: 1e-5 where these have 1e-10.
RESIDUAL = 1e5
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
        self._plain, self._norms = (
            True,
            np.ones((self.size, self.size)),
        )  # whether P is diagonal, and its products
        self._gram = np.zeros((self.size, self.size))  # upper half of H of all rows, in the coordinates of P
        self._weakest, self._weight = 0.0, 0.0
        self._free = np.zeros(self.size)
        self._scratch = np.empty((self.size, TILE))

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
        # numba is imported where it is first needed.
        from sindyjoint.discovery import products

        gram = np.zeros((self.size, self.size))
        if self._plain:
            products.plain(block, gram)
            gram /= self._norms
        else:
            products.solved(block, self._base, self._scratch, gram)
        weight = self._weight + float(gram.trace())
        if not np.isfinite(weight):
            raise _not_finite(block)
        if not self._accurate(weight):
            # More rows have come since: the weakest direction can only have grown.
            self._weakest = _weakest(_symmetric(self._gram + gram) + np.diag(self._free))
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
        # Directions in which the rows say nothing set no standard.
        self._free = np.where(weak, float(self.rows), 0.0)
        scale = np.maximum(norms, np.where(norms > 0, 0.0, 1.0)) / np.sqrt(self.rows)
        self._plain = True
        self._take(np.diag(scale))
        self._norms = np.outer(scale, scale)
        if weak.any() or not self._accurate(MARGIN * self._weight):
            # The columns by themselves are too much alike; a dependent one is known as such to more digits so.
            base = self._triangle / np.sqrt(self.rows)
            base[weak, weak.nonzero()[0]] = least[weak] / np.sqrt(self.rows)
            self._plain = False
            self._take(base)

    def _take(self, base: Array) -> None:
        """Take a triangle for P."""
        root = _divided(self._triangle, base)
        self._base, self._gram = np.ascontiguousarray(base), root.T @ root
        self._weakest = _weakest(self._gram + np.diag(self._free))
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


def _weakest(gram: Array) -> float:
    """Return the least that a unit combination of columns leaves; of the target, what they leave, to fewer digits."""
    least, vectors = np.linalg.eigh(gram[:-1, :-1])
    if not least[0] > 0:
        return 0.0
    left = float(gram[-1, -1] - np.sum((vectors.T @ gram[:-1, -1]) ** 2 / least))
    return min(float(least[0]), RESIDUAL * left)


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
