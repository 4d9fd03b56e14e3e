"""One run as rows of independent unit noise: how errors of the angle reach the moment, and what several runs are."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
import scipy
from numpy.typing import NDArray

from sindyjoint.diagnosis.campaign.rows.half_cycles import HalfCycles
from sindyjoint.diagnosis.effects.motion import MeasuredMotion
from sindyjoint.equation.model import JointModel
from sindyjoint.equation.terms import Reference
from sindyjoint.numeric import Array, convolve
from sindyjoint.soundness.policy import POLICY as SOUNDNESS
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
    lower = np.linalg.cholesky(covariance)
    return scipy.linalg.solve_triangular(lower, np.eye(sigma.size), lower=True, check_finite=False)


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
    return scipy.linalg.cholesky_banded(banded, lower=True, check_finite=False), banded[0]


# A run alone is cut into this many stretches; those left out together are spread without a period (golden ratio).
STRETCHES = 20
FOLDS = 5
GOLDEN = 0.6180339887


@dataclass(frozen=True, eq=False)
class GapRun:
    """One run as rows of independent unit noise.

    Parameters
    ----------
    name : str
    group : str
        What is held out together with it.
    level : str or None
    motion : MeasuredMotion
    target : ndarray, shape (m,)
        Transfer moment at the kept samples (moment at the sensor where the inertia is identified), N·m.
    factor : ndarray, shape (m, m) or (bands + 1, m)
        Where folded the inverse of the Cholesky factor of the rows' covariance; else that factor, banded, lower.
    sigma : ndarray, shape (m,)
        Standard error of each row's moment by the moment's own noise, N·m.
    folded : bool
        Whether the rows are a mean period, whose noise repetition has measured.
    variance : float
        Mean variance of the rows by noise, (N·m)²; what a model leaves beyond it is the model's own error.
    noise_share : float
        Share of the variance by which rows are weighted that is noise; the rest is the model's own error.
    band : Band, optional
        Where an acceleration enters: the band within which it is known.
    half_cycles : HalfCycles, optional
        Of a free run: rows are then what a moment changes of its motion, two for each half-cycle.
    record : ndarray, optional
        For pictures: the target of a run that does not repeat at every sample, NaN where the joint sticks.
    processing : ndarray, shape (m,), optional
        What the processing leaves of the model's own simulation, N·m: taken off the target.
    secant : bool
        Whether slopes of the moment are those between the measured angle and the joint's own.
    """

    name: str
    group: str
    level: str | None
    motion: MeasuredMotion
    target: Array
    factor: Array
    sigma: Array
    folded: bool
    variance: float = 0.0
    band: Band | None = None
    half_cycles: HalfCycles | None = None
    record: Array | None = None
    processing: Array | None = None
    noise_share: float = 1.0
    secant: bool = False

    def whole(self) -> GapRun:
        """Return the run with every moving sample of its record as a row; its noise is not that of these rows."""
        if self.record is None:
            return self
        between = max(1, (self.motion.angle.size - 1) // max(1, self.record.size - 1))
        rows = np.flatnonzero(np.isfinite(self.record))
        return replace(self, motion=replace(self.motion, keep=rows * between), target=self.record[rows])

    def white(self, rows: Array) -> Array:
        """Return rows of columns, (m,) or (m, k), in units of independent noise; as many, but in free motion."""
        if self.half_cycles is not None:
            return self.half_cycles.white(rows)
        if self.folded:
            return self.factor @ rows
        solution, _ = scipy.linalg.lapack.dtbtrs(self.factor, rows, uplo="L")
        return solution.reshape(rows.shape)

    @property
    def white_size(self) -> int:
        """Number of rows of independent noise."""
        return self.target.size if self.half_cycles is None else self.half_cycles.size

    def row_groups(self, alone: bool, size: int) -> NDArray[np.object_]:
        """Return what is held out together, per row: the run's group, or stretches of it where the run is alone."""
        if not alone:
            return np.full(size, self.group, dtype=object)
        stretch = np.arange(size) * STRETCHES // size
        return (stretch * GOLDEN % 1 * FOLDS).astype(int).astype(object)

    def rough(self) -> GapRun:
        """Return the run for searching nonlinear parameters: internal states are integrated in longer steps."""
        return replace(self, motion=self.motion.rough())

    @property
    def angle(self) -> Array:
        """Angle at the kept samples, rad."""
        return self.motion.angle[self.motion.keep]

    @property
    def rate(self) -> Array:
        """Rate at the kept samples, rad/s."""
        return self.motion.rate[self.motion.keep]

    @property
    def acceleration(self) -> Array:
        """Acceleration at the kept samples, rad/s²."""
        return self.motion.acceleration[self.motion.keep]

    @property
    def inputs(self) -> dict[str, Array]:
        """Declared inputs at the kept samples."""
        return {name: values[self.motion.keep] for name, values in self.motion.inputs.items()}


@dataclass(frozen=True, eq=False)
class Band:
    """A low-pass over the even grid from which rows were taken."""

    kernel: Array
    places: NDArray[np.intp]

    def within(self, residual: Array) -> Array:
        """Return a residual at the rows within the band, shape (m,); gaps between rows are bridged."""
        grid = np.interp(np.arange(self.places[0], self.places[-1] + 1), self.places, residual)
        half = self.kernel.size // 2
        smooth = convolve(np.pad(grid, half, mode="edge"), self.kernel)
        return smooth[self.places - self.places[0]]


def row_groups(runs: Sequence[GapRun], white: bool = False) -> NDArray[np.object_]:
    """Return what is held out together, for the stacked rows of all runs: of moments, or of independent noise."""
    sizes = [run.white_size if white else run.target.size for run in runs]
    alone = len({run.group for run in runs}) == 1
    if alone and len(runs) > 1:
        return np.concatenate(
            [np.full(size, run.name, dtype=object) for run, size in zip(runs, sizes, strict=True)]
        )
    return np.concatenate([run.row_groups(alone, size) for run, size in zip(runs, sizes, strict=True)])


def reference_scales(runs: Sequence[GapRun]) -> Reference:
    """Return the largest angle and rate over the kept samples of all runs; and half of the range of a shifted angle."""
    angle = np.concatenate([run.angle for run in runs])
    rate = max(float(np.abs(run.rate).max()) for run in runs)
    largest, swing = float(np.abs(angle).max()), float(np.ptp(angle)) / 2
    return Reference(largest, rate, swing=swing if largest > (1 + SOUNDNESS.far_offset) * swing else None)
