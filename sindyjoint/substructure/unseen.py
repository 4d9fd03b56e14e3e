"""The slow part of a joint's angle, which sensors of acceleration hardly see, from the law that is sought.

An accelerometer shows an angle as ω²θ: nothing of its mean, and little of harmonics far below the others. The moment
shows them: M(θ + δθ, θ̇ + δθ̇) of the law. Law and slow part are found together by Gauss–Newton, rows
M = Σ c·φ + (∂M/∂θ)·δθ + (∂M/∂θ̇)·δθ̇ with the amplitudes of δθ unknown in each run, beside what the sensors do say of
them, within its standard error.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import scipy

from sindyjoint.equation.terms import ResolvedTerm, term_columns
from sindyjoint.limits import SUBSTRUCTURE
from sindyjoint.numeric import DIFFERENCE, Array, Booleans, Complex, Integers, partials, scaled_least_squares
from sindyjoint.states import ForceStates, moving_mask

Basis = tuple[Array, Array, Array]  # of angle, rate and moment, shapes (n, u)


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
    frequency : float
        Of the first order, Hz.
    drift : float
        One over the length of a record that does not repeat, Hz: that it ends at another angle than it began at, and at
        another rate, no accelerometer sees. Zero in runs that repeat.
    level : float
        How far the mean moment may be from that of equilibrium, N·m, as where a structure that still vibrates freely
        does not end as it began. Zero: it is that one.
    """

    orders: Integers
    amplitudes: Complex
    standard_error: Array
    frequency: float = 0.0
    drift: float = 0.0
    level: float = 0.0

    def basis(self, state: ForceStates, rows: Integers | slice = slice(None)) -> Basis:
        """Return what each unknown adds to angle, rate and moment: cosines, sines, mean, then ends and mean moment."""
        angular = 2 * np.pi * self.frequency * self.orders
        time = (state.time - state.time[0])[rows]
        phase = np.outer(time, angular)
        one = np.ones((len(phase), 1))
        cosine, sine = np.cos(phase), np.sin(phase)
        angle, rate = [cosine, sine, one], [-sine * angular, cosine * angular, 0 * one]
        if self.drift:
            part = self.drift * time[:, None]
            angle += [part - 0.5, part**2 - part + 1 / 6]
            rate += [self.drift * one, self.drift * (2 * part - 1)]
        if self.level:
            angle, rate = [*angle, 0 * one], [*rate, 0 * one]
        moment = np.zeros((len(phase), self.start.size))
        moment[:, self.start.size - 1] = self.level > 0
        return np.hstack(angle), np.hstack(rate), moment

    @property
    def blind(self) -> int:
        """Of how many unknowns nothing is seen at all: the mean, drift and bend of a record, the mean moment."""
        return (3 if self.drift else 1) + (self.level > 0)

    @property
    def start(self) -> Array:
        """The unknowns as the sensors show them, shape (u,)."""
        return np.concatenate([self.amplitudes.real, -self.amplitudes.imag, np.zeros(self.blind)])

    @property
    def errors(self) -> Array:
        """Their standard errors; infinite of what is not seen at all."""
        blind = np.full(self.blind, np.inf)
        if self.level:
            blind[-1] = self.level
        return np.concatenate([self.standard_error, self.standard_error, blind])


@dataclass(frozen=True, eq=False)
class LawRows:
    """Rows of a law at the slow parts that were found with it, linearised about them.

    Parameters
    ----------
    unknowns : tuple of ndarray
        Of each run's slow part, each of shape (u,).
    coefficients : ndarray, shape (terms,)
    kept : tuple of ndarray of int
        Samples of each run that are rows.
    columns : ndarray, shape (rows of all runs, terms + unknowns of all runs)
        Weighted.
    slopes : tuple of tuple of ndarray, each of shape (n,)
        ∂M/∂θ and ∂M/∂θ̇ of the law.
    residual : tuple of ndarray, each of shape (n,)
        N·m.
    said : ndarray, shape (terms + unknowns of all runs,)
        By what the sensors' word of each unknown counts; zero where they say nothing, as of the coefficients.
    weights : ndarray, shape (runs,)
    """

    unknowns: tuple[Array, ...]
    coefficients: Array
    kept: tuple[Integers, ...]
    columns: Array
    slopes: tuple[tuple[Array, Array], ...]
    residual: tuple[Array, ...]
    said: Array
    weights: Array


def find_slow(
    states: Sequence[ForceStates],
    slow: Sequence[Slow],
    terms: Sequence[ResolvedTerm],
    weights: Array,
    begin: Sequence[Array] = (),
) -> LawRows:
    """Find the unknowns of each run's slow part together with the coefficients of a law.

    Parameters
    ----------
    states : sequence of ForceStates
        As they were recovered.
    slow : sequence of Slow
    terms : sequence of ResolvedTerm
        Of the law.
    weights : ndarray, shape (runs,)
        What rows of each run count.
    begin : sequence of ndarray, optional
        Unknowns of each run to start from, as of a law found before. Default: as the sensors show them.
    """
    kept = [_thinned(state) for state in states]
    bases = [each.basis(state, rows) for state, each, rows in zip(states, slow, kept, strict=True)]
    moments = [state.moment[rows] for state, rows in zip(states, kept, strict=True)]
    unknowns = [*begin] or [each.start for each in slow]
    if not begin and any(each.drift for each in slow):
        unknowns = _begin(states, slow, terms, kept, bases, unknowns)
    largest = max(
        float(np.ptp(state.angle[rows] + basis[0] @ values)) / 2
        for state, rows, basis, values in zip(states, kept, bases, unknowns, strict=True)
    )
    coefficients = np.zeros(len(terms))

    def linearised() -> Iterator[tuple[Any, ...]]:
        given = zip(states, kept, bases, unknowns, strict=True)
        return zip(*(_linearised(*each, terms, coefficients) for each in given), strict=True)

    def whole_moments() -> list[Array]:
        return [m + basis[2] @ values for m, basis, values in zip(moments, bases, unknowns, strict=True)]

    # At first the law is not known, and the angles are as the sensors show them.
    target = np.concatenate([np.sqrt(w) * m for w, m in zip(weights, whole_moments(), strict=True)])
    columns = np.vstack([np.sqrt(w) * part for w, part in zip(weights, next(linearised()), strict=True)])
    coefficients = scaled_least_squares(columns, target, 1e-10)
    noise = float(np.std(target - columns @ coefficients))
    for _ in range(19):
        own, _, of_unknowns = linearised()
        counts = [noise / each.errors for each in slow]
        words = [n * (each.start - now) for n, each, now in zip(counts, slow, unknowns, strict=True)]
        runs = [
            np.sqrt(w) * np.column_stack(part)
            for w, *part in zip(weights, of_unknowns, own, whole_moments(), strict=True)
        ]
        coefficients, steps = _solve(runs, counts, words)
        left = [
            run[:, -1] - run[:, :-1] @ np.append(step, coefficients)
            for run, step in zip(runs, steps, strict=True)
        ]
        noise = float(np.sqrt(np.mean(np.concatenate(left) ** 2)))
        moved = [float(np.abs(basis[0] @ step).max()) for basis, step in zip(bases, steps, strict=True)]
        # A step may change an angle by three tenths of the largest.
        unknowns = [
            value + step * min(1.0, 0.3 * largest / max(most, 1e-300))
            for value, step, most in zip(unknowns, steps, moved, strict=True)
        ]
        if max(moved) < 1e-5 * largest:
            break
    own, slopes, of_unknowns = linearised()
    columns = _stacked(own, of_unknowns, weights)
    residual = [moment - part @ coefficients for moment, part in zip(whole_moments(), own, strict=True)]
    said = np.concatenate([np.zeros(len(terms)), *(noise / each.errors for each in slow)])
    return LawRows(
        tuple(unknowns), coefficients, tuple(kept), columns, tuple(slopes), tuple(residual), said, weights
    )  # fmt: skip


# Terms of a joint that is not nonlinear: with them what drifts is found without a start.
LINEAR = ("linear_stiffness", "linear_damping", "coulomb_friction")


def _begin(
    states: Sequence[ForceStates],
    slow: Sequence[Slow],
    terms: Sequence[ResolvedTerm],
    kept: Sequence[Integers],
    bases: Sequence[Basis],
    unknowns: Sequence[Array],
) -> list[Array]:
    """Return the unknowns with mean, drift and bend of records that a linear joint with friction would have.

    M = k₁·(θ + d) + c₁·θ̇ + M_F·sign θ̇ is linear in k₁, c₁, M_F and k₁·d.
    """
    linear = [term for name in LINEAR for term in terms if term.id == name]
    if not linear or linear[0].id != LINEAR[0]:
        return [*unknowns]
    columns, blind = [], []
    for state, each, rows, basis, values in zip(states, slow, kept, bases, unknowns, strict=True):
        angle, rate = state.angle[rows] + basis[0] @ values, state.rate[rows] + basis[1] @ values
        columns.append(term_columns(linear, angle, rate, state.acceleration[rows]))
        blind.append(basis[0][:, values.size - each.blind :])
    target = np.concatenate([state.moment[rows] for state, rows in zip(states, kept, strict=True)])
    solved = scaled_least_squares(_stacked(columns, blind, np.ones(len(states))), target, 1e-12)
    found = np.split(solved[len(linear) :] / solved[0], np.cumsum([each.blind for each in slow])[:-1])
    return [
        values + np.concatenate([np.zeros(values.size - more.size), more])
        for values, more in zip(unknowns, found, strict=True)
    ]


def _linearised(
    state: ForceStates,
    rows: Integers,
    basis: Basis,
    unknowns: Array,
    terms: Sequence[ResolvedTerm],
    coefficients: Array,
) -> tuple[Array, tuple[Array, Array], Array]:
    """Return the terms' columns of a run with its slow part, the law's slopes by angle and rate, and the unknowns'."""
    motion = state.angle[rows] + basis[0] @ unknowns, state.rate[rows] + basis[1] @ unknowns

    def columns(angle: Array, rate: Array) -> Array:
        return term_columns(terms, angle, rate, state.acceleration[rows])

    by_angle, by_rate = partials(lambda *at: columns(*at) @ coefficients, motion, DIFFERENCE)
    of_unknowns = by_angle[:, None] * basis[0] + by_rate[:, None] * basis[1] - basis[2]
    return columns(*motion), (by_angle, by_rate), of_unknowns


def _stacked(columns: Sequence[Array], blocks: Sequence[Array], weights: Array) -> Array:
    """Return weighted rows of all runs, which share the first columns and have further ones of their own."""
    sizes = np.repeat(np.sqrt(weights), [len(own) for own in columns])
    return np.asarray(np.hstack([np.vstack(columns), scipy.linalg.block_diag(*blocks)]) * sizes[:, None])


def _solve(
    runs: Sequence[Array], counts: Sequence[Array], said: Sequence[Array]
) -> tuple[Array, list[Array]]:
    """Return coefficients and steps of the unknowns; what is said of these counts beside the rows.

    Each run's unknowns are eliminated from its rows of unknowns, terms and moment by a QR decomposition: runs share the
    terms alone.
    """
    factors: list[Array] = []
    for run, count, word in zip(runs, counts, said, strict=True):
        known = np.zeros((count.size, run.shape[1]))
        known[:, : count.size], known[:, -1] = np.diag(count), word
        factors.append(np.asarray(np.linalg.qr(np.vstack([run, known]), mode="r")))
    rest = np.vstack(
        [factor[count.size :, count.size :] for factor, count in zip(factors, counts, strict=True)]
    )
    coefficients = scaled_least_squares(rest[:, :-1], rest[:, -1], 1e-12)
    steps = []
    for factor, count in zip(factors, counts, strict=True):
        own, others = factor[: count.size, : count.size], factor[: count.size, count.size :]
        steps.append(scaled_least_squares(own, others[:, -1] - others[:, :-1] @ coefficients, 1e-12))
    return coefficients, steps


def run_weights(states: Sequence[ForceStates]) -> Array:
    """Return what rows of each run count, by the noise of its states, shape (runs,); one in the mean of all rows.

    In moment the noise of angle and rate is that of the stiffness and damping that go with the best-known run. What
    noise is below the scatter that any law leaves, a hundredth of the moment, does not matter.
    """
    best = min(states, key=lambda s: s.noise.rate / np.std(s.rate))
    largest = float(np.std(best.moment))
    by_angle, by_rate = largest / np.std(best.angle), largest / np.std(best.rate)
    noise = np.array(
        [
            np.hypot(by_angle * s.noise.angle, by_rate * s.noise.rate) ** 2
            + s.noise.moment**2 / (1 if s.replicate is None else s.block[-1] + 1)
            for s in states
        ]
    )
    weight = 1 / (noise + (SUBSTRUCTURE.small_share * largest) ** 2)
    rows = np.array([np.count_nonzero(s.moving) for s in states])
    return np.asarray(weight * rows.sum() / (weight @ rows))


def with_slow(state: ForceStates, slow: Slow, values: Array) -> ForceStates:
    """Return force states with the slow part of their angle, moving where they do with it, too."""
    angle, rate, moment = (basis @ values for basis in slow.basis(state))
    of_blocks = state.replicate
    replicate = of_blocks and (of_blocks[0] + angle, of_blocks[1] + rate, of_blocks[2])
    rate = state.rate + rate
    moving = state.moving & moving_mask(rate, state.slowest, state.guard)
    angle, moment = state.angle + angle, state.moment + moment
    return replace(state, angle=angle, rate=rate, moment=moment, replicate=replicate, moving=moving)


def within_record(samples: int, sample_rate: float, bandwidth: float) -> Booleans:
    """Return where the series of a record that does not repeat does not ring of its ends, shape (n,)."""
    edge = int(np.ceil(SUBSTRUCTURE.edge * sample_rate / max(bandwidth, 1e-9)))
    place = np.arange(samples)
    return np.asarray((place >= edge) & (place < samples - edge))


def _thinned(state: ForceStates) -> Integers:
    rows = np.flatnonzero(state.moving)
    return rows[:: max(1, rows.size // 2000)]
