"""Laws that no catalogue names: what each kind of them predicts of a campaign's gap, on runs that it never saw.

A surface over (θ, θ̇) stands for every memoryless law. Stop operators of several thresholds (a Prandtl-Ishlinskii
model; Visintin, Differential Models of Hysteresis, 1994, chapter III) and relaxations of several times (a generalised
Maxwell model) stand for laws with a memory. Columns in frequency, time and acceleration stand for what differs between
runs.
"""

from collections.abc import Sequence
from functools import cache, cached_property

import numpy as np
import scipy
from numba import njit
from numpy.typing import NDArray

from sindyjoint.diagnosis.campaign import GapRun, row_groups
from sindyjoint.diagnosis.campaign.regression import GapRegression, stack
from sindyjoint.diagnosis.parts import Budget, divide_gap
from sindyjoint.diagnosis.policy import DiagnosisPolicy
from sindyjoint.equation.terms import Reference
from sindyjoint.numeric import ROUNDING, Array

TURNS = 3


def surface_columns(run: GapRun, reference: Reference) -> Array:
    """Return a basis of functions of (θ, θ̇) that may jump at θ̇ = 0, shape (m, k); piecewise linear between knots."""
    x, v = run.angle / (reference.angle or 1.0), run.rate / (reference.rate or 1.0)
    forward = (v > 0)[:, None]
    angle, rate, fine_angle, fine_rate = _knots()
    sheet = (hats(x, angle)[:, :, None] * hats(np.abs(v), rate)[:, None, :]).reshape(x.size, -1)
    along, across = hats(x, fine_angle), hats(np.abs(v), fine_rate)
    return np.hstack(
        [
            sheet * forward,
            sheet * ~forward,
            along,
            along * np.sign(v)[:, None],
            across * forward,
            across * ~forward,
        ]
    )


@cache
def surface_roughness() -> Array:
    """Return the quadratic form c'Rc ≈ ∫|∂²f|² of the surface's coefficients, shape (k, k)."""
    angle, rate, fine_angle, fine_rate = _knots()
    sheet = np.kron(_bend(angle.size, 2.0), np.eye(rate.size)) + np.kron(
        np.eye(angle.size), _bend(rate.size, 1.0)
    )
    along, across = _bend(fine_angle.size, 2.0), _bend(fine_rate.size, 1.0)
    rough: Array = scipy.linalg.block_diag(sheet, sheet, along, along, across, across)
    return rough


def hats(x: Array, knots: Array) -> Array:
    """Return piecewise linear hat functions on knots, constant beyond the ends, shape (n, knots)."""
    place = np.interp(x, knots, np.arange(knots.size))
    return np.maximum(0.0, 1 - np.abs(place[:, None] - np.arange(knots.size)[None, :]))


def _knots() -> tuple[Array, Array, Array, Array]:
    # Stribeck friction lives near rest: knots of the rate lie closer there.
    return (
        np.linspace(-1, 1, 9),
        np.linspace(0, 1, 5),
        np.linspace(-1, 1, 49),
        np.linspace(0, 1, 15) ** 2,
    )


def _bend(count: int, length: float) -> Array:
    """Return D'D of second differences, in the scale of the integral of the second derivative squared."""
    second = np.diff(np.eye(count), 2, axis=0)
    return second.T @ second * ((count - 1) / length) ** 3


def relaxation_columns(run: GapRun, pulse: float) -> Array:
    """Return the angle as Maxwell branches of several times forget it, ż = θ̇ − z/τ, shape (m, 5).

    ``pulse`` is the angular frequency that all runs have on the whole, rad/s.
    """
    motion = run.motion
    # Relaxation times, in units of the motion's own 1/ω.
    return forgotten(motion.angle, motion.step, np.array([0.15, 0.4, 1.0, 2.5, 6.0]) / pulse, motion.repeats)[
        motion.keep
    ]


def stop_columns(run: GapRun, largest: float) -> Array:
    """Return stop operators of several thresholds, alone and behind a gap, shape (m, 27).

    ``largest`` is the largest angle of all runs, rad.
    """
    # Thresholds, as shares of the largest angle.
    motion, thresholds = run.motion, largest * np.geomspace(0.015, 0.8, 9)
    z = stopped(motion.angle, thresholds, motion.repeats)[motion.keep]
    return np.hstack(
        [z, *(np.sign(z) * np.maximum(np.abs(z) - gap * thresholds, 0.0) for gap in (0.6, 0.85))]
    )


@njit(cache=True, no_cfunc_wrapper=True)
def stopped(angle, thresholds, repeats):
    """Return stop operators along an angle, z ← min(max(z + Δθ, −r), r), shape (n, thresholds), rad.

    An angle that ``repeats`` is one period, and is run through until its states have settled.
    """
    states = np.empty((angle.size, thresholds.size))
    z = np.zeros(thresholds.size)
    for turn in range(TURNS if repeats else 1):
        for i in range(angle.size):
            change = angle[i] - angle[i - 1] if i > 0 else (angle[0] - angle[-1] if turn > 0 else 0.0)
            for j in range(thresholds.size):
                z[j] = min(max(z[j] + change, -thresholds[j]), thresholds[j])
                states[i, j] = z[j]
    return states


@njit(cache=True, no_cfunc_wrapper=True)
def forgotten(angle, step, times, repeats):
    """Return relaxations along an angle, exact where it is linear between samples, shape (n, times), rad."""
    states = np.empty((angle.size, times.size))
    z = np.zeros(times.size)
    for turn in range(TURNS if repeats else 1):
        for i in range(angle.size):
            change = angle[i] - angle[i - 1] if i > 0 else (angle[0] - angle[-1] if turn > 0 else 0.0)
            for j in range(times.size):
                kept = np.exp(-step / times[j])
                z[j] = kept * z[j] + change * (1 - kept) * times[j] / step
                states[i, j] = z[j]
    return states


def frequency_columns(run: GapRun, middle: float) -> Array:
    """Return stiffness and damping that grow with the excitation frequency, from ``middle`` Hz, shape (m, 2)."""
    # Frequencies that differ by rounding are one.
    off = round(run.motion.frequency - middle, 9)
    return np.column_stack([off * run.angle, off * run.rate])


def inertial_columns(run: GapRun) -> Array:
    """Return the acceleration: at one frequency it is a stiffness, shape (m, 1).

    Zero where the run moves freely: its moment is then that of its own inertia, which any multiple of it would explain.
    """
    own, target = run.acceleration, run.target
    cosine = float(own @ target) / max(float(np.linalg.norm(own) * np.linalg.norm(target)), 1e-300)
    return np.zeros((own.size, 1)) if abs(cosine) > 1 - ROUNDING else own[:, None]


def time_columns(run: GapRun, middle: float) -> Array:
    """Return moment, stiffness and damping that grow along the run, and stiffness over all runs, shape (m, 4)."""
    time = np.round(run.motion.time[run.motion.keep] - middle, 9)
    return np.column_stack([time, time * run.angle, time * run.rate, (time + run.motion.began) * run.angle])


def own_pulse(runs: Sequence[GapRun]) -> float:
    """Return RMS rate over RMS angle of all runs, rad/s."""
    angle, rate = (np.concatenate([getattr(r, name) for r in runs]) for name in ("angle", "rate"))
    return float(np.sqrt(np.mean(rate**2) / max(float(np.mean(angle**2)), 1e-300))) or 1.0


LEAST_SHRINKAGE = 1e-8

BASE = "base"
#: Kinds of law, and of each the sets of columns that may stand for it.
KINDS: dict[str, tuple[tuple[str, ...], ...]] = {
    "state": (("surface",),),
    "history": (("relaxations",), ("stops",), ("relaxations", "stops")),
    "run": (("frequency",), ("acceleration",), ("time",), ("frequency", "acceleration", "time")),
}


# Blocks of rows to predict, each with those to predict it from.
Folds = tuple[tuple[int, tuple[int, ...]], ...]


class Prediction:
    """The held-out errors of families of laws on one gap.

    Parameters
    ----------
    problem : GapRegression
    """

    def __init__(self, problem: GapRegression) -> None:
        self.labels, self.folds = _folds(problem)
        self.blocks = [self.labels == label for label in dict.fromkeys(self.labels.tolist())]
        self._problem = problem
        self._columns = _columns(problem)
        ends = np.cumsum([0, *(c.shape[1] for c in self._columns.values())])
        self._place = {n: np.arange(a, b) for n, a, b in zip(self._columns, ends[:-1], ends[1:], strict=True)}
        self.rows = sum(int(np.count_nonzero(self.blocks[out])) for out, _ in self.folds)

    @cached_property
    def _products(self) -> tuple[list[Array], list[Array], list[float]]:
        """Return X'X, X'y and y'y of every block."""
        columns, target = np.hstack(list(self._columns.values())), self._problem.residual
        parts = [(columns[rows], target[rows]) for rows in self.blocks]
        return [x.T @ x for x, _ in parts], [x.T @ y for x, y in parts], [float(y @ y) for _, y in parts]

    @cached_property
    def _known(self) -> dict[tuple[int, ...], tuple[Array, Array]]:
        """Return X'X and X'y of every set of blocks that others are predicted from."""
        square, product, _ = self._products
        sets = dict.fromkeys(known for _, known in self.folds)
        return {
            known: (np.sum([square[i] for i in known], axis=0), np.sum([product[i] for i in known], axis=0))
            for known in sets
        }

    @cached_property
    def base(self) -> float:
        """Squared error of the model's own terms."""
        return self._error((BASE,), 0.0, LEAST_SHRINKAGE)

    def best(self, kind: str, beside: tuple[str, ...] = ()) -> tuple[float, tuple[str, ...]]:
        """Return the least squared error that a set of a kind's columns leaves beside other columns, and all these."""
        tried = [
            (self._least((BASE, *beside, *names)), (*beside, *names)) for names in KINDS[kind]
            if all(self._columns[name].shape[1] for name in names)
        ]  # fmt: skip
        return min(tried, key=lambda each: each[0], default=(np.inf, beside))

    def _least(self, names: tuple[str, ...]) -> float:
        smooth = (1e-6, 1e-4, 1e-2, 1.0) if "surface" in names else (0.0,)
        shrink = (1e-6, 1e-4, 1e-2) if set(names) - {BASE, "surface"} else (LEAST_SHRINKAGE,)
        return min(self._error(names, a, b) for a in smooth for b in shrink)

    def _error(self, names: tuple[str, ...], smoothness: float, shrinkage: float) -> float:
        """Return the squared error, over all folds, of a penalised fit to the known blocks."""
        square, product, own = self._products
        use = np.concatenate([self._place[name] for name in names])
        grid = np.ix_(use, use)
        penalty = self._penalty(names, smoothness, shrinkage)
        solved = {
            known: np.linalg.solve(normal[grid] + penalty, right[use])
            for known, (normal, right) in self._known.items()
        }
        total = 0.0
        for out, known in self.folds:
            c = solved[known]
            total += own[out] - 2 * float(c @ product[out][use])
            total += float(c @ square[out][grid] @ c)
        return total

    def _penalty(self, names: tuple[str, ...], smoothness: float, shrinkage: float) -> Array:
        parts = []
        for name in names:
            identity = np.eye(self._place[name].size)
            if name == "surface":
                parts.append(smoothness * surface_roughness() + LEAST_SHRINKAGE * identity)
            else:
                parts.append((LEAST_SHRINKAGE if name == BASE else shrinkage) * identity)
        penalty: Array = scipy.linalg.block_diag(*parts)
        return penalty


def _columns(problem: GapRegression) -> dict[str, Array]:
    """Return the whitened columns of every set, each set of unit norm on the whole; a set that is zero is empty."""
    runs, reference = problem.runs, problem.reference
    pulse = own_pulse(runs)
    frequency = float(np.mean([run.motion.frequency for run in runs]))
    time = float(np.mean([np.mean(run.motion.time) for run in runs]))
    sets = {
        "surface": stack(runs, lambda run: surface_columns(run, reference)),
        "relaxations": stack(runs, lambda run: relaxation_columns(run, pulse)),
        "stops": stack(runs, lambda run: stop_columns(run, reference.angle or 1.0)),
        "frequency": stack(runs, lambda run: frequency_columns(run, frequency)),
        "acceleration": stack(runs, inertial_columns),
        "time": stack(runs, lambda run: time_columns(run, time)),
    }
    # The surface's columns keep their ratio, on which its smoothness rests.
    own = {
        name: columns / float(np.sqrt(np.mean(np.sum(columns**2, axis=0))))
        if name == "surface"
        else _normed(columns)
        for name, columns in sets.items()
    }
    return {BASE: _normed(problem.base), **own}


def _normed(columns: Array) -> Array:
    """Return columns of unit norm; those that are zero are left out."""
    norm = np.linalg.norm(columns, axis=0)
    kept = norm > 0
    return columns[:, kept] / norm[kept]


def _folds(problem: GapRegression) -> tuple[NDArray[np.object_], Folds]:
    """Return the block of every row, and which blocks predict which.

    Of periodic runs each is predicted from those of other levels, where one of them is larger. Where there is but one
    level, and in runs that do not repeat and pass through all levels, groups of runs predict each other.
    """
    runs = problem.runs
    if all(run.folded for run in runs) and (folds := _between_levels(runs, problem.policy)):
        return np.concatenate([np.full(r.target.size, i, dtype=object) for i, r in enumerate(runs)]), folds
    labels = row_groups(runs, white=True)
    count = len(dict.fromkeys(labels.tolist()))
    return labels, tuple((i, tuple(j for j in range(count) if j != i)) for i in range(count))


def _between_levels(runs: Sequence[GapRun], policy: DiagnosisPolicy) -> Folds:
    # To the percent, so that runs of one level are predicted from the same others.
    amplitude = np.exp(np.round(np.log([float(np.abs(run.angle).max()) for run in runs]), 2))
    folds = []
    for index, own in enumerate(amplitude):
        known = np.flatnonzero(np.abs(np.log(amplitude / own)) > np.log1p(policy.tolerated))
        if known.size and amplitude[known].max() > own:
            folds.append((index, tuple(int(i) for i in known)))
    return tuple(folds)


def shares(problem: GapRegression, noise: float, measured: bool = False) -> dict[str, float]:
    """Return what each kind of law explains of the gap beyond noise, from 0 to 1, by kind; their sum is at most one.

    The kind that predicts the runs left out best alone is credited first, the others with what they win on top. Within
    noise of each other a law without memory comes before one with it, and that before one of the run. ``noise`` is the
    share of the mean square gap that is noise, which counts where repetition has not measured it row by row; it is
    ``measured`` where neighbouring samples of a path show it.
    """
    prediction = Prediction(problem)
    before = prediction.base
    deviation = float(np.sqrt(2 * prediction.rows))
    margin = problem.policy.significant * deviation
    floor = min(float(prediction.rows), before) if problem.repeats else noise * before
    credit = dict.fromkeys(KINDS, 0.0)
    if before - floor <= margin:
        return credit
    residual, open_kinds = before, list(KINDS)
    beside: tuple[str, ...] = ()
    while open_kinds:
        tried = {kind: prediction.best(kind, beside) for kind in open_kinds}
        least = min(error for error, _ in tried.values())
        kind = next(k for k in KINDS if k in tried and tried[k][0] <= least + deviation)
        error, columns = tried[kind]
        gain = residual - max(error, floor)
        if gain <= margin:
            break
        credit[kind] = gain
        residual, beside = max(error, floor), columns
        open_kinds.remove(kind)
    # What repeats and nothing predicts is the run's own. Where nothing repeats it cannot be distinguished from noise,
    # unless that is known.
    if (problem.repeats or measured) and residual - floor > margin:
        credit["run"] += residual - floor
    return {kind: value / (before - floor) for kind, value in credit.items()}


def make_budget(
    problem: GapRegression,
    total: float,
    noise: float,
    processing: float,
    drift: float = 0.0,
    measured: bool = False,
) -> Budget:
    """Return the budget of a gap, of which the regression (without the drift of a channel) explains shares."""
    return divide_gap(total, noise, processing, lambda share: shares(problem, share, measured), drift)
