"""The gap between a model and a measurement, row by row, in units of its own noise.

A periodic run is folded onto one mean period. What the fold cannot repeat is noise of the moment; noise of the angle
enters through the series of harmonics, each of which is uncertain by its own standard error. Both are known, so the
rows of a run have a known covariance, Σ = σ²I + B S Bᵀ with B the moment that an error of each harmonic makes, and
multiplying by the inverse of its Cholesky factor gives rows of independent unit noise: sums of squares are then
likelihoods (linearised errors in variables; Fuller, Measurement Error Models, 1987, section 1.4).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from sindyjoint.discovery.model import JointModel
from sindyjoint.discovery.terms import Reference
from sindyjoint.discrepancy.effects import MeasuredMotion
from sindyjoint.states import ForceStates

Array = NDArray[np.float64]

PHASES = 240
MOST_ROWS = 4000
STRETCHES = 5
FOLLOWED = 20
# The chain itself (truncated series, folded phases) errs by this share of the moment; below it nothing is claimed.
CHAIN_ERROR = 5e-4


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
    whitener : ndarray, shape (m, m) or (m,)
        Multiplies rows so that their noise is independent and of unit variance.
    sigma : ndarray, shape (m,)
        Standard error of each row's moment by the moment's own noise, N·m.
    """

    name: str
    group: str
    level: str | None
    motion: MeasuredMotion
    target: Array
    whitener: Array
    sigma: Array

    def white(self, rows: Array) -> Array:
        """Return rows of columns in units of noise; shape as given, (m,) or (m, k)."""
        if self.whitener.ndim == 2:
            return self.whitener @ rows
        return self.whitener * rows if rows.ndim == 1 else self.whitener[:, None] * rows

    def row_groups(self, alone: bool) -> NDArray[np.object_]:
        """Return what is held out together, per row: the run's group, or stretches of it where the run is alone."""
        if not alone:
            return np.full(self.target.size, self.group, dtype=object)
        return (np.arange(self.target.size) * STRETCHES // self.target.size).astype(object)

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


def gap_runs(
    states: Sequence[ForceStates], model: JointModel, groups: Sequence[str], phases: int = PHASES
) -> tuple[GapRun, ...]:
    """Return the rows of every run.

    Parameters
    ----------
    states : sequence of ForceStates
    model : JointModel
        Its slopes carry errors of the angle into the moment.
    groups : sequence of str
        What is held out together, one label per run.
    phases : int
        Samples of the mean period.
    """
    scale = model.fitted.moment_rms
    return tuple(
        _folded(s, model, g, phases, scale) if s.method == "periodic" else _strided(s, model, g, scale)
        for s, g in zip(states, groups, strict=True)
    )


def row_groups(runs: Sequence[GapRun]) -> NDArray[np.object_]:
    """Return what is held out together, for the stacked rows of all runs."""
    alone = len({run.group for run in runs}) == 1
    if alone and len(runs) > 1:
        return np.concatenate([np.full(run.target.size, run.name, dtype=object) for run in runs])
    return np.concatenate([run.row_groups(alone) for run in runs])


def reference_scales(runs: Sequence[GapRun]) -> Reference:
    """Return the largest angle and rate over the kept samples of all runs."""
    return Reference(
        float(max(np.abs(r.angle).max() for r in runs)), float(max(np.abs(r.rate).max() for r in runs)), None
    )


def slopes(model: JointModel, angle: Array, rate: Array) -> tuple[Array, Array]:
    """Return ∂M/∂θ and ∂M/∂θ̇ of a model's smooth moment along a motion, by central differences.

    The step is a thousandth of the range, and a rate keeps its sign: the friction step is no slope.
    """
    small = 1e-3 * model.fitted.angle
    along = (model.moment(angle + small, rate) - model.moment(angle - small, rate)) / (2 * small)
    tiny = np.minimum(1e-3 * model.fitted.rate, 0.5 * np.abs(rate)) + 1e-300
    across = (model.moment(angle, rate + tiny) - model.moment(angle, rate - tiny)) / (2 * tiny)
    return along, np.where(np.abs(rate) > 1e-9 * model.fitted.rate, across, 0.0)


def _folded(states: ForceStates, model: JointModel, group: str, phases: int, scale: float) -> GapRun:
    """Fold a periodic run onto one mean period and whiten it."""
    assert states.frequency is not None
    phases = min(phases, int(states.sample_rate / states.frequency))
    position = (states.time - states.time[0]) * states.frequency % 1.0
    bins = np.minimum((position * phases).astype(int), phases - 1)
    count = np.bincount(bins, minlength=phases)
    filled = np.maximum(count, 1)

    def mean(signal: Array) -> Array:
        return np.bincount(bins, signal, phases) / filled

    angle, rate, acceleration, moment = map(
        mean, (states.angle, states.rate, states.acceleration, states.moment)
    )
    empty = np.flatnonzero(count == 0)
    if empty.size:
        full = np.flatnonzero(count)
        angle, rate, acceleration, moment = (
            np.interp(np.arange(phases), full, s[full], period=phases)
            for s in (angle, rate, acceleration, moment)
        )
    moving = np.bincount(bins, ~states.moving, phases) == 0
    keep = np.flatnonzero(moving & (count > 0))
    # The mean of a phase is that of its instants over all periods: a moment linear in time keeps its value.
    time = np.interp(np.arange(phases), np.flatnonzero(count), mean(states.time)[count > 0])
    step = 1 / (states.frequency * phases)
    motion = _motion(states, model, angle, rate, acceleration, step, keep, True, time)
    inertia = model.joint.inertia
    sigma = np.sqrt(states.noise.moment**2 / filled[keep] + (CHAIN_ERROR * scale) ** 2)
    whitener = _whitener(states, model, motion, sigma, (np.arange(phases)[keep] + 0.5) / phases)
    target = moment[keep] - (inertia or 0.0) * acceleration[keep]
    return GapRun(states.run, group, states.level, motion, target, whitener, sigma)


def _whitener(
    states: ForceStates, model: JointModel, motion: MeasuredMotion, sigma: Array, phase: Array
) -> Array:
    """Return the inverse Cholesky factor of the rows' covariance."""
    assert states.frequency is not None
    kept = max(1, int(round(states.bandwidth / states.frequency)))
    orders = np.arange(0, kept + 9)
    angular = 2 * np.pi * states.frequency * orders
    stiffness, damping = (s[motion.keep] for s in slopes(model, motion.angle, motion.rate))
    cosine, sine = np.cos(2 * np.pi * np.outer(phase, orders)), np.sin(2 * np.pi * np.outer(phase, orders))
    inertial = model.inertia * angular**2
    carried = [
        stiffness[:, None] * cosine - damping[:, None] * angular * sine + inertial * cosine,
        stiffness[:, None] * sine + damping[:, None] * angular * cosine + inertial * sine,
    ]
    error = np.full(orders.size, np.sqrt(2.0 / states.n_samples) * states.noise.angle)
    error[0] /= np.sqrt(2.0)
    # A harmonic that was cut is anything below the level at which it would have been kept.
    error[kept + 1 :] *= 3.0
    matrix = np.hstack([block * error for block in carried])
    covariance = matrix @ matrix.T
    covariance[np.diag_indices_from(covariance)] += sigma**2
    from scipy.linalg import solve_triangular

    lower = np.linalg.cholesky(covariance)
    return solve_triangular(lower, np.eye(sigma.size), lower=True, check_finite=False)


def _strided(states: ForceStates, model: JointModel, group: str, scale: float) -> GapRun:
    """Take evenly spaced moving samples of a run that does not repeat."""
    # The motion holds nothing above its bandwidth. Internal states are followed on some twenty samples per period of
    # it: fewer than measured where the record is dense, more (by Hermite interpolation) where it is not.
    every = max(1, int(states.sample_rate / (FOLLOWED * states.bandwidth)))
    between = max(1, int(np.ceil(FOLLOWED * states.bandwidth / states.sample_rate))) if every == 1 else 1
    moving = np.flatnonzero(states.moving[::every])
    rows = moving[:: max(1, moving.size // MOST_ROWS)]
    angle, rate, acceleration = (s[::every] for s in (states.angle, states.rate, states.acceleration))
    step = every / states.sample_rate
    target = states.moment[::every][rows] - (model.joint.inertia or 0.0) * acceleration[rows]
    if between > 1:
        jerk = np.gradient(acceleration, step)
        angle, rate, acceleration = (
            hermite(values, slope, step, between)
            for values, slope in ((angle, rate), (rate, acceleration), (acceleration, jerk))
        )
    keep = rows * between
    motion = _motion(states, model, angle, rate, acceleration, step / between, keep, False)
    stiffness, damping = (s[keep] for s in slopes(model, motion.angle, motion.rate))
    noise = states.noise
    variance = (
        noise.moment**2
        + (model.inertia * noise.acceleration) ** 2
        + (damping * noise.rate) ** 2
        + (stiffness * noise.angle) ** 2 * min(1.0, 2 * states.bandwidth / states.sample_rate)
        + (CHAIN_ERROR * scale) ** 2
    )
    sigma = np.sqrt(variance)
    return GapRun(states.run, group, states.level, motion, target, 1 / sigma, sigma)


def hermite(values: Array, slope: Array, step: float, between: int) -> Array:
    """Return a signal at ``between`` instants per sample, by cubic Hermite interpolation of values and slopes."""
    left, right = values[:-1, None], values[1:, None]
    rise, fall = step * slope[:-1, None], step * slope[1:, None]
    u = np.arange(between)[None, :] / between
    inner = (
        (1 + 2 * u) * (1 - u) ** 2 * left
        + u * (1 - u) ** 2 * rise
        + u**2 * (3 - 2 * u) * right
        - u**2 * (1 - u) * fall
    )
    return np.append(inner.ravel(), values[-1])


def _motion(
    states: ForceStates,
    model: JointModel,
    angle: Array,
    rate: Array,
    acceleration: Array,
    step: float,
    keep: NDArray[np.intp],
    repeats: bool,
    time: Array | None = None,
) -> MeasuredMotion:
    stiffness, damping = slopes(model, angle, rate)
    return MeasuredMotion(
        angle=angle,
        rate=rate,
        acceleration=acceleration,
        step=step,
        time=states.time[0] + step * np.arange(angle.size) if time is None else time,
        frequency=states.frequency or 0.0,
        moment_rate=stiffness * rate + damping * acceleration,
        moment_slope=stiffness,
        keep=keep,
        repeats=repeats,
        began=states.began,
    )


def base_columns(model: JointModel, run: GapRun) -> Array:
    """Return the columns of the model's own terms at the kept samples, shape (m, p)."""
    from sindyjoint.discovery.formula import compile_terms

    function = compile_terms([term.expression for term in model.terms])
    return function(run.angle, run.rate, run.acceleration)
