"""Force states of a run that does not repeat: one smoothing kernel and its own derivatives."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from sindyjoint.errors import InputError
from sindyjoint.record import Run
from sindyjoint.states.mask import RATE_SHARE, moving_mask, rate_limit
from sindyjoint.states.record import ForceStates, NoiseFloor

Array = NDArray[np.float64]

BLOCKS = 32
# Passband edge of the widest kernel as a share of the sampling rate; its stopband begins at half of it.
WIDEST = 0.38
KAISER_BETA = 6.0  # about −63 dB in the stopband
SIGNAL_TO_NOISE = 2.0


def smoothing_kernels(cutoff: float, sample_rate: float) -> tuple[Array, Array, Array]:
    """Return a low-pass kernel and its first and second time derivatives, sampled.

    The kernel is sin(2π·f_c·t)/(π·t) under a Kaiser window. Convolving with its derivative gives exactly the
    derivative of the smoothed signal, with no phase and no finite-difference error within the passband.

    Parameters
    ----------
    cutoff : float
        Edge of the passband (−6 dB), Hz.
    sample_rate : float
        Hz.

    Returns
    -------
    tuple of three ndarray, shape (2h + 1,)
        Units 1, 1/s and 1/s².
    """
    transition = min(0.5 * cutoff, 0.98 * (0.5 * sample_rate - cutoff))
    half = int(np.ceil(2.0 * sample_rate / transition))
    offset = np.arange(-half, half + 1)
    # The sampled low-pass kernel defines the smoothed signal; differentiating its own finite Fourier series
    # differentiates that signal.
    low = 2 * cutoff / sample_rate * np.sinc(2 * cutoff * offset / sample_rate) * np.kaiser(2 * half + 1, KAISER_BETA)
    low /= low.sum()
    padded = 16 * offset.size
    frequency = 2 * np.pi * np.fft.rfftfreq(padded, 1 / sample_rate)
    response = np.fft.rfft(np.roll(np.pad(low, (0, padded - low.size)), -half)).real
    first = np.roll(np.fft.irfft(1j * frequency * response, padded), half)[: 2 * half + 1]
    second = np.roll(np.fft.irfft(-(frequency**2) * response, padded), half)[: 2 * half + 1]
    return low, _exact_on_polynomials(first, offset / sample_rate, 1), _exact_on_polynomials(
        second, offset / sample_rate, 2
    )


def _exact_on_polynomials(kernel: Array, offset: Array, order: int) -> Array:
    """Return the kernel with the moments that make it exact on cubics: cutting the tails disturbs them."""
    scale = np.abs(offset).max()
    powers = np.vander(-offset / scale, 4, increasing=True).T
    wanted = np.zeros(4)
    wanted[order] = (1.0 if order == 1 else 2.0) / scale**order
    taper = np.kaiser(offset.size, KAISER_BETA)
    gram = (powers * taper) @ powers.T
    return kernel + taper * (powers.T @ np.linalg.solve(gram, wanted - powers @ kernel))


def signal_bandwidth(signal: Array, sample_rate: float) -> tuple[float, float]:
    """Return the frequency at which a signal sinks into its white noise floor, and the RMS of that noise.

    The floor is the median spectral density over the top third of the band; the signal ends where its smoothed
    density stays below twice the floor. Beyond that frequency every derivative holds more noise than signal.

    Returns
    -------
    bandwidth : float
        Hz, at most 0.38 of the sampling rate.
    noise : float
        RMS of the white noise over the whole band, in the unit of the signal.
    """
    from scipy.signal import welch

    segment = int(min(signal.size, max(256, signal.size // 8)))
    frequency, density = welch(signal, sample_rate, window="blackmanharris", nperseg=segment, detrend="linear")
    floor = float(np.median(density[2 * density.size // 3 :]))
    window = max(3, density.size // 100) | 1
    smooth = np.convolve(density, np.ones(window) / window, mode="same")
    above = np.flatnonzero(smooth > (1 + SIGNAL_TO_NOISE) * floor)
    edge = float(frequency[above[-1]]) if above.size else float(frequency[1])
    return float(np.clip(edge, 8 * sample_rate / signal.size, WIDEST * sample_rate)), float(
        np.sqrt(floor * sample_rate / 2)
    )


def difference_noise(signal: Array) -> float:
    """Return the RMS of the white noise of a smooth signal with steps.

    Second differences of white noise have variance 6σ²; their median absolute value ignores steps and turning
    points (1.4826·MAD is σ for Gaussian noise).
    """
    second = signal[2:] - 2 * signal[1:-1] + signal[:-2]
    return float(1.4826 * np.median(np.abs(second - np.median(second))) / np.sqrt(6.0))


def broadband_states(run: Run, bandwidth: float | None = None, rate_share: float = RATE_SHARE) -> ForceStates:
    """Return the force states of a run that does not repeat.

    Angle, rate and acceleration are convolutions of the measured angle (or, for the last two, of the measured
    rate) with one zero-phase kernel and its derivatives; the ends that the kernel does not cover are dropped.

    Parameters
    ----------
    run : Run
    bandwidth : float, optional
        Cut-off of the kernel, Hz. Default: where the angle sinks into its noise.
    rate_share : float
        Share of the peak rate below which samples count as reversal.

    Raises
    ------
    InputError
        If the record is too short for the kernel.
    """
    from scipy.signal import fftconvolve

    found, angle_noise = signal_bandwidth(run.angle, run.sample_rate)
    cutoff = float(np.clip(bandwidth or found, 1e-6, WIDEST * run.sample_rate))
    low, first, second = smoothing_kernels(cutoff, run.sample_rate)
    half = low.size // 2
    if run.n_samples < 4 * low.size:
        cutoff = min(WIDEST * run.sample_rate, 40 * run.sample_rate / run.n_samples)
        low, first, second = smoothing_kernels(cutoff, run.sample_rate)
        half = low.size // 2
        if run.n_samples < 3 * low.size:
            raise InputError(
                f"run {run.name!r}: {run.n_samples} samples are too few to differentiate; at least "
                f"{3 * low.size} are wanted"
            )
    middle = slice(half, run.n_samples - half)
    angle = fftconvolve(run.angle - run.angle[0], low, mode="valid") + run.angle[0]
    if run.rate is None:
        # Centred first: a large offset times the kernel's rounding would show in the second derivative.
        rate = fftconvolve(run.angle - np.mean(run.angle), first, mode="valid")
        acceleration = fftconvolve(run.angle - np.mean(run.angle), second, mode="valid")
        rate_noise, acceleration_noise = (angle_noise * float(np.linalg.norm(k)) for k in (first, second))
    else:
        rate = fftconvolve(run.rate, low, mode="valid")
        acceleration = fftconvolve(run.rate, first, mode="valid")
        measured = signal_bandwidth(run.rate, run.sample_rate)[1]
        rate_noise, acceleration_noise = (measured * float(np.linalg.norm(k)) for k in (low, first))
    guard = max(2, int(np.ceil(0.5 * run.sample_rate / cutoff)))
    moving = moving_mask(rate, rate_limit(rate, rate_noise, rate_share), guard)
    return ForceStates(
        run=run.name,
        frequency=run.frequency,
        level=run.level,
        sample_rate=run.sample_rate,
        time=run.time[middle],
        angle=angle,
        rate=rate,
        acceleration=acceleration,
        moment=run.moment[middle],
        moving=moving,
        block=np.minimum(np.arange(angle.size) * BLOCKS // angle.size, BLOCKS - 1),
        replicate=None,
        noise=NoiseFloor(difference_noise(run.moment), angle_noise, rate_noise, acceleration_noise),
        method="broadband",
        bandwidth=cutoff,
        dropped=half / run.sample_rate,
    )
