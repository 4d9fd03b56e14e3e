"""Runs as whitened rows in which the noise and a discrepancy of the law are both uncorrelated.

A law that lacks something is wrong by a moment that is smooth along the motion. Beside the noise, which whitening makes
independent, this discrepancy is a second covariance, exp(−|Δ|/ℓ) along the phase of a period or along time. An
orthogonal rotation of the whitened rows makes it diagonal too; for long runs piece by piece.
"""

from __future__ import annotations

from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from sindyjoint.numeric import Array

# Length over which a discrepancy keeps its sign, in periods of the motion (of its main frequency).
LENGTH = 0.05
# Rows of a long run that are rotated together.
PIECE = 160
MOST_HATS = 400
# Rows that a segment has at least.
SHORTEST = 12


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
            value = np.zeros(high - low)
            value[: singular.size] = singular**2
            self._turns.append(left.T)
            spread.append(value)
        self.spread = np.concatenate(spread)

    def __call__(self, rows: Array) -> Array:
        """Return whitened and rotated rows of columns, shape (m', k) or (m',)."""
        white = self.run.white(rows)
        parts = zip(self._turns, self._edges[:-1], self._edges[1:], strict=True)
        return np.concatenate([turn @ white[low:high] for turn, low, high in parts])


def _edges(rows: int, segments: int, whole: bool) -> NDArray[np.intp]:
    """Return the ends of pieces of some rows, whole numbers of which are a segment."""
    segments = max(1, min(segments, rows // SHORTEST))
    pieces = 1 if whole else segments * max(1, round(rows / PIECE / segments))
    return np.round(np.linspace(0, rows, pieces + 1)).astype(int)


def _hats(place: Array) -> Array:
    """Return hat functions as wide as a discrepancy keeps its sign, of which a smooth one is the sum."""
    width = max(LENGTH, float(np.ptp(place)) / MOST_HATS)
    middles = np.arange(float(place.min()), float(place.max()) + width, width)
    return np.maximum(0.0, 1 - np.abs(place[:, None] - middles) / width)


def _kernel(place: Array, cyclic: bool) -> Array:
    apart = np.abs(place[:, None] - place)
    if cyclic:
        # Periodic and positive definite: the chord takes the place of the arc.
        apart = np.sin(np.pi * apart) / np.pi
        apart = np.abs(apart)
    kernel: Array = np.exp(-apart / LENGTH)
    return kernel
