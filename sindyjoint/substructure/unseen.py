"""The slow part of a joint's angle, which sensors of acceleration hardly see, from the law that is sought.

An accelerometer shows an angle as ω²θ: nothing of its mean, and little of harmonics far below the others. The moment
shows them: M(θ + δθ, θ̇ + δθ̇) of the law. Law and slow part are found together by Gauss–Newton, rows
M = Σ c·φ + (∂M/∂θ)·δθ + (∂M/∂θ̇)·δθ̇ with the amplitudes of δθ unknown in each run, beside what the sensors do say of
them, within its standard error.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from sindyjoint.equation.terms import ResolvedTerm, term_columns
from sindyjoint.numeric import scaled_least_squares
from sindyjoint.states.record import ForceStates

Array = NDArray[np.float64]
Complex = NDArray[np.complex128]

ROUNDS = 10
ROWS = 2000  # of each run
SETTLED = 1e-5  # change of an angle, of the largest, at which it is found
STEP = 1e-4  # by which angle and rate are varied, of the largest


@dataclass(frozen=True, eq=False)
class Slow:
    """The slow harmonics of an angle beyond what its states hold, as the sensors show them.

    Parameters
    ----------
    orders : ndarray of int, shape (k,)
        Beside the mean, of which nothing is known.
    amplitudes : ndarray of complex, shape (k,)
        rad.
    standard_error : ndarray, shape (k,)
        Of a real part.
    """

    orders: NDArray[np.intp]
    amplitudes: Complex
    standard_error: Array

    def basis(self, state: ForceStates, rows: NDArray[np.intp] | slice = slice(None)) -> tuple[Array, Array]:
        """Return what each unknown adds to angle and rate at some samples, shapes (n, 1 + 2k): mean, cosines, sines."""
        frequency = state.frequency or 0.0
        angular = 2 * np.pi * frequency * self.orders
        phase = np.outer((state.time - state.time[0])[rows], angular)
        one = np.ones((len(phase), 1))
        cosine, sine = np.cos(phase), np.sin(phase)
        return np.hstack([one, cosine, sine]), np.hstack([0 * one, -sine * angular, cosine * angular])

    @property
    def start(self) -> Array:
        """The unknowns as the sensors show them, shape (1 + 2k,)."""
        return np.concatenate([[0.0], self.amplitudes.real, -self.amplitudes.imag])

    @property
    def errors(self) -> Array:
        """Their standard errors; that of the mean is infinite."""
        return np.concatenate([[np.inf], self.standard_error, self.standard_error])


@dataclass(frozen=True, eq=False)
class LawRows:
    """Rows of a law at the slow parts that were found with it, linearised about them.

    Parameters
    ----------
    unknowns : tuple of ndarray
        Of each run's slow part, each of shape (1 + 2k,).
    coefficients : ndarray, shape (terms,)
    kept : tuple of ndarray of int
        Samples of each run that are rows.
    columns : ndarray, shape (rows of all runs, terms + unknowns of all runs)
        Weighted.
    slopes : tuple of tuple of ndarray, each of shape (n,)
        ∂M/∂θ and ∂M/∂θ̇ of the law.
    residual : tuple of ndarray, each of shape (n,)
        N·m.
    said : ndarray, shape (unknowns of all runs,)
        By what the sensors' word of each unknown counts; zero where they say nothing.
    weights : ndarray, shape (runs,)
    """

    unknowns: tuple[Array, ...]
    coefficients: Array
    kept: tuple[NDArray[np.intp], ...]
    columns: Array
    slopes: tuple[tuple[Array, Array], ...]
    residual: tuple[Array, ...]
    said: Array
    weights: Array


def find_slow(
    states: Sequence[ForceStates],
    slow: Sequence[Slow],
    terms: Sequence[ResolvedTerm],
    weights: Array | None = None,
) -> LawRows:
    """Find the unknowns of each run's slow part together with the coefficients of a law.

    Parameters
    ----------
    states : sequence of ForceStates
        As they were recovered.
    slow : sequence of Slow
    terms : sequence of ResolvedTerm
        Of the law.
    weights : ndarray, shape (runs,), optional
        What rows of each run count. Default: all the same.
    """
    kept = [_thinned(state) for state in states]
    bases = [each.basis(state, rows) for state, each, rows in zip(states, slow, kept, strict=True)]
    moments = [state.moment[rows] for state, rows in zip(states, kept, strict=True)]
    largest = max(float(np.abs(state.angle).max()) for state in states)
    weights = np.ones(len(states)) if weights is None else weights
    unknowns = [each.start for each in slow]
    coefficients, noise = np.zeros(len(terms)), 0.0

    errors = np.concatenate([each.errors for each in slow])

    def linearised() -> tuple[list[Array], list[tuple[Array, Array]], Array]:
        found = [
            _columns_and_slopes(state, rows, basis, values, terms, coefficients)
            for state, rows, basis, values in zip(states, kept, bases, unknowns, strict=True)
        ]
        own, slopes = [columns for columns, _ in found], [pair for _, pair in found]
        of_unknowns = [
            by_angle[:, None] * basis[0] + by_rate[:, None] * basis[1]
            for (by_angle, by_rate), basis in zip(slopes, bases, strict=True)
        ]
        return own, slopes, _stacked(own, of_unknowns, weights)

    target = np.concatenate([np.sqrt(w) * moment for w, moment in zip(weights, moments, strict=True)])
    for number in range(ROUNDS):
        _, _, columns = linearised()
        if number == 0:
            # At first the law is not known, and the angles are as the sensors show them.
            coefficients = scaled_least_squares(columns[:, : len(terms)], target, 1e-10)
            noise = float(np.std(target - columns[:, : len(terms)] @ coefficients))
            continue
        said = np.concatenate([each.start - now for each, now in zip(slow, unknowns, strict=True)])
        solved = _solve(columns, target, noise / errors, said)
        coefficients, noise = solved[: len(terms)], float(np.sqrt(np.mean((target - columns @ solved) ** 2)))
        steps = np.split(solved[len(terms) :], np.cumsum([each.size for each in unknowns])[:-1])
        limited = [np.clip(step, -0.3 * largest, 0.3 * largest) for step in steps]
        unknowns = [value + step for value, step in zip(unknowns, limited, strict=True)]
        if max(float(np.abs(step).max()) for step in steps) < SETTLED * largest:
            break
    own, slopes, columns = linearised()
    residual = [moment - part @ coefficients for moment, part in zip(moments, own, strict=True)]
    return LawRows(
        tuple(unknowns), coefficients, tuple(kept), columns, tuple(slopes), tuple(residual), noise / errors, weights
    )  # fmt: skip


def _columns_and_slopes(
    state: ForceStates,
    rows: NDArray[np.intp],
    basis: tuple[Array, Array],
    unknowns: Array,
    terms: Sequence[ResolvedTerm],
    coefficients: Array,
) -> tuple[Array, tuple[Array, Array]]:
    """Return the terms' columns of a run with its slow part, and the law's slopes by angle and rate."""
    angle, rate = state.angle[rows] + basis[0] @ unknowns, state.rate[rows] + basis[1] @ unknowns
    of_angle, of_rate = (STEP * float(np.abs(values).max()) for values in (angle, rate))

    def at(a: float, r: float) -> Array:
        return term_columns(terms, angle + a, rate + r, state.acceleration[rows])

    by_angle = (at(of_angle, 0) - at(-of_angle, 0)) @ coefficients / (2 * of_angle)
    by_rate = (at(0, of_rate) - at(0, -of_rate)) @ coefficients / (2 * of_rate)
    return at(0, 0), (by_angle, by_rate)


def _stacked(columns: Sequence[Array], blocks: Sequence[Array], weights: Array) -> Array:
    terms, sizes = columns[0].shape[1], [block.shape[1] for block in blocks]
    ends = terms + np.cumsum([0, *sizes])
    parts = []
    for index, (own, block, weight) in enumerate(zip(columns, blocks, weights, strict=True)):
        part = np.zeros((len(own), int(ends[-1])))
        part[:, :terms], part[:, ends[index] : ends[index + 1]] = own, block
        parts.append(part * np.sqrt(weight))
    return np.vstack(parts)


def _solve(columns: Array, target: Array, counts: Array, said: Array) -> Array:
    """Return coefficients and steps of the unknowns; what is said of these counts beside the rows."""
    known = np.zeros((counts.size, columns.shape[1]))
    known[:, columns.shape[1] - counts.size :] = np.diag(counts)
    return scaled_least_squares(np.vstack([columns, known]), np.concatenate([target, counts * said]), 1e-12)


def with_slow(state: ForceStates, slow: Slow, values: Array) -> ForceStates:
    """Return force states with the slow part of their angle."""
    angle, rate = (basis @ values for basis in slow.basis(state))
    replicate = state.replicate
    if replicate is not None:
        replicate = (replicate[0] + angle, replicate[1] + rate, replicate[2])
    return replace(state, angle=state.angle + angle, rate=state.rate + rate, replicate=replicate)


def _thinned(state: ForceStates) -> NDArray[np.intp]:
    rows = np.flatnonzero(state.moving)
    return rows[:: max(1, rows.size // ROWS)]
