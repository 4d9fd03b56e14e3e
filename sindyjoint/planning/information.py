"""The information of a run on the coefficients: its part of the expected covariance, by the processing that awaits it.

A discovery fits the pooled moving samples by least squares and reads the errors from the scatter of replicate blocks.
The expectation of that covariance is B⁻¹ S B⁻¹ with B = Σ XᵀX and S = Σ Xᵀ cov(e) X over the runs, both of which add.
In the residual e = ε_M − (∂M/∂θ) δθ − (∂M/∂θ̇) δθ̇ − I δθ̈ the noise ε_M of the moment is white, while that of the
angle is in the coefficients of its Fourier series, each of which has the standard error σ_θ √(2/n).
White (1982), Econometrica 50(1), for the covariance; Fisher information is B/σ² where the angle is free of noise.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, fields

import numpy as np
import scipy
from numpy.typing import NDArray

from sindyjoint.equation.formula import compile_terms
from sindyjoint.equation.model import JointModel
from sindyjoint.errors import InputError, refuse
from sindyjoint.limits import DISCOVERY, STATES
from sindyjoint.numeric import Array, partials
from sindyjoint.planning import POINTS, PlannedRun, motion
from sindyjoint.response.laws import model_law
from sindyjoint.states import (
    BAND_SHARE,
    MAXIMUM_HARMONICS,
    REPLICATES,
    Harmonics,
    moving_mask,
    rate_limit,
    reversal_guard,
    significant_harmonics,
)


@dataclass(frozen=True)
class Sensors:
    """What reads moment and angle.

    Parameters
    ----------
    sample_rate : float
        Hz.
    noise : float
        RMS noise of a sample as a share of the channel's RMS, where the next two do not say otherwise.
    moment, angle : float, optional
        RMS noise of a sample, N·m and rad.
    moment_resolution, angle_resolution : float, optional
        Step of the reading, N·m and rad: its error is taken for white noise of the RMS step/√12, which holds where
        noise or motion cross many steps (Widrow and Kollár 2008, Quantization Noise).
    """

    sample_rate: float = 1000.0
    noise: float = 0.01
    moment: float | None = None
    angle: float | None = None
    moment_resolution: float | None = None
    angle_resolution: float | None = None

    def __post_init__(self) -> None:
        refuse(
            (not (np.isfinite(value) and value > 0), f"{name} is {value!r}; expected a positive number")
            for name, value in vars(self).items()
            if value is not None
        )

    def of(self, moment: Array, angle: Array) -> tuple[float, float]:
        """Return the RMS noise of moment and angle in a run, that of the resolution included."""
        moment_noise, angle_noise = self.analogue(moment, angle)
        return (
            float(np.hypot(moment_noise, (self.moment_resolution or 0.0) / np.sqrt(12))),
            float(np.hypot(angle_noise, (self.angle_resolution or 0.0) / np.sqrt(12))),
        )

    def analogue(self, moment: Array, angle: Array) -> tuple[float, float]:
        """Return the RMS noise of moment and angle before they are read in steps."""
        return (
            self.moment or self.noise * float(np.sqrt(np.mean(moment**2))),
            self.angle or self.noise * float(np.sqrt(np.mean(angle**2))),
        )


@dataclass(frozen=True, eq=False)
class Information:
    """Information of runs on the coefficients of joints; shapes have a leading axis for each run and joint.

    Parameters
    ----------
    bread : ndarray, shape (..., p, p)
        XᵀX of the moving samples.
    meat : ndarray, shape (..., p, p)
        Covariance of the scores Xᵀe.
    blocks : ndarray, shape (...)
        Replicate blocks.
    """

    bread: Array
    meat: Array
    blocks: Array

    @classmethod
    def of(cls, combine: Callable[..., Array], *parts: Information) -> Information:
        """Return what a function makes of each field of some pieces."""
        return cls(*(combine(*(getattr(part, f.name) for part in parts)) for f in fields(cls)))

    def take(self, runs: Sequence[int]) -> Information:
        """Return that of some of the runs."""
        return Information.of(lambda each: each[[*runs]], self)

    def sum(self) -> Information:
        """Return that of all runs together."""
        return Information.of(lambda each: each.sum(axis=0), self)

    def with_runs(self, other: Information | None) -> Information:
        """Return that of these runs after those of another."""
        if other is None:
            return self
        return Information.of(lambda own, first: np.concatenate([first, own]), self, other)


def stacked(parts: Sequence[Information]) -> Information:
    """Return several pieces along a new leading axis."""
    return Information.of(lambda *each: np.stack(each), *parts)


def run_information(run: PlannedRun, model: JointModel, sensors: Sensors) -> Information:
    """Return the information of a run on a joint.

    Parameters
    ----------
    run : PlannedRun
    model : JointModel
        The joint: its coefficients are taken to be true. What elements with a memory add to the moment is in the motion
        and is taken to be known: their numbers are none of the columns.
    sensors : Sensors

    Raises
    ------
    SimulationError
        When the joint passes its softening limit.
    InputError
        When too few periods of the run are steady.
    """
    frequency, rate = run.frequency, sensors.sample_rate
    points = max(POINTS, round(rate / frequency))
    moved = motion(model_law(model), run.drive, frequency, run.level, points, run.waveform)
    # The first period is left out as start-up.
    periods = int(run.duration * frequency + 1e-9) - 1
    if periods < STATES.fewest:
        raise InputError(f"a run of {run.duration:g} s has {periods} steady periods of {frequency:g} Hz")
    samples = periods * rate / frequency
    period = slice(-points, None)
    angle, moment = moved.angle[period], moved.moment[period]
    if not np.ptp(angle) > 0:
        return _nothing(len(model.terms))
    moment_noise, angle_noise = sensors.of(moment, angle)
    kept, values = _kept_harmonics(angle, rate, frequency, angle_noise * np.sqrt(2 / samples))
    w = 2 * np.pi * frequency
    waves = np.asarray(np.exp(2j * np.pi * np.outer(np.arange(points) / points, kept.orders)), np.complex128)
    states = [(waves * (1j * w * kept.orders) ** order @ values).real for order in range(3)]
    states[0] = states[0] + angle.mean()
    guard = reversal_guard(rate, frequency, frequency * float(kept.orders[-1]))
    slowest = rate_limit(states[1], kept.derivative_noise(frequency, 1), STATES.periodic_rate_share)
    # The cycle has no ends.
    moving = moving_mask(np.tile(states[1], 3), slowest, round(guard * points * frequency / rate))[
        points : 2 * points
    ]
    if not moving.any():
        return _nothing(len(model.terms))
    columns, slopes = _columns(model, [state[moving] for state in states])
    noisy = _noise_columns(waves[moving], (w * kept.orders).astype(float), slopes, model.inertia)
    errors = np.append(angle_noise / np.sqrt(samples), np.tile(kept.standard_error, 2))
    weight = samples / points
    gram = weight * columns.T @ columns
    pulled = weight * columns.T @ noisy * errors
    return Information(
        gram, moment_noise**2 * gram + pulled @ pulled.T, np.array(float(min(REPLICATES, periods)))
    )


def _nothing(size: int) -> Information:
    """Return the information of a run in which the joint sticks all the time: none."""
    return Information(np.zeros((size, size)), np.zeros((size, size)), np.array(1.0))


def _kept_harmonics(
    angle: Array, rate: float, frequency: float, error: float
) -> tuple[Harmonics, NDArray[np.complex128]]:
    """Return which harmonics of a period the processing would keep, and their complex amplitudes."""
    most = int(np.clip(BAND_SHARE * rate / frequency, 1, min(MAXIMUM_HARMONICS, angle.size // 2 - 1)))
    spectrum = np.fft.rfft(angle)[1 : most + 1] * 2 / angle.size
    # As large as they are measured: true amplitude and noise.
    seen = np.sqrt(np.abs(spectrum) ** 2 + 2 * error**2)
    keep = significant_harmonics(seen, np.full(most, error))
    orders = np.flatnonzero(keep) + 1
    return Harmonics(orders, np.full(orders.size, error)), spectrum[keep]


def _columns(model: JointModel, states: Sequence[Array]) -> tuple[Array, tuple[Array, Array]]:
    """Return the terms along a motion, shape (n, p), and the moment's slopes over angle and rate."""
    evaluate = compile_terms([term.expression for term in model.terms])
    *motion, acceleration = states
    by_angle, by_rate = partials(lambda *at: evaluate(*at, acceleration) @ model.coefficients, motion)
    return np.asarray(evaluate(*states)), (by_angle, by_rate)


def _noise_columns(
    waves: NDArray[np.complex128], angular: Array, slopes: tuple[Array, Array], inertia: float
) -> Array:
    """Return by what each number of the angle's series moves the residual: mean, cosines, sines."""
    by_angle, by_rate = slopes
    moved = waves * (by_angle[:, None] + 1j * angular * by_rate[:, None] - angular**2 * inertia)
    return np.column_stack([by_angle, moved.real, moved.imag])


def half_widths(information: Information, noise: np.random.Generator | None = None, draws: int = 1) -> Array:
    """Return the half-widths of the 95 % intervals that a discovery of the runs would report.

    With Student's t on the degrees of freedom that the scatter of blocks leaves (Satterthwaite's rule), and
    n/(n − p) of a small sample.

    Parameters
    ----------
    information : Information
        With axes (runs, joints).
    noise : Generator, optional
        Draw the scatter of the reported variances, too: each run's is χ² on its blocks less one.
    draws : int
        For each joint.

    Returns
    -------
    ndarray, shape (joints, p) or (draws, joints, p)
        Infinite where the runs do not determine the coefficients.
    """
    inverse, singular = _inverse(information.bread.sum(axis=0))
    parts = np.einsum("jkl,rjlm,jmk->rjk", inverse, information.meat, inverse, optimize=True)
    spare = np.maximum(information.blocks - 1, 1)[..., None]
    if noise is not None:
        parts = parts * noise.chisquare(spare, (draws, *parts.shape)) / spare
    total = parts.sum(axis=-3)
    squares = np.sum(parts**2 / spare, axis=-3)
    degrees = np.where(squares > 0, total**2 / np.where(squares > 0, squares, 1.0), 1.0)
    blocks = (information.blocks - 1).sum(axis=0)[:, None]
    widened = total * blocks / np.maximum(blocks - inverse.shape[1], 1)
    widths = scipy.special.stdtrit(np.maximum(degrees, 1), 0.975) * np.sqrt(widened)
    return np.asarray(np.where(singular[:, None], np.inf, widths))


def _inverse(bread: Array) -> tuple[Array, NDArray[np.bool_]]:
    """Return the inverses of matrices XᵀX, shape (..., p, p), and where there is none."""
    scale = np.sqrt(np.einsum("...kk->...k", bread))
    scale = np.where(scale > 0, scale, 1.0)
    scaled = bread / scale[..., :, None] / scale[..., None, :]
    # Of a matrix with a larger condition rounding leaves less than three digits.
    sizes = np.abs(np.linalg.eigvalsh(scaled))
    singular = ~(sizes.max(axis=-1) * np.finfo(float).eps < 1e-3 * sizes.min(axis=-1))
    scaled[singular] = np.eye(scale.shape[-1])
    return np.linalg.inv(scaled) / scale[..., :, None] / scale[..., None, :], singular


def expected_errors(total: Information, coefficients: Array) -> tuple[Array, Array]:
    """Return what sums of information promise of each coefficient, both of shape (..., p).

    Parameters
    ----------
    total : Information
        Sums over runs.
    coefficients : ndarray, shape (joints, p)
        The joints are the last leading axis of the information.

    Returns
    -------
    errors : ndarray
        Standard error of each coefficient; infinite where the runs do not determine it.
    shares : ndarray
        Share of the moment's RMS that each term carries alone: |c| / √(B⁻¹)_kk over √(cᵀBc).
    """
    inverse, singular = _inverse(total.bread)
    spread = inverse @ total.meat @ inverse
    errors = np.sqrt(np.einsum("...kk->...k", spread))
    moment = np.sqrt(
        np.maximum(np.einsum("...k,...kl,...l->...", coefficients, total.bread, coefficients), 1e-300)
    )
    shares = np.abs(coefficients) / np.sqrt(np.einsum("...kk->...k", inverse)) / moment[..., None]
    lost = singular[..., None]
    return np.where(lost, np.inf, errors), np.where(lost, 0.0, shares)


def requirements(errors: Array, shares: Array, coefficients: Array) -> Array:
    """Return by how much each term passes what a discovery asks of it; from one on it is taken."""
    asked = np.maximum(errors * DISCOVERY.term_significance, 1e-300)
    return np.asarray(np.minimum(np.abs(coefficients) / asked, shares / DISCOVERY.accuracy))


def margins(information: Information, coefficients: Array) -> Array:
    """Return by how much each term passes what a discovery of the runs asks of it, shape (joints, p).

    From one on it is taken: it is significant, and carries alone a least share of the moment's RMS.
    """
    _, shares = expected_errors(information.sum(), coefficients)
    return requirements(half_widths(information) / 1.96, shares, coefficients)


def chosen_terms(information: Information, coefficients: Array) -> NDArray[np.bool_]:
    """Return which terms a discovery of the runs is expected to take, shape (joints, p)."""
    return np.asarray(margins(information, coefficients) >= 1.0)


def changes_over_band(information: Information, frequencies: Sequence[float]) -> Array:
    """Return the half-widths of the change of each coefficient over the band, shape (joints, p).

    Of the slope of a straight line through the estimates at single frequencies, weighted by their variance, times the
    band; infinite with fewer than three frequencies.
    """
    groups = np.unique(frequencies)
    if groups.size < 3:
        return np.full(information.meat.shape[1:-1], np.inf)
    runs = [np.flatnonzero(np.isclose(frequencies, frequency)).tolist() for frequency in groups]
    errors = np.array([half_widths(information.take(each)) for each in runs]) / 1.96
    weight = 1 / np.maximum(errors**2, 1e-300)
    f = groups[:, None, None]
    total = np.maximum(weight.sum(axis=0), 1e-300)
    spread = np.sum(weight * (f - (weight * f).sum(axis=0) / total) ** 2, axis=0)
    with np.errstate(divide="ignore"):
        return np.asarray(1.96 * np.ptp(groups) / np.sqrt(spread))
