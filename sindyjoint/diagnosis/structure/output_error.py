"""The output-error problem of a pulse test: the residual between records and simulation, and its fit.

Unknown are the model's coefficients, which keep to their covariance, and the numbers of effects. Both are found by a
bounded Gauss–Newton search on the simulated response with horizons that grow: over a long record a slightly wrong
frequency is whole cycles off, and a search that begins with all of it ends in the nearest wrong cycle.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

from sindyjoint.diagnosis.effects.change import Change
from sindyjoint.diagnosis.effects.joint import JointLaws, place_of
from sindyjoint.diagnosis.effects.setup import Setup
from sindyjoint.diagnosis.policy import STRUCTURE, DiagnosisPolicy
from sindyjoint.diagnosis.structure.noise import RecordNoise
from sindyjoint.equation.model import INERTIA, JointModel
from sindyjoint.errors import InputError, SimulationError
from sindyjoint.evidence.score import Evidence, Score
from sindyjoint.mechanics.pulse_test import with_laws
from sindyjoint.mechanics.rigs import MeasuredResponse, Rig
from sindyjoint.numeric import Array

# Step of the differences: in standard errors of a coefficient, and in the scaled numbers of an effect.
STEP_PRIOR, STEP_EFFECT = 0.05, 2e-4
# Parts of the rows, at least, that are predicted one from the others.
GROUPS = 8
# Modes are added to the search only as far as records can show them.
MODES = 6


@dataclass(frozen=True, eq=False)
class Fit:
    """The best numbers of a problem over a horizon.

    Parameters
    ----------
    x : ndarray
        Numbers of the base, then of the candidate.
    cost : float
        Sum of squares of the residuals, prior rows included, in units of noise.
    residual : ndarray, shape (rows,)
    jacobian : ndarray, shape (rows, x.size)
    """

    x: Array
    cost: float
    residual: Array = field(repr=False)
    jacobian: Array = field(repr=False)


class Fitted(Protocol):
    """What a fit asks of a problem."""

    @property
    def base_size(self) -> int:
        """Numbers of the base."""

    @property
    def groups(self) -> NDArray[np.intp]:
        """Of each residual what is predicted together from the others, shape (rows,)."""

    def bounds(self, extra: Change | None = None) -> tuple[Array, Array]:
        """Return lower and upper bounds of the numbers."""

    def residuals(self, x: Array, duration: float, extra: Change | None = None) -> Array | None:
        """Return simulated less measured in units of noise up to a time, then the prior rows; None for no motion."""

    def derivatives(
        self, x: Array, residual: Array, duration: float, places: Sequence[int], extra: Change | None = None
    ) -> Array:
        """Return the columns of the Jacobian at some places."""


@dataclass(frozen=True, eq=False)
class PulseProblem:
    """Records of a rig, a model in its joint, and the effects named so far.

    Parameters
    ----------
    rig : Rig
    places : frozenset of str
        Joints that the model stands for.
    model : JointModel
    laws : JointLaws
    records : tuple of MeasuredResponse
    noise : tuple of RecordNoise
        Of each record.
    found : tuple of Change
    pulse_uncertainty : float
        Relative standard error of the force.
    step_error : tuple of ndarray
        What the time step does to each record, m; empty where it is not known.
    policy : DiagnosisPolicy
    """

    rig: Rig
    places: frozenset[str]
    model: JointModel
    laws: JointLaws
    records: tuple[MeasuredResponse, ...]
    noise: tuple[RecordNoise, ...]
    found: tuple[Change, ...] = ()
    pulse_uncertainty: float = 0.0
    step_error: tuple[Array, ...] = ()
    policy: DiagnosisPolicy = STRUCTURE
    _kept: dict[object, tuple[Array, ...]] = field(default_factory=dict, repr=False)

    @property
    def duration(self) -> float:
        """Of the longest record, s."""
        return max(r.displacement.size / r.sample_rate for r in self.records)

    def rows(self, duration: float | None = None) -> float:
        """Return the effective number of samples up to a time."""
        duration = self.duration if duration is None else duration
        counts = [self.count(record, duration) for record in self.records]
        return sum(count / noise.length for count, noise in zip(counts, self.noise, strict=True))

    @property
    def groups(self) -> NDArray[np.intp]:
        """Of each residual what is predicted together from the others: stretches of the records, and the priors."""
        parts = parted([self.count(record, self.duration) for record in self.records])
        return np.append(parts, np.full(self.priors, parts.max() + 1))

    @property
    def priors(self) -> int:
        """Numbers that have a prior: step, pulse, coefficients of the model."""
        return 2 + self._root.shape[1]

    @property
    def base_size(self) -> int:
        """Numbers of the base."""
        return self.priors + sum(change.size for change in self.found)

    def start(self) -> Array:
        """Return the base without anything added."""
        return np.concatenate([np.zeros(self.priors), *(change.start for change in self.found)])

    @cached_property
    def _root(self) -> Array:
        return prior_root(self.model, self.policy.model_error)

    def setup(self, x: Array, extra: Change | None = None) -> Setup:
        """Return the setup of some numbers."""
        setup = Setup(
            tuple(self.rig.items), 1 / self.rig.clamp_stiffness, self._numbers(x[2 : self.priors]),
            pulse=1 + self.pulse_uncertainty * float(x[1]),
        )  # fmt: skip
        at = self.priors
        for change in (*self.found, *((extra,) if extra is not None else ())):
            setup = change.apply(setup, x[at : at + change.size])
            at += change.size
        return setup

    def _numbers(self, u: Array) -> dict[str, float]:
        moved = self._root @ u
        numbers = {}
        terms = [term for term in self.model.terms if term.id != INERTIA]
        for term, shift in zip(terms, moved, strict=True):
            value = term.coefficient + float(shift)
            if term.id == "coulomb_friction" and term.coefficient >= 0:
                value = max(value, 0.0)
            numbers[place_of(term.id)] = value
        return numbers | self.laws.fixed

    def bounds(self, extra: Change | None = None) -> tuple[Array, Array]:
        """Return lower and upper bounds of the numbers."""
        changes = (*self.found, *((extra,) if extra is not None else ()))
        free = np.full(self.priors, 8.0)
        free[1] *= self.pulse_uncertainty > 0
        return (
            np.concatenate([-free, *(c.low for c in changes)]),
            np.concatenate([free, *(c.high for c in changes)]),
        )

    def simulate(self, setup: Setup, duration: float, step: float | None = None) -> tuple[Array, ...] | None:
        """Return the displacement of each record up to a time, m; None where the simulation fails."""
        motions = self._motion(setup, duration + abs(setup.delay), step)
        if motions is None:
            return None
        shown = []
        for record, motion in zip(self.records, motions, strict=True):
            count = self.count(record, duration)
            time = np.arange(motion.size) / record.sample_rate
            if setup.delay:
                motion = _later(motion, setup.delay, record.sample_rate)
            shown.append(setup.gain * motion[:count] + setup.zero + setup.drift * time[:count])
        return tuple(shown)

    @staticmethod
    def count(record: MeasuredResponse, duration: float) -> int:
        """Return the samples of a record up to a time."""
        return min(record.displacement.size, max(int(round(duration * record.sample_rate)), 8))

    def _motion(self, setup: Setup, duration: float, step: float | None) -> tuple[Array, ...] | None:
        key = (setup.motion_key, duration, step)
        if key in self._kept:
            return self._kept[key]
        if not all(map(np.isfinite, setup.numbers.values())):
            return None  # friction that never becomes steady, for one
        law = self.laws.law(setup)
        rig = with_laws(
            replace(
                self.rig,
                items=setup.items,
                clamp_stiffness=np.inf if setup.compliance <= 0 else 1 / setup.compliance,
                excitation=self.rig.excitation.scaled(setup.pulse),
            ),
            lambda hinge: law if hinge.name in self.places else hinge.law,
        )
        points = tuple(dict.fromkeys(r.point for r in self.records))
        found: dict[float, dict[str, Array]] = {}
        try:
            for rate in {r.sample_rate for r in self.records}:
                found[rate] = rig.respond(
                    points=points, duration=duration, sample_rate=rate, modes=min(rig.modes, MODES),
                    step=rig.step if step is None else step,
                ).displacement  # fmt: skip
        except (SimulationError, InputError, np.linalg.LinAlgError):
            return None
        motions = tuple(found[r.sample_rate][r.point] for r in self.records)
        if not all(np.all(np.isfinite(m)) for m in motions):
            return None
        if len(self._kept) > 64:
            self._kept.clear()
        self._kept[key] = motions
        return motions

    def residuals(self, x: Array, duration: float, extra: Change | None = None) -> Array | None:
        """Return simulated less measured over noise, then the prior rows."""
        shown = self.simulate(self.setup(x, extra), duration)
        if shown is None:
            return None
        parts = []
        for i, (record, noise, signal) in enumerate(zip(self.records, self.noise, shown, strict=True)):
            residual = signal - record.displacement[: signal.size]
            if self.step_error:
                residual = residual + float(x[0]) * self.step_error[i][: signal.size]
            parts.append(residual / noise.weight)
        return np.concatenate([*parts, x[: self.priors]])

    def derivatives(
        self, x: Array, residual: Array, duration: float, places: Sequence[int], extra: Change | None = None
    ) -> Array:
        """Return the columns of the Jacobian at some places, by differences, shape (rows, len(places))."""
        low, high = self.bounds(extra)
        columns = np.zeros((residual.size, len(places)))
        for column, place in enumerate(places):
            step = STEP_PRIOR if place < self.priors else STEP_EFFECT * max(1.0, 0.1 * (high - low)[place])
            if high[place] <= low[place]:
                continue
            step = step if x[place] + step <= high[place] else -step
            moved = x.copy()
            moved[place] += step
            ahead = self.residuals(moved, duration, extra)
            if ahead is None:
                moved[place] -= 2 * step
                ahead, step = self.residuals(moved, duration, extra), -step
            if ahead is not None:
                columns[:, column] = (ahead - residual) / step
        return columns

    def near(self, x: Array) -> PulseProblem:
        """Return the problem for a first look round some numbers: itself."""
        return self

    def prepared(self, x: Array) -> PulseProblem:
        """Return the problem with what the time step does to the response, by Richardson's rule for order two."""
        setup = self.setup(x)
        whole = self.simulate(setup, self.duration)
        half = self.simulate(setup, self.duration, 0.5 * self.rig.step)
        if whole is None or half is None:
            return replace(self, step_error=())
        return replace(self, step_error=tuple(4 / 3 * (b - a) for a, b in zip(whole, half, strict=True)))


def parted(sizes: Sequence[int]) -> NDArray[np.intp]:
    """Return labels of the rows of several pieces, which are cut so that there are enough parts in all."""
    parts = -(-GROUPS // max(len(sizes), 1))
    labels = [place * parts + np.arange(size) * parts // size for place, size in enumerate(sizes) if size]
    return np.concatenate([np.empty(0, dtype=np.intp), *labels])


def score_of(problem: Fitted, found: Any) -> Score:
    """Return the predictive score of a fit of all its numbers, by linearisation where it ended.

    ``found`` has residuals in units of noise and their derivatives.
    """
    labels = np.unique(problem.groups, return_inverse=True)[1]
    evidence = Evidence(-found.residual, labels, np.zeros(labels.size))
    return evidence.score(evidence.add(found.jacobian[:, np.any(found.jacobian != 0, axis=0)]))


def prior_root(model: JointModel, least: float) -> Array:
    """Return L with L·Lᵀ the covariance of a model's coefficients (inertia left out), each ``least`` of itself more."""
    kept = [i for i, term in enumerate(model.terms) if term.id != INERTIA]
    values = model.coefficients[kept]
    covariance = model.covariance_matrix[np.ix_(kept, kept)]
    errors = np.sqrt(np.diag(covariance) + (least * values) ** 2)
    errors[errors == 0] = 1e-12
    matrix = (covariance + np.diag((least * values) ** 2)) / np.outer(errors, errors)
    size, vectors = np.linalg.eigh((matrix + matrix.T) / 2)
    return errors[:, None] * (vectors * np.sqrt(np.maximum(size, 0.0)))


def _later(motion: Array, delay: float, sample_rate: float) -> Array:
    """Return a motion that was at rest before it began, later by a delay, s."""
    from scipy.interpolate import CubicSpline

    time = np.arange(motion.size) / sample_rate
    asked = time - delay
    shown = CubicSpline(time, motion)(np.clip(asked, 0.0, time[-1]))
    return np.where(asked < 0, 0.0, shown)


def fit(
    problem: Fitted,
    x: Array,
    duration: float,
    extra: Change | None = None,
    *,
    base_jacobian: Array | None = None,
    iterations: int = 6,
    tolerance: float = 0.1,
    relative: float = 1e-4,
) -> Fit | None:
    """Return the numbers near `x` that leave least over a horizon, by Levenberg's and Marquardt's method.

    Parameters
    ----------
    problem : Fitted
    x : ndarray
    duration : float
        Horizon, s.
    extra : Change, optional
        A candidate beside what was found.
    base_jacobian : ndarray, optional
        Columns of the base, which are then not worked out but corrected as the search goes (Broyden 1965). The
        candidate's own columns are worked out anew only after a step that fell short of what they promised.
    iterations : int
    tolerance, relative : float
        Fall of the cost, and share of the cost beyond one per row, at which the search ends.

    Returns
    -------
    Fit or None
        ``None`` where the start cannot be simulated.
    """
    low, high = problem.bounds(extra)
    x = np.clip(x, low, high)
    residual = problem.residuals(x, duration, extra)
    if residual is None:
        return None
    cost = float(residual @ residual)
    base = problem.base_size
    own = list(range(base, x.size))
    jacobian = np.zeros((residual.size, x.size))
    fixed = base_jacobian is not None
    if base_jacobian is not None:
        jacobian[:, :base] = base_jacobian
    damping, stale = 1e-3, True
    for _ in range(iterations):
        places = own if fixed else list(range(x.size))
        if stale:
            jacobian[:, places] = problem.derivatives(x, residual, duration, places, extra)
        for _ in range(5):
            step = _step(jacobian, residual, x, low, high, damping)
            trial = problem.residuals(x + step, duration, extra)
            if trial is not None and float(trial @ trial) < cost:
                break
            trial, damping = None, max(damping, 1e-3) * 10
        if trial is None:
            if stale:
                break
            stale, damping = True, 1e-3
            continue
        gain = cost - float(trial @ trial)
        promised = residual + jacobian @ step
        stale = not fixed or gain < 0.7 * (cost - float(promised @ promised))
        if fixed and np.any(step):
            jacobian += np.outer(trial - promised, step) / float(step @ step)
        x, residual, cost = x + step, trial, float(trial @ trial)
        damping = max(damping / 10, 1e-9)
        if gain < max(tolerance, relative * (cost - residual.size)):
            if stale or not fixed or gain < tolerance:
                break
            stale = True
    return Fit(x, cost, residual, jacobian)


def _step(jacobian: Array, residual: Array, x: Array, low: Array, high: Array, damping: float) -> Array:
    """Return a damped Gauss–Newton step inside the bounds; what leans against a bound stays there."""
    step = np.zeros(x.size)
    free = (high > low) & np.any(jacobian != 0, axis=0)
    normal, slope = jacobian.T @ jacobian, jacobian.T @ residual
    for _ in range(x.size + 1):
        at = np.flatnonzero(free)
        if not at.size:
            break
        scale = np.sqrt(np.diag(normal)[at])
        matrix = normal[np.ix_(at, at)] / np.outer(scale, scale)
        right = -(slope[at] + normal[np.ix_(at, np.flatnonzero(~free))] @ step[~free]) / scale
        step[at] = np.linalg.solve(matrix + damping * np.eye(at.size), right) / scale
        out = (x + step < low) | (x + step > high)
        if not np.any(out & free):
            break
        step = np.clip(x + step, low, high) - x
        free &= ~out
    return np.clip(x + step, low, high) - x
