"""The joint's angle from an accelerometer, alone or beside other motion sensors: the optimal smoother.

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

from __future__ import annotations

import numpy as np

from sindyjoint.accelerometer.fused import Fusion
from sindyjoint.numeric import Array

# Of the slow correction, radians of the frequency at which the sensors weigh alike, per step of its grid.
STEP = 0.03


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
    from scipy.interpolate import CubicSpline
    from scipy.sparse import block_array, csr_array, diags, eye
    from scipy.sparse.linalg import spsolve

    n, noise, rate, drift = path.size, fusion.noise, fusion.rate, fusion.drift
    size = min(fusion.angle_noise, fusion.prior)
    alike = np.sqrt(noise / size)
    if np.isfinite(fusion.rate_noise):
        alike = max(alike, noise / fusion.rate_noise)
    each = int(np.clip(STEP / (alike * step), 1, max(1, n // 16)))
    edges = np.linspace(0, n, n // each + 1).astype(int)
    centre = (edges[:-1] + edges[1:] - 1) / 2
    wide, blocks = step * n / centre.size, centre.size

    def mean(signal: Array) -> Array:
        return np.add.reduceat(signal, edges[:-1]) / np.diff(edges)

    first = diags([-1.0, 1.0], [0, 1], shape=(blocks - 1, blocks))
    second = diags([1.0, -2.0, 1.0], [0, 1, 2], shape=(blocks - 2, blocks))
    told = mean((0.0 if fusion.angle is None else fusion.angle) - path)
    weight = 1 / (noise * wide**2) ** 2
    matrix = eye(blocks) / size**2 + weight * second.T @ second
    right = told / size**2
    # The zero of the accelerometer, in second differences.
    zero = weight * csr_array((second.T @ np.ones(blocks - 2))[:, None])
    if rate is not None:
        integral = CubicSpline(np.arange(n) * step, rate).antiderivative()(np.arange(n) * step)
        slope = first.T @ first / (fusion.rate_noise * wide) ** 2
        matrix, right = matrix + slope, right + slope @ mean(integral - path)
    if drift > 0:
        # Increments of a block's drift, and its mean known to no more than it walks over the record.
        walk = each * drift
        drifts = eye(blocks) * (1 / size**2 + 1 / (blocks * n * drift**2)) + first.T @ first / walk**2
        matrix = block_array([[matrix, eye(blocks) / size**2], [eye(blocks) / size**2, drifts]])
        right = np.concatenate([right, told / size**2])
        zero = csr_array(np.concatenate([zero.toarray(), np.zeros((blocks, 1))]))
    matrix = block_array([[matrix, zero], [zero.T, csr_array([[weight * (blocks - 2)]])]])
    found = spsolve(matrix.tocsc(), np.append(right, 0.0))[:blocks]
    return np.asarray(CubicSpline(centre, found)(np.arange(n)))
