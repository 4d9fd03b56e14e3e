"""Fourier series of a known fundamental, fitted to whole periods and differentiated exactly."""

from __future__ import annotations

from collections import deque
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from sindyjoint.limits import STATES
from sindyjoint.numeric import BLOCK, Array, Booleans, Complex, Integers, chunks

FIRST_ORDERS = (1, 2, 3)


@dataclass(frozen=True, eq=False)
class HarmonicBasis:
    """Cosine and sine columns of selected harmonics at given instants.

    Parameters
    ----------
    cosine, sine : ndarray, shape (n, h)
    angular : ndarray, shape (h,)
        Angular frequencies of the harmonics, rad/s.
    complete : bool
        Whether these are all harmonics from the first to the last.
    """

    cosine: Array
    sine: Array
    angular: Array
    complete: bool = False

    @classmethod
    def build(cls, time: Array, frequency: float, orders: Integers) -> HarmonicBasis:
        """Return the basis of the given harmonic orders of ``frequency`` (Hz) at ``time`` (s).

        Runs of one frequency and length follow one another, and have one basis.
        """
        angular = np.asarray(2 * np.pi * frequency * orders, dtype=np.float64)
        if not np.array_equal(orders, np.arange(1, len(orders) + 1)):
            cosine, sine = _compute_multiples(2 * np.pi * frequency * time, orders[-1])
            return cls(cosine[orders - 1].T, sine[orders - 1].T, angular)
        for instants, made in LATEST:
            if np.array_equal(made.angular, angular) and np.array_equal(instants, time):
                return made
        cosine, sine = _compute_multiples(angular[0] * time, len(orders))
        made = cls(cosine.T, sine.T, angular, complete=True)
        if cosine.size <= 1_250_000:
            LATEST.append((time, made))
        return made

    def take(self, keep: Booleans) -> HarmonicBasis:
        """Return the basis of the harmonics marked in ``keep``."""
        return HarmonicBasis(self.cosine.T[keep].T, self.sine.T[keep].T, self.angular[keep])

    def rows(self, rows: slice) -> HarmonicBasis:
        """Return the basis at some of the instants."""
        return HarmonicBasis(self.cosine[rows], self.sine[rows], self.angular, self.complete)

    def fit(self, signal: Array) -> tuple[float, Array, Array]:
        """Return mean, cosine and sine coefficients of the least-squares series of ``signal``."""
        means, a, b = self.fit_all(signal[None])
        return float(means[0]), a[0], b[0]

    def fit_all(self, signals: Array) -> tuple[Array, Array, Array]:
        """Return the same of several signals, shape (m, n), at once: shapes (m,), (m, h), (m, h)."""
        if self.complete:
            gram = self._complete_gram
        else:
            design = np.vstack([np.ones((1, signals.shape[1])), self.cosine.T, self.sine.T])
            gram = design @ design.T
        rows = signals.T
        moments = np.vstack([signals.sum(axis=1), self.cosine.T @ rows, self.sine.T @ rows])
        coefficients = np.linalg.solve(gram, moments)
        h = self.angular.size
        return coefficients[0], coefficients[1 : h + 1].T, coefficients[h + 1 :].T

    @cached_property
    def _complete_gram(self) -> Array:
        """Return the products of all columns from the sums of harmonics up to twice the highest.

        cos k·cos l = ½[cos(k − l) + cos(k + l)] and so on: of h² products only the 2h sums need the samples.
        """
        cosine, sine, h = self.cosine.T, self.sine.T, self.angular.size
        top_cosine, top_sine = cosine[-1], sine[-1]
        ones = np.ones(cosine.shape[1])
        even = np.concatenate([[ones.size], cosine @ ones, cosine @ top_cosine - sine @ top_sine])
        odd = np.concatenate([[0.0], sine @ ones, sine @ top_cosine + cosine @ top_sine])
        order = np.arange(1, h + 1)
        less, more = order[:, None] - order, order[:, None] + order
        # The sum of sin(k − l) changes its sign with it.
        odd_less = np.sign(less) * odd[np.abs(less)]
        gram = np.empty((2 * h + 1, 2 * h + 1))
        gram[0] = gram[:, 0] = np.concatenate([even[: h + 1], odd[1 : h + 1]])
        gram[1 : h + 1, 1 : h + 1] = 0.5 * (even[np.abs(less)] + even[more])
        gram[h + 1 :, h + 1 :] = 0.5 * (even[np.abs(less)] - even[more])
        gram[h + 1 :, 1 : h + 1] = 0.5 * (odd[more] + odd_less)
        gram[1 : h + 1, h + 1 :] = gram[h + 1 :, 1 : h + 1].T
        return gram

    def series(self, mean: float, a: Array, b: Array) -> Array:
        """Return mean + Σ a·cos + b·sin at the instants of the basis."""
        return mean + self.cosine @ a + self.sine @ b

    def motion(self, mean: float, a: Array, b: Array) -> Array:
        """Return the series and its first two time derivatives, which are exact, shape (3, n)."""
        c, s, w = self.cosine, self.sine, self.angular
        first = c @ (b * w) - s @ (a * w)
        return np.array([self.series(mean, a, b), first, -(c @ (a * w**2)) - s @ (b * w**2)])


def fitted_motion(
    bases: Sequence[HarmonicBasis], signals: Sequence[Array], rows: slice = slice(None)
) -> Array:
    """Return angle, rate and acceleration of the harmonics of an angle, or of an angle and a rate, shape (3, n).

    They are fitted at the ``rows`` at which they are given.
    """
    cut = [basis.rows(rows) for basis in bases]
    angle, *rate = (
        basis.motion(*basis.fit(signal[rows])) for basis, signal in zip(cut, signals, strict=False)
    )
    return np.array([angle[0], *rate[0][:2]]) if rate else angle


def record_series(amplitudes: Complex, n: int) -> Array:
    """Return n samples of Σ Re a·exp(2πi·k·t/T) over a record of length T, k from 1, shapes (h, …) to (n, …)."""
    spectrum = np.zeros((n // 2 + 1, *amplitudes.shape[1:]), dtype=complex)
    spectrum[1 : len(amplitudes) + 1] = amplitudes * n / 2
    return np.fft.irfft(spectrum, n, axis=0)


#: The latest bases with their instants, of at most 1.25 million cosines each: 40 MB in all.
LATEST: deque[tuple[Array, HarmonicBasis]] = deque(maxlen=2)


def _compute_multiples(phase: Array, count: int) -> tuple[Array, Array]:
    """Return cosine and sine of 1 to ``count`` times a phase, each of shape (count, n).

    By the formulas for sums of angles, four products each instead of two series; rounding grows to
    ``count`` times that of one.
    """
    cosine, sine = np.empty((2, count, phase.size))
    # Few samples at a time: all of them stay in the cache.
    for rows in chunks(phase.size, BLOCK):
        c, s = np.cos(phase[rows]), np.sin(phase[rows])
        cosine[0, rows], sine[0, rows] = c, s
        for k in range(1, count):
            np.subtract(cosine[k - 1, rows] * c, sine[k - 1, rows] * s, out=cosine[k, rows])
            np.add(sine[k - 1, rows] * c, cosine[k - 1, rows] * s, out=sine[k, rows])
    return cosine, sine


def local_noise(residual: Array, sample_rate: float, frequencies: Array, width: float) -> Array:
    """Return the noise variance of a residual around each frequency, as of white noise.

    Parameters
    ----------
    residual : ndarray, shape (n,)
    sample_rate : float
        Hz.
    frequencies : ndarray, shape (h,)
        Hz.
    width : float
        Half-width of the neighbourhood, Hz.

    Returns
    -------
    ndarray, shape (h,)
        σ² such that white noise of that variance has the same spectral density there.
    """
    n = residual.size
    power = np.abs(np.fft.rfft(residual)) ** 2 / n
    total = np.concatenate([[0.0], np.cumsum(power)])
    low = np.clip(np.round((frequencies - width) * n / sample_rate).astype(int), 0, power.size - 1)
    high = np.clip(np.round((frequencies + width) * n / sample_rate).astype(int), low + 1, power.size)
    # The fit has removed the component at the harmonic itself: its two degrees of freedom are one bin.
    return (total[high] - total[low]) / np.maximum(high - low - 1, 1)


def significant_harmonics(amplitude: Array, standard_error: Array) -> Booleans:
    """Return which harmonics to keep: significant ones, up to where the spectrum ends in noise.

    Parameters
    ----------
    amplitude, standard_error : ndarray, shape (h,)
        Amplitude of each harmonic and the standard error of one of its two coefficients.
    """
    keep = amplitude > STATES.harmonic_significance * standard_error
    keep[0] = True
    missed = np.convolve(~keep, np.ones(STATES.harmonic_misses))[: keep.size]
    return keep & ~np.logical_or.accumulate(missed == STATES.harmonic_misses)


def refine_frequency(signal: Array, sample_rate: float, frequency: float, order: int = 1) -> float:
    """Return the frequency at which a signal repeats, near ``frequency``, from the drift of a harmonic's phase.

    The record is cut into whole periods; the slope of the unwrapped phase of a harmonic, the fundamental unless it is
    hardly there, is the error of the declared frequency. The declared value is kept unless the data contradict it by
    four standard errors.
    """
    per = sample_rate / frequency
    periods = int(signal.size / per)
    if periods < 4:
        return frequency
    phase = np.unwrap(np.angle(_sum_periods(signal, sample_rate, frequency, [order])[:, 0]))
    centre = np.arange(periods) - (periods - 1) / 2
    slope = centre @ phase / (centre @ centre)
    scatter = np.std(phase - np.mean(phase) - slope * centre, ddof=2) / np.sqrt(centre @ centre)
    if abs(slope) <= STATES.outstanding * scatter:
        return frequency
    return float(frequency * (1 + slope / (2 * np.pi * order)))


def unsteady_periods(
    signal: Array, sample_rate: float, frequency: float, orders: Sequence[int] = FIRST_ORDERS
) -> tuple[int, int]:
    """Return how many whole periods to leave out, before the motion repeats and at the end, as of a drive ramped down.

    A period is steady when some harmonics, the first three unless others are stronger, lie within five scatters of
    their median over the second half of the record (scatter: median distance there, and at least 0.2 % of the first of
    these harmonics).
    """
    per = sample_rate / frequency
    periods = int(signal.size / per)
    if periods < 4:
        return 0, 0
    phasor = _sum_periods(signal, sample_rate, frequency, orders) / per
    late = phasor[periods // 2 :]
    target = np.median(late.real, axis=0) + 1j * np.median(late.imag, axis=0)
    distance = np.sqrt(np.sum(np.abs(phasor - target) ** 2, axis=1))
    scatter = max(float(np.median(distance[periods // 2 :])), STATES.accuracy * float(np.abs(target[0])))
    steady = distance <= STATES.unsteady * scatter
    unsteady = np.flatnonzero(~steady[: periods // 2])
    last = np.flatnonzero(steady[periods // 2 :])
    return int(unsteady[-1]) + 1 if unsteady.size else 0, late.shape[0] - 1 - int(last[-1])


def _sum_periods(signal: Array, sample_rate: float, frequency: float, orders: Sequence[int]) -> Complex:
    """Return the sums of a signal times some harmonics' rotation over each whole period, shape (periods, orders).

    A sample that the end of a period divides counts for both sides by its parts: a period would else have one sample
    more than another. A harmonic's sum over one period is not quite zero then; the mean is removed first, so the
    remainder is the same in every period.
    """
    per = sample_rate / frequency
    ends = np.arange(int(signal.size / per) + 1) * per
    whole = np.minimum(ends.astype(int), signal.size - 1)
    time = np.arange(whole[-1] + 1) / sample_rate
    rotated = (signal - np.mean(signal))[: time.size, None] * np.exp(
        -2j * np.pi * frequency * np.outer(time, orders)
    )
    before = np.cumsum(rotated, axis=0) - rotated
    return np.diff(before[whole] + (ends - whole)[:, None] * rotated[whole], axis=0)
