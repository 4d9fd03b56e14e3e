"""What processing and noise do to the numbers of a repaired model with elements, taken out of them.

A mean period rounds off the corners of a slider, so that numbers fitted to it are wrong, and say little of what they
should be: they snap to where corners meet the grid. What a fit leaves is therefore held beside what the same law, with
the same numbers, leaves of synthetic replicates of a model; the numbers of that model are fitted until both are alike
(indirect inference by the residuals of an auxiliary model; Gourieroux, Monfort and Renault, J. Applied Econometrics 8,
S85, 1993). Replicates with noise show what that adds on average (parametric bootstrap; Efron and Tibshirani 1993,
section 6.5).
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from sindyjoint.diagnosis.campaign.candidates import refine_effect
from sindyjoint.diagnosis.campaign.numbers.noise import left_in_all, mean_by_noise, noise_covariance
from sindyjoint.diagnosis.campaign.numbers.replicates import Replicates
from sindyjoint.diagnosis.campaign.numbers.whole import Numbers, is_element, numbers_of, with_numbers
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
# Slopes are differences over a standard error, or this share of a number.
LARGEST_DIFFERENCE = 0.05
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
    """

    fitted: Repaired
    values: Array
    covariance: Array
    unlikeness: float


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
    return with_numbers(best.fitted, best.values, best.covariance), _undetermined_forms(best, alike)


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


def _solve(work: Work, fitted: Repaired) -> _Solved | None:
    """Return the solution for a model in one form; None where there is none."""
    numbers = numbers_of(fitted, work.rows)
    errors = np.sqrt(np.diag(numbers.covariance))
    free = np.ones(errors.size, dtype=bool)
    for each in fitted.effects:
        # A delay is out of the states already and does not move.
        free[numbers.coefficients[each.name]] = not each.shifts
    own = np.r_[(*numbers.coefficients.values(), *numbers.inner.values())].astype(int)
    own = own[free[own]]
    ends = _ends(work, fitted, numbers)
    target = left_in_all(work.rows, fitted)

    def left(values: Array) -> tuple[Replicates, Array] | None:
        there = Replicates.of(work, with_numbers(fitted, values, numbers.covariance))
        return None if there is None else (there, left_in_all(there.rows(), fitted))

    # Numbers of an element that are hardly known are moved by less than their error: the response bends on the way.
    unit = errors.copy()
    unit[own] = np.minimum(errors[own], LARGEST_DIFFERENCE * np.abs(numbers.values[own]))
    values, step, best, damping = numbers.values, np.zeros_like(errors), np.inf, 0.0
    slopes = np.zeros((target.size, errors.size))
    for _ in range(ROUNDS):
        tried = left(np.clip(values + step, *ends))
        if tried is None or not np.sum((target - tried[1]) ** 2) < best:
            if not np.isfinite(best):
                return None
            damping = max(STRONGER * damping, FIRST_DAMPING)
            if damping > MOST_DAMPING:
                break
        else:
            # Slopes by the coefficients of the terms hardly change on the way.
            places = np.flatnonzero(free) if np.isinf(best) else own
            values, (found, rest) = np.clip(values + step, *ends), tried
            best, damping = float(np.sum((target - rest) ** 2)), damping / STRONGER
            if not _renew(slopes, places, (values, unit, ends), rest, left):
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
    values = values.copy()
    values[free] -= by_noise * unit[free]
    values = np.clip(values, *ends)
    most = np.maximum(LARGEST * np.abs(numbers.values), LARGEST_SIGMAS * errors)
    if misfit > LIKE_NOISE and np.any(np.abs(values - numbers.values) > most):
        return None
    return _Solved(fitted, values, _with_fixed(covariance, numbers.covariance, free), best)


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


def _ends(work: Work, fitted: Repaired, numbers: Numbers) -> Array:
    """Return the least and the largest value of each number, shape (2, n): of parameters as the catalogue has them."""
    ends = np.outer([-np.inf, np.inf], np.ones(numbers.values.size))
    reference = reference_scales(work.rows)
    for each in fitted.effects:
        if not each.shifts:
            within = each.variant.bounds(reference) if each.within is None else each.within
            own = numbers.values[numbers.inner[each.name]]
            ends[:, numbers.inner[each.name]] = [
                np.minimum(within[:, 0], own), np.maximum(within[:, 1], own)
            ]  # fmt: skip
    return ends


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


def _renew(
    slopes: Array,
    places: NDArray[np.intp],
    where: tuple[Array, Array, Array],
    rest: Array,
    left: Callable[[Array], tuple[Replicates, Array] | None],
) -> bool:
    """Write by how much what is left of replicates changes with some numbers, each by its unit.

    ``where`` are numbers, units, and ends of numbers. Return whether replicates could be simulated, on either side of
    each number.
    """
    values, unit, ends = where
    for place in places:
        inside = 1.0 if values[place] + unit[place] <= ends[1, place] else -1.0
        for sign in (inside, -inside):
            later = values.copy()
            later[place] += sign * unit[place]
            if (moved := left(later)) is not None:
                slopes[:, place] = sign * (moved[1] - rest)
                break
        else:
            return False
    return True


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
