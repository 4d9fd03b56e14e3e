"""The response gap: a model with effects simulated from the measured drive, beside the measurement."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from sindyjoint.diagnosis.campaign.regression import GapRegression
from sindyjoint.diagnosis.campaign.rows.build import gap_runs
from sindyjoint.diagnosis.campaign.simulated_run import simulated
from sindyjoint.diagnosis.campaign.start import Work
from sindyjoint.diagnosis.effects.fitted import FittedEffect
from sindyjoint.equation.model import JointModel
from sindyjoint.errors import SindyJointError
from sindyjoint.response.run import pooled_nrmse
from sindyjoint.states import force_states
from sindyjoint.states.rows import group_labels


def response_gap(work: Work, model: JointModel, effects: Sequence[FittedEffect]) -> float:
    """Return the relative RMS of measured less simulated response, over all runs of the fit.

    The angle where the moment drives, the moment where the motion does. Runs that the model cannot follow (it snaps
    through, say) are left out; NaN if it can follow none.
    """
    errors = []
    for run, state in zip(work.runs, work.states, strict=True):
        result = simulated(run, state, model, effects)
        if result is not None and np.isfinite(result.response_nrmse):
            errors.append((result.channel, result.response_nrmse, result.response_scale))
    return pooled_nrmse(errors)


# Runs whose simulations show what the processing leaves, at most.
MOST_SIMULATED = 4


def processing_error(work: Work) -> float:
    """Return what the processing leaves of the model's own simulation: mean square over that of the moment.

    The measured moment drives the model; its angle, with no noise of its own, goes through the same processing. Rows of
    runs that do not repeat know it already.
    """
    runs, model = work.runs, work.model
    known = [row.processing for row in work.rows if row.processing is not None]
    if known:
        own = np.concatenate([row.target for row in work.rows if row.processing is not None])
        return float(np.mean(np.concatenate(known) ** 2) / np.mean(own**2))
    chosen = [
        runs[i] for i in np.unique(np.linspace(0, len(runs) - 1, min(MOST_SIMULATED, len(runs))).astype(int))
    ]
    made = []
    for run in chosen:
        result = simulated(run, force_states(run), model, ())
        if result is None or result.simulated_angle is None:
            return 0.0
        made.append(
            replace(
                run, moment=result.moment, angle=result.simulated_angle, rate=None, source=None, valid=None
            )
        )
    try:
        states = [force_states(run) for run in made]
    except SindyJointError:
        return 0.0
    rows = gap_runs(states, model, group_labels(states), work.policy)
    problem = GapRegression.build(rows, model, (), work.policy)
    excess = max(problem.chi_square / problem.degrees - 1.0, 0.0)
    noise = float(np.mean(np.concatenate([r.sigma**2 for r in rows])))
    return excess * noise / model.fitted.moment_rms**2
