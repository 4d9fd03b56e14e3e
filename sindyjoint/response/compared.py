"""Runs as they are held against a model: put right, their states, the simulation that answers them.

A diagnosis computes its gap on runs that were kept out of its fit by the same functions as a verification, so that the
saved model has that gap again.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence

from sindyjoint.mechanics.laws import Law
from sindyjoint.record import Campaign, Run
from sindyjoint.response.drive import Drive, prescribed
from sindyjoint.response.run import WINDOW, SimulatedRun, pooled_nrmse, simulate_run
from sindyjoint.states import ForceStates, one_after_another, states_of
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


def compare_run(law_of: LawOf, run: Run, states: ForceStates, window: float = WINDOW) -> SimulatedRun:
    """Simulate the law of a run, by the motion where that was the drive."""
    law = law_of(states)
    drive: Drive | None = "motion" if prescribed(states, inertia=law.inertia) else None
    return simulate_run(law, run, states, drive=drive, window=window)


def pooled_errors(runs: Sequence[SimulatedRun]) -> tuple[float, float]:
    """Return the relative RMS errors of moment and response of several runs; runs that failed are left out.

    NaN where none is left.
    """
    moments = [("moment", run.moment_nrmse, run.moment_scale) for run in runs]
    responses = [(run.channel, run.response_nrmse, run.response_scale) for run in runs]
    known = [[each for each in errors if each[1] == each[1]] for errors in (moments, responses)]
    return pooled_nrmse(known[0]), pooled_nrmse(known[1])
