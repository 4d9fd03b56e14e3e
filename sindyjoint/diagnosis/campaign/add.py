"""Adding an effect to those found before: channels aligned, earlier names tested again, everything fitted together."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from sindyjoint.diagnosis.campaign.admissible import off_its_ends, off_the_ends
from sindyjoint.diagnosis.campaign.candidates import fit_effect, fit_effects, refine_effect
from sindyjoint.diagnosis.campaign.regression import GapRegression, rank_effects
from sindyjoint.diagnosis.campaign.repair import Repaired, keeping, refit, refit_nonlinear, without
from sindyjoint.diagnosis.campaign.rows.build import gap_runs
from sindyjoint.diagnosis.campaign.start import Work
from sindyjoint.diagnosis.effects.catalogue import Effect
from sindyjoint.diagnosis.effects.fitted import Corrections, FittedEffect
from sindyjoint.diagnosis.ranking import Ranking
from sindyjoint.discovery.delay import shifted
from sindyjoint.discovery.policy import POLICY
from sindyjoint.equation.model import JointModel
from sindyjoint.numeric import Array

LONGEST = POLICY.longest_delay  # that the linear steps may reach
SAME_ZERO = 1e-4  # change of a zero error or a drift, of itself, that is none
ZERO_ROUNDS = 12
ROUNDS = 4  # of delays and nonlinear parameters in turn; the third changes neither by its error

Retested = dict[str, Ranking[FittedEffect] | None]


def add_effect(
    work: Work, found: Sequence[FittedEffect], best: FittedEffect, candidates: Sequence[Effect]
) -> tuple[Work, Repaired, Retested]:
    """Return the model with an effect added to those found before, delays of the channels first.

    A delay is removed from the states, which decides anew what the effects before it were; any other effect is fitted
    beside them, and each of them is tested again against the ``candidates``, if there are any: the result says by
    what it was replaced, or that it is needless.
    """
    shifts = [f for f in found if f.shifts]
    others = [f for f in found if not f.shifts]
    if best.shifts:
        work, best = aligned(work, others, best)
        shifts = [*(f for f in shifts if f.effect.id != best.effect.id), best]
        others, again = _retested(work, others, others, candidates)
    else:
        # A search ends as soon as it knows what an effect is; what has states was refined to know that.
        best = best if best.variant.states else refine_effect(work.regression(others), best)
        others, again = _retested(work, [*others, best], others, candidates)
        others, again = _ranked_again(work, others, best, candidates, again)
    return *fitted_together(work, shifts, others), again


def fitted_together(
    work: Work, shifts: list[FittedEffect], others: list[FittedEffect]
) -> tuple[Work, Repaired]:
    """Return the model with delays, which are removed from the states of ``work``, and effects, all fitted together."""
    work, shifts, others = _settled(work, shifts, others)
    folded = all(run.folded for run in work.rows)
    # Under weights of the model before, whose error the effect was, its terms do not stand out of their errors.
    repaired = refit(work.rows, work.model, others, work.policy if folded else keeping(work.policy))
    work = work.again(repaired.model, repaired.effects)
    if not folded:
        # The rows are weighted anew by the residual, and with them the nonlinear parameters.
        effects = _refitted(replace(work, model=repaired.model), repaired.effects)
        repaired = refit(work.rows, repaired.model, effects, work.policy)
    work, repaired = counted_from_zero(work, repaired)
    work = replace(work, model=repaired.model)
    return work, replace(repaired, effects=(*shifts, *repaired.effects))


def counted_from_zero(work: Work, repaired: Repaired) -> tuple[Work, Repaired]:
    """Correct what one linear step missed of a zero error of the angle or its drift: the secant is of the law found.

    Errors that do not settle are those of a law that lacks something else, and stay as they are.
    """
    later, fitted = work, repaired
    for _ in range(ZERO_ROUNDS):
        before = _angle_errors(fitted)
        if not before.any():
            break
        later = later.again(fitted.model, fitted.effects)
        fitted = refit(later.rows, later.model, fitted.effects, keeping(work.policy))
        if np.all(np.abs(_angle_errors(fitted) - before) <= SAME_ZERO * np.abs(before)):
            return later, fitted
    return work, repaired


def _angle_errors(repaired: Repaired) -> Array:
    found = Corrections.of(repaired.effects)
    return np.array([found.zero, found.drift])


def without_term(work: Work, name: str) -> Work:
    """Return the work less a term of its model that an effect of that name is with free numbers."""
    ids = work.model.ids
    if name not in ids or len(ids) < 2:
        return work
    return replace(work, model=without(work.model, ids.index(name)))


def aligned(work: Work, others: list[FittedEffect], delay: FittedEffect) -> tuple[Work, FittedEffect]:
    """Shift the states by the delay found, and correct what the linear estimate missed."""
    total, policy, gain = 0.0, work.policy, delay.gain
    states = work.states
    for _ in range(4):
        total = float(np.clip(total + delay.coefficients[0], -LONGEST, LONGEST))
        states = tuple(shifted(s, total) for s in work.states)
        rows = gap_runs(states, work.model, work.groups, policy)
        model: JointModel = refit(rows, work.model, others, policy).model
        rows = gap_runs(states, model, work.groups, policy)
        more, coefficients = GapRegression.build(rows, model, others, policy).gain(
            delay.variant, delay.values
        )
        delay = replace(delay, coefficients=coefficients)
        if more < 1.0:
            break
    delay = replace(delay, coefficients=np.array([total]), gain=gain)
    return work.again(work.model, others, states), delay


def _settled(
    work: Work, shifts: list[FittedEffect], others: list[FittedEffect]
) -> tuple[Work, list[FittedEffect], list[FittedEffect]]:
    """Correct delays and the nonlinear parameters beside them in turn: neither is right while the other is not."""
    for _ in range(ROUNDS):
        before = work
        for index, delay in enumerate(shifts):
            work, shifts[index] = _realigned(work, others, delay)
        if work is before or not any(each.values.size for each in others):
            break
        others = _refitted(work, others)
    return work, shifts, others


def _realigned(work: Work, others: list[FittedEffect], delay: FittedEffect) -> tuple[Work, FittedEffect]:
    """Correct a delay that was removed while an effect was missing beside it."""
    gain, coefficients = work.regression(others).gain(delay.variant, delay.values)
    if gain < work.policy.realign:
        return work, delay
    work, more = aligned(work, others, replace(delay, coefficients=coefficients))
    return work, replace(delay, coefficients=delay.coefficients + more.coefficients)


def _refitted(work: Work, effects: Sequence[FittedEffect]) -> list[FittedEffect]:
    """Return effects with their nonlinear parameters fitted anew, off the ends of their ranges where the data allow."""
    later = refit_nonlinear(work.rows, work.model, effects, work.policy)
    for index, each in enumerate(later):
        later[index] = off_its_ends(work.regression(later[:index] + later[index + 1 :]), each)
    return later


def _retested(
    work: Work, moving: list[FittedEffect], earlier: Sequence[FittedEffect], candidates: Sequence[Effect]
) -> tuple[list[FittedEffect], Retested]:
    """Test the effects found earlier again: each keeps its place, gives it to a better one, or goes."""
    again: Retested = {}
    if not earlier or not candidates:
        return moving, again
    moving = _refitted(work, moving)
    for name in [f.name for f in earlier]:
        each = next(f for f in moving if f.name == name)
        others = [f for f in moving if f is not each]
        if each.variant.states:
            others = _hysteresis_searched_anew(work, others)
        problem = work.regression(others)
        taken = {f.name for f in others}
        # Memory effects are many times dearer to fit: they are tried again only in the place of one of their own.
        trial = [
            e
            for e in candidates
            if e.id not in taken
            and e.enters != "time shift"
            and (e.family == each.family or not e.variants[0].states)
        ]
        ranking = off_the_ends(problem, rank_effects(problem, fit_effects(problem, trial)))
        if 1 - ranking.nothing < work.policy.belief:
            moving, again[name] = others, None
        else:
            best = ranking.fitted[0]
            moving = [best if f is each else f for f in moving]
            again[name] = ranking
    return moving, again


def _hysteresis_searched_anew(work: Work, effects: list[FittedEffect]) -> list[FittedEffect]:
    """Return effects with their hysteresis searched anew.

    Two hysteretic laws share one loop: by the numbers that they have beside each other neither can go.
    """
    later = list(effects)
    for index, each in enumerate(later):
        if each.variant.states:
            problem = work.regression(later[:index] + later[index + 1 :])
            later[index] = max(fit_effect(problem, each.effect), refine_effect(problem, each), key=_gain)
    return later


def _gain(fitted: FittedEffect) -> float:
    return fitted.gain


def _ranked_again(
    work: Work, moving: list[FittedEffect], best: FittedEffect, candidates: Sequence[Effect], again: Retested
) -> tuple[list[FittedEffect], Retested]:
    """Rank the effect that was added among all candidates where it made an earlier one needless."""
    if None not in again.values():
        return moving, again
    others = [f for f in moving if f.name != best.name]
    problem, taken = work.regression(others), {f.name for f in others}
    trial = [e for e in candidates if e.id not in taken and e.enters != "time shift"]
    ranking = off_the_ends(problem, rank_effects(problem, fit_effects(problem, trial)))
    if 1 - ranking.nothing < work.policy.belief:
        return moving, again
    return [*others, ranking.fitted[0]], {**again, best.name: ranking}
