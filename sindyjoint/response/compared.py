"""Runs as they are held against a model: put right, their states, the simulation that answers them.

A diagnosis computes its gap on runs that were kept out of its fit by the same functions as a verification, so that the
saved model has that gap again.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np

from sindyjoint.equation.model import JointModel
from sindyjoint.equation.test_record import TestNuisances
from sindyjoint.mechanics.laws import Law
from sindyjoint.record import Campaign, Run
from sindyjoint.response.drive import Drive, prescribed
from sindyjoint.response.nuisances import law_of_test
from sindyjoint.response.policy import POLICY
from sindyjoint.response.run import WINDOW, SimulatedRun, pooled_nrmse, simulate_run
from sindyjoint.states import ForceStates, force_states, one_after_another, states_of
from sindyjoint.states.build import Choice

LawOf = Callable[[ForceStates], Law]


def compared_states(campaign: Campaign, runs: Sequence[Run], timed: bool) -> tuple[ForceStates, ...]:
    """Return the force states of runs, one after another.

    Parameters
    ----------
    campaign : Campaign
    runs : sequence of Run
        Of it.
    timed : bool
        Whether the law changes in time: then no run repeats, whatever its drive does.
    """
    method: Choice = "broadband" if timed else "auto"
    return one_after_another(campaign, states_of(campaign, runs, method))


def compare_run(
    law_of: LawOf,
    run: Run,
    states: ForceStates,
    window: float | None = WINDOW,
    free_run: int | None = None,
    response_only: bool = False,
) -> SimulatedRun:
    """Simulate the law of a run, by the motion where that was the drive.

    A free run has no steady state, whether it repeats or not; see :func:`~sindyjoint.response.run.simulate_run`.
    """
    law = law_of(states)
    drive: Drive | None = "motion" if prescribed(states, inertia=law.inertia) else None
    if free_run is not None:
        # Moments of one test depend on the time at which states begin.
        states = replace(force_states(run, "broadband"), began=states.began)
        law = law_of(states)
    return simulate_run(
        law, run, states, drive=drive, window=window, free_run=free_run, response_only=response_only
    )


def pooled_errors(runs: Sequence[SimulatedRun]) -> tuple[float, float]:
    """Return the relative RMS errors of moment and response of several runs; runs that failed are left out.

    NaN where none is left.
    """
    moments = [("moment", run.moment_nrmse, run.moment_scale) for run in runs]
    responses = [(run.channel, run.response_nrmse, run.response_scale) for run in runs]
    known = [[each for each in errors if each[1] == each[1]] for errors in (moments, responses)]
    return pooled_nrmse(known[0]), pooled_nrmse(known[1])


def simulated_gap(model: JointModel, campaign: Campaign, test: TestNuisances) -> float:
    """Return the response NRMSE over the validation runs, or all; NaN where a simulation fails."""
    return _gap_and_floor(model, campaign, test, WINDOW)[0]


def _gap_and_floor(
    model: JointModel, campaign: Campaign, test: TestNuisances, window: float | None
) -> tuple[float, float]:
    runs = {run.name: run for run in campaign.validation_runs or campaign.runs}
    found = [
        compare_run(
            lambda known: law_of_test(test, model, known), runs[states.run], states, window, None, True
        )
        for states in compared_states(campaign, list(runs.values()), False)
    ]
    errors = [(run.channel, run.response_nrmse, run.response_scale) for run in found]
    floors = [(run.channel, run.response_floor, run.response_scale) for run in found]
    return pooled_nrmse(errors), pooled_nrmse(floors)


def predicts_worse(
    before: JointModel, after: JointModel, campaign: Campaign, test: TestNuisances, window: float | None
) -> str:
    """Return in words by how much a model predicts runs kept out worse than another one; empty if it does not.

    What a law lacks goes into numbers that are fitted to its response, and is of the runs that they were fitted to. A
    difference within the noise of those kept out is none.
    """
    if not campaign.validation_runs:
        return ""
    (first, floor), (last, _) = (_gap_and_floor(model, campaign, test, window) for model in (before, after))
    if np.isnan(first) or last <= (1 + POLICY.kept_out_growth) * np.hypot(first, np.nan_to_num(floor)):
        return ""
    missed = f"by {100 * last:.3g} %" if np.isfinite(last) else "altogether"
    return f"the runs kept out would be missed {missed}, where they are by {100 * first:.3g} % without it"
