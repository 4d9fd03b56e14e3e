"""Which effect explains the gap of a pulse test: every candidate is fitted by output error, and probabilities follow.

The evidence is counted as in :mod:`sindyjoint.diagnosis.campaign.ranking`: half the fall of χ², less ½·ln N for each
number that a candidate chooses (Schwarz 1978), tempered; "nothing is missing" has half of the prior belief.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from sindyjoint.diagnosis.effects.structure import Change
from sindyjoint.diagnosis.structure.problem import Fit, PulseProblem, fit
from sindyjoint.parallel import side_by_side

Array = NDArray[np.float64]

TEMPER = 2.0
# A simulation follows a real structure no better than this share of the gap.
SIMULATION_ERROR = 0.001
# What effects found before got wrong, as a share of what they explained, is left over and no effect of its own.
FOUND_ERROR = 0.01
RIVAL_NATS = 3.0  # members of a class: within e³ = 20 times of the best
# Candidates so many tempered nats behind the best on a short horizon are not followed to a longer one.
BEHIND = 40.0
# All candidates get so many steps of the fit; those that then lie among the first get the rest.
RACE_STEPS, RACED = 2, 12
POLISHED = 4
# With less than this left in units of noise, the response is linear in what is missing.
LINEAR = 4.0
# With no more than this left, there is nothing for spare ways to explain.
LEFT_OVER = 1.1
MOST_SCREENED = 10


@dataclass(frozen=True, eq=False)
class FittedChange:
    """A candidate with its best numbers.

    Parameters
    ----------
    change : Change
    x : ndarray
        Numbers of the base beside it, then its own.
    gain : float
        Fall of χ².
    """

    change: Change
    x: Array
    gain: float

    @property
    def own(self) -> Array:
        """The candidate's own numbers."""
        return self.x[self.x.size - self.change.size :]

    @property
    def parameters(self) -> dict[str, float]:
        """The candidate's own numbers by name, SI."""
        return self.change.report(self.own)


@dataclass(frozen=True)
class StructureRanking:
    """The candidates, one per effect, in order of probability; the rest belongs to "nothing is missing"."""

    fitted: tuple[FittedChange, ...]
    probabilities: tuple[float, ...]
    nothing: float

    def members(self) -> tuple[FittedChange, ...]:
        """Return the best candidate and those that the records cannot tell from it."""
        limit = self.probabilities[0] * np.exp(-RIVAL_NATS)
        return tuple(f for f, p in zip(self.fitted, self.probabilities, strict=True) if p >= limit)


def rows_of(problem: PulseProblem, duration: float | None = None) -> float:
    """Return the effective number of samples."""
    duration = problem.duration if duration is None else duration
    return sum(
        problem.count(record, duration) / noise.length
        for record, noise in zip(problem.records, problem.noise, strict=True)
    )


def rank(
    fitted: Sequence[FittedChange], base_cost: float, rows: float, explained: float = 0.0
) -> StructureRanking:
    """Return the candidates with their probabilities, the best way of each effect alone.

    Parameters
    ----------
    fitted : sequence of FittedChange
    base_cost : float
        χ² without any of them.
    rows : float
        Effective samples.
    explained : float
        Fall of χ² that effects found before have brought.
    """
    best: dict[str, tuple[float, FittedChange]] = {}
    left = max(1.0, min((base_cost - f.gain) / rows for f in fitted))
    blur = TEMPER + SIMULATION_ERROR**2 * max(f.gain for f in fitted) / left
    for each in fitted:
        gain = max(each.gain - FOUND_ERROR**2 * explained, 0.0)
        evidence = 0.5 * gain / left / blur - 0.5 * each.change.size * np.log(rows) / TEMPER
        if each.change.effect not in best or evidence > best[each.change.effect][0]:
            best[each.change.effect] = evidence, each
    kept = [each for _, each in best.values()]
    values = np.array([*(e - np.log(len(kept)) for e, _ in best.values()), 0.0])
    weight = np.exp(values - values.max())
    weight /= weight.sum()
    order = np.argsort(-weight[:-1], kind="stable")
    return StructureRanking(
        tuple(kept[i] for i in order), tuple(float(weight[i]) for i in order), float(weight[-1])
    )


def horizons(problem: PulseProblem, period: float) -> tuple[float, ...]:
    """Return horizons that grow fourfold from five main periods to the whole record, s."""
    found = [problem.duration]
    while found[0] > 10 * period:
        found.insert(0, max(found[0] / 4, 5 * period))
    return tuple(found)


def search(
    problem: PulseProblem,
    base: Fit,
    changes: Sequence[Change],
    period: float,
    say: Callable[[str], None] = lambda words: None,
) -> list[FittedChange]:
    """Fit every candidate beside the base, and return those that were followed to the whole record.

    Spare ways are tried only where the others leave more than noise.

    Parameters
    ----------
    problem : PulseProblem
    base : Fit
        Over the whole record.
    changes : sequence of Change
    period : float
        Of the main oscillation, s.
    say : callable
    """
    found = _search(problem, base, [change for change in changes if not change.spare], period, say)
    spare = [change for change in changes if change.spare]
    left = min((base.cost - each.gain for each in found), default=base.cost) / rows_of(problem)
    if spare and left > LEFT_OVER:
        found += _search(problem, base, spare, period, say)
    return found


def _search(
    problem: PulseProblem, base: Fit, changes: Sequence[Change], period: float, say: Callable[[str], None]
) -> list[FittedChange]:
    steps = horizons(problem, period)
    rows = rows_of(problem)
    small = base.cost < LINEAR * rows
    start = base.x if small else _held(problem, base)
    say(f"trying {len({c.effect for c in changes})} effects")
    tried = _begin(problem, start, changes, steps[0])
    if small:
        return _screened(problem, base, tried, period)
    alive = tried
    anchor: tuple[Array, Change | None] = (start, None)
    fits: list[tuple[Change, Fit]] = []
    for index, horizon in enumerate(steps):
        say(f"trying {len({c.effect for c, _ in alive})} effects over {horizon:.3g} s")
        jacobian = _base_jacobian(problem, anchor, horizon)
        if jacobian is None:
            jacobian = _base_jacobian(problem, (start, None), horizon)
        if index == 0 and len(alive) > RACED:
            alive = _raced(problem, alive, horizon, jacobian)
        fits = _fits(problem, alive, horizon, jacobian, 6)
        if not fits:
            return []
        cost = min(f.cost for _, f in fits)
        fits = _close(fits, cost, rows_of(problem, horizon), last=index == len(steps) - 1)
        best = min(fits, key=lambda each: each[1].cost)
        anchor, alive = (best[1].x, best[0]), [(change, found.x) for change, found in fits]
    return _polished(problem, base, fits)


def _held(problem: PulseProblem, base: Fit) -> Array:
    """Return the base's numbers with the model where it was: a large gap drags its coefficients after it."""
    x = problem.start()
    x[problem.priors :] = base.x[problem.priors :]
    return x


def _parallel(work: Callable[..., object], tasks: Sequence[tuple]) -> list:
    return side_by_side(lambda task: work(*task), tasks)


def _begin(
    problem: PulseProblem, start: Array, changes: Sequence[Change], horizon: float
) -> list[tuple[Change, Array]]:
    """Return for each candidate the point of its grid, and the linear estimate there, that promise most."""
    residual = problem.residuals(start, horizon)
    if residual is None:
        return [(change, np.concatenate([start, change.start])) for change in changes]
    base = problem.derivatives(start, residual, horizon, range(start.size))
    tasks = [(problem, start, change, horizon, residual, base) for change in changes]
    return [each for each in _parallel(_promising, tasks) if each is not None]


def _promising(
    problem: PulseProblem, start: Array, change: Change, horizon: float, residual: Array, base: Array
) -> tuple[Change, Array] | None:
    best: tuple[float, Array] | None = None
    for row in change.grid:
        x = np.concatenate([start, row])
        places = [start.size + i for i in change.linear]
        if places:
            columns = problem.derivatives(x, residual, horizon, places, change)
            promised, numbers = _linear(np.hstack([base, columns]), residual)
            low, high = change.low[: len(places)], change.high[: len(places)]
            inside = np.clip(numbers[start.size :], 0.5 * low, 0.5 * high)
            if not np.array_equal(np.sign(inside), np.sign(numbers[start.size :])):
                promised = float(residual @ residual)
            x[places] = inside
        else:
            there = problem.residuals(x, horizon, change)
            if there is None:
                continue
            promised, _ = _linear(base, there)
        if best is None or promised < best[0]:
            best = promised, x
    return None if best is None else (change, best[1])


def _linear(columns: Array, residual: Array) -> tuple[float, Array]:
    """Return the sum of squares that columns leave of a residual, and the numbers that do it."""
    size = np.linalg.norm(columns, axis=0)
    size[size == 0] = 1.0
    numbers, *_ = np.linalg.lstsq(columns / size, -residual, rcond=1e-9)
    left = residual + (columns / size) @ numbers
    return float(left @ left), numbers / size


def _base_jacobian(
    problem: PulseProblem, anchor: tuple[Array, Change | None], horizon: float
) -> Array | None:
    x, change = anchor
    residual = problem.residuals(x, horizon, change)
    if residual is None:
        return None
    return problem.derivatives(x, residual, horizon, range(problem.base_size), change)


def _raced(
    problem: PulseProblem, alive: Sequence[tuple[Change, Array]], horizon: float, jacobian: Array | None
) -> list[tuple[Change, Array]]:
    """Return the candidates that lead after a few steps, and all that are close to them."""
    fits = sorted(_fits(problem, alive, horizon, jacobian, RACE_STEPS), key=lambda each: each[1].cost)
    close = fits[0][1].cost + BEHIND * 2 * TEMPER * max(1.0, fits[0][1].cost / rows_of(problem, horizon))
    return [(c, found.x) for i, (c, found) in enumerate(fits) if i < RACED or found.cost < close]


def _fits(
    problem: PulseProblem,
    alive: Sequence[tuple[Change, Array]],
    horizon: float,
    jacobian: Array | None,
    iterations: int,
) -> list[tuple[Change, Fit]]:
    def one(change: Change, x: Array) -> tuple[Change, Fit | None]:
        return change, fit(problem, x, horizon, change, base_jacobian=jacobian, iterations=iterations)

    return [(change, found) for change, found in _parallel(one, alive) if found is not None]


def _close(fits: list[tuple[Change, Fit]], cost: float, rows: float, last: bool) -> list[tuple[Change, Fit]]:
    """Return the candidates that can still win, and of each effect only its best way."""
    left = max(1.0, cost / rows)
    kept: dict[str, tuple[float, Change, Fit]] = {}
    for change, found in fits:
        behind = (found.cost - cost) / (2 * left * TEMPER) + 0.5 * change.size * np.log(rows) / TEMPER
        if change.effect not in kept or behind < kept[change.effect][0]:
            kept[change.effect] = behind, change, found
    best = min(behind for behind, _, _ in kept.values())
    limit = best + BEHIND + SIMULATION_ERROR * cost
    return [(change, found) for behind, change, found in kept.values() if last or behind <= limit]


def _polished(problem: PulseProblem, base: Fit, fits: Sequence[tuple[Change, Fit]]) -> list[FittedChange]:
    """Return the candidates; the best few are fitted once more with every derivative worked out."""
    order = sorted(fits, key=lambda each: each[1].cost)
    first = order[:POLISHED]

    def one(change: Change, found: Fit) -> Fit:
        again = fit(problem, found.x, problem.duration, change, iterations=3)
        return found if again is None or again.cost > found.cost else again

    again = _parallel(one, first)
    pairs = [(c, f) for (c, _), f in zip(first, again, strict=True)] + list(order[POLISHED:])
    return [FittedChange(change, found.x, max(base.cost - found.cost, 0.0)) for change, found in pairs]


def _screened(
    problem: PulseProblem, base: Fit, tried: Sequence[tuple[Change, Array]], period: float
) -> list[FittedChange]:
    """Return candidates for a small gap: all by their linear gain, those that promise most by a fit."""
    duration = problem.duration
    residual = problem.residuals(base.x, duration)
    assert residual is not None
    columns = base.jacobian

    def score(change: Change, x: Array) -> float:
        places = [base.x.size + i for i in change.linear]
        if places:
            at = x.copy()
            at[places] = 0.0
            own = problem.derivatives(at, residual, duration, places, change)
            promised, numbers = _linear(np.hstack([columns, own]), residual)
            number = numbers[base.x.size :]
            if np.any((number < change.low[: len(places)]) | (number > change.high[: len(places)])):
                return 0.0
            return base.cost - promised
        there = problem.residuals(x, duration, change)
        return 0.0 if there is None else base.cost - _linear(columns, there)[0]

    gains = _parallel(score, tried)
    rows = rows_of(problem)
    price = [
        0.5 * gain - 0.5 * change.size * np.log(rows) for gain, (change, _) in zip(gains, tried, strict=True)
    ]
    order = np.argsort(-np.array(price), kind="stable")
    chosen = [int(i) for i in order[:MOST_SCREENED] if price[int(i)] > 0]
    fits = _fits(problem, [_put(base, *tried[i]) for i in chosen], duration, columns, 4)
    found = _polished(problem, base, fits) if fits else []
    others = [tried[int(i)] + (gains[int(i)],) for i in order if int(i) not in chosen]
    known = {f.change.effect for f in found}
    return found + [
        FittedChange(change, x, max(min(gain, max([f.gain for f in found], default=gain)), 0.0))
        for change, x, gain in others
        if change.effect not in known
    ]


def _put(base: Fit, change: Change, x: Array) -> tuple[Change, Array]:
    """Return a candidate beside the base's own numbers."""
    return change, np.concatenate([base.x, x[base.x.size :]])
