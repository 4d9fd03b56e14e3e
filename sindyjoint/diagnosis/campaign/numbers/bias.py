"""What processing and noise do to the numbers of a repaired model with elements, taken out of them.

A mean period rounds off the corners of a slider, so that numbers fitted to it are wrong, and say little of what they
should be: they snap to where corners meet the grid. What a fit leaves is therefore held beside what the same law, with
the same numbers, leaves of synthetic replicates of a model; the numbers of that model are fitted until both are alike
(indirect inference by the residuals of an auxiliary model; Gourieroux, Monfort and Renault, J. Applied Econometrics 8,
S85, 1993). Replicates with noise show what that adds on average (parametric bootstrap; Efron and Tibshirani 1993,
section 6.5).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from sindyjoint.diagnosis.campaign.candidates import refine_effect
from sindyjoint.diagnosis.campaign.numbers.likeness import Likeness
from sindyjoint.diagnosis.campaign.numbers.noise import mean_by_noise, noise_covariance
from sindyjoint.diagnosis.campaign.numbers.valley import Valley, walk
from sindyjoint.diagnosis.campaign.numbers.whole import is_element, with_numbers
from sindyjoint.diagnosis.campaign.regression import GapRegression
from sindyjoint.diagnosis.campaign.repair import Repaired, least_squares, refit
from sindyjoint.diagnosis.campaign.rows.run import reference_scales
from sindyjoint.diagnosis.campaign.start import Work
from sindyjoint.diagnosis.effects.catalogue import Variant
from sindyjoint.diagnosis.effects.fitted import FittedEffect
from sindyjoint.equation.formula import formula_text
from sindyjoint.numeric import Array

# Beyond this share of a number and so many of its standard errors the processing is not known to move it so, unless
# replicates with the numbers found differ from the measurement by little more than the noise, as a ratio of squares.
LARGEST, LARGEST_SIGMAS, LIKE_NOISE = 0.5, 2.0, 2.0
# Trials of the numbers, and what χ² would still fall by where they end: a fifth of a standard error, squared. Corners
# make it rough below: on the way to a tenth numbers moved by less than a twentieth, in three times the trials.
ROUNDS, LEAST_GAIN = 20, 0.04
# Valleys of a shape: searches from a lower point, and by what share of the 95 % limit it is lower.
RESTARTS, LEAST_FALL = 3, 0.1
# Damping of a step, by the errors of the regression, after the first that led to nothing; by how much it grows then,
# and from where on nothing is gained.
FIRST_DAMPING, STRONGER, MOST_DAMPING = 0.25, 4.0, 100.0
# Forms of an element whose unlikeness to the measurement, a χ², is within this of the least are not told apart: they
# are as probable as one to twenty.
FORM_LEAD = 6.0


@dataclass(frozen=True, eq=False)
class _Solved:
    """A repaired model, and the numbers with which its replicates are most like the measurement.

    Parameters
    ----------
    fitted : Repaired
        With the numbers that fit the rows.
    values, covariance : ndarray
        The numbers found, in the order of :func:`numbers_of`.
    unlikeness : float
        Sum of squares of the difference of the residuals that the fit leaves of the measurement and of the replicates,
        in units of noise.
    likeness : Likeness
    centre : ndarray
        The numbers before what noise adds on average is taken out of them.
    slopes : ndarray, shape (m, n)
        Of what the fit leaves of replicates, by each number times its unit.
    """

    fitted: Repaired
    values: Array
    covariance: Array
    unlikeness: float
    likeness: Likeness
    centre: Array
    slopes: Array


def without_bias(work: Work, repaired: Repaired) -> tuple[Repaired, tuple[str, ...]]:
    """Return a repaired model whose numbers are freed of what the processing of repeating runs does to them, and notes.

    An element is used in the form, of those that the catalogue has of it, whose replicates are most like the
    measurement: rounded corners of one form look like another. Of forms that are alike the plainest is used, and a note
    names the others. The model stays as it is where it has no element, where runs do not repeat, where a simulation
    does not follow them, or where a number would move by more than its half and replicates stay unlike the measurement.
    """
    if not any(is_element(e) for e in repaired.effects) or not all(row.folded for row in work.rows):
        return repaired, ()
    forms = [repaired]
    for place, each in enumerate(repaired.effects):
        if is_element(each):
            others = [_in_form(work, repaired, place, other) for other in _other_forms(each)]
            forms += [other for other in others if _has_signs(other.effects[place])]
    solved = [found for form in forms if (found := _solve(work, form)) is not None]
    if not solved:
        return repaired, ()
    least = min(each.unlikeness for each in solved)
    alike = [each for each in solved if each.unlikeness < least + FORM_LEAD]
    # The catalogue begins with the plainest form.
    best = min(alike, key=lambda each: ([_rank(e) for e in each.fitted.effects], each.unlikeness))
    best, shapes = _along_valleys(work, best)
    return with_numbers(best.fitted, best.values, best.covariance), (
        *_undetermined_forms(best, alike),
        *shapes,
    )


def _along_valleys(work: Work, best: _Solved) -> tuple[_Solved, tuple[str, ...]]:
    """Return a solution whose covariance reaches along the valleys of its shapes, and notes on long ones.

    Where the unlikeness is less on the way, the solution is sought from there.
    """
    notes, long = [], work.policy.long_valley
    for place, each in enumerate(best.fitted.effects):
        for name in _shapes(each):
            for _ in range(RESTARTS):
                valley, ranges = _valley(work, best, place, name)
                lower = _lower(best, valley, ranges)
                if lower is None:
                    break
                point, variant = lower
                effects = list(best.fitted.effects)
                effects[place] = replace(effects[place], variant=variant, within=None)
                again = _solve(work, replace(best.fitted, effects=tuple(effects)), point)
                if again is None or not again.unlikeness < best.unlikeness:
                    break
                best = again
            covariance = valley.widened(best.centre, best.covariance)
            low, high = np.sort(valley.ends[:, valley.at])
            whole = low <= min(r[0] for _, r in ranges) and high >= max(r[1] for _, r in ranges)
            if whole or covariance[valley.at, valley.at] > long**2 * best.covariance[valley.at, valley.at]:
                notes.append(
                    f"these runs do not determine the numbers of {each.effect.name} one by one: with {name} from "
                    f"{low:.3g} to {high:.3g} it fits about as well; its intervals hold all of these"
                )
            best = replace(best, covariance=covariance)
    return best, tuple(notes)


def _shapes(effect: FittedEffect) -> tuple[str, ...]:
    """Return the nonlinear parameters of an element that have no unit."""
    return tuple(p.name for p in effect.variant.parameters if p.unit == "1") if is_element(effect) else ()


def _valley(work: Work, best: _Solved, place: int, name: str) -> tuple[Valley, list[tuple[Variant, Array]]]:
    """Return the valley of a shape, over all ranges that the catalogue has for the form, and these ranges."""
    effect, likeness = best.fitted.effects[place], best.likeness
    reference = reference_scales(work.rows)
    k = effect.variant.names.index(name)
    at = likeness.numbers.inner[effect.name].start + k
    same = [v for v in effect.effect.variants if _formulas(v) == _formulas(effect.variant)]
    ranges = [(v, v.bounds(reference)[k]) for v in same] or [(effect.variant, likeness.ends[:, at])]
    ends = likeness.ends.copy()
    ends[:, at] = min(r[0] for _, r in ranges), max(r[1] for _, r in ranges)
    own = best.covariance[at]
    # Weights count noise that replicates do not have: χ² rises by the ratio of both variances.
    linear = np.zeros_like(best.covariance)
    free = likeness.free
    linear[np.ix_(free, free)] = least_squares(best.slopes[:, free], np.zeros(best.slopes.shape[0]))[1]
    rise = float(own[at] / (linear[at, at] * likeness.unit[at] ** 2))
    errors = (own / np.sqrt(own[at]), rise)
    return walk(replace(likeness, ends=ends), (best.unlikeness, best.centre), best.slopes, at, errors), ranges


def _lower(
    best: _Solved, valley: Valley, ranges: list[tuple[Variant, Array]]
) -> tuple[Array, Variant] | None:
    """Return the numbers of the lowest point of a valley and the form with that range; None where it is not lower."""
    points = [
        (unlikeness, values, variant)
        for unlikeness, values in zip(valley.unlikeness, valley.values, strict=True)
        for variant, (low, high) in ranges
        if low <= values[valley.at] <= high and unlikeness < best.unlikeness - LEAST_FALL * valley.limit
    ]
    return min(points, key=lambda p: p[0])[1:] if points else None


def _has_signs(effect: FittedEffect) -> bool:
    """Return whether what the catalogue asks to be positive is."""
    columns = zip(effect.variant.columns, effect.coefficients, strict=True)
    return all(value > 0 for column, value in columns if column.positive)


def _undetermined_forms(best: _Solved, alike: Sequence[_Solved]) -> tuple[str, ...]:
    """Return a note for each element of which other forms are as like the measurement."""
    notes = []
    for place, mine in enumerate(best.fitted.effects):
        others = dict.fromkeys(_formulas(each.fitted.effects[place].variant) for each in alike)
        forms = [form for form in others if form != _formulas(mine.variant)]
        if forms:
            notes.append(
                f"these runs do not determine the form of {mine.effect.name}: {_formulas(mine.variant)} is used, and "
                f"{' or '.join(forms)} fits as well; its numbers hold for the form used"
            )
    return tuple(notes)


def _rank(effect: FittedEffect) -> int:
    """Return which form of its effect in the catalogue an effect has; past the last one where it has another."""
    forms = [_formulas(variant) for variant in effect.effect.variants]
    mine = _formulas(effect.variant)
    return forms.index(mine) if mine in forms else len(forms)


def _formulas(variant: Variant) -> str:
    parts = [
        *(column.formula for column in variant.columns),
        *(f"{s.name}' = {formula_text(s.rate)}" for s in variant.states),
    ]
    return ", ".join(parts)


def _solve(work: Work, fitted: Repaired, start: Array | None = None) -> _Solved | None:
    """Return the solution for a model in one form, sought from the numbers of the fit or others; None without one."""
    likeness = Likeness.of(work, fitted, start)
    numbers, target, unit = likeness.numbers, likeness.target, likeness.unit
    errors, ends, free = np.sqrt(np.diag(numbers.covariance)), likeness.ends, likeness.free
    values, step, best, damping = (
        numbers.values if start is None else start,
        np.zeros_like(errors),
        np.inf,
        0.0,
    )
    slopes = np.zeros((target.size, errors.size))
    for _ in range(ROUNDS):
        tried = likeness.left(np.clip(values + step, *ends))
        if tried is None or not np.sum((target - tried[1]) ** 2) < best:
            if not np.isfinite(best):
                return None
            damping = max(STRONGER * damping, FIRST_DAMPING)
            if damping > MOST_DAMPING:
                break
        else:
            # Slopes by the coefficients of the terms hardly change on the way.
            places = np.flatnonzero(free) if np.isinf(best) else likeness.own
            values, (found, rest) = np.clip(values + step, *ends), tried
            best, damping = float(np.sum((target - rest) ** 2)), damping / STRONGER
            if not likeness.renew(slopes, places, values, rest):
                return None
        room, away = (ends - values).T, target - rest
        step = _step(slopes / unit, away, 0.0 * errors, free, room)
        if float(away @ away) - float(np.sum((away - slopes / unit @ step) ** 2)) < LEAST_GAIN:
            # A step that small is taken without a look where it leads.
            values = values + step
            break
        if damping:
            step = _step(slopes / unit, away, damping / errors**2, free, room)
    covariance = np.zeros((errors.size, errors.size))
    own_noise, misfit = noise_covariance(found, fitted, slopes[:, free], target - rest)
    covariance[np.ix_(free, free)] = own_noise * np.outer(unit[free], unit[free])
    by_noise = mean_by_noise(found, fitted, slopes[:, free])
    centre, values = values, values.copy()
    values[free] -= by_noise * unit[free]
    values = np.clip(values, *ends)
    most = np.maximum(LARGEST * np.abs(numbers.values), LARGEST_SIGMAS * errors)
    if misfit > LIKE_NOISE and np.any(np.abs(values - numbers.values) > most):
        return None
    covariance = _with_fixed(covariance, numbers.covariance, free)
    return _Solved(fitted, values, covariance, best, likeness, centre, slopes)


def _with_fixed(own: Array, regression: Array, free: NDArray[np.bool_]) -> Array:
    """Return the covariance of all numbers: the free ones follow a delay within its error, as the regression has it.

    With C of the regression and B = C_fd·C_dd⁻¹: cov_ff = own + B·C_dd·Bᵀ, cov_fd = B·C_dd = C_fd.
    """
    fixed = ~free
    covariance = own.copy()
    across, between = regression[np.ix_(fixed, fixed)], regression[np.ix_(free, fixed)]
    covariance[np.ix_(fixed, fixed)] = across
    covariance[np.ix_(free, fixed)], covariance[np.ix_(fixed, free)] = between, between.T
    covariance[np.ix_(free, free)] += between @ np.linalg.pinv(across, hermitian=True) @ between.T
    return covariance


def _step(slopes: Array, rest: Array, damping: Array, free: NDArray[np.bool_], room: Array) -> Array:
    """Return the step of Levenberg and Marquardt within the room that each number has; at its end one stays there."""
    step = np.zeros(free.size)
    for _ in range(free.size):
        rows = np.vstack([slopes[:, free], np.diag(np.sqrt(damping[free]))])
        left = rest - slopes @ np.where(free, 0.0, step)
        step[free] = least_squares(rows, np.concatenate([left, np.zeros(rows.shape[1])]))[0]
        beyond = free & ((step < room[:, 0]) | (step > room[:, 1]))
        if not beyond.any():
            break
        step = np.where(beyond, np.clip(step, *room.T), step)
        free = free & ~beyond
    return step


def _other_forms(effect: FittedEffect) -> list[FittedEffect]:
    """Return an effect in the other forms, and ranges, that the catalogue has of it, with the same numbers."""
    mine = effect.variant
    return [
        replace(effect, variant=each, within=None)
        for each in effect.effect.variants
        if each != mine
        and each.names == mine.names
        and [c.symbol for c in each.columns] == [c.symbol for c in mine.columns]
        and [s.name for s in each.states] == [s.name for s in mine.states]
    ]


def _in_form(work: Work, repaired: Repaired, place: int, form: FittedEffect) -> Repaired:
    """Return the repaired model with an effect in another form, fitted to the rows."""
    others = [e for k, e in enumerate(repaired.effects) if k != place]
    fitted = refine_effect(GapRegression.build(work.rows, repaired.model, others, work.policy), form)
    effects = (*repaired.effects[:place], fitted, *repaired.effects[place + 1 :])
    keeping = replace(work.policy, needless_ratio=0.0)
    return replace(refit(work.rows, repaired.model, effects, keeping), dropped=repaired.dropped)
