"""Several sensors of one motion: how well each is known, one angle of all of them, and whether they agree.

The sensors show the same motion: θ_m = θ + d + v_θ, ω_m = θ̇ + v_ω, a_m = θ̈ + v_a, with white noise v and a slow drift d
of the displacement sensor, a random walk. The angle of least squares is the acceleration integrated twice, p, and a
slow correction c, with the unknown zero b of the accelerometer,

    θ̂ = p + c,   c, d, b = argmin Σ (θ_m − p − c − d)²/σ_θ² + Σ (∫ω_m dt − p − c)'²/σ_ω² + Σ (c'' + b)²/σ_a² + Σ d'²/q²,

which at each frequency weighs the sensors by their noise: θ_m by 1/σ_θ², ω_m by ω²/σ_ω², a_m by ω⁴/σ_a². It is what a
Kalman filter with a backward pass gives (Smyth and Wu, Mech. Syst. Signal Process. 21, 2007; Kim, Kim and Sohn, Mech.
Syst. Signal Process. 42, 2014), written as one banded system (Whittaker's smoother). As p − θ_m holds no motion but
noise, the correction is solved for on a coarser grid. What two sensors disagree in is no motion either: its spectrum
shows the noise of both.
"""

from dataclasses import replace

import numpy as np
import scipy
from numpy.typing import ArrayLike

from sindyjoint.numeric import Array, line_spectrum, noise_by_differences, scaled_least_squares
from sindyjoint.rig import Fusion, SensorNoise

# Noise below this share of a channel's RMS counts as so much: beyond, rounding decides.
LEAST_NOISE = 1e-3


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
        floor = LEAST_NOISE * float(np.std(rate))
        fusion = replace(fusion, rate_noise=max(declared.rate or rough_noise(rate), floor))
    if angle is None:
        prior = moving_size(acceleration, sample_rate, noise, frequency)
        # Motion that repeats is as dense at its lines as white noise of so many times its size: less draws its
        # amplitude to zero (at 10, by 1e-5 where the noise is 3 % of the acceleration at the first line).
        prior *= 1.0 if frequency is None else 10.0
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
    # Drift, and motion below the excitation, as a share of the angle's RMS, beyond which its mean is not known.
    least = 0.02 * float(np.std(found))
    known = fusion.angle is not None and fusion.drift * np.sqrt(found.size / 6) <= least
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
    # Share of the largest rate beyond which the joint surely moves.
    moves = np.abs(rate) > 0.1 * np.max(np.abs(rate))
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
    # Elastic part of the moment, as a share of its RMS, from which it shows where the angle is zero.
    if np.std(np.polyval(elastic, angle)) < 0.2 * np.std(moment):
        return None
    roots = np.roots(elastic)
    real = roots.real[(np.abs(roots.imag) < 1e-9 * np.abs(roots)) & (np.abs(roots) <= np.max(np.abs(angle)))]
    if not real.size:
        return None
    nearest = float(real[np.argmin(np.abs(real))])
    return nearest if np.polyval(np.polyder(elastic), nearest) > 0 else None


# A line of a spectrum this many times above the noise is motion.
LINE = 25.0


def integrated_twice(acceleration: Array, step: float) -> Array:
    """Return the double time integral of a signal, without its straight line.

    Second differences of θ over Δt² are θ̈ averaged with a triangle two samples wide, whose response is sinc²(fΔt):
    so filtered and summed twice, the samples of a band-limited θ̈ give those of θ without an error of discretisation.

    Parameters
    ----------
    acceleration : ndarray, shape (n,)
    step : float
        Sampling interval, s.
    """
    n = acceleration.size
    room = min(256, n - 1)
    padded = np.pad(acceleration, room, mode="reflect")
    response = np.sinc(np.fft.rfftfreq(padded.size)) ** 2
    smooth = np.fft.irfft(np.fft.rfft(padded) * response, padded.size)[room : room + n]
    rate = np.concatenate([[0.0], np.cumsum(smooth[1:-1])])
    path = step**2 * np.concatenate([[0.0], np.cumsum(rate)])
    grid = np.linspace(-1, 1, n)
    return path - np.polynomial.polynomial.polyval(grid, np.polynomial.polynomial.polyfit(grid, path, 1))


def slow_correction(path: Array, step: float, fusion: Fusion) -> Array:
    """Return what the other sensors add to a doubly integrated acceleration, shape (n,); see the module.

    Parameters
    ----------
    path : ndarray, shape (n,)
        The acceleration integrated twice, rad.
    step : float
        Sampling interval, s.
    fusion : Fusion
        The sensors and their noise. Without a displacement sensor its ``prior`` says that slower motion is noise.
    """
    n, noise, rate, drift = path.size, fusion.noise, fusion.rate, fusion.drift
    size = min(fusion.angle_noise, fusion.prior)
    alike = max(np.sqrt(noise / size), noise / fusion.rate_noise)
    # Of the slow correction, radians of the frequency at which the sensors weigh alike, per step of its grid.
    each = int(np.clip(0.03 / (alike * step), 1, max(1, n // 16)))
    edges = np.linspace(0, n, n // each + 1).astype(int)
    centre = (edges[:-1] + edges[1:] - 1) / 2
    wide, blocks = step * n / centre.size, centre.size

    def mean(signal: Array) -> Array:
        return np.add.reduceat(signal, edges[:-1]) / np.diff(edges)

    first = scipy.sparse.diags([-1.0, 1.0], [0, 1], shape=(blocks - 1, blocks))
    second = scipy.sparse.diags([1.0, -2.0, 1.0], [0, 1, 2], shape=(blocks - 2, blocks))
    told = mean((0.0 if fusion.angle is None else fusion.angle) - path)
    weight = 1 / (noise * wide**2) ** 2
    matrix = scipy.sparse.eye(blocks) / size**2 + weight * second.T @ second
    right = told / size**2
    # The zero of the accelerometer, in second differences.
    zero = weight * scipy.sparse.csr_array((second.T @ np.ones(blocks - 2))[:, None])
    if rate is not None:
        integral = scipy.interpolate.CubicSpline(np.arange(n) * step, rate).antiderivative()(
            np.arange(n) * step
        )
        slope = first.T @ first / (fusion.rate_noise * wide) ** 2
        matrix, right = matrix + slope, right + slope @ mean(integral - path)
    if drift > 0:
        # Increments of a block's drift, and its mean known to no more than it walks over the record.
        walk = each * drift
        drifts = (
            scipy.sparse.eye(blocks) * (1 / size**2 + 1 / (blocks * n * drift**2)) + first.T @ first / walk**2
        )
        matrix = scipy.sparse.block_array(
            [[matrix, scipy.sparse.eye(blocks) / size**2], [scipy.sparse.eye(blocks) / size**2, drifts]]
        )
        right = np.concatenate([right, told / size**2])
        zero = scipy.sparse.csr_array(np.concatenate([zero.toarray(), np.zeros((blocks, 1))]))
    matrix = scipy.sparse.block_array(
        [[matrix, zero], [zero.T, scipy.sparse.csr_array([[weight * (blocks - 2)]])]]
    )
    found = scipy.sparse.linalg.spsolve(matrix.tocsc(), np.append(right, 0.0))[:blocks]
    return np.asarray(scipy.interpolate.CubicSpline(centre, found)(np.arange(n)))


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
    apart = np.diff(angle - path, 2) * sample_rate**2
    power = line_spectrum(apart) ** 2 / np.sum(np.hanning(apart.size) ** 2)
    frequency = np.fft.rfftfreq(apart.size)
    # Frequencies, logarithmically spaced, at which the disagreement of two sensors is read.
    edges = np.unique(np.geomspace(3, power.size, 41).astype(int))
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
        found = scipy.optimize.nnls(parts * weight[:, None] / scale, level * weight)[0] / scale
        model = np.maximum(parts @ found, 1e-6 * level + 1e-300)
    noise, angle_noise, drift = np.sqrt(found)
    return float(noise), float(angle_noise), float(drift)


def rough_noise(signal: Array) -> float:
    """Return the RMS of the white noise of a channel, at least that: by differences, or where its spectrum ends.

    The median of third differences ignores steps, that of the top third of the band lines.
    """
    power = line_spectrum(signal) ** 2
    top = power[2 * power.size // 3 :] / np.sum(np.hanning(signal.size) ** 2)
    return float(min(noise_by_differences(signal, 3), np.sqrt(np.median(top) / np.log(2))))


def moving_size(
    acceleration: Array, sample_rate: float, noise: float, frequency: float | None = None
) -> float:
    """Return the RMS of the angle by what of an acceleration stands out of its noise, rad.

    Σ |A(f)|²/ω⁴ over such lines, from half the frequency of the excitation on where that is known.
    """
    power = line_spectrum(acceleration) ** 2 / np.sum(np.hanning(acceleration.size) ** 2)
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
