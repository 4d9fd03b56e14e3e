"""Amplitude and period of a vibration, cycle by cycle, and how two vibrations differ in them."""

from dataclasses import dataclass
from typing import ClassVar

import numpy as np
import scipy
from numpy.typing import ArrayLike

from sindyjoint.described import same
from sindyjoint.limits import RESPONSE
from sindyjoint.numeric import Array, Integers, analytic, convolve, main_frequency, noise_by_differences

# Span of the local cubic that finds turning points, in periods: noise averages out, a turning point stays.
CUBIC_SPAN = 0.35


@dataclass(frozen=True, eq=False)
class Oscillation:
    """Turning points of a vibration.

    Parameters
    ----------
    time, value : ndarray, shape (n,)
        Maxima and minima in turn, s and the signal's unit.
    first : int
        +1 if the first one is a maximum, −1 if it is a minimum.
    """

    WRITTEN: ClassVar = {"time": "amplitude_time", **same("amplitude", "period")}
    time: Array
    value: Array
    first: int

    @property
    def amplitude(self) -> Array:
        """Amplitude of each half-cycle between turning points, shape (n − 1,); a drifting mean drops out."""
        return np.abs(np.diff(self.value)) / 2

    @property
    def amplitude_time(self) -> Array:
        """Middle of each half-cycle, s, shape (n − 1,)."""
        return (self.time[1:] + self.time[:-1]) / 2

    @property
    def period(self) -> Array:
        """From each maximum to the next and each minimum to the next, s, shape (n − 2,)."""
        return self.time[2:] - self.time[:-2]


def oscillation(signal: ArrayLike, sample_rate: float, frequency: float | None = None) -> Oscillation | None:
    """Find the turning points of a vibration.

    A cubic is fitted around every sample (Savitzky & Golay, Analytical Chemistry 36(8), 1964); its extremes that
    exceed the noise are refined by a parabola.

    Parameters
    ----------
    signal : array_like, shape (n,)
    sample_rate : float
        Hz.
    frequency : float, optional
        Hz; the strongest line of the signal if not given.

    Returns
    -------
    Oscillation or None
        ``None`` for a signal with fewer than four turning points.

    Examples
    --------
    >>> t = np.arange(4000) / 1000
    >>> found = oscillation(np.exp(-0.2 * t) * np.sin(2 * np.pi * 4 * t), 1000)
    >>> round(float(np.mean(found.period)), 4)
    0.25
    """
    values = np.asarray(signal, dtype=np.float64)
    if values.size < 16 or np.ptp(values) == 0:
        return None
    frequency = main_frequency(values, sample_rate) if frequency is None else frequency
    width = max(5, int(CUBIC_SPAN * sample_rate / frequency) | 1)
    if width >= values.size:
        return None
    smooth = _local_cubic(values, width)
    # A cubic over w points keeps 9/(4w) of the noise's variance (its value in the middle).
    least = max(
        RESPONSE.stands_out * noise_by_differences(values, 4) * np.sqrt(2.25 / width),
        RESPONSE.accuracy * float(np.ptp(smooth)),
    )
    maxima, minima = _prominent(smooth, least), _prominent(-smooth, least)
    indices = np.concatenate([maxima, minima])
    signs = np.concatenate([np.ones(maxima.size), -np.ones(minima.size)])
    order = np.argsort(indices, kind="stable")
    indices, signs = _keep_alternating(indices[order], signs[order], smooth)
    if indices.size < 4:
        return None
    left, middle, right = smooth[indices - 1], smooth[indices], smooth[indices + 1]
    bend = left - 2 * middle + right
    shift = np.where(bend != 0, 0.5 * (left - right) / np.where(bend != 0, bend, 1.0), 0.0)
    return Oscillation((indices + shift) / sample_rate, middle - 0.25 * (left - right) * shift, int(signs[0]))


def _local_cubic(signal: Array, width: int) -> Array:
    """Return a signal smoothed by cubics over ``width`` samples, an odd number; the outermost ones hold to the ends."""
    half = width // 2
    basis = np.linalg.qr(np.vander(np.linspace(-1.0, 1.0, width), 4))[0]
    head, tail = (basis @ (basis.T @ part) for part in (signal[:width], signal[-width:]))
    middle = convolve(signal, basis @ basis[half])
    return np.concatenate([head[:half], middle, tail[half + 1 :]])


def _prominent(signal: Array, least: float) -> Integers:
    """Return the maxima that stand ``least`` above the higher one of the valleys beside them.

    A valley ends where the signal is higher than the maximum. That of a plateau is its middle.
    """
    begins = np.concatenate([[0], np.flatnonzero(np.diff(signal)) + 1])
    level = signal[begins]
    rises = np.diff(level) > 0
    tops = np.flatnonzero(rises[:-1] & ~rises[1:]) + 1
    valleys = np.minimum.reduceat(level, np.concatenate([[0], tops])) if tops.size else level[:0]
    bases = np.maximum(
        _valley_before(level[tops], valleys), _valley_before(level[tops][::-1], valleys[::-1])[::-1]
    )
    ends = np.append(begins, signal.size)
    found = tops[level[tops] - bases >= least]
    return (begins[found] + ends[found + 1] - 1) // 2


def _valley_before(heights: Array, valleys: Array) -> Array:
    """Return the lowest signal between each maximum and the last higher one, of the valley before each maximum."""
    bases = np.empty(heights.size)
    open_ones: list[tuple[float, float]] = []
    for place, (height, base) in enumerate(zip(heights.tolist(), valleys.tolist(), strict=False)):
        while open_ones and open_ones[-1][0] <= height:
            base = min(base, open_ones.pop()[1])
        open_ones.append((height, base))
        bases[place] = base
    return bases


def _keep_alternating(indices: Integers, signs: Array, smooth: Array) -> tuple[Integers, Array]:
    """Return turning points of alternating sign: of several maxima (minima) in a row the highest (lowest)."""
    groups = np.split(np.arange(indices.size), np.flatnonzero(np.diff(signs)) + 1)
    kept = [g[np.argmax(signs[g] * smooth[indices[g]])] for g in groups if g.size]
    return indices[kept], signs[kept]


def hilbert_envelope(signal: ArrayLike, sample_rate: float) -> tuple[Array, Array]:
    """Return envelope and instantaneous frequency by Hilbert's transform, each of shape (n,).

    Noise (by the local cubic of :func:`oscillation`) and the slow part (mean over one period) are taken away first;
    the frequency, Hz, is the phase's mean slope over a period. A period at either end is an extrapolation.
    """
    values = np.asarray(signal, dtype=np.float64)
    period = max(3, round(sample_rate / main_frequency(values, sample_rate)))
    width = max(5, int(CUBIC_SPAN * period) | 1)
    if width < values.size:
        values = _local_cubic(values, width)
    vibration = values - scipy.ndimage.uniform_filter1d(values, period, mode="nearest")
    # Odd continuation at both ends: the transform of a record that breaks off has large end errors.
    n = min(2 * period, values.size - 1)
    padded = np.concatenate([-vibration[n:0:-1], vibration, -vibration[-2 : -n - 2 : -1]])
    turned = analytic(padded)[n : n + values.size]
    phase = np.unwrap(np.angle(turned))
    frequency = scipy.ndimage.uniform_filter1d(
        np.gradient(phase) * sample_rate / (2 * np.pi), period, mode="nearest"
    )
    envelope = scipy.ndimage.uniform_filter1d(np.abs(turned), max(3, period // 2), mode="nearest")
    return envelope, frequency


@dataclass(frozen=True)
class OscillationGap:
    """The paper's two figures for two vibrations.

    Parameters
    ----------
    amplitude_rms_error : float
        RMS of the difference of amplitudes, by half-cycle, relative to the first measured amplitude.
    mean_period_difference : float
        Mean of the absolute difference of periods, s.
    half_cycles : int
        Number compared.
    """

    amplitude_rms_error: float
    mean_period_difference: float
    half_cycles: int


def compare_oscillations(
    measured: Oscillation | None, simulated: Oscillation | None
) -> OscillationGap | None:
    """Compare two vibrations that were excited at the same time, half-cycle by half-cycle.

    Returns
    -------
    OscillationGap or None
        ``None`` where one of them does not vibrate.
    """
    if measured is None or simulated is None:
        return None
    a, b = _align_starts(measured, simulated)
    n = min(a.time.size, b.time.size)
    if n < 4:
        return None
    # A vibration that falls below the noise long before the other has no amplitude from there on; one that only
    # has fewer half-cycles in the same time is compared by half-cycle.
    sunk = abs(float(a.time[-1] - b.time[-1])) > RESPONSE.sunk_periods * float(np.median(a.period))
    count = max(a.amplitude.size, b.amplitude.size) if sunk else n - 1
    amplitudes = np.zeros((2, count))
    for row, found in zip(amplitudes, (a.amplitude[:count], b.amplitude[:count]), strict=True):
        row[: found.size] = found
    error = float(np.sqrt(np.mean((amplitudes[0] - amplitudes[1]) ** 2)))
    periods = np.abs(a.period[: n - 2] - b.period[: n - 2])
    return OscillationGap(error / float(a.amplitude[0]), float(np.mean(periods)), n - 1)


def _align_starts(a: Oscillation, b: Oscillation) -> tuple[Oscillation, Oscillation]:
    """Drop first turning points until both begin with the same kind at nearly the same time."""
    half = float(np.median(a.period)) / 2
    while a.time.size > 4 and a.time[0] < b.time[0] - half / 2:
        a = Oscillation(a.time[1:], a.value[1:], -a.first)
    while b.time.size > 4 and b.time[0] < a.time[0] - half / 2:
        b = Oscillation(b.time[1:], b.value[1:], -b.first)
    if a.first != b.first:
        b = Oscillation(b.time[1:], b.value[1:], -b.first)
    return a, b
