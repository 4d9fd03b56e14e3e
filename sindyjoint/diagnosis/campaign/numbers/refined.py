"""The numbers of a repaired model fitted once more, to the simulated response of its campaign."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from sindyjoint.equation.element import JointElement
from sindyjoint.equation.formula import formula_text
from sindyjoint.equation.model import JointModel
from sindyjoint.equation.test_record import TestNuisances
from sindyjoint.record import Campaign
from sindyjoint.response.compared import simulated_gap
from sindyjoint.response.nuisances import corrected
from sindyjoint.response.refine import refine
from sindyjoint.states import campaign_states, one_after_another

if TYPE_CHECKING:
    from sindyjoint.diagnosis.campaign.problem import CampaignProblem
    from sindyjoint.diagnosis.effects.fitted import FittedEffect


def refined_problem(
    problem: CampaignProblem,
    usable: Campaign,
    test: TestNuisances,
    progress: Callable[[str], None] | None = None,
) -> tuple[CampaignProblem, tuple[str, ...]]:
    """Return a repaired campaign whose whole model is fitted to the simulated response, and notes on that.

    As it is where the response gap would grow by it. Where the catalogue has further forms of an element, as of Bouc
    and Wen's law or of a gap, the one with the least misfit of the response is used.

    Parameters
    ----------
    problem : CampaignProblem
        The last one of a diagnosis.
    usable : Campaign
        Without the samples that the check of the data leaves out; channels as they were measured.
    test : TestNuisances
        What the diagnosis found of the test.
    progress : callable, optional
    """
    whole = problem.whole
    if not (whole.terms or whole.elements):
        return problem, ()
    (progress or (lambda stage: None))("refining on the simulated response")
    campaign = corrected(test, usable)
    states = one_after_another(campaign, campaign_states(campaign))
    tried = [
        refine(model, campaign, states=states, test=test)
        for model in (whole, *other_forms(whole, problem.found))
    ]
    # One that did not succeed has no misfit.
    refinement = min(tried, key=lambda each: each.misfit if each.refined else np.inf)
    if not refinement.refined:
        return problem, refinement.notes
    before, after = (simulated_gap(model, campaign, test) for model in (whole, refinement.model))
    if not after <= (1 + problem.policy.refined_gap) * before:
        note = (
            f"the refinement on the simulated response is not used: the response gap would be {100 * after:.3f} % "
            f"where it is {100 * before:.3f} %"
        )
        return problem, (note,)
    notes = refinement.notes
    if refinement is not tried[0]:
        notes = (
            *notes,
            "the simulated response is better with another form of an element than the regression chose: "
            f"{refinement.model.equation()}",
        )
    return problem.with_whole(refinement.model), notes


def other_forms(model: JointModel, effects: Sequence[FittedEffect]) -> list[JointModel]:
    """Return a model with one element in another form that the catalogue has of its effect, numbers as they are.

    Forms with other numbers than the element has are left out.
    """
    models = []
    for effect in effects:
        place = next((i for i, each in enumerate(model.elements) if each.id == effect.name), None)
        if place is None:
            continue
        known = model.elements[place]
        seen = {_form(known)}
        for variant in effect.effect.variants:
            if variant.names != effect.variant.names or len(variant.columns) != len(known.columns):
                continue
            if [state.name for state in variant.states] != [state.name for state in known.states]:
                continue
            columns = tuple(
                replace(value, formula=formula_text(column.expression))
                for value, column in zip(known.columns, variant.columns, strict=True)
            )
            states = tuple(
                replace(
                    old,
                    rate=formula_text(new.rate),
                    limit=None if new.limit is None else formula_text(new.limit),
                )
                for old, new in zip(known.states, variant.states, strict=True)
            )
            other = replace(known, columns=columns, states=states)
            if _form(other) not in seen:
                seen.add(_form(other))
                elements = (*model.elements[:place], other, *model.elements[place + 1 :])
                models.append(replace(model, elements=elements))
    return models


def _form(element: JointElement) -> tuple[str, ...]:
    """Return the formulas of an element."""
    return (
        *(column.formula for column in element.columns),
        *(f"{state.rate}, {state.limit}" for state in element.states),
    )
