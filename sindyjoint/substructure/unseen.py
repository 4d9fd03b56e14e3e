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


def find_slow(
    states: Sequence[ForceStates], slow: Sequence[Slow], terms: Sequence[ResolvedTerm]
) -> tuple[Array, ...]:
    """Return the unknowns of each run's slow part, each of shape (1 + 2k,).

    Parameters
    ----------
    states : sequence of ForceStates
        As they were recovered.
    slow : sequence of Slow
    terms : sequence of ResolvedTerm
        Of the law, whose coefficients are found at the same time.
    """
    rows = [_thinned(state) for state in states]
    bases = [each.basis(state, kept) for state, each, kept in zip(states, slow, rows, strict=True)]
    moments = [state.moment[kept] for state, kept in zip(states, rows, strict=True)]
    largest = max(float(np.abs(state.angle).max()) for state in states)
    fastest = max(float(np.abs(state.rate).max()) for state in states)
    unknowns = [each.start for each in slow]
    coefficients, noise = np.zeros(len(terms)), float(np.std(np.concatenate(moments)))
    for number in range(ROUNDS):
        columns, slopes = [], []
        for state, kept, basis, values in zip(states, rows, bases, unknowns, strict=True):
            angle, rate = state.angle[kept] + basis[0] @ values, state.rate[kept] + basis[1] @ values
            at = [
                term_columns(terms, angle + a, rate + r, state.acceleration[kept])
                for a, r in (
                    (0, 0),
                    (STEP * largest, 0),
                    (-STEP * largest, 0),
                    (0, STEP * fastest),
                    (0, -STEP * fastest),
                )
            ]
            columns.append(at[0])
            by_angle, by_rate = (at[1] - at[2]) / (2 * STEP * largest), (at[3] - at[4]) / (2 * STEP * fastest)
            # At first the law is not known, and the angles are as the sensors show them.
            slopes.append(
                (by_angle @ coefficients)[:, None] * basis[0] + (by_rate @ coefficients)[:, None] * basis[1]
            )
        if number == 0:
            target = np.concatenate(moments)
            coefficients = scaled_least_squares(np.vstack(columns), target, 1e-10)
            noise = float(np.std(target - np.vstack(columns) @ coefficients))
            continue
        steps, coefficients, noise = _solve(columns, slopes, moments, unknowns, slow, noise)
        limited = [np.clip(step, -0.3 * largest, 0.3 * largest) for step in steps]
        unknowns = [value + step for value, step in zip(unknowns, limited, strict=True)]
        if max(float(np.abs(step).max()) for step in steps) < SETTLED * largest:
            break
    return tuple(unknowns)


def _solve(
    columns: Sequence[Array],
    slopes: Sequence[Array],
    moments: Sequence[Array],
    unknowns: Sequence[Array],
    slow: Sequence[Slow],
    noise: float,
) -> tuple[list[Array], Array, float]:
    """Return the steps of the unknowns, the coefficients, and the residual, by one weighted least squares."""
    terms, sizes = columns[0].shape[1], [values.size for values in unknowns]
    ends = terms + np.cumsum([0, *sizes])
    width = int(ends[-1])
    parts, targets = [], []
    for index, (own, slope, moment) in enumerate(zip(columns, slopes, moments, strict=True)):
        block = np.zeros((moment.size, width))
        block[:, :terms], block[:, ends[index] : ends[index + 1]] = own, slope
        parts.append(block)
        targets.append(moment)
    rows = np.vstack(parts)
    target = np.concatenate(targets)
    known = np.zeros((width - terms, width))
    known[:, terms:] = np.diag(noise / np.concatenate([each.errors for each in slow]))
    said = np.concatenate([each.start - now for each, now in zip(slow, unknowns, strict=True)])
    with np.errstate(invalid="ignore"):
        said = np.nan_to_num(np.diag(known[:, terms:]) * said)
    solved = scaled_least_squares(np.vstack([rows, known]), np.concatenate([target, said]), 1e-12)
    left = target - rows @ solved
    steps = [solved[low:high] for low, high in zip(ends[:-1], ends[1:], strict=True)]
    return steps, solved[:terms], float(np.sqrt(np.mean(left**2)))


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
