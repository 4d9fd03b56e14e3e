"""The mean angle of a joint in each run, which sensors of acceleration do not see.

At rest about θ₀ the moment is M(θ + θ₀, θ̇): equilibrium gives its mean, so the angle follows from the law that is
sought. Both are found together by Gauss–Newton: rows M = Σ c·φ(θ + θ₀, θ̇) + (∂M/∂θ)·δθ₀ with one δθ₀ for each run.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from sindyjoint.equation.terms import ResolvedTerm, term_columns
from sindyjoint.numeric import scaled_least_squares
from sindyjoint.states.record import ForceStates

Array = NDArray[np.float64]

ROUNDS = 8
ROWS = 1500  # of each run; more make the mean no surer than its harmonics are
SETTLED = 1e-6  # change of a mean angle, of the largest angle, at which it is found
STEP = 1e-4  # by which angles are varied, of the largest


def find_mean_angles(states: Sequence[ForceStates], terms: Sequence[ResolvedTerm]) -> Array:
    """Return by how much the angle of each run is to be shifted for the terms to hold in all, rad, shape (runs,).

    Parameters
    ----------
    states : sequence of ForceStates
    terms : sequence of ResolvedTerm
        Of the law, whose coefficients are found at the same time.
    """
    runs = [_thinned(state) for state in states]
    largest = max(float(np.abs(angle).max()) for angle, _, _, _ in runs)
    shifts = np.zeros(len(runs))
    coefficients = np.zeros(len(terms))
    target = np.concatenate([moment for *_, moment in runs])
    for number in range(ROUNDS):
        parts, slopes = [], []
        for (angle, rate, acceleration, _), shift in zip(runs, shifts, strict=True):
            at = [
                term_columns(terms, angle + shift + d, rate, acceleration)
                for d in (-STEP * largest, 0.0, STEP * largest)
            ]
            parts.append(at[1])
            # In the first round the law is not known: any one angle-dependent moment holds a constant for each run.
            slopes.append(
                (at[2] - at[0]) @ coefficients / (2 * STEP * largest) if number else np.ones(angle.size)
            )
        blocks = np.zeros((target.size, len(runs)))
        first = 0
        for index, slope in enumerate(slopes):
            blocks[first : first + slope.size, index] = slope
            first += slope.size
        solved = scaled_least_squares(np.column_stack([np.vstack(parts), blocks]), target, 1e-10)
        coefficients = solved[: len(terms)]
        if number == 0:
            continue
        step = np.clip(solved[len(terms) :], -0.2 * largest, 0.2 * largest)
        shifts = shifts + step
        if np.abs(step).max() < SETTLED * largest:
            break
    return shifts


def shifted(state: ForceStates, angle: float) -> ForceStates:
    """Return force states at angles that are larger by a constant, rad."""
    replicate = state.replicate
    if replicate is not None:
        replicate = (replicate[0] + angle, *replicate[1:])
    return replace(state, angle=state.angle + angle, replicate=replicate)


def _thinned(state: ForceStates) -> tuple[Array, Array, Array, Array]:
    rows = np.flatnonzero(state.moving)
    rows = rows[:: max(1, rows.size // ROWS)]
    return state.angle[rows], state.rate[rows], state.acceleration[rows], state.moment[rows]
