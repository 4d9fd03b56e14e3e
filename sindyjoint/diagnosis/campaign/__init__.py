"""Diagnosis of a campaign: each run as rows of independent unit noise, of moments or of what they change of a motion.

Errors of the angle reach the moment through the law's slopes.

In a decay no moment is measured, and a small dissipation hides in the noise of the acceleration; in the motion itself
it adds up. Along the measured motion an error r of the moment moves the simulated state x = (δ, δ̇) by

    I·δ̈ + ∂M/∂θ̇·δ̇ + ∂M/∂θ·δ = r,    x(end) = Φ(end, start)·x(start) + ∫ Φ(end, s)·(0, 1/I)·r(s) ds

with the transition matrix Φ of the linearised model. The integral over one half-cycle is an energy and a timing: two
rows. Within it noise of the angle cancels exactly, since the integrand is a total derivative of it; only the states at
its two ends are uncertain, and neighbouring half-cycles share one of them. This is multiple shooting (Bock 1983),
linearised; the integrands are the test functions of a weak form.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace

import numpy as np
import scipy
from numpy.typing import NDArray

from sindyjoint.diagnosis.effects.setup import MeasuredMotion
from sindyjoint.diagnosis.policy import CAMPAIGN, DiagnosisPolicy
from sindyjoint.equation.model import JointModel
from sindyjoint.equation.terms import Reference
from sindyjoint.limits import SOUNDNESS
from sindyjoint.numeric import Array, convolve
from sindyjoint.states import WIDEST, ForceStates, smoothing_kernels


@dataclass(frozen=True, eq=False)
class HalfCycles:
    """The rows of a free run.

    Parameters
    ----------
    starts : ndarray of int, shape (half_cycles,)
        First sample of each half-cycle.
    integrand : ndarray, shape (m, 2)
        What a moment at each sample does to angle and (scaled) rate at the end of its half-cycle.
    """

    starts: NDArray[np.intp]
    integrand: Array
    _factor: Array = field(repr=False)

    @classmethod
    def build(
        cls, rate: Array, step: float, slopes: tuple[Array, Array], inertia: float, limit: float,
        noise: tuple[float, float], policy: DiagnosisPolicy = CAMPAIGN,
    ) -> HalfCycles | None:  # fmt: skip
        """Return the rows of a run, or None where it has too few of them.

        Parameters
        ----------
        rate : ndarray, shape (m,)
            rad/s, every ``step`` s.
        step : float
            s.
        slopes : (ndarray, ndarray), each of shape (m,)
            ∂M/∂θ, N·m/rad, and ∂M/∂θ̇, N·m·s/rad.
        inertia : float
            kg·m².
        limit : float
            A rate below it has no sign, rad/s.
        noise : (float, float)
            Standard errors of angle, rad, and rate, rad/s, at a sample.
        policy : DiagnosisPolicy
        """
        ends = reversals(rate, limit)
        if ends.size < policy.fewest_half_cycles:
            return None
        starts = np.concatenate([[0], ends])
        angular = np.pi / (step * float(np.median(np.diff(ends))))
        stiffness, damping = slopes
        # What nothing drives gains no energy, whatever the terms alone say beside an element that dissipates.
        damping = damping if np.mean(damping) >= 0 else np.maximum(damping, 0.0)
        onward = transition_steps((stiffness, damping), inertia, step, angular)
        transitions = np.empty((rate.size, 2, 2))
        ahead = np.eye(2)
        last = set((starts[1:] - 1).tolist())
        for k in range(rate.size - 1, -1, -1):
            ahead = (np.eye(2) if k in last else ahead) @ onward[k]
            transitions[k] = ahead
        # The rate of the state is in units of ω, so that both of its numbers are angles.
        integrand = transitions[:, :, 1] * step / (inertia * angular)
        return cls(
            starts,
            integrand,
            _covariance_factor(transitions[starts], np.array([noise[0], noise[1] / angular])),
        )

    @property
    def size(self) -> int:
        """Number of rows."""
        return 2 * self.starts.size

    def plain(self, moments: Array) -> Array:
        """Return what moments, shape (m,) or (m, k), change of angle and scaled rate at the ends of half-cycles."""
        columns = moments.reshape(moments.shape[0], -1)
        parts = [np.add.reduceat(w[:, None] * columns, self.starts) for w in self.integrand.T]
        return np.stack(parts, axis=1).reshape(self.size, *moments.shape[1:])

    def white(self, moments: Array) -> Array:
        """Return the same in units of independent noise."""
        rows = self.plain(moments)
        solution, _ = scipy.linalg.lapack.dtbtrs(self._factor, rows, uplo="L")
        return solution.reshape(rows.shape)


def reversals(rate: Array, limit: float) -> NDArray[np.intp]:
    """Return the first samples after the rate has changed its sign for good: it passed ``limit`` on both sides."""
    sign = np.where(np.abs(rate) > limit, np.sign(rate), 0)
    fast = np.flatnonzero(sign)
    turns = np.flatnonzero(np.diff(sign[fast]))
    before, after = fast[turns], fast[turns + 1]
    return np.array(
        [a + 1 + int(np.argmin(np.abs(rate[a + 1 : b + 1]))) for a, b in zip(before, after, strict=True)],
        dtype=np.intp,
    )


def _covariance_factor(transition: Array, noise: Array) -> Array:
    """Return the banded Cholesky factor of the rows' covariance: each is e(end) − Φ·e(start) of errors e."""
    spread = np.diag(noise**2)
    own = spread + transition @ spread @ transition.transpose(0, 2, 1)
    shared = -transition[1:] @ spread
    banded = np.zeros((4, 2 * transition.shape[0]))
    banded[0] = np.array([own[:, 0, 0], own[:, 1, 1]]).T.ravel()
    banded[1, 0::2] = own[:, 1, 0]
    banded[2, 0:-2:2], banded[1, 1:-2:2] = shared[:, 0, 0], shared[:, 0, 1]
    banded[3, 0:-2:2], banded[2, 1:-2:2] = shared[:, 1, 0], shared[:, 1, 1]
    return scipy.linalg.cholesky_banded(banded, lower=True, check_finite=False)


def transition_steps(slopes: tuple[Array, Array], inertia: float, step: float, angular: float) -> Array:
    """Return exp(A) of the linearised state equation over one step at each sample, shape (m, 2, 2).

    With h half the trace of A and q² = h² − det A, exp(A) = eʰ·(cosh q·1 + sinh q/q·(A − h·1)).
    """
    stiffness, damping = slopes
    change = np.zeros((stiffness.size, 2, 2))
    change[:, 0, 1] = angular * step
    change[:, 1, 0] = -stiffness / (inertia * angular) * step
    change[:, 1, 1] = -damping / inertia * step
    half = 0.5 * change[:, 1, 1]
    square = half**2 + change[:, 0, 1] * change[:, 1, 0]
    q = np.sqrt(square.astype(complex))
    # Where the slope of friction is steep cosh q alone would overflow.
    rising, falling = np.exp(half + q), np.exp(half - q)
    # Here sinh q/q is its series, which errs by q⁴/120.
    small = np.abs(q) < 1e-4
    series = np.exp(half) * (1 + square / 6)
    even = 0.5 * (rising + falling).real
    odd = np.where(small, series, (0.5 * (rising - falling) / np.where(small, 1.0, q)).real)
    identity = np.eye(2)
    shifted: Array = change - half[:, None, None] * identity
    return even[:, None, None] * identity + odd[:, None, None] * shifted


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
    # How far beyond the bandwidth of a smoothed angle its unknown rest is accounted for.
    cutoff = min(2.0 * states.bandwidth, WIDEST * states.sample_rate)
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
        # Negative or zero: row j is later than column i.
        lag = samples[: samples.size - band] - samples[band:]
        inside = -lag <= longest
        place = np.where(inside, lag, 0) + longest
        row = sum(one[: lag.size] * other[band:] * correlation[place] for one, other, correlation in pairs)
        banded[band, : lag.size] = np.where(inside, row, 0.0)
    banded[0] += sigma**2
    return scipy.linalg.cholesky_banded(banded, lower=True, check_finite=False), banded[0]


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

    @property
    def passed(self) -> float:
        """Share of the variance of white noise that lies within the band."""
        return float(self.kernel @ self.kernel)

    def within(self, residual: Array) -> Array:
        """Return a residual at the rows within the band, shape (m,); gaps between rows are bridged."""
        grid = np.interp(np.arange(self.places[0], self.places[-1] + 1), self.places, residual)
        half = self.kernel.size // 2
        smooth = convolve(np.pad(grid, half, mode="edge"), self.kernel)
        return smooth[self.places - self.places[0]]


def row_groups(runs: Sequence[GapRun], white: bool = False) -> NDArray[np.object_]:
    """Return what is held out together, for the stacked rows of all runs: of moments, or of independent noise.

    That is a run's group; runs of one group are left out one by one, and of a run alone stretches.
    """
    sizes = [run.white_size if white else run.target.size for run in runs]
    if len(runs) == 1:
        # It is cut into twenty; those left out together are spread without a period (golden ratio).
        stretch = np.arange(sizes[0]) * 20 // sizes[0]
        return (stretch * 0.6180339887 % 1 * 5).astype(int).astype(object)
    alone = len({run.group for run in runs}) == 1
    return np.repeat(np.array([run.name if alone else run.group for run in runs], dtype=object), sizes)


def reference_scales(runs: Sequence[GapRun]) -> Reference:
    """Return the largest angle and rate over the kept samples of all runs; and half of the range of a shifted angle."""
    angle = np.concatenate([run.angle for run in runs])
    rate = max(float(np.abs(run.rate).max()) for run in runs)
    largest, swing = float(np.abs(angle).max()), float(np.ptp(angle)) / 2
    return Reference(largest, rate, swing=swing if largest > (1 + SOUNDNESS.far_offset) * swing else None)
