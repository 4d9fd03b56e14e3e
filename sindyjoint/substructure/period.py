"""Periodic signals as Fourier coefficients and as samples, and the moment of a joint over one period of a motion.

A signal with H harmonics is x(τ) = x₀ + Σ_h x_{2h−1} cos hτ + x_{2h} sin hτ over the phase τ = Ω t; its coefficients
stand in one real vector of 2H + 1 numbers. The moment is that of the steady state of the internal states.
"""

from dataclasses import dataclass
from functools import lru_cache
from typing import Any

import numpy as np
from numpy.typing import NDArray

from sindyjoint.errors import SimulationError
from sindyjoint.numeric import Array, partials


@lru_cache(maxsize=16)
def synthesis(harmonics: int, samples: int) -> Array:
    """Return the matrix that gives samples of a signal over its period, shape (samples, 2H + 1)."""
    phase = 2 * np.pi * np.outer(np.arange(samples) / samples, np.arange(1, harmonics + 1))
    matrix = np.ones((samples, 2 * harmonics + 1))
    matrix[:, 1::2], matrix[:, 2::2] = np.cos(phase), np.sin(phase)
    matrix.flags.writeable = False
    return matrix


@lru_cache(maxsize=16)
def analysis(harmonics: int, samples: int) -> Array:
    """Return the matrix that gives the coefficients of samples (their projection), shape (2H + 1, samples)."""
    matrix = synthesis(harmonics, samples).T * (2.0 / samples)
    matrix[0] /= 2
    matrix.flags.writeable = False
    return matrix


@lru_cache(maxsize=16)
def rates(harmonics: int, samples: int) -> Array:
    """Return the matrix that gives samples of dx/dτ, shape (samples, 2H + 1)."""
    whole, orders = synthesis(harmonics, samples), np.arange(1, harmonics + 1)
    matrix = np.zeros_like(whole)
    matrix[:, 1::2], matrix[:, 2::2] = -orders * whole[:, 2::2], orders * whole[:, 1::2]
    matrix.flags.writeable = False
    return matrix


def real_blocks(factor: NDArray[np.complex128]) -> Array:
    """Return complex factors of one harmonic as factors of its (cos, sin) coefficients.

    With x = Re(a·exp(iτ)), a = x_c − i·x_s: y = S·a has y_c = Re S·x_c + Im S·x_s, y_s = −Im S·x_c + Re S·x_s.

    Parameters
    ----------
    factor : ndarray of complex, shape (n, m)

    Returns
    -------
    ndarray, shape (2n, 2m)
        Cosine and sine coefficients of each freedom side by side.
    """
    blocks = np.array([[factor.real, factor.imag], [-factor.imag, factor.real]])
    return blocks.transpose(2, 0, 3, 1).reshape(2 * factor.shape[0], 2 * factor.shape[1])


def by_harmonic(factors: NDArray[np.complex128], spare: int = 0) -> Array:
    """Return complex factors of each harmonic as a matrix on the coefficients of all signals.

    Parameters
    ----------
    factors : ndarray of complex, shape (H + 1, n, n)
    spare : int
        Rows and columns of zeros behind.

    Returns
    -------
    ndarray, shape (n·(2H + 1) + spare, n·(2H + 1) + spare)
    """
    count, width = factors.shape[1], 2 * len(factors) - 1
    rows: NDArray[np.intp] = np.arange(count) * width
    matrix = np.zeros((count * width + spare,) * 2)
    matrix[np.ix_(rows, rows)] = factors[0].real
    for order in range(1, len(factors)):
        pairs: NDArray[np.intp] = np.ravel(rows[:, None] + np.array([2 * order - 1, 2 * order]))
        matrix[np.ix_(pairs, pairs)] = real_blocks(factors[order])
    return matrix


# Runge–Kutta steps of internal states per sample of a period, and periods until they repeat within the tolerance.
SUBSTEPS = 4
PERIODS = 60
REPEATS = 1e-8


@dataclass(frozen=True, eq=False)
class PeriodMoment:
    """Moment over a period, M = middle + friction·s with s in [−1, 1] at standstill and sign θ̇ in slip, and its slopes.

    Parameters
    ----------
    middle, friction : ndarray, shape (n,)
        N·m (N).
    d_middle, d_friction : ndarray, shape (n, m)
        Derivatives by the m coefficients of the motion.
    """

    middle: Array
    friction: Array
    d_middle: Array
    d_friction: Array


def steady_states(law: Any, angle: Array, rate: Array, period: float) -> Array:
    """Return the internal states over one period once they repeat, shape (n_states, n).

    Periods are passed until the states at their end no longer change; what decays slowly (a Maxwell branch with a long
    relaxation time) is extrapolated by Aitken's Δ² process. A slider that never slips stays where it began: at zero.

    Parameters
    ----------
    law : Law
    angle, rate : ndarray, shape (n,)
        Samples at k·period/n.
    period : float
        s.

    Raises
    ------
    SimulationError
        If a state does not stay finite.
    """
    compiled = law.compiled()
    states = np.zeros((compiled.n_states, angle.size + 1))
    if not compiled.n_states:
        return states[:, :-1]
    from sindyjoint.mechanics.kernels import integrate_states

    closed = np.append(angle, angle[0]), np.append(rate, rate[0])
    ends = [states[:, 0].copy()]
    for _ in range(PERIODS):
        integrate_states(compiled.address, *closed, compiled.numbers, period / angle.size, SUBSTEPS, states)
        if not np.isfinite(states).all():
            raise SimulationError(
                "an internal state of the joint is no longer finite over a period", time=0.0
            )
        ends.append(states[:, -1].copy())
        if np.all(np.abs(ends[-1] - ends[-2]) <= REPEATS * np.abs(states).max(axis=1)):
            break
        states[:, 0] = ends[-1]
        if len(ends) % 4 == 0:
            last, before = ends[-1] - ends[-2], ends[-2] - ends[-3]
            slow = (last * before > 0) & (np.abs(last) < np.abs(before))
            with np.errstate(all="ignore"):
                states[:, 0] += np.where(slow, last**2 / (before - last), 0.0)
    return states[:, :-1]


def period_moment(
    law: Any, motion: tuple[Array, Array], slopes: tuple[Array, Array] | None, period: float
) -> PeriodMoment:
    """Return the moment over a period and its derivatives.

    Parameters
    ----------
    law : Law
    motion : tuple of ndarray, shape (n,)
        Angle and rate.
    slopes : tuple of ndarray, shape (n, m)
        Their derivatives by the coefficients of the motion; None: those of the moment are left at zero.
    period : float
        s.
    """
    states = steady_states(law, *motion, period)
    at = [*motion, *states]

    def parts(*values: Array) -> Array:
        angle, rate, inner = values[0], values[1], np.array(values[2:]).reshape(-1, values[0].size)
        side = np.ones_like(angle)
        up, down = law.moment(angle, rate, side, inner), law.moment(angle, rate, -side, inner)
        return np.array([(up + down) / 2, (up - down) / 2])

    middle, friction = parts(*at)
    if slopes is None:
        none = np.zeros((middle.size, 1))
        return PeriodMoment(middle, friction, none, none)
    d_at = [*slopes, *_state_slopes(law, at, slopes, period)]
    total = sum(p[..., None] * d for p, d in zip(partials(parts, at), d_at, strict=True))
    return PeriodMoment(middle, friction, total[0], total[1])


def _state_slopes(law: Any, at: list[Array], slopes: tuple[Array, Array], period: float) -> Array:
    """Return derivatives of the internal states by the coefficients, shape (n_states, n, m).

    The linearised state equation by the implicit Euler rule, closed over the period: near enough for Newton steps.
    """
    count, (samples, size) = len(at) - 2, slopes[0].shape
    if not count:
        return np.empty((0, samples, size))

    def rates(*values: Array) -> Array:
        side = np.where(values[1] >= 0, 1.0, -1.0)
        return np.asarray(law.state_rate(values[0], values[1], side, np.array(values[2:])))

    by_angle, by_rate, *by_state = partials(rates, at)
    step = period / samples
    drive = step * (by_angle[..., None] * slopes[0] + by_rate[..., None] * slopes[1]).transpose(1, 0, 2)
    back = np.linalg.inv(np.eye(count) - step * np.array(by_state).transpose(2, 1, 0))

    def passed(start: Array, with_drive: float) -> Array:
        rows = np.empty((samples, count, start.shape[1]))
        for i in range(samples):
            start = rows[i] = back[i] @ (start + with_drive * drive[i] if with_drive else start)
        return rows

    # From the last sample to itself one period later: d = Φ·d + g.
    once = passed(np.eye(count), 0.0)[-1]
    forced = passed(np.zeros((count, size)), 1.0)[-1]
    start = np.linalg.lstsq(np.eye(count) - once, forced, rcond=1e-6)[0]
    return passed(start, 1.0).transpose(1, 0, 2)
