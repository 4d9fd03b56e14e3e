"""Fourier series of the channels of a run: of its period, or of the whole record where it does not repeat.

The noise is measured: from what does not repeat, or from what is left where the channel has ended.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
import scipy
from numpy.typing import NDArray

from sindyjoint.errors import InputError
from sindyjoint.measurement.noise import signal_end
from sindyjoint.mechanics.rig_test import RigRun
from sindyjoint.numeric import Array
from sindyjoint.states.harmonics import (
    FIRST_ORDERS,
    HarmonicBasis,
    local_noise,
    refine_frequency,
    steady_start,
)
from sindyjoint.states.periodic import cut_blocks
from sindyjoint.states.policy import POLICY
from sindyjoint.substructure.policy import POLICY as LIMITS

Complex = NDArray[np.complex128]

# Most harmonics of a run: a multisine of a hundred lines has them, and what they hold beyond is noise.
MOST_HARMONICS = 400
# Lines of noise, at least, from which that of a harmonic is estimated: of nine, weights that follow their scatter make
# standard errors a tenth too small.
NOISE_LINES = 50


@dataclass(frozen=True, eq=False)
class Spectra:
    """The channels of a run as Fourier series: x(t) = mean + Re Σ amplitude·exp(2πi·order·frequency·t).

    Parameters
    ----------
    frequency : float
        Hz.
    first : int
        First sample of the steady periods; time counts from it.
    edges : ndarray of int, shape (blocks + 1,)
        Samples, counted from there, at which blocks of whole periods begin and end.
    mean : ndarray, shape (channels,)
    amplitudes : ndarray, shape (channels, h)
        Of the orders 1 to h.
    blocks : ndarray, shape (blocks, channels, h)
        The same from each block.
    variance : ndarray, shape (channels, h)
        Of the real and of the imaginary part of an amplitude.
    repeats : bool
        Whether the run does; else the series is that of the whole record.
    """

    frequency: float
    first: int
    edges: NDArray[np.intp]
    mean: Array
    amplitudes: Complex
    blocks: Complex
    variance: Array
    repeats: bool = True

    @property
    def angular(self) -> Array:
        """Angular frequencies of the harmonics, rad/s, shape (h,)."""
        return 2 * np.pi * self.frequency * np.arange(1, self.amplitudes.shape[1] + 1)


def channel_spectra(run: RigRun, declared: Array | None = None, bandwidth: float | None = None) -> Spectra:
    """Return the Fourier series of all channels of a run: its drive, then its sensors.

    Parameters
    ----------
    run : RigRun
    declared : ndarray, shape (1 + sensors,), optional
        Standard deviation of single samples of each channel as declared, NaN where it was not: a floor of what is
        measured.
    bandwidth : float, optional
        Highest frequency, Hz. Default: 0.37 of the sampling rate.

    Raises
    ------
    InputError
        If fewer than three periods are steady.
    """
    if run.frequency is None:
        return _record_spectra(run, declared, bandwidth)
    signals = run.signals
    main = signals[np.argmax(signals.std(axis=1) / (np.abs(signals).max(axis=1) + 1e-300))]
    orders = _strongest_orders(run)
    frequency = refine_frequency(main, run.sample_rate, run.frequency, orders[0])
    per = run.sample_rate / frequency
    first = max(int(round(steady_start(s, run.sample_rate, frequency, orders) * per)) for s in signals[1:])
    periods = int(np.floor((run.drive.size - first) / per + 1e-3))
    if periods < POLICY.fewest:
        raise InputError(
            f"run {run.name!r}: {periods} steady period(s) of {frequency:g} Hz; expected {POLICY.fewest} or "
            "more: record longer, or begin later"
        )
    stop = min(first + int(round(periods * per)), run.drive.size)
    edges = cut_blocks(periods, per, stop - first)
    time = np.arange(stop - first) / run.sample_rate
    top = (
        LIMITS.band * run.sample_rate if bandwidth is None else min(bandwidth, LIMITS.band * run.sample_rate)
    )
    count = int(np.clip(top / frequency, 1, min(MOST_HARMONICS, 3 * (int(np.diff(edges).min()) - 8) // 8)))
    basis = HarmonicBasis.build(time, frequency, np.arange(1, count + 1))
    # Between harmonics lie as many lines of noise as there are periods, less one.
    neighbours = int(np.ceil(NOISE_LINES / max(1, periods - 1)))
    steady, variance = signals[:, first:stop], []
    means, cosine, sine = basis.fit_all(steady)
    for number, signal in enumerate(steady):
        residual = signal - basis.series(means[number], cosine[number], sine[number])
        noise = local_noise(residual, run.sample_rate, basis.angular / (2 * np.pi), 0.5 * frequency)
        noise = scipy.ndimage.uniform_filter1d(noise, neighbours, mode="nearest")
        if declared is not None and np.isfinite(declared[number]):
            noise = np.maximum(noise, declared[number] ** 2)
        # Of exact data rounding is all that is left.
        least = np.finfo(float).eps * float(np.abs(signal).max(initial=1e-300))
        variance.append(2 * np.maximum(noise, least**2) / time.size)
    parts = []
    for low, high in zip(edges[:-1], edges[1:], strict=True):
        _, a, b = basis.rows(slice(low, high)).fit_all(steady[:, low:high])
        parts.append(a - 1j * b)
    return Spectra(
        frequency, first, edges, means, cosine - 1j * sine, np.array(parts), np.array(variance)
    )  # fmt: skip


def _strongest_orders(run: RigRun) -> Sequence[int]:
    """Return three harmonics of the declared frequency: the first ones, or where the drive lacks these its strongest.

    A multisine of a band has no line at the frequency at which it repeats.
    """
    assert run.frequency is not None
    per = run.sample_rate / run.frequency
    periods = int(run.drive.size / per)
    size = (
        np.abs(np.fft.rfft(run.drive[: round(periods * per)]))[periods::periods] if periods else np.zeros(0)
    )
    if size.size < len(FIRST_ORDERS) or np.argmax(size) == 0:
        return FIRST_ORDERS
    return [int(order) + 1 for order in np.argsort(-size)[: len(FIRST_ORDERS)]]


def _record_spectra(run: RigRun, declared: Array | None, bandwidth: float | None) -> Spectra:
    """Return the Fourier series of a whole record, with its length as the period.

    By the trapezoidal rule, half of each end. Noise is white, as it was declared or of the density above which the
    channel has ended.
    """
    signals, n = run.signals, run.drive.size - 1
    frequency = run.sample_rate / n
    top = (
        LIMITS.band * run.sample_rate if bandwidth is None else min(bandwidth, LIMITS.band * run.sample_rate)
    )
    count = max(1, int(top / frequency))
    jump = signals[:, -1:] - signals[:, :1]
    amplitudes = 2 / n * (np.fft.rfft(signals[:, :-1])[:, 1 : count + 1] + jump / 2)
    variance = []
    for number, signal in enumerate(signals):
        noise = signal_end(signal, run.sample_rate).noise
        if declared is not None and np.isfinite(declared[number]):
            noise = float(declared[number])
        least = np.finfo(float).eps * float(np.abs(signal).max(initial=1e-300))
        variance.append(np.full(count, 2 * max(noise, least) ** 2 / n))
    return Spectra(
        frequency, 0, np.array([0, n]), signals.mean(axis=1), amplitudes, amplitudes[None], np.array(variance), False
    )  # fmt: skip


def strongest(spectra: Spectra, count: int) -> tuple[Spectra, Array]:
    """Return the harmonics of a run that stand furthest out of the noise, and their angular frequencies."""
    power = np.sum(np.abs(spectra.amplitudes[1:]) ** 2 / spectra.variance[1:], axis=0)
    rows = np.sort(np.argsort(power)[-count:])
    kept = replace(spectra, amplitudes=spectra.amplitudes[:, rows], variance=spectra.variance[:, rows])
    return kept, spectra.angular[rows]
