"""What processing and noise do to the numbers of a repaired model with elements, taken out of them.

A mean period rounds off the corners of a slider. Numbers θ̂ are fitted to the measurement; b(θ) is by how much the same
fit to synthetic replicates of a model with numbers θ misses these. θ = θ̂ − b(θ) is solved by repetition (indirect
inference; Gourieroux, Monfort and Renault, J. Applied Econometrics 8, S85, 1993). Replicates with noise then tell how
far θ̂ scatters, and what noise adds to b (parametric bootstrap; Efron and Tibshirani 1993, section 6.5).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from sindyjoint.bias.policy import POLICY as BIAS
from sindyjoint.diagnosis.campaign.candidates import refine_effect
from sindyjoint.diagnosis.campaign.numbers.replicates import LEAST_LEFT, Replicates
from sindyjoint.diagnosis.campaign.numbers.whole import Numbers, is_element, numbers_of, with_numbers
from sindyjoint.diagnosis.campaign.regression import GapRegression
from sindyjoint.diagnosis.campaign.repair import Repaired, modelled, refit
from sindyjoint.diagnosis.campaign.start import Work
from sindyjoint.diagnosis.effects.catalogue import Variant
from sindyjoint.diagnosis.effects.fitted import FittedEffect
from sindyjoint.equation.formula import formula_text

Array = NDArray[np.float64]

# Beyond this share of a number and so many of its standard errors the processing is not known to move it so.
LARGEST, LARGEST_SIGMAS = 0.5, 2.0
# Repetitions of θ = θ̂ − b(θ), and the change, in standard errors, at which they end.
ROUNDS, SAME = 6, 0.1
# Forms of an element whose unlikeness to the measurement differs by less than this share are not told apart: in five of
# seven campaigns in which a moment drives a play a wrong form was ahead, by up to 8 %.
FORM_LEAD = 0.1
# How many times the last change a step may go beyond it.
FURTHEST = 3.0
# Draws of noise, each used with both signs: what is linear in it then leaves the mean.
PAIRS = 4
# Steps of a fit to replicates.
MOST_STEPS = 12


@dataclass(frozen=True, eq=False)
class _Solved:
    """A repaired model whose numbers θ solve θ = θ̂ − b(θ).

    Parameters
    ----------
    fitted : Repaired
        With θ̂.
    numbers : Numbers
        θ̂ and its covariance.
    moved : ndarray
        b(θ).
    replicates : Replicates
        Of the model with θ.
    unlikeness : float
        Sum of squares of the difference of the residuals that the fit leaves of the measurement and of these
        replicates, in units of noise.
    """

    fitted: Repaired
    numbers: Numbers
    moved: Array
    replicates: Replicates
    unlikeness: float


def without_bias(work: Work, repaired: Repaired) -> tuple[Repaired, tuple[str, ...]]:
    """Return a repaired model whose numbers are freed of what the processing of repeating runs does to them, and notes.

    An element is used in the form, of those that the catalogue has of it, whose replicates are most like the
    measurement: rounded corners of one form look like another, and where two are alike a note says so. The model stays
    as it is where it has no element, where runs do not repeat, where a simulation does not follow them, or where a
    number would move by more than its half. A share of the correction stays in the errors, as of any correction.
    """
    if not any(is_element(e) for e in repaired.effects) or not all(row.folded for row in work.rows):
        return repaired, ()
    forms = [repaired]
    for place, each in enumerate(repaired.effects):
        if is_element(each):
            forms += [_in_form(work, repaired, place, other) for other in _other_forms(each)]
    solved = [found for form in forms if (found := _solve(work, form)) is not None]
    if not solved:
        return repaired, ()
    best = min(solved, key=lambda each: each.unlikeness)
    values, covariance = best.numbers.values, best.numbers.covariance
    by_noise, scatter = _by_noise(best)
    # One factor for all numbers: a few draws do not tell the scatter of each.
    wider = max(1.0, float(np.mean(scatter / np.diag(covariance))))
    total = best.moved + by_noise
    covariance = covariance * wider + np.outer(total, total) * BIAS.uncertain_share**2
    alike = [each for each in solved if each.unlikeness < (1 + FORM_LEAD) * best.unlikeness]
    return with_numbers(best.fitted, values - total, covariance), _undetermined_forms(best, alike)


def _undetermined_forms(best: _Solved, alike: Sequence[_Solved]) -> tuple[str, ...]:
    """Return a note for each element of which other forms are as like the measurement."""
    notes = []
    for place, mine in enumerate(best.fitted.effects):
        others = [each.fitted.effects[place].variant for each in alike]
        forms = [_formulas(v) for v in others if v is not mine.variant]
        if forms:
            notes.append(
                f"these runs do not determine the form of {mine.effect.name}: {_formulas(mine.variant)} is used, and "
                f"{' or '.join(forms)} fits as well; its numbers hold for the form used"
            )
    return tuple(notes)


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
    most = np.maximum(LARGEST * np.abs(numbers.values), LARGEST_SIGMAS * errors)
    left = np.concatenate(
        [row.white(row.target - modelled(row, fitted.model, fitted.effects)) for row in work.rows]
    )
    inner = np.r_[tuple(numbers.inner.values())] if numbers.inner else np.empty(0, dtype=int)
    trial, last, found = np.zeros_like(errors), None, None
    for _ in range(ROUNDS):
        # ``trial`` is θ - θ̂, ``short`` is what θ̂ - b(θ) - θ has still to go.
        if np.any((numbers.values + trial)[inner] <= LEAST_LEFT * numbers.values[inner]):
            return None
        there = Replicates.of(work, with_numbers(fitted, numbers.values + trial, numbers.covariance))
        if there is None:
            return None
        missed, own = there.fit(there.rows(), most=MOST_STEPS)
        moved = missed - there.numbers.values
        found = _Solved(fitted, numbers, moved, there, float(np.sum((left - own) ** 2)))
        short = numbers.values - missed
        if np.any(np.abs(moved) > most):
            return None
        if np.all(np.abs(short) < SAME * errors):
            break
        trial, last = _next_trial(trial, short, last, errors), (trial, short)
    return found


def _next_trial(trial: Array, short: Array, last: tuple[Array, Array] | None, errors: Array) -> Array:
    """Return the next trial of a fixed point, by the last two (Anderson, J. ACM 12(4), 1965, with one earlier step)."""
    if last is None:
        return trial + short
    change = (short - last[1]) / errors
    share = float(change @ (short / errors)) / max(float(change @ change), 1e-300)
    share = float(np.clip(share, -FURTHEST, 0.5))
    return np.asarray(trial + short - share * (trial + short - last[0] - last[1]))


def _by_noise(solved: _Solved) -> tuple[Array, Array]:
    """Return by how much noise moves numbers on average beyond the processing, and their variance by it.

    Pairs of opposite noise: the mean of a pair holds what is quadratic in it, half of the difference what is linear.
    """
    rng, replicates = np.random.default_rng(0), solved.replicates
    fitted = replicates.numbers.values + solved.moved
    means, halves = [], []
    for _ in range(PAIRS):
        noise = replicates.draw_noise(rng)
        both = []
        for sign in (1.0, -1.0):
            rows = replicates.rows([(sign * moment, sign * angle) for moment, angle in noise])
            both.append(replicates.fit(rows, fitted)[0] - fitted)
        means.append((both[0] + both[1]) / 2)
        halves.append((both[0] - both[1]) / 2)
    return np.mean(means, axis=0), np.mean(np.square(halves), axis=0)


def _other_forms(effect: FittedEffect) -> list[FittedEffect]:
    """Return an effect in the other forms that the catalogue has of it, with the same numbers."""
    mine = effect.variant
    return [
        replace(effect, variant=other)
        for other in effect.effect.variants
        if other is not mine
        and other.names == mine.names
        and [c.symbol for c in other.columns] == [c.symbol for c in mine.columns]
        and [s.name for s in other.states] == [s.name for s in mine.states]
    ]


def _in_form(work: Work, repaired: Repaired, place: int, form: FittedEffect) -> Repaired:
    """Return the repaired model with an effect in another form, fitted to the rows."""
    others = [e for k, e in enumerate(repaired.effects) if k != place]
    fitted = refine_effect(GapRegression.build(work.rows, repaired.model, others, work.policy), form)
    effects = (*repaired.effects[:place], fitted, *repaired.effects[place + 1 :])
    keeping = replace(work.policy, needless_ratio=0.0)
    return replace(refit(work.rows, repaired.model, effects, keeping), dropped=repaired.dropped)
