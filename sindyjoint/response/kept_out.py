"""The response of runs that a fit did not use: what a model predicts, before and after its numbers are refined."""

from __future__ import annotations

import numpy as np

from sindyjoint.equation.model import JointModel
from sindyjoint.equation.test_record import TestNuisances
from sindyjoint.record import Campaign
from sindyjoint.response.drive import Drive, prescribed
from sindyjoint.response.nuisances import law_of_test
from sindyjoint.response.policy import POLICY
from sindyjoint.response.run import pooled_nrmse, simulate_run
from sindyjoint.states import one_after_another, states_of


def simulated_gap(model: JointModel, campaign: Campaign, test: TestNuisances) -> float:
    """Return the response NRMSE over the validation runs, or all; NaN where a simulation fails."""
    return _gap_and_floor(model, campaign, test)[0]


def _gap_and_floor(model: JointModel, campaign: Campaign, test: TestNuisances) -> tuple[float, float]:
    runs = {run.name: run for run in campaign.validation_runs or campaign.runs}
    errors, floors = [], []
    for states in one_after_another(campaign, states_of(campaign, list(runs.values()))):
        law = law_of_test(test, model, states)
        motion = prescribed(states, inertia=law.inertia)
        drive: Drive | None = "motion" if motion else None
        run = simulate_run(law, runs[states.run], states, drive=drive, response_only=True)
        errors.append(("moment" if motion else "angle", run.response_nrmse, run.response_scale))
        floors.append(("moment" if motion else "angle", run.response_floor, run.response_scale))
    return pooled_nrmse(errors), pooled_nrmse(floors)


def predicts_worse(before: JointModel, after: JointModel, campaign: Campaign, test: TestNuisances) -> str:
    """Return in words by how much a model predicts runs kept out worse than another one; empty if it does not.

    What a law lacks goes into numbers that are fitted to its response, and is of the runs that they were fitted to. A
    difference within the noise of those kept out is none.
    """
    if not campaign.validation_runs:
        return ""
    (first, floor), (last, _) = (_gap_and_floor(model, campaign, test) for model in (before, after))
    if np.isnan(first) or last <= (1 + POLICY.kept_out_growth) * np.hypot(first, np.nan_to_num(floor)):
        return ""
    missed = f"by {100 * last:.3g} %" if np.isfinite(last) else "altogether"
    return f"the runs kept out would be missed {missed}, where they are by {100 * first:.3g} % without it"
