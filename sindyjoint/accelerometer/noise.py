"""Noise, drift, gain and time of several sensors, from one motion that all of them see."""

from __future__ import annotations

import numpy as np

from sindyjoint.accelerometer.smoother import integrated_twice
from sindyjoint.numeric import Array

# A line of a spectrum this many times above the noise is motion.
LINE = 25.0
# Frequencies, logarithmically spaced, at which the disagreement of two sensors is read.
BANDS = 40


def sensor_noise(angle: Array, path: Array, sample_rate: float) -> tuple[float, float, float]:
    """Return the noise of an accelerometer and a displacement sensor, and the drift of the latter.

    Second differences of θ_m − p hold no motion. Their spectrum is σ_a² + x²σ_θ²/Δt⁴ + x·q²/Δt⁴, x = 2 − 2cos ωΔt. Its
    three parts are fitted, none of them negative, to the medians of the periodogram in bands, which single lines (of a
    gain that is not quite right) do not move.

    Parameters
    ----------
    angle : ndarray, shape (n,)
    path : ndarray, shape (n,)
        The acceleration integrated twice.
    sample_rate : float
        Hz.

    Returns
    -------
    tuple of float
        rad/s², rad, and rad per square root of a sample.
    """
    from scipy.optimize import nnls

    apart = np.diff(angle - path, 2) * sample_rate**2
    window = np.hanning(apart.size)
    power = np.abs(np.fft.rfft((apart - apart.mean()) * window)) ** 2 / np.sum(window**2)
    frequency = np.fft.rfftfreq(apart.size)
    edges = np.unique(np.geomspace(3, power.size, BANDS + 1).astype(int))
    bands = [slice(low, high) for low, high in zip(edges[:-1], edges[1:], strict=True) if high - low >= 3]
    level = np.array([np.median(power[band]) for band in bands]) / np.log(2)
    count = np.array([band.stop - band.start for band in bands])
    middle = np.array([np.mean(frequency[band]) for band in bands])
    chord = (2 - 2 * np.cos(2 * np.pi * middle)) * sample_rate**2
    # The triangle that the acceleration was averaged with.
    parts = np.column_stack([np.sinc(middle) ** 4, chord**2, chord * sample_rate**2])
    model = np.maximum(level, 1e-300)
    for _ in range(20):
        weight = np.sqrt(count) / model
        scale = np.linalg.norm(parts * weight[:, None], axis=0)
        found = nnls(parts * weight[:, None] / scale, level * weight)[0] / scale
        model = np.maximum(parts @ found, 1e-6 * level + 1e-300)
    noise, angle_noise, drift = np.sqrt(found)
    return float(noise), float(angle_noise), float(drift)


def rough_noise(signal: Array) -> float:
    """Return the RMS of the white noise of a channel, at least that: by differences, or where its spectrum ends.

    The median of third differences ignores steps, that of the top third of the band lines.
    """
    third = np.diff(signal, 3)
    power = np.abs(np.fft.rfft((signal - np.mean(signal)) * np.hanning(signal.size))) ** 2
    top = power[2 * power.size // 3 :] / np.sum(np.hanning(signal.size) ** 2)
    return float(min(1.4826 * np.median(np.abs(third)) / np.sqrt(20.0), np.sqrt(np.median(top) / np.log(2))))


def moving_size(
    acceleration: Array, sample_rate: float, noise: float, frequency: float | None = None
) -> float:
    """Return the RMS of the angle by what of an acceleration stands out of its noise, rad.

    Σ |A(f)|²/ω⁴ over such lines, from half the frequency of the excitation on where that is known.
    """
    window = np.hanning(acceleration.size)
    power = np.abs(np.fft.rfft((acceleration - np.mean(acceleration)) * window)) ** 2 / np.sum(window**2)
    angular = 2 * np.pi * np.fft.rfftfreq(acceleration.size, 1 / sample_rate)
    lowest = max(3.0, 0.0 if frequency is None else 0.5 * frequency * acceleration.size / sample_rate)
    keep = (power > LINE * noise**2) & (np.arange(power.size) >= lowest)
    if not keep.any():
        return float(np.std(acceleration)) / (2 * np.pi * sample_rate / acceleration.size) ** 2
    return float(np.sqrt(2 * np.sum(power[keep] / angular[keep] ** 4) / acceleration.size))


def disagreement(
    angle: Array, acceleration: Array, sample_rate: float, angle_noise: float, noise: float
) -> tuple[float, float, float, float] | None:
    """Return how many times the displacement sensor's acceleration the accelerometer shows, and how much later.

    A(f) = g·exp(−iωτ)·Θ̈(f) ≈ (g − iωh)·Θ̈(f), τ = h/g, by least squares over the lines that stand out of both
    channels' noise, each weighted by it.

    Parameters
    ----------
    angle, acceleration : ndarray, shape (n,)
    sample_rate : float
        Hz.
    angle_noise, noise : float
        Of single samples of either.

    Returns
    -------
    tuple of float, or None
        Gain and its standard error, time and its standard error, s; None where no line stands out.
    """
    path = integrated_twice(acceleration - np.mean(acceleration), 1 / sample_rate)
    window = np.hanning(path.size - 2)
    scale = 1 / np.sum(window**2)
    # Second differences of both: what a window leaks of them is alike.
    both = [np.diff(signal, 2) * sample_rate**2 for signal in (path, angle)]
    seen, told = (np.fft.rfft((signal - np.mean(signal)) * window) for signal in both)
    angular = 2 * np.pi * np.fft.rfftfreq(window.size, 1 / sample_rate)
    of_both = np.sqrt(noise**2 + angular**4 * angle_noise**2)
    stands = np.minimum(np.abs(told), np.abs(seen)) ** 2 * scale > LINE * of_both**2
    stands &= np.arange(seen.size) >= 3
    if np.count_nonzero(stands) < 2:
        return None
    x, y, weight = told[stands], seen[stands], 1 / of_both[stands]
    columns = np.column_stack([x, -1j * angular[stands] * x]) * weight[:, None]
    real = np.concatenate([columns.real, columns.imag])
    target = np.concatenate([(y * weight).real, (y * weight).imag])
    norms = np.linalg.norm(real, axis=0)
    found: Array = np.linalg.lstsq(real / norms, target, rcond=None)[0] / norms
    g, h = float(found[0]), float(found[1])
    spread = np.sum((target - real @ found) ** 2) / max(target.size - 2, 1)
    inverse = np.linalg.inv((real / norms).T @ (real / norms))
    errors = np.asarray(np.sqrt(spread * np.diag(inverse)) / norms)
    return g, float(errors[0]), h / g, float(errors[1] / abs(g))
