"""The search for the effect that explains the gap of a pulse test: every candidate is fitted by output error."""

from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np

from sindyjoint.diagnosis.effects.change import Change
from sindyjoint.diagnosis.evidence import Ranking, rank
from sindyjoint.diagnosis.policy import STRUCTURE
from sindyjoint.diagnosis.structure import Fit, FittedChange, OutputError, fit, score_of
from sindyjoint.diagnosis.structure.pulses import PulseProblem
from sindyjoint.numeric import Array, norms_of
from sindyjoint.parallel import side_by_side
from sindyjoint.record import LARGEST

# All candidates get so many steps of the fit; those that then lie among the first get the rest.
SCREEN_STEPS, SCREENED = 2, 12
REFINED = 4


def rank_changes(problem: OutputError, fitted: Sequence[FittedChange], base: Fit) -> Ranking[FittedChange]:
    """Return the candidates with their probabilities, the best variant of each effect alone."""
    simplest = sorted(fitted, key=lambda each: each.change.size)
    scored = [(each, score_of(problem, each)) for each in simplest]
    return rank(scored, score_of(problem, base), STRUCTURE.rival_nats)


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

    Fallback variants are tried only where the others leave more than noise. ``period``: of the main oscillation, s.
    """
    found = _search(problem, base, [change for change in changes if not change.fallback], period, say)
    fallback = [change for change in changes if change.fallback]
    residual = min((base.cost - each.gain for each in found), default=base.cost) / problem.rows()
    if fallback and residual > problem.policy.significant_excess:
        found += _search(problem, base, fallback, period, say)
    return found


def _search(
    problem: PulseProblem, base: Fit, changes: Sequence[Change], period: float, say: Callable[[str], None]
) -> list[FittedChange]:
    steps = horizons(problem, period)
    small = base.cost < problem.policy.linear * problem.rows()
    # A large gap drags the coefficients of the model after it: it stays where it was.
    own = problem.priors
    start = base.x if small else np.append(problem.start()[:own], base.x[own:])
    say(f"trying {len({c.effect.id for c in changes})} effects")
    tried = _begin(problem, start, changes, steps[0])
    if small:
        return _linearised(problem, base, tried)
    alive = tried
    anchor: tuple[Array, Change | None] = (start, None)
    fits: list[tuple[Change, Fit]] = []
    for index, horizon in enumerate(steps):
        words = f"over {horizon:.3g} s" if horizon else "in the steady motion"
        say(f"trying {len({c.effect.id for c, _ in alive})} effects {words}")
        jacobian = _base_jacobian(problem, (anchor, (start, None)), horizon)
        if index == 0 and len(alive) > SCREENED:
            alive = _screened(problem.near(start), alive, horizon, jacobian)
        fits = _fits(problem, alive, horizon, jacobian, 6)
        if not fits:
            return []
        cost = min(f.cost for _, f in fits)
        fits = _close(problem, fits, cost, horizon)
        best = min(fits, key=lambda each: each[1].cost)
        anchor, alive = (best[1].x, best[0]), [(change, found.x) for change, found in fits]
    return _refined(problem, base, fits)


def _begin(
    problem: PulseProblem, start: Array, changes: Sequence[Change], horizon: float
) -> list[tuple[Change, Array]]:
    """Return for each candidate the point of its grid, and the linear estimate there, that promise most."""
    problem = problem.near(start)
    residual = problem.residuals(start, horizon)
    if residual is None:
        return [(change, np.concatenate([start, change.start])) for change in changes]
    base = problem.derivatives(start, residual, horizon, range(start.size))
    tasks = [(problem, start, change, horizon, residual, base) for change in changes]
    return [each for each in side_by_side(lambda task: _promising(*task), tasks) if each is not None]


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
            if there is None or not np.all(np.abs(there) < LARGEST):
                continue
            promised, _ = _linear(base, there)
        if best is None or promised < best[0]:
            best = promised, x
    return None if best is None else (change, best[1])


def _linear(columns: Array, residual: Array) -> tuple[float, Array]:
    """Return the least sum of squares of a residual beside columns, and the numbers that do it."""
    size = norms_of(columns)
    numbers, *_ = np.linalg.lstsq(columns / size, -residual, rcond=1e-9)
    least = residual + (columns / size) @ numbers
    return float(least @ least), numbers / size


def _base_jacobian(
    problem: PulseProblem, anchors: Sequence[tuple[Array, Change | None]], horizon: float
) -> Array | None:
    """Return the columns of the base at the first of some numbers that can be simulated."""
    for x, change in anchors:
        residual = problem.residuals(x, horizon, change)
        if residual is not None:
            return problem.derivatives(x, residual, horizon, range(problem.base_size), change)
    return None


def _screened(
    problem: PulseProblem, alive: Sequence[tuple[Change, Array]], horizon: float, jacobian: Array | None
) -> list[tuple[Change, Array]]:
    """Return the candidates that lead after a few steps, and all that are close to them."""
    fits = sorted(_fits(problem, alive, horizon, jacobian, SCREEN_STEPS), key=lambda each: each[1].cost)
    policy, least = problem.policy, fits[0][1].cost
    close = least + 2 * policy.behind * max(1.0, least / problem.rows(horizon))
    return [(c, found.x) for i, (c, found) in enumerate(fits) if i < SCREENED or found.cost < close]


def _fits(
    problem: PulseProblem,
    alive: Sequence[tuple[Change, Array]],
    horizon: float,
    jacobian: Array | None,
    iterations: int,
) -> list[tuple[Change, Fit]]:
    def one(task: tuple[Change, Array]) -> tuple[Change, Fit | None]:
        change, x = task
        return change, fit(problem, x, horizon, change, base_jacobian=jacobian, iterations=iterations)

    return [(change, found) for change, found in side_by_side(one, alive) if found is not None]


def _close(
    problem: PulseProblem, fits: Sequence[tuple[Change, Fit]], cost: float, horizon: float
) -> list[tuple[Change, Fit]]:
    """Return the candidates that can still win (at the end all), and of each effect only its best variant."""
    policy, rows = problem.policy, problem.rows(horizon)
    residual, last = max(1.0, cost / rows), horizon == problem.duration
    kept: dict[str, tuple[float, Change, Fit]] = {}
    for change, found in fits:
        behind = (found.cost - cost) / (2 * residual) + 0.5 * change.size * np.log(rows)
        if change.effect.id not in kept or behind < kept[change.effect.id][0]:
            kept[change.effect.id] = behind, change, found
    best = min(behind for behind, _, _ in kept.values())
    limit = best + policy.behind + policy.accuracy * cost
    return [(change, found) for behind, change, found in kept.values() if last or behind <= limit]


def _refined(problem: PulseProblem, base: Fit, fits: Sequence[tuple[Change, Fit]]) -> list[FittedChange]:
    """Return the candidates; the best few are fitted once more with every derivative worked out."""
    order = sorted(fits, key=lambda each: each[1].cost)

    def one(task: tuple[Change, Fit]) -> tuple[Change, Fit]:
        change, found = task
        again = fit(problem, found.x, problem.duration, change, iterations=3)
        return change, found if again is None or again.cost > found.cost else again

    pairs = side_by_side(one, order[:REFINED]) + order[REFINED:]
    return [FittedChange(**vars(f), change=change, gain=max(base.cost - f.cost, 0.0)) for change, f in pairs]


def _linearised(
    problem: PulseProblem, base: Fit, tried: Sequence[tuple[Change, Array]]
) -> list[FittedChange]:
    """Return candidates for a small gap: all by their linear gain, those that promise most by a fit."""
    duration = problem.duration
    residual = problem.residuals(base.x, duration)
    assert residual is not None
    columns, near = base.jacobian, problem.near(base.x)

    def linear(task: tuple[Change, Array]) -> FittedChange | None:
        change, x = task
        places = [base.x.size + i for i in change.linear]
        at = x.copy()
        at[places] = 0.0
        there = near.residuals(at, duration, change) if change.size > len(places) or not places else residual
        if there is None:
            return None
        own = near.derivatives(at, there, duration, places, change)
        whole = np.hstack([columns, own])
        least, numbers = _linear(whole, there)
        number = numbers[base.x.size :]
        if np.any((number < change.low[: len(places)]) | (number > change.high[: len(places)])):
            return None
        at[: base.x.size] += numbers[: base.x.size]
        at[places] = number
        nonlinear = np.zeros((there.size, change.size - len(places)))
        jacobian = np.hstack([whole, nonlinear])
        return FittedChange(at, least, there + whole @ numbers, jacobian, change, base.cost - least)

    rows = problem.rows()
    guessed = [each for each in side_by_side(linear, tried) if each is not None]
    guessed.sort(key=lambda each: -(each.gain - each.change.size * np.log(rows)))
    promising = [f for f in guessed[:10] if f.gain > f.change.size * np.log(rows)]
    fits = _fits(
        problem,
        [(f.change, np.concatenate([base.x, f.x[base.x.size :]])) for f in promising],
        duration,
        columns,
        4,
    )
    found = _refined(problem, base, fits)
    known, most = {f.name for f in found}, max([f.gain for f in found], default=np.inf)
    rest = [replace(f, gain=max(min(f.gain, most), 0.0)) for f in guessed if f not in promising]
    return found + [each for each in rest if each.name not in known]
