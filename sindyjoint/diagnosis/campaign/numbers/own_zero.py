"""The joint's own zero as a number of the law: fitted with everything else once the law is there.

The zero from which a search starts is found beside a law that lacks what the search finds later, and with a constant
beside it that says nearly the same. By as much as it is wrong a constant moment seems to be there, M_0 = k1·Δθ_0.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from sindyjoint.diagnosis.campaign.joint_zero import CONSTANT, counted_from, has_middle, shifted_run
from sindyjoint.diagnosis.campaign.measure import score_of
from sindyjoint.diagnosis.campaign.numbers.whole import number_columns
from sindyjoint.diagnosis.campaign.regression import stack
from sindyjoint.diagnosis.campaign.repair import (
    Repaired,
    keeping,
    least_squares,
    modelled,
    refit,
    refit_nonlinear,
)
from sindyjoint.diagnosis.campaign.rows.run import GapRun
from sindyjoint.diagnosis.effects.fitted import FittedEffect
from sindyjoint.diagnosis.evidence.policy import POLICY
from sindyjoint.equation.model import JointModel
from sindyjoint.numeric import Array

# The problem of a campaign is made of this module's functions: its class, which imports them, cannot be named here.
Problem = Any

# Steps of Gauss and Newton, of which the last is below this share of the zero's standard error; the difference by which
# the law's slope along the motion is taken, of the largest angle.
ROUNDS, SMALL_STEP, DIFFERENCE = 6, 0.1, 1e-4


def with_zero_fitted(problem: Problem) -> tuple[Problem, bool]:
    """Return the problem with its zero fitted beside the law, and whether a constant moment went by it.

    A constant stays where it wins beside the zero that is best without it; the zero is then fitted beside both, if the
    law has effects that know where its middle is.
    """
    constant = next((e for e in problem.found if e.name == CONSTANT), None)
    others = tuple(e for e in problem.found if e is not constant)
    without = _fitted(problem, others)
    if constant is None:
        return without, False
    both = _fitted(problem, problem.found) if any(has_middle(e.effect) for e in others) else problem
    scores = [score_of(p.work.plain, p.repaired.model, p.found).total for p in (both, without)]
    stays = scores[0] - scores[1] > -np.log(POLICY.chance)
    return (both, False) if stays else (without, True)


def _fitted(problem: Problem, effects: Sequence[FittedEffect]) -> Problem:
    """Return the problem with these effects, all numbers and the zero fitted together."""
    work, model = problem.work, problem.repaired.model
    shifts = [e for e in effects if e.shifts]
    adding: Sequence[FittedEffect] = [e for e in effects if not e.shifts]
    total, error, chi_square = 0.0, 0.0, np.inf
    best: Repaired | None = None
    for _ in range(ROUNDS):
        rows = [shifted_run(run, total) for run in work.rows]
        adding = refit_nonlinear(rows, model, adding, work.policy)
        fitted = refit(rows, model, adding, keeping(work.policy))
        step, its_error, misfit = _zero_step(rows, fitted.model, fitted.effects)
        if not misfit < chi_square:
            break
        found, best, error, chi_square = total, fitted, its_error, misfit
        if abs(step) < SMALL_STEP * error:
            break
        total += step
    assert best is not None
    later = counted_from(problem, found, best)
    repaired = replace(later.repaired, effects=(*shifts, *later.repaired.effects))
    return replace(later, repaired=repaired, zero_error=error)


def _zero_step(
    rows: Sequence[GapRun], model: JointModel, effects: Sequence[FittedEffect]
) -> tuple[float, float, float]:
    """Return the step of the zero by linearisation of all numbers, its standard error, and χ² as it is."""
    largest = max(float(np.abs(run.angle).max()) for run in rows)
    columns = stack(rows, lambda run: _columns(run, model, effects, DIFFERENCE * largest))
    residual = np.concatenate([run.white(run.target - modelled(run, model, effects)) for run in rows])
    numbers, covariance = least_squares(columns, residual)
    step = float(np.clip(numbers[0], -largest, largest))
    return step, float(np.sqrt(covariance[0, 0])), float(residual @ residual)


def _columns(run: GapRun, model: JointModel, effects: Sequence[FittedEffect], difference: float) -> Array:
    """Return the derivatives of a run's moment by the zero from which its displacement is counted, and all numbers."""
    low, high = (modelled(shifted_run(run, by), model, effects) for by in (-difference, difference))
    return np.column_stack([(high - low) / (2 * difference), number_columns(run, model, effects)])
