"""Fourier series: of the channels of a run, of any signal as coefficients and samples, of a joint's moment.

A signal with H harmonics is x(τ) = x₀ + Σ_h x_{2h−1} cos hτ + x_{2h} sin hτ over the phase τ = Ω t; its coefficients
stand in one real vector of 2H + 1 numbers. Of a channel it is that of its period, or of the whole record where it does
not repeat; the noise is measured, from what does not repeat, or from what is left where the channel has ended. The
moment of a joint is that of the steady state of the internal states.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import lru_cache
from typing import Any

import numpy as np
import scipy

from sindyjoint.errors import InputError, SimulationError
from sindyjoint.limits import STATES, SUBSTRUCTURE
from sindyjoint.measurement import signal_end
from sindyjoint.mechanics.rig_test import RigRun
from sindyjoint.numeric import Array, Complex, Integers, partials
from sindyjoint.states import (
    FIRST_ORDERS,
    HarmonicBasis,
    cut_blocks,
    local_noise,
    refine_frequency,
    unsteady_periods,
)


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


def real_blocks(factor: Complex) -> Array:
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


def by_harmonic(factors: Complex, spare: int = 0) -> Array:
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
    blocks = np.zeros((count, width, count, width))
    blocks[:, 0, :, 0] = factors[0].real
    cos, sin, rest = np.arange(1, width, 2), np.arange(2, width, 2), factors[1:]
    blocks[:, cos, :, cos] = blocks[:, sin, :, sin] = rest.real
    blocks[:, cos, :, sin], blocks[:, sin, :, cos] = rest.imag, -rest.imag
    matrix = np.zeros((count * width + spare,) * 2)
    matrix[: count * width, : count * width] = blocks.reshape(count * width, -1)
    return matrix


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
    # Runge–Kutta steps of internal states, four per sample, over periods until they repeat within the tolerance.
    for _ in range(60):
        integrate_states(compiled.address, *closed, compiled.numbers, period / angle.size, 4, states)
        if not np.isfinite(states).all():
            raise SimulationError(
                "an internal state of the joint is no longer finite over a period", time=0.0
            )
        ends.append(states[:, -1].copy())
        if np.all(np.abs(ends[-1] - ends[-2]) <= 1e-8 * np.abs(states).max(axis=1)):
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
) -> tuple[Array, Array]:
    """Return the moment over a period, M = middle + friction·s, and its derivatives.

    s lies in [−1, 1] at standstill and is sign θ̇ in slip.

    Parameters
    ----------
    law : Law
    motion : tuple of ndarray, shape (n,)
        Angle and rate.
    slopes : tuple of ndarray, shape (n, m)
        Their derivatives by the coefficients of the motion; None: those of the moment are left at zero.
    period : float
        s.

    Returns
    -------
    ndarray, shape (2, n); ndarray, shape (2, n, m)
        Middle and friction, N·m (N), and their derivatives by the coefficients.
    """
    states = steady_states(law, *motion, period)
    at = [*motion, *states]

    def parts(*values: Array) -> Array:
        inner = np.array(values[2:]).reshape(-1, values[0].size)
        return np.array(law.friction_interval(values[0], values[1], inner))

    moment = parts(*at)
    if slopes is None:
        return moment, np.zeros((*moment.shape, 1))
    d_at = [*slopes, *_state_slopes(law, at, slopes, period)]
    return moment, np.sum([p[..., None] * d for p, d in zip(partials(parts, at), d_at, strict=True)], axis=0)


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
    edges: Integers
    mean: Array
    amplitudes: Complex
    blocks: Complex
    variance: Array
    repeats: bool = True

    @property
    def angular(self) -> Array:
        """Angular frequencies of the harmonics, rad/s, shape (h,)."""
        return 2 * np.pi * self.frequency * np.arange(1, self.amplitudes.shape[1] + 1)


def channel_spectra(run: RigRun, declared: Array | float = np.nan, bandwidth: float = np.inf) -> Spectra:
    """Return the Fourier series of all channels of a run: its drive, then its sensors.

    Parameters
    ----------
    run : RigRun
    declared : float or ndarray, shape (1 + sensors,), optional
        Standard deviation of single samples of each channel as declared, NaN where it was not: a floor of what is
        measured.
    bandwidth : float, optional
        Highest frequency, Hz, where that is below 0.37 of the sampling rate.

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
    ends = [unsteady_periods(s, run.sample_rate, frequency, orders) for s in signals[1:]]
    before, after = np.max(ends, axis=0)
    first = int(round(before * per))
    periods = int(np.floor((run.drive.size - first) / per + 1e-3)) - int(after)
    if periods < STATES.fewest:
        raise InputError(
            f"run {run.name!r}: {periods} steady period(s) of {frequency:g} Hz; expected {STATES.fewest} or "
            "more: record longer, or begin later"
        )
    stop = min(first + int(round(periods * per)), run.drive.size)
    edges = cut_blocks(periods, per, stop - first)
    time = np.arange(stop - first) / run.sample_rate
    top = min(bandwidth, SUBSTRUCTURE.band * run.sample_rate)
    # Most harmonics of a run: a multisine of a hundred lines has them, and what they hold beyond is noise.
    count = int(np.clip(top / frequency, 1, min(400, 3 * (int(np.diff(edges).min()) - 8) // 8)))
    basis = HarmonicBasis.build(time, frequency, np.arange(1, count + 1))
    # Between harmonics lie as many lines of noise as there are periods, less one. Fifty estimate that of a harmonic: of
    # nine, weights that follow their scatter make standard errors a tenth too small.
    neighbours = int(np.ceil(50 / max(1, periods - 1)))
    steady = signals[:, first:stop]
    means, cosine, sine = basis.fit_all(steady)
    residuals = [s - basis.series(*fitted) for s, *fitted in zip(steady, means, cosine, sine, strict=True)]
    at, half = basis.angular / (2 * np.pi), 0.5 * frequency
    noise = [local_noise(residual, run.sample_rate, at, half) for residual in residuals]
    smooth = scipy.ndimage.uniform_filter1d(noise, neighbours, mode="nearest")
    known = np.fmax(smooth, np.square(declared)[..., None])
    variance = 2 * np.maximum(known, _rounding(steady)[:, None] ** 2) / time.size
    blocks = [slice(low, high) for low, high in zip(edges[:-1], edges[1:], strict=True)]
    parts = [basis.rows(block).fit_all(steady[:, block]) for block in blocks]
    of_blocks = np.array([a - 1j * b for _, a, b in parts])
    return Spectra(frequency, first, edges, means, cosine - 1j * sine, of_blocks, variance)


def _rounding(signals: Array) -> Array:
    """Return the rounding of signals, shape (channels,): of exact data it is all that is left."""
    return np.asarray(np.finfo(float).eps * np.abs(signals).max(axis=1, initial=1e-300))


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


def _record_spectra(run: RigRun, declared: Array | float, bandwidth: float) -> Spectra:
    """Return the Fourier series of a whole record, with its length as the period.

    By the trapezoidal rule, half of each end. Noise is white, as it was declared or of the density above which the
    channel has ended.
    """
    signals, n = run.signals, run.drive.size - 1
    frequency = run.sample_rate / n
    top = min(bandwidth, SUBSTRUCTURE.band * run.sample_rate)
    count = max(1, int(top / frequency))
    jump = signals[:, -1:] - signals[:, :1]
    amplitudes = 2 / n * (np.fft.rfft(signals[:, :-1])[:, 1 : count + 1] + jump / 2)
    ends = [signal_end(signal, run.sample_rate).noise for signal in signals]
    noise = np.where(np.isfinite(declared), declared, ends)
    variance = np.repeat(2 * np.maximum(noise, _rounding(signals))[:, None] ** 2 / n, count, axis=1)
    mean = signals[:, :-1].mean(axis=1) + jump[:, 0] / 2 / n
    return Spectra(
        frequency, 0, np.array([0, n]), mean, amplitudes, amplitudes[None], variance, False
    )  # fmt: skip


def between_harmonics(run: RigRun, spectra: Spectra, count: int) -> tuple[Array, Array, Complex]:
    """Return what a run that should repeat has between its harmonics, at its strongest lines.

    Parameters
    ----------
    run : RigRun
    spectra : Spectra
        Of a run that repeats.
    count : int
        Of lines, those that stand furthest out of the noise.

    Returns
    -------
    angular : ndarray, shape (count,)
    sigma, amplitudes : ndarray, shapes (count, channels)
        Noise of a real part, and what was found.
    """
    n = int(spectra.edges[-1])
    signals = run.signals[:, spectra.first : spectra.first + n]
    orders = np.arange(1, spectra.amplitudes.shape[1] + 1)
    basis = HarmonicBasis.build(np.arange(n) / run.sample_rate, spectra.frequency, orders)
    series = [
        basis.series(mean, part.real, -part.imag)
        for mean, part in zip(spectra.mean, spectra.amplitudes, strict=True)
    ]
    lines = 2 / n * np.fft.rfft(signals - series)[:, 1:]
    angular = 2 * np.pi * run.sample_rate / n * np.arange(1, lines.shape[1] + 1)
    within = angular <= spectra.angular[-1]
    lines, angular = lines[:, within], angular[within]
    sigma = np.sqrt([np.interp(angular, spectra.angular, each) for each in spectra.variance])
    rows = np.sort(np.argsort(np.sum(np.abs(lines / sigma) ** 2, axis=0))[-count:])
    return angular[rows], sigma[:, rows].T, lines[:, rows].T


def strongest(spectra: Spectra, count: int) -> tuple[Spectra, Array]:
    """Return the harmonics of a run that stand furthest out of the noise, and their angular frequencies."""
    power = np.sum(np.abs(spectra.amplitudes[1:]) ** 2 / spectra.variance[1:], axis=0)
    rows = np.sort(np.argsort(power)[-count:])
    kept = replace(spectra, amplitudes=spectra.amplitudes[:, rows], variance=spectra.variance[:, rows])
    return kept, spectra.angular[rows]
