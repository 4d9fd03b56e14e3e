"""What the noise of the sensors makes of the coefficients of a law, the slow parts of its angles being free.

Coefficients c and unknowns u of the slow parts solve one weighted least squares of rows A·(c, u) ≈ M. An error of the
recovered amplitudes, δθ of the angle and δM of the moment at each harmonic, is an error of the rows,
e(t) = Re Σ (δM − (∂M/∂θ + iω·∂M/∂θ̇)·δθ)·exp(iωt), and of the coefficients, δc = (AᵀA)⁻¹Aᵀ·e, of which the first
entries. With the covariance of the amplitudes known, that of the coefficients follows: the slow parts are marginalised,
and noise that angle and moment share is in it (propagation of errors through least squares whose weights are not those
of the noise: the sandwich of Huber, Proc. 5th Berkeley Symposium 1, 1967).
"""

from collections.abc import Sequence
from dataclasses import dataclass, field
from functools import cached_property

import numpy as np

from sindyjoint.numeric import Array, Booleans, Complex, Integers
from sindyjoint.states import ForceStates, record_series
from sindyjoint.substructure.recovery import Recovery
from sindyjoint.substructure.states import kept_of, slow_orders
from sindyjoint.substructure.unseen import LawRows, Slow


@dataclass(frozen=True, eq=False)
class Recovered:
    """A joint's states in one run, with what they were made of; `unseen` is the slow part of its angle."""

    recovery: Recovery
    joint: int
    states: ForceStates
    unseen: Array = field(default_factory=lambda: np.zeros(1))
    weight: float = 1.0


@dataclass(frozen=True, eq=False)
class LawErrors:
    """How the coefficients of a law, and the slow parts found with it, follow errors of what was recovered.

    Parameters
    ----------
    size : int
        Number of coefficients, k.
    sources : tuple of Recovered
    slopes : tuple of ndarray of complex, each of shape (k + u, h, 2)
        δ(c, u) = Re Σ slopes·(δθ, δM) over the harmonics of each joint in each run.
    angle_error : ndarray, shape (runs,)
        RMS of the error of the angle: of the slow part by the covariance, of the rest as the sensors have it; rad.
    weights : ndarray, shape (runs,)
        What a row of each run counts.
    excess : float
        Mean square of what is left of the rows, of what noise makes of it.
    others : ndarray, shape (m,)
        Coefficients that other terms would have beside the law, in their standard errors.
    excess_with : ndarray, shape (m,)
        The excess with each of these.
    hidden : ndarray, shape (m,)
        Share of the moment, beside the law, that a standard error of each of these is.
    shifts : ndarray, shape (k, m)
        By what the coefficients are off where each of these is there, of the size that it would have.
    likely : ndarray of bool, shape (m,)
        Which of these may be there though nothing shows it.
    """

    size: int
    sources: tuple[Recovered, ...]
    slopes: tuple[Complex, ...]
    angle_error: Array
    weights: Array
    excess: float
    others: Array
    excess_with: Array
    hidden: Array
    shifts: Array
    likely: Booleans

    @property
    def of_noise(self) -> Array:
        """Covariance of the coefficients, shape (k, k), larger by what is left of the rows beyond the noise.

        As far as terms see it. Harmonics beyond the band of the sensors are missing from both sides of the law. What
        they leave in the rows is too quick to pass for any term; an error of the structure is not, and shows in terms
        beside the law.
        """
        return self._of_sensors * max(1.0, min(self.excess, self.lack))

    @cached_property
    def _of_sensors(self) -> Array:
        return _covariance(self.sources, [slope[: self.size] for slope in self.slopes])

    @property
    def covariance(self) -> Array:
        """The same as far as terms see it, however little of the rows that is, with what leaving out likely terms does.

        The last as far as the size of each is not that of its own error.
        """
        beyond_error = 1 - 1 / np.maximum(self.others**2, 1.0)
        shifts = self.shifts * self.likely * np.sqrt(beyond_error)
        return np.asarray(self._of_sensors * max(1.0, self.lack) + shifts @ shifts.T)

    @property
    def lack(self) -> float:
        """Mean square of the coefficients that other terms would have, in their noise; without any that of the rows."""
        if not self.others.size:
            return self.excess
        return float(np.mean(self.others**2 * np.maximum(self.excess_with, 1.0)))

    @property
    def angle_share(self) -> float:
        """RMS error of the angles over all rows of the law, of the angles: a run counts by what it moves the joint."""
        rows = np.array([np.count_nonzero(s.states.moving) for s in self.sources]) * self.weights
        sizes = np.array([np.std(s.states.angle) for s in self.sources])
        return float(np.sqrt(rows @ self.angle_error**2 / (rows @ sizes**2)))

    def change(self, others: Sequence[Recovery]) -> Array:
        """Return by how much the coefficients change where the same runs are recovered otherwise, shape (k,)."""
        total = np.zeros(self.size)
        for source, slope, other in zip(self.sources, self.slopes, others, strict=True):
            difference = (other.values - source.recovery.values)[source.recovery.rows(source.joint)]
            total += np.tensordot(slope[: self.size], difference.T, 2).real
        return total


def _covariance(sources: Sequence[Recovered], slopes: Sequence[Complex]) -> Array:
    """Return the covariance of what follows the amplitudes; joints of one run share its sensors and their errors."""
    k = len(slopes[0])
    total = np.zeros((k, k))
    for recovery in {id(s.recovery): s.recovery for s in sources}.values():
        joints = recovery.transfer.angles.shape[1]
        gathered = np.zeros((k, recovery.values.shape[1], 2 * joints), dtype=complex)
        for source, slope in zip(sources, slopes, strict=True):
            if source.recovery is recovery:
                gathered[:, :, recovery.rows(source.joint)] += slope
        spread = (gathered.swapaxes(0, 1) @ recovery.covariance).swapaxes(0, 1)
        total += np.tensordot(spread, gathered.conj(), ((1, 2), (1, 2))).real
        by_ends = np.tensordot(gathered, recovery.of_ends, ((1, 2), (0, 1))).real
        total += by_ends @ by_ends.T
    return total


def law_excess(rows: LawRows, sources: Sequence[Recovered]) -> float:
    """Return the mean square of what is left of the rows of a law, of what noise makes of it."""
    inverse, left, expected = _inverse(rows), 0.0, 0.0
    starts = np.cumsum([0, *(kept.size for kept in rows.kept)])
    for index, (own, weight) in enumerate(
        zip(map(_RowErrors, sources, rows.kept, rows.slopes), rows.weights, strict=True)
    ):
        # Of what errors of the ends do to the rows, coefficients and slow angles follow the most.
        ends = np.sqrt(weight) * own.of_ends
        shared = rows.columns[starts[index] : starts[index + 1]].T @ ends
        expected += weight * own.expected + float(np.sum(ends**2) - np.sum(shared * (inverse @ shared)))
        left += weight * float(np.sum(rows.residual[index] ** 2))
    return left / expected


def _inverse(rows: LawRows) -> Array:
    """Return (AᵀA)⁻¹ of the rows of a law, with what the sensors say of the slow angles."""
    scale = np.sqrt(np.sum(rows.columns**2, axis=0) + rows.said**2)
    scale[scale == 0] = 1.0
    scaled = rows.columns / scale
    inverse = np.linalg.pinv(
        scaled.T @ scaled + np.diag((rows.said / scale) ** 2), rcond=1e-14, hermitian=True
    )
    return np.asarray(inverse / scale[:, None] / scale)


def law_errors(
    rows: LawRows,
    sources: Sequence[Recovered],
    slow: Sequence[Slow],
    others: Sequence[Array] | None = None,
    likely: Booleans | bool = False,
) -> LawErrors:
    """Return how the coefficients of a law follow errors of the recovered amplitudes.

    Parameters
    ----------
    rows : LawRows
        Of the law.
    sources : sequence of Recovered
        Of its runs, in their order.
    slow : sequence of Slow
        Of each run.
    others : sequence of ndarray, each of shape (n, m), optional
        Columns of terms beyond the law at the rows of each run.
    likely : bool or ndarray of bool, shape (m,)
        Which of these may be there though nothing shows it.
    """
    k = rows.coefficients.size
    others = [np.zeros((kept.size, 0)) for kept in rows.kept] if others is None else others
    beyond = np.vstack([np.sqrt(w) * columns for w, columns in zip(rows.weights, others, strict=True)])
    inverse = _inverse(rows)
    # A further term beside the law (Frisch and Waugh 1933): what of its column the law does not follow.
    followed = inverse @ (rows.columns.T @ beyond)
    apart = beyond - rows.columns @ followed
    unique = np.maximum(np.sum(apart * beyond, axis=0), np.finfo(float).tiny)
    starts = np.cumsum([0, *(kept.size for kept in rows.kept)])
    unknowns = k + np.cumsum([0, *(values.size for values in rows.unknowns)])
    slopes, of_others = [], []
    for index, (errors, weight) in enumerate(
        zip(map(_RowErrors, sources, rows.kept, rows.slopes), rows.weights, strict=True)
    ):
        own = slice(starts[index], starts[index + 1])
        of_rows = np.vstack([inverse @ rows.columns[own].T, (apart[own] / unique).T]) * np.sqrt(weight)
        slope = errors.through(of_rows)
        orders = slow[index].orders - 1
        # First stand cosines and sines of the slow harmonics, as the sensors show them.
        place = unknowns[index] + np.arange(orders.size)
        said = np.vstack([inverse, -(followed / unique).T]) * rows.said**2
        slope[:, orders, 0] += said[:, place] + 1j * said[:, place + orders.size]
        slopes.append(slope[: len(inverse)])
        of_others.append(slope[len(inverse) :])
    covariance = _covariance(sources, slopes)
    angle = []
    for index, (source, part) in enumerate(zip(sources, slow, strict=True)):
        place = slice(unknowns[index], unknowns[index + 1])
        basis = part.basis(source.states, rows.kept[index])[0]
        of_slow = np.mean(np.sum((basis @ covariance[place, place]) * basis, axis=1))
        seen = kept_of(source.recovery, source.joint)
        seen[part.orders - 1] = False
        angle.append(np.sqrt(of_slow + np.sum(source.recovery.standard_error[source.joint, seen] ** 2)))
    weighted = np.concatenate([np.sqrt(w) * r for w, r in zip(rows.weights, rows.residual, strict=True)])
    would_be = beyond.T @ weighted / unique
    excess = law_excess(rows, sources)
    would_leave = excess * (1 - would_be**2 * unique / (weighted @ weighted))
    spread = np.sqrt(np.diag(_covariance(sources, of_others)) * np.maximum(would_leave, 1.0))
    ratios = np.divide(would_be, spread, out=np.zeros_like(spread), where=spread > 0)
    moment = np.concatenate(
        [
            np.sqrt(w) * source.states.moment[kept]
            for w, source, kept in zip(rows.weights, sources, rows.kept, strict=True)
        ]
    )
    law = np.linalg.qr(rows.columns[:, :k])[0]
    alone = np.linalg.norm(beyond - law @ (law.T @ beyond), axis=0)
    return LawErrors(
        k, tuple(sources), tuple(slopes), np.array(angle), rows.weights, excess, ratios, would_leave,
        spread * alone / np.linalg.norm(moment), followed[:k] * would_be,
        np.broadcast_to(likely, ratios.shape),
    )  # fmt: skip


@dataclass(frozen=True, eq=False)
class _RowErrors:
    """Errors of rows by those of angle and moment at each harmonic: (−∂M/∂θ − iω·∂M/∂θ̇)·δθ + δM, times exp(iωt)."""

    source: Recovered
    rows: Integers
    slopes: tuple[Array, Array]

    @cached_property
    def kept(self) -> Integers:
        """The harmonics that are used."""
        return np.flatnonzero(kept_of(self.source.recovery, self.source.joint))

    @cached_property
    def rated(self) -> Complex:
        """Of these iω."""
        return np.asarray(1j * self.source.recovery.spectra.angular[self.kept], dtype=np.complex128)

    @cached_property
    def seen(self) -> Array:
        """One where the angle is that of the sensors, zero where the law tells it."""
        return np.where(slow_orders(self.source.recovery, self.source.joint)[self.kept], 0.0, 1.0)

    @cached_property
    def _spin(self) -> Complex:
        """exp(iωt) of a run that repeats, shape (n, harmonics); a record has those of its Fourier transform."""
        time = self.source.states.time
        return np.exp(np.outer((time - time[0])[self.rows], self.rated))

    def _analysed(self, of_rows: Array) -> Complex:
        """Return Σ a·exp(iωt) over the rows, shapes (k, n) to (k, harmonics)."""
        if self.source.recovery.spectra.repeats:
            return np.asarray(of_rows @ self._spin, dtype=np.complex128)
        spread = np.zeros((len(of_rows), self.source.states.n_samples))
        spread[:, self.rows] = of_rows
        return np.asarray(np.fft.rfft(spread)[:, self.kept + 1].conj())

    def _series(self, amplitudes: Complex) -> Array:
        """Return Re Σ a·exp(iωt) at the rows, shapes (harmonics, k) to (n, k)."""
        if self.source.recovery.spectra.repeats:
            return np.asarray((self._spin @ amplitudes).real)
        whole = np.zeros((self.source.recovery.spectra.angular.size, amplitudes.shape[1]), dtype=complex)
        whole[self.kept] = amplitudes
        return record_series(whole, self.source.states.n_samples)[self.rows]

    def through(self, of_rows: Array) -> Complex:
        """Return what errors of the amplitudes make of anything linear in the rows, shapes (k, n) to (k, h, 2)."""
        stiff, damped = (self._analysed(of_rows * slope) for slope in self.slopes)
        passed = np.zeros((len(of_rows), self.source.recovery.spectra.angular.size, 2), dtype=complex)
        passed[:, self.kept, 0] = -self.seen * (stiff + self.rated * damped)
        passed[:, self.kept, 1] = self._analysed(of_rows)
        return passed

    @property
    def expected(self) -> float:
        """The sum of squares of the rows that the noise makes; the moment is that of single blocks."""
        pair = self.source.recovery.rows(self.source.joint)
        covariance = self.source.recovery.covariance[self.kept][:, pair][:, :, pair]
        stiff, damped = self.slopes
        of_angle = self.seen * (stiff @ stiff + np.abs(self.rated) ** 2 * (damped @ damped))
        both = -self.seen * (stiff.sum() + self.rated * damped.sum())
        of_moment = stiff.size * len(self.source.recovery.spectra.blocks)
        parts = of_angle * covariance[:, 0, 0] + of_moment * covariance[:, 1, 1]
        return float(np.sum(parts + 2 * both * covariance[:, 0, 1]).real)

    @property
    def of_ends(self) -> Array:
        """What errors of the ends of a record do to the rows, shape (n, errors)."""
        added = self.source.recovery.of_ends[:, self.source.recovery.rows(self.source.joint)][self.kept]
        of_angle = self.seen[:, None] * added[:, 0]
        parts = self._series(np.hstack([of_angle, self.rated[:, None] * of_angle, added[:, 1]]))
        angle, rate, moment = np.hsplit(parts, 3)
        stiff, damped = (slope[:, None] for slope in self.slopes)
        return np.asarray(moment - stiff * angle - damped * rate)
