"""The angle of a run with an accelerometer: fused, and what is said of what the sensors leave open."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import ArrayLike

from sindyjoint.measurement.sensors import (
    integrated_twice,
    moving_size,
    rough_noise,
    sensor_noise,
    slow_correction,
)
from sindyjoint.numeric import Array, scaled_least_squares
from sindyjoint.rig import Fusion, SensorNoise

# Noise below this share of a channel's RMS counts as so much: beyond, rounding decides.
LEAST_NOISE = 1e-3
# Drift, and motion below the excitation, as a share of the angle's RMS, beyond which its mean is not known.
DRIFTS = 0.02
# Elastic part of the moment, as a share of its RMS, from which it shows where the angle is zero.
RESTORES = 0.2
# Share of the largest rate beyond which the joint surely moves.
MOVES = 0.1
# Motion that repeats is as dense at its lines as white noise of so many times its size: less draws its amplitude to
# zero (at 10, by 1e-5 where the noise is 3 % of the acceleration at the first line).
LINES = 10.0


def fuse(
    moment: Array,
    acceleration: Array,
    sample_rate: float,
    angle: Array | None = None,
    rate: Array | None = None,
    frequency: float | None = None,
    declared: SensorNoise | None = None,
) -> tuple[Array, Array, Fusion]:
    """Return moment and angle of a run with an accelerometer, and what is known of them.

    Parameters
    ----------
    moment, acceleration : ndarray, shape (n,)
        N·m and rad/s² (N, m/s²).
    sample_rate : float
        Hz.
    angle, rate : ndarray, shape (n,), optional
        Where they were measured, too, rad and rad/s.
    frequency : float, optional
        Of the excitation, Hz: what moves slower is no motion of a run that repeats.
    declared : SensorNoise, optional
        Noise of the sensors. Default: measured.

    Returns
    -------
    moment, angle : ndarray, shape (n,)
        An angle whose mean is not known is counted from where the elastic moment is zero; without a stiffness from its
        mean, and the moment then is without its constant part.
    fusion : Fusion
    """
    declared = declared or SensorNoise()
    step = 1 / sample_rate
    path = integrated_twice(acceleration - np.mean(acceleration), step)
    least = LEAST_NOISE * float(np.std(acceleration))
    noise = max(declared.acceleration or rough_noise(acceleration), least)
    fusion = Fusion(acceleration, angle, rate, noise)
    if rate is not None:
        of_rate = max(declared.rate or rough_noise(rate), LEAST_NOISE * float(np.std(rate)))
        fusion = replace(fusion, rate_noise=of_rate)
    if angle is None:
        prior = moving_size(acceleration, sample_rate, noise, frequency)
        prior *= 1.0 if frequency is None else LINES
        fusion = replace(fusion, prior=prior, mean_known=False)
    else:
        fusion = _with_measured_noise(fusion, angle, path, sample_rate, declared)
    found = path + slow_correction(path, step, fusion)
    found, known = _mean_of(found, fusion, sample_rate, frequency)
    if known:
        return moment, found, fusion
    found = found - np.mean(found)
    elastic = elastic_moment(moment, found, acceleration, step)
    zero = zero_of(elastic, found, moment)
    if zero is not None:
        return moment, found - zero, replace(fusion, mean_known=False, placed=True)
    constant = float(elastic[-1])
    return moment - constant, found, replace(fusion, mean_known=False, constant=constant)


def _mean_of(found: Array, fusion: Fusion, sample_rate: float, frequency: float | None) -> tuple[Array, bool]:
    """Return an angle, without what moves slower than an excitation where its mean is not known, and whether it is."""
    least = DRIFTS * float(np.std(found))
    known = fusion.mean_known
    if fusion.angle is not None:
        known = fusion.drift * np.sqrt(found.size / 6) <= least
    if frequency is None:
        return found, known
    slow = averaged(found, sample_rate / frequency)
    known = known and float(np.std(slow)) <= least
    return found if known else found - slow, known


def _with_measured_noise(
    fusion: Fusion, angle: Array, path: Array, sample_rate: float, declared: SensorNoise
) -> Fusion:
    noise, angle_noise, drift = sensor_noise(angle, path, sample_rate)
    least = LEAST_NOISE * float(np.std(fusion.acceleration))
    return replace(
        fusion,
        # The rough one is too large where samples are few, never too small; a strong drift hides the other.
        noise=max(declared.acceleration or float(np.clip(noise, 0.5 * fusion.noise, fusion.noise)), least),
        angle_noise=max(declared.angle or angle_noise, LEAST_NOISE * float(np.std(angle))),
        drift=drift,
    )


def averaged(signal: Array, samples: float) -> Array:
    """Return the running mean of a signal over a period, which is zero for all that repeats with it, shape (n,).

    The integral ends between samples, so a period need not be a whole number of them. At the ends of the record, where
    half a period is missing, it goes on as straight as it was over the half before.
    """
    n, half = signal.size, samples / 2
    running = np.concatenate([[0.0], np.cumsum(signal)])
    first, last = half - 0.5, n - 0.5 - half

    def mean(at: ArrayLike) -> Array:
        before, after = (
            np.interp(np.asarray(at) + 0.5 + side, np.arange(n + 1), running) for side in (-half, half)
        )
        return (after - before) / samples

    grid = np.arange(n)
    slow = mean(np.clip(grid, first, last))
    if last - first >= half:
        early, late = (
            (mean(at + half / 2) - mean(at - half / 2)) / half for at in (first + half / 2, last - half / 2)
        )
        slow += early * np.minimum(grid - first, 0) + late * np.maximum(grid - last, 0)
    return slow


def elastic_moment(moment: Array, angle: Array, acceleration: Array, step: float) -> Array:
    """Return the elastic moment about an unknown mean angle as a polynomial of θ, coefficients of θ⁴ to θ⁰, N·m/radⁱ.

    The law about the mean position, M = Σ kᵢθⁱ + c₁θ̇ + M_F sign θ̇ + Iθ̈, i ≤ 4, by least squares while the joint moves;
    its constant is what no motion explains.
    """
    rate = np.gradient(angle, step)
    moves = np.abs(rate) > MOVES * np.max(np.abs(rate))
    # At its ends a record says least of the slow part of the angle.
    moves[: angle.size // 10] = moves[angle.size - angle.size // 10 :] = False
    size = float(np.max(np.abs(angle))) or 1.0
    powers = np.vander(angle / size, 5)
    columns = np.column_stack([powers, rate, np.sign(rate), acceleration - np.mean(acceleration)])
    found = scaled_least_squares(columns[moves], moment[moves], rcond=1e-8)[:5]
    return np.asarray(found / size ** np.arange(4, -1, -1))


def zero_of(elastic: Array, angle: Array, moment: Array) -> float | None:
    """Return the angle at which an elastic moment is zero, rad; None where it restores too little, or is nowhere zero.

    Parameters
    ----------
    elastic : ndarray, shape (5,)
        As :func:`elastic_moment` gives it.
    angle, moment : ndarray, shape (n,)
        About the unknown mean angle, rad and N·m.
    """
    if np.std(np.polyval(elastic, angle)) < RESTORES * np.std(moment):
        return None
    roots = np.roots(elastic)
    real = roots.real[(np.abs(roots.imag) < 1e-9 * np.abs(roots)) & (np.abs(roots) <= np.max(np.abs(angle)))]
    if not real.size:
        return None
    nearest = float(real[np.argmin(np.abs(real))])
    return nearest if np.polyval(np.polyder(elastic), nearest) > 0 else None
