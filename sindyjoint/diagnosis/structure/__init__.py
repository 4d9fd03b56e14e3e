"""Diagnosis of a structure by output error: the residual of the simulated response, its fit, and what that predicts.

Unknown are numbers of laws and structure, which keep to their covariance, and those of effects. Both are found by a
bounded Gauss–Newton search on the simulated response.
"""

from collections.abc import Callable, Sequence
from contextlib import suppress
from dataclasses import dataclass, field
from typing import Any, Protocol, Self, TypeVar

import numpy as np

from sindyjoint.diagnosis.effects.change import Change
from sindyjoint.diagnosis.effects.setup import Setup
from sindyjoint.diagnosis.evidence import GROUPS, Evidence, Score
from sindyjoint.errors import InputError, SimulationError
from sindyjoint.numeric import Array, Integers
from sindyjoint.record import LARGEST

Made = TypeVar("Made")

# Step of the differences, in standard errors of numbers that have a prior: a simulation in time has events, and a
# smaller one would see them.
STEP_PRIOR = 0.05


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


@dataclass(frozen=True, eq=False)
class FittedChange(Fit):
    """A candidate with its best numbers, those of the base beside it first.

    Parameters
    ----------
    change : Change
    gain : float
        Fall of χ².
    """

    change: Change
    gain: float

    @property
    def name(self) -> str:
        """Id of the effect."""
        return self.change.effect.id

    @property
    def family(self) -> str:
        """Of the effect."""
        return self.change.effect.family

    @property
    def own(self) -> Array:
        """The candidate's own numbers."""
        return self.x[self.x.size - self.change.size :]

    @property
    def parameters(self) -> dict[str, float]:
        """The candidate's own numbers by name, SI."""
        return self.change.report(self.own)


class OutputError(Protocol):
    """A measured response, and a simulated one whose numbers are fitted: those that have a prior, then of effects."""

    found: tuple[Change, ...]
    _kept: dict[Any, Any]

    @property
    def priors(self) -> int:
        """Numbers of structure and laws, which come first."""

    @property
    def free(self) -> Array:
        """How far each of these may move."""

    @property
    def groups(self) -> Integers:
        """Of each residual what is predicted together from the others, shape (rows,)."""

    def residuals(self, x: Array, duration: float, extra: Change | None = None) -> Array | None:
        """Return simulated less measured in units of noise up to a time, prior rows among them; None for no motion."""

    def derivatives(
        self, x: Array, residual: Array, duration: float, places: Sequence[int], extra: Change | None = None
    ) -> Array:
        """Return the columns of the Jacobian at some places, shape (rows, len(places))."""

    def near(self, x: Array) -> Self:
        """Return the problem for a first look round some numbers: itself, unless there is a quicker one."""
        return self

    def prepared(self, x: Array) -> Self:
        """Return the problem for a search from some numbers; it is weighed as before, so that gains compare."""
        return self

    @property
    def base_size(self) -> int:
        """Numbers of the base."""
        return self.priors + sum(change.size for change in self.found)

    def start(self) -> Array:
        """Return the base without anything added."""
        return np.concatenate([np.zeros(self.priors), *(change.start for change in self.found)])

    def bounds(self, extra: Change | None = None) -> tuple[Array, Array]:
        """Return lower and upper bounds of the numbers."""
        changes = self._changes(extra)
        low, high = [-self.free, *(c.low for c in changes)], [self.free, *(c.high for c in changes)]
        return np.concatenate(low), np.concatenate(high)

    def _changes(self, extra: Change | None) -> tuple[Change, ...]:
        return (*self.found, *((extra,) if extra is not None else ()))

    def _once(self, key: object, make: Callable[[], Made], most: int = 200) -> Made:
        """Return what is kept under a key, of so many at most, or else made."""
        found = self._kept.get(key, self)
        if found is self:
            found = make()
            if len(self._kept) > most:
                self._kept.clear()
            self._kept[key] = found
        return found

    def changed(self, setup: Setup, x: Array, extra: Change | None = None) -> Setup:
        """Return a setup with the effects found, and an extra one."""
        at = self.priors
        for change in self._changes(extra):
            setup = change.apply(setup, x[at : at + change.size])
            at += change.size
        return setup


def attempted(make: Callable[..., Made], *given: Any) -> Made | None:
    """Return what is made of something given; None without a motion."""
    with suppress(SimulationError, InputError, np.linalg.LinAlgError):
        return make(*given)
    return None


def differences(
    evaluate: Callable[[Array], Array | None],
    x: Array,
    here: Array,
    places: Sequence[int],
    steps: Array,
    high: Array,
) -> Array:
    """Return the columns of a Jacobian by differences, shape (rows, len(places)), to the side that can be evaluated.

    Parameters
    ----------
    evaluate : callable
    x : ndarray, shape (n,)
    here : ndarray, shape (rows,)
        What it returns there.
    places : sequence of int
    steps, high : ndarray, shape (n,)
        Steps, and upper bounds, which are not passed; a step of zero leaves a column of zeros.
    """
    columns = np.zeros((here.size, len(places)))
    for column, place in enumerate(places):
        step = steps[place] if x[place] + steps[place] <= high[place] else -steps[place]
        for way in (step, -step) if step else ():
            moved = x.copy()
            moved[place] += way
            ahead = evaluate(moved)
            # A law that pushes without bound has no derivative.
            if ahead is not None and np.all(np.abs(ahead) < LARGEST):
                columns[:, column] = (ahead - here) / way
                break
    return columns


def covariance_of(jacobian: Array) -> Array:
    """Return the covariance of the numbers of a fit, from its Jacobian in units of noise."""
    normal = jacobian.T @ jacobian
    scale = np.sqrt(np.diag(normal))
    sizes = np.outer(scale, scale)
    sizes[sizes == 0] = 1.0
    return np.asarray(np.linalg.pinv(normal / sizes, hermitian=True) / sizes)


def parted(sizes: Sequence[int]) -> Integers:
    """Return labels of the rows of several pieces, which are cut so that there are enough parts in all."""
    parts = -(-GROUPS // max(len(sizes), 1))
    labels = [place * parts + np.arange(size) * parts // size for place, size in enumerate(sizes) if size]
    return np.concatenate([np.empty(0, dtype=np.intp), *labels])


def score_of(problem: OutputError, found: Fit) -> Score:
    """Return the predictive score of a fit of all its numbers, by linearisation where it ended."""
    labels = np.unique(problem.groups, return_inverse=True)[1]
    evidence = Evidence(-found.residual, labels, np.zeros(labels.size))
    return evidence.score(evidence.add(found.jacobian[:, np.any(found.jacobian != 0, axis=0)]))


def fit(
    problem: OutputError,
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
    problem : OutputError
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
