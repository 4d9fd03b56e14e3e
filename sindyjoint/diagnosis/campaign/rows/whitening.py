"""The noise of rows of the gap: how errors of the angle, known by their spectrum, reach the moment."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from sindyjoint.diagnosis.effects.motion import MeasuredMotion
from sindyjoint.equation.model import JointModel
from sindyjoint.numeric import Array, convolve
from sindyjoint.states import ForceStates
from sindyjoint.states.broadband import WIDEST, smoothing_kernels

# How far beyond the bandwidth of a smoothed angle its unknown rest is accounted for.
BEYOND = 2.0


def folded_whitener(
    states: ForceStates, model: JointModel, motion: MeasuredMotion, sigma: Array, phase: Array
) -> Array:
    """Return the inverse Cholesky factor of the noise of a mean period's rows, shape (m, m).

    Parameters
    ----------
    states : ForceStates
    model : JointModel
    motion : MeasuredMotion
        The mean period.
    sigma : ndarray, shape (m,)
        Standard error of each row by the moment's own noise, N·m.
    phase : ndarray, shape (m,)
        Of the rows within the period, 0 to 1.
    """
    assert states.frequency is not None
    kept = max(1, int(round(states.bandwidth / states.frequency)))
    orders = np.arange(0, kept + 9)
    angular = 2 * np.pi * states.frequency * orders
    stiffness, damping = (s[motion.keep] for s in model.slopes(motion.angle, motion.rate))
    cosine, sine = np.cos(2 * np.pi * np.outer(phase, orders)), np.sin(2 * np.pi * np.outer(phase, orders))
    inertial = model.inertia * angular**2
    carried = [
        stiffness[:, None] * cosine - damping[:, None] * angular * sine + inertial * cosine,
        stiffness[:, None] * sine + damping[:, None] * angular * cosine + inertial * sine,
    ]
    error = np.sqrt(2.0 / states.n_samples) * states.white_noise(states.frequency * np.maximum(orders, 1))
    error[0] /= np.sqrt(2.0)
    # A harmonic that was cut is anything below the level at which it would have been kept.
    error[kept + 1 :] *= 3.0
    matrix = np.hstack([block * error for block in carried])
    covariance = matrix @ matrix.T
    covariance[np.diag_indices_from(covariance)] += sigma**2
    from scipy.linalg import solve_triangular

    lower = np.linalg.cholesky(covariance)
    return solve_triangular(lower, np.eye(sigma.size), lower=True, check_finite=False)


def kernel_noise_factor(
    states: ForceStates,
    model: JointModel,
    motion: MeasuredMotion,
    samples: NDArray[np.intp],
    sigma: Array,
) -> tuple[Array, Array]:
    """Return the banded Cholesky factor of the noise of broadband rows, lower form, and the variance of each row.

    Shapes (bands + 1, m) and (m,).

    White noise of the angle comes out of the smoothing kernel and its derivatives correlated over the kernel's
    length, with Cov(i, j) = σ_θ² Σ_ab s_a(i) s_b(j) (h_a ⋆ h_b)(t_i − t_j) and s = (∂M/∂θ, ∂M/∂θ̇, I): at low
    frequencies an acceleration is known far better than sample by sample. A measured rate has noise of its own.
    Beyond the bandwidth, where the angle was cut, it may be anything up to its noise: the kernels of the covariance
    reach further than those of the states.

    Parameters
    ----------
    states : ForceStates
    model : JointModel
    motion : MeasuredMotion
    samples : ndarray of int, shape (m,)
        Places of the rows among the run's samples, rising.
    sigma : ndarray, shape (m,)
        Standard error of each row by independent noise, N·m.
    """
    from scipy.linalg import cholesky_banded

    cutoff = min(BEYOND * states.bandwidth, WIDEST * states.sample_rate)
    low, first, second = smoothing_kernels(cutoff, states.sample_rate)
    longest = low.size - 1
    stiffness, damping = model.slopes(motion.angle[motion.keep], motion.rate[motion.keep])
    inertia = np.full(samples.size, model.inertia)
    angle = states.noise.angle
    if states.rate_measured:
        rate = states.noise.rate / float(np.linalg.norm(low))
        sources = [[(angle * stiffness, low)], [(rate * damping, low), (rate * inertia, first)]]
    else:
        sources = [[(angle * stiffness, low), (angle * damping, first), (angle * inertia, second)]]
    pairs = [
        (one, other, convolve(a, b[::-1], mode="full"))
        for source in sources
        for one, a in source
        for other, b in source
    ]
    spacing = int(np.min(np.diff(samples))) if samples.size > 1 else 1
    bands = min(longest // max(spacing, 1), samples.size - 1)
    banded = np.zeros((bands + 1, samples.size), order="F")
    for band in range(bands + 1):
        lag = (
            samples[: samples.size - band] - samples[band:]
        )  # negative or zero: row j is later than column i
        inside = -lag <= longest
        place = np.where(inside, lag, 0) + longest
        row = sum(one[: lag.size] * other[band:] * correlation[place] for one, other, correlation in pairs)
        banded[band, : lag.size] = np.where(inside, row, 0.0)
    banded[0] += sigma**2
    return cholesky_banded(banded, lower=True, check_finite=False), banded[0]
