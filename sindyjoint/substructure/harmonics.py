"""Periodic signals as Fourier coefficients and as samples over one period.

A signal with H harmonics is x(τ) = x₀ + Σ_h x_{2h−1} cos hτ + x_{2h} sin hτ over the phase τ = Ω t; its coefficients
stand in one real vector of 2H + 1 numbers.
"""

from __future__ import annotations

from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from sindyjoint.numeric import Array


@lru_cache(maxsize=16)
def synthesis(harmonics: int, samples: int) -> Array:
    """Return the matrix that gives samples of a signal over its period, shape (samples, 2H + 1)."""
    phase = 2 * np.pi * np.outer(np.arange(samples) / samples, np.arange(1, harmonics + 1))
    matrix = np.ones((samples, 2 * harmonics + 1))
    matrix[:, 1::2], matrix[:, 2::2] = np.cos(phase), np.sin(phase)
    matrix.flags.writeable = False
    return matrix


@lru_cache(maxsize=16)
def analysis(harmonics: int, samples: int) -> Array:
    """Return the matrix that gives the coefficients of samples (their projection), shape (2H + 1, samples)."""
    matrix = synthesis(harmonics, samples).T * (2.0 / samples)
    matrix[0] /= 2
    matrix.flags.writeable = False
    return matrix


@lru_cache(maxsize=16)
def differentiation(harmonics: int) -> Array:
    """Return the matrix of d/dτ on coefficients, shape (2H + 1, 2H + 1)."""
    matrix = np.zeros((2 * harmonics + 1, 2 * harmonics + 1))
    for h in range(1, harmonics + 1):
        matrix[2 * h - 1, 2 * h], matrix[2 * h, 2 * h - 1] = h, -h
    matrix.flags.writeable = False
    return matrix


@lru_cache(maxsize=16)
def rates(harmonics: int, samples: int) -> Array:
    """Return the matrix that gives samples of dx/dτ, shape (samples, 2H + 1)."""
    matrix = synthesis(harmonics, samples) @ differentiation(harmonics)
    matrix.flags.writeable = False
    return matrix


def real_blocks(factor: NDArray[np.complex128]) -> Array:
    """Return complex factors of one harmonic as factors of its (cos, sin) coefficients.

    With x = Re(a·exp(iτ)), a = x_c − i·x_s: y = S·a has y_c = Re S·x_c + Im S·x_s, y_s = −Im S·x_c + Re S·x_s.

    Parameters
    ----------
    factor : ndarray of complex, shape (n, m)

    Returns
    -------
    ndarray, shape (2n, 2m)
        Cosine and sine coefficients of each freedom side by side.
    """
    blocks = np.array([[factor.real, factor.imag], [-factor.imag, factor.real]])
    return blocks.transpose(2, 0, 3, 1).reshape(2 * factor.shape[0], 2 * factor.shape[1])


def by_harmonic(factors: NDArray[np.complex128], spare: int = 0) -> Array:
    """Return complex factors of each harmonic as a matrix on the coefficients of all signals.

    Parameters
    ----------
    factors : ndarray of complex, shape (H + 1, n, n)
    spare : int
        Rows and columns of zeros behind.

    Returns
    -------
    ndarray, shape (n·(2H + 1) + spare, n·(2H + 1) + spare)
    """
    count, width = factors.shape[1], 2 * len(factors) - 1
    rows: NDArray[np.intp] = np.arange(count) * width
    matrix = np.zeros((count * width + spare,) * 2)
    matrix[np.ix_(rows, rows)] = factors[0].real
    for order in range(1, len(factors)):
        pairs: NDArray[np.intp] = np.ravel(rows[:, None] + np.array([2 * order - 1, 2 * order]))
        matrix[np.ix_(pairs, pairs)] = real_blocks(factors[order])
    return matrix
