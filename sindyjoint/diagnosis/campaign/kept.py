"""Runs that were kept out of the fit, held against a model with effects as a verification holds them."""

from __future__ import annotations

from collections.abc import Sequence

from sindyjoint.diagnosis.campaign.start import Work
from sindyjoint.diagnosis.effects.fitted import Corrections, FittedEffect, law_of
from sindyjoint.equation.element import Value
from sindyjoint.equation.model import JointModel
from sindyjoint.equation.test_record import Enters, Nuisance, TestNuisances
from sindyjoint.errors import SindyJointError
from sindyjoint.mechanics.laws import Law
from sindyjoint.response.compared import compare_run, compared_states, corrected
from sindyjoint.response.run import SimulatedRun
from sindyjoint.states import ForceStates


def kept_runs(work: Work, model: JointModel, effects: Sequence[FittedEffect]) -> list[SimulatedRun]:
    """Return the runs kept for validation beside their simulation; without those that no simulation can follow."""
    campaign = corrected(_channels(effects), work.campaign)
    runs = {run.name: run for run in campaign.validation_runs}
    timed = any(each.variant.uses & {"time", "elapsed"} for each in effects if each.effect.enters == "moment")

    def law(states: ForceStates) -> Law:
        return law_of(model, effects, states)

    found = []
    for states in compared_states(campaign, list(runs.values()), timed):
        try:
            found.append(compare_run(law, runs[states.run], states))
        except SindyJointError:
            continue  # a law that no simulation can follow: the gap says so by having no figure
    return found


def _channels(effects: Sequence[FittedEffect]) -> TestNuisances:
    """Return what effects put right in the channels; the inertia belongs to the law."""
    found = Corrections.of(effects)
    values: tuple[tuple[Enters, float], ...] = (
        ("time shift", found.shift),
        ("angle zero", found.zero),
        ("angle drift", found.drift),
    )
    made = [Nuisance(way, way, Value("", value, 0.0, (value, value), "")) for way, value in values if value]
    return TestNuisances("", nuisances=tuple(made))
