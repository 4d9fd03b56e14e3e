"""A law with the effects found, everything fitted together: channels aligned, zeros counted, numbers refined."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from sindyjoint.diagnosis.campaign.regression import GapRegression
from sindyjoint.diagnosis.campaign.repair import Repaired, keeping, refit, refit_nonlinear
from sindyjoint.diagnosis.campaign.rows.build import gap_runs
from sindyjoint.diagnosis.campaign.start import Work
from sindyjoint.diagnosis.effects.fitted import Corrections, FittedEffect
from sindyjoint.discovery.delay import shifted
from sindyjoint.discovery.policy import POLICY
from sindyjoint.equation.model import JointModel
from sindyjoint.numeric import Array

LONGEST = POLICY.longest_delay  # that the linear steps may reach
SAME_ZERO = 1e-4  # change of a zero error or a drift, of itself, that is none
ZERO_ROUNDS = 12
ROUNDS = 4  # of delays and nonlinear parameters in turn; the third changes neither by its error


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
        effects = refit_nonlinear(work.rows, repaired.model, repaired.effects, work.policy)
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
        others = refit_nonlinear(work.rows, work.model, others, work.policy)
    return work, shifts, others


def _realigned(work: Work, others: list[FittedEffect], delay: FittedEffect) -> tuple[Work, FittedEffect]:
    """Correct a delay that was removed while an effect was missing beside it, where that leaves less of the moment."""
    before = GapRegression.build(work.plain, work.model, others, work.policy)
    gain, coefficients = before.gain(delay.variant, delay.values)
    if gain < work.policy.realign:
        return work, delay
    later, more = aligned(work, others, replace(delay, coefficients=coefficients))
    after = GapRegression.build(later.plain, later.model, others, work.policy)
    if after.chi_square / after.target.size > before.chi_square / before.target.size:
        return work, delay
    return later, replace(delay, coefficients=delay.coefficients + more.coefficients)
