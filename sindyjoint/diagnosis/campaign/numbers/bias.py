"""What the processing does to the numbers of a repaired model with elements, taken out of them.

A mean period rounds off the corners of a slider. The repaired model is simulated under the measured drive, its motion
and moment are processed as the measurement was, and the numbers are fitted to these rows by one Gauss-Newton step from
the values that are true there: δ = (JᵀJ)⁻¹Jᵀr is what the processing moves them by.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from sindyjoint.bias.policy import POLICY as BIAS
from sindyjoint.diagnosis.campaign.numbers.whole import is_element, number_columns, numbers_of
from sindyjoint.diagnosis.campaign.regression import stack
from sindyjoint.diagnosis.campaign.repair import Repaired, least_squares, modelled
from sindyjoint.diagnosis.campaign.rows.build import gap_runs
from sindyjoint.diagnosis.campaign.rows.run import GapRun
from sindyjoint.diagnosis.campaign.simulated_run import simulated
from sindyjoint.diagnosis.campaign.start import Work
from sindyjoint.diagnosis.effects.fitted import FittedEffect
from sindyjoint.equation.model import JointModel
from sindyjoint.errors import SindyJointError
from sindyjoint.record import Run
from sindyjoint.response.model_law import with_coefficients
from sindyjoint.states import ForceStates, force_states

Array = NDArray[np.float64]

# Beyond this share of a number one linear step does not tell what the processing does to it.
LARGEST = 0.2


def without_bias(work: Work, repaired: Repaired) -> Repaired:
    """Return a repaired model whose numbers are freed of what the processing of repeating runs does to them.

    As it is where it has no element, where runs do not repeat, where the simulation does not follow them, or where a
    number would move by more than a fifth. A share of the correction stays in the errors, as of any correction, and
    what no change of the numbers takes off the replicate's rows counts as their error.
    """
    model, effects = repaired.model, repaired.effects
    if not any(is_element(e) for e in effects) or not all(row.folded for row in work.rows):
        return repaired
    rows = _replicated(work, model, effects)
    if rows is None:
        return repaired
    numbers = numbers_of(repaired, work.rows)
    left = np.concatenate([row.white(row.target - modelled(row, model, effects)) for row in rows])
    adding, shifts = ([e for e in effects if e.shifts == shift] for shift in (False, True))
    slopes = stack(rows, lambda row: number_columns(row, model, adding, shifts))
    moved, _ = least_squares(slopes, left)
    remaining = _covariance_of(slopes, left - slopes @ moved)
    for each in shifts:
        moved[numbers.coefficients[each.name]] = 0.0
    if np.any(np.abs(moved) > LARGEST * np.abs(numbers.values)):
        return repaired
    values = numbers.values - moved
    covariance = numbers.covariance + np.outer(moved, moved) * BIAS.uncertain_share**2 + remaining
    size = len(model.terms)
    later = tuple(
        e
        if e.shifts
        else replace(
            e, coefficients=values[numbers.coefficients[e.name]], values=values[numbers.inner[e.name]]
        )
        for e in effects
    )
    return replace(
        repaired,
        model=with_coefficients(model, values[:size], covariance[:size, :size]),
        effects=later,
        covariance=covariance,
    )


def _covariance_of(slopes: Array, errors: Array) -> Array:
    """Return the covariance of numbers whose rows err by so much, with unknown sign (White 1980, equation 3)."""
    size = np.maximum(np.linalg.norm(slopes, axis=0), 1e-300)
    inverse = np.linalg.pinv(slopes / size)
    found: Array = (inverse * errors**2) @ inverse.T / np.outer(size, size)
    return found


def _replicated(work: Work, model: JointModel, effects: Sequence[FittedEffect]) -> tuple[GapRun, ...] | None:
    """Return the rows of the model's own simulation of every run; None where one has none."""
    states = []
    for run, state in zip(work.runs, work.states, strict=True):
        made = _replicate(run, state, model, effects, work)
        if made is None:
            return None
        states.append(made)
    return gap_runs(states, model, work.groups, work.policy)


def _replicate(
    run: Run, state: ForceStates, model: JointModel, effects: Sequence[FittedEffect], work: Work
) -> ForceStates | None:
    result = simulated(run, state, model, effects, work.policy)
    if result is None or result.simulated_response is None:
        return None
    moves = result.drive == "motion"
    made = replace(
        run,
        moment=result.simulated_moment if moves else result.moment,
        angle=result.states.angle if moves else result.simulated_response,
        rate=None,
        source=None,
        valid=None,
    )
    try:
        there = force_states(made, "periodic", state.bandwidth, rate_share=work.policy.rate_share)
    except SindyJointError:
        return None
    return replace(there, noise=state.noise)
