"""The factor of rows that pass by once, at the speed of a Gram matrix and with the accuracy of a QR decomposition.

A Gram matrix squares the condition number: at 1e6 it leaves four digits. The Gram matrix of *preconditioned* columns
X·P⁻¹, P a triangular factor of the rows so far, does not: it is near the identity, and with H = P⁻ᵀXᵀX P⁻¹ = R̃ᵀR̃ the
factor of X is R̃·P. Rows are solved with P and multiplied a tile at a time, which stays in the cache. Rows that P
does not suit (they excite what the rows so far did not) are decomposed by themselves, and P is renewed.

Reference: the Cholesky QR with preconditioning of Fukaya, Kannan, Nakatsukasa, Yamamoto and Yanagisawa, SIAM J. Sci.
Comput. 42(1), 2020, with the factor of the first rows instead of a shifted one.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import scipy

from sindyjoint.discovery.factors import Factor, merge
from sindyjoint.equation.evaluation import TermFunction
from sindyjoint.errors import InputError
from sindyjoint.numeric import BLOCK, ROUNDING, Array

# Rounding of the Gram matrix, relative to its weakest direction, beyond which rows are decomposed instead. It bounds
# the relative error of a coefficient; noise of a thousandth leaves that of ten million rows at 3e-7.
TOLERANCE = 1e-9


@dataclass(frozen=True, eq=False)
class Base:
    """Coordinates in which columns are so little alike that their products may be summed.

    Parameters
    ----------
    triangle : ndarray, shape (p + 1, p + 1)
        P, upper triangular.
    diagonal : bool
        Whether P only scales the columns.
    free : ndarray, shape (p + 1,)
        1 in directions in which the rows that P was made of say nothing, and which set no standard; otherwise 0.
    """

    triangle: Array
    diagonal: bool
    free: Array

    @classmethod
    def of(cls, factor: Factor) -> "Base | None":
        """Return the coordinates that suit rows like those of a factor; ``None`` where these are too few."""
        size = factor.triangle.shape[0]
        if factor.rows < 2 * size:
            return None
        triangle, root = factor.triangle, np.sqrt(factor.rows)
        norms = np.linalg.norm(triangle, axis=0)
        least = np.where(norms > 0, ROUNDING * norms, 1.0)
        weak = np.abs(np.diag(triangle)) < least
        scales = cls(np.diag(np.where(norms > 0, norms, 1.0)) / root, True, weak.astype(float))
        gram = scales.products_of(triangle)
        # Rows whose columns are multiplied as they are keep away from that by a factor of two.
        if not weak.any() and accurate(2.0 * np.trace(gram), _find_weakest(gram)):
            return scales
        # The columns by themselves are too much alike; a dependent one is known as such to more digits so.
        base = triangle / root
        base[weak, weak.nonzero()[0]] = least[weak] / root
        return cls(np.ascontiguousarray(base), False, weak.astype(float))

    def products_of(self, triangle: Array) -> Array:
        """Return H of rows of which a triangular factor is known."""
        root = _divided(triangle, self.triangle)
        return np.asarray(root.T @ root)

    def products(self, block: Array) -> Array:
        """Return H of a block, shape (p + 1, n), whose rows are the columns."""
        if not self.diagonal:
            solved = scipy.linalg.blas.dtrsm(1.0, self.triangle, block.T, side=1)
            return np.asarray(solved.T @ solved)
        scale = np.diag(self.triangle)
        return np.asarray(block @ block.T / np.outer(scale, scale))

    def weakest(self, gram: Array, rows: float) -> float:
        """Return the least of H of so many rows, counted as :func:`_find_weakest` does."""
        return _find_weakest(gram + rows * np.diag(self.free))

    def factor_of(self, gram: Array) -> Array:
        """Return the triangular factor of rows of which H is known."""
        # A column of zeros stays one: of what rounding makes of it it would no longer be seen to be nothing.
        nothing = np.diag(gram) == 0
        full = gram + np.diag(nothing.astype(float))
        root, failed = scipy.linalg.lapack.dpotrf(full, lower=0, clean=1)
        if failed:
            values, vectors = np.linalg.eigh(full)
            root = np.linalg.qr(np.sqrt(np.maximum(values, 0.0))[:, None] * vectors.T, mode="r")
        root[:, nothing] = 0.0
        return np.asarray(np.triu(root @ self.triangle))


def accurate(weight: float, weakest: float) -> bool:
    """Return whether the rounding of sums of products leaves their weakest direction its digits."""
    return bool(np.finfo(float).eps * weight <= TOLERANCE * weakest)


class GramSum:
    """Adds rows to their products in given coordinates; who adds them sees to it that these suit.

    Parameters
    ----------
    base : Base
    """

    def __init__(self, base: Base):
        self.base = base
        self.gram = np.zeros_like(base.triangle)

    def add(self, block: Array) -> None:
        """Add rows, as :meth:`FactorSum.add` does."""
        gram = self.base.products(block)
        if not np.isfinite(gram.trace()):
            raise _not_finite(block)
        self.gram += gram


class FactorSum:
    """Adds rows to a factor, in coordinates that it renews as the rows ask for it.

    Parameters
    ----------
    columns : int
        Number of columns, the target not counted.
    """

    def __init__(self, columns: int):
        self.size = columns + 1
        self.rows = 0
        self._triangle = np.zeros((self.size, self.size))  # of all rows up to the last renewal
        self._base: Base | None = None
        self._gram = np.zeros((self.size, self.size))  # H of all rows
        self._weakest, self._weight = 0.0, 0.0
        self._standing = 0.0  # rows of the last renewal

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
        gram = self._base.products(block)
        weight = self._weight + float(gram.trace())
        if not np.isfinite(weight):
            raise _not_finite(block)
        if not accurate(weight, self._weakest):
            # More rows have come since: the weakest direction can only have grown.
            self._weakest = self._base.weakest(self._gram + gram, self._standing)
            if not accurate(weight, self._weakest):
                self._renew(block)
                return
        self.rows += n
        self._gram += gram
        self._weight = weight

    def factor(self) -> Factor:
        """Return the factor of all rows so far."""
        triangle = self._triangle if self._base is None else self._base.factor_of(self._gram)
        return Factor(triangle, float(self.rows))

    def _renew(self, block: Array) -> None:
        """Decompose rows by themselves, and take what is known now for the base."""
        if not np.isfinite(block).all():
            raise _not_finite(block)
        self._triangle = merge([self.factor(), Factor.of(block[:-1].T, block[-1])]).triangle
        self.rows += block.shape[1]
        self._standing = float(self.rows)
        self._base = Base.of(Factor(self._triangle, self._standing))
        if self._base is not None:
            self._gram = self._base.products_of(self._triangle)
            self._weakest = self._base.weakest(self._gram, self._standing)
            self._weight = float(np.trace(self._gram))


class Tiles:
    """Evaluates terms at force states a tile of rows at a time, in memory that is reused.

    Parameters
    ----------
    function : TermFunction
        Of (θ, θ̇, θ̈).
    """

    def __init__(self, function: TermFunction):
        self.function = function
        self._scratch = np.empty((len(function.operations), BLOCK))
        self._block = np.empty((len(function.outputs) + 1, BLOCK))

    def add_to(
        self,
        total: FactorSum | GramSum,
        states: Sequence[Array],
        target: Array,
        weight: Array | None = None,
    ) -> None:
        """Add rows to a sum.

        Parameters
        ----------
        total : FactorSum or GramSum
        states : sequence of ndarray, shape (n,)
            θ, θ̇ and, where a term needs it, θ̈.
        target : ndarray, shape (n,)
        weight : ndarray, shape (n,), optional
            How often each row counts.

        Raises
        ------
        InputError
            If a term or the target has no finite value somewhere.
        """
        for start in range(0, target.size, BLOCK):
            part = slice(start, start + BLOCK)
            block = self.columns(
                [s[part] for s in states], target[part], None if weight is None else weight[part]
            )
            try:
                total.add(block)
            except InputError as error:
                raise InputError(f"rows from {start} of this segment: {error}") from None

    def columns(self, states: Sequence[Array], target: Array, weight: Array | None = None) -> Array:
        """Return terms and target at a tile of rows, or fewer, shape (p + 1, n); of a tile until the next call."""
        n = target.size
        block = self._block if n == BLOCK else np.empty((self._block.shape[0], n))
        extra: list[Any] = [np.nan] * (len(self.function.arguments) - len(states))
        inputs = [np.ascontiguousarray(s, dtype=np.float64) for s in states]
        self.function.tile([*inputs, *extra], self._scratch[:, :n], block)
        block[-1] = target
        if weight is not None:
            block *= np.sqrt(weight)
        return block


def _find_weakest(gram: Array) -> float:
    """Return the least residual of a unit combination of columns, and of the target on them, to fewer digits."""
    least, vectors = np.linalg.eigh(gram[:-1, :-1])
    if not least[0] > 0:
        return 0.0
    residual = float(gram[-1, -1] - np.sum((vectors.T @ gram[:-1, -1]) ** 2 / least))
    # The mean square of the residual needs fewer digits than the coefficients: 1e-5 where these have 1e-9.
    return min(float(least[0]), 1e4 * residual)


def _not_finite(block: Array) -> InputError:
    """Say where a block has no finite value; looked for only once its products have shown that it has."""
    row, column = (int(indices[0]) for indices in np.nonzero(~np.isfinite(block.T)))
    what = "the target" if column == block.shape[0] - 1 else f"column {column + 1} (of {block.shape[0] - 1})"
    return InputError(f"{what} has no finite value at row {row}; leave the term out or repair the row")


def _divided(matrix: Array, triangle: Array) -> Array:
    """Return matrix · triangle⁻¹ for an upper triangle, column by column."""
    result = np.empty_like(matrix)
    for j in range(triangle.shape[0]):
        result[:, j] = (matrix[:, j] - result[:, :j] @ triangle[:j, j]) / triangle[j, j]
    return result
