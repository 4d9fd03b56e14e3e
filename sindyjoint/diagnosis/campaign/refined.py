"""The numbers of a repaired model fitted once more, to the simulated response of its campaign.

A mean period rounds off the corners of a slider: numbers fitted along the measured motion are those of rounded corners,
and one form of an element looks like another. The simulated response has the corners where the joint has them.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np

from sindyjoint.diagnosis.campaign import reference_scales
from sindyjoint.diagnosis.campaign.numbers import is_element
from sindyjoint.diagnosis.campaign.problem import CampaignProblem
from sindyjoint.diagnosis.campaign.regression import GapRegression, wrong_signs
from sindyjoint.diagnosis.campaign.repair import Repaired, refine_effect, refit
from sindyjoint.diagnosis.effects import Variant
from sindyjoint.diagnosis.effects.fitted import FittedEffect
from sindyjoint.equation.formula import formula_text
from sindyjoint.equation.model import JointModel
from sindyjoint.equation.test_record import TestNuisances
from sindyjoint.record import Campaign
from sindyjoint.response import corrected, simulated_gap
from sindyjoint.response.refinement import refine
from sindyjoint.states import campaign_states, one_after_another


def refined_problem(
    problem: CampaignProblem,
    usable: Campaign,
    test: TestNuisances,
    progress: Callable[[str], None] | None = None,
) -> tuple[CampaignProblem, tuple[str, ...]]:
    """Return a repaired campaign whose whole model is fitted to the simulated response, and notes on that.

    As it is where the response gap would grow by it. Of the forms that the catalogue has of an element, as of Bouc and
    Wen's law or of a gap, the one with the least misfit of the response is used, or the plainest of those that are
    alike; a note names the others.

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
    if not (problem.whole.terms or problem.whole.elements):
        return problem, ()
    (progress or (lambda stage: None))("refining on the simulated response")
    campaign = corrected(test, usable)
    states = one_after_another(campaign, campaign_states(campaign))
    tried = [
        (form, refine(form.whole, campaign, states=states, test=test))
        for form in (problem, *_in_other_forms(problem))
    ]
    # An element that would have to push the other way stands in for something else.
    done = [(form, each) for form, each in tried if each.refined and _as_signed(form.whole, each.model)]
    if not done:
        return problem, tried[0][1].notes
    least = min(each.misfit for _, each in done)
    # Forms of an element whose misfits, a χ², are within this of the least are not told apart: they are as probable
    # as one to twenty.
    alike = [(form, each) for form, each in done if each.misfit <= least + 6.0]
    best, refinement = min(alike, key=lambda pair: (_rank(pair[0]), pair[1].misfit))
    before, after = (simulated_gap(model, campaign, test) for model in (problem.whole, refinement.model))
    if not after <= (1 + problem.policy.trivial_share) * before:
        note = (
            f"the refinement on the simulated response is not used: the response gap would be {100 * after:.3f} % "
            f"where it is {100 * before:.3f} %"
        )
        return problem, (note,)
    others = [form for form, _ in alike if form is not best]
    return best.with_whole(refinement.model), (*refinement.notes, *_undetermined(best, others))


def _as_signed(before: JointModel, after: JointModel) -> bool:
    """Return whether the coefficients of all elements kept their signs."""
    pairs = zip(before.elements, after.elements, strict=True)
    return all(np.array_equal(np.sign(a.coefficients), np.sign(b.coefficients)) for a, b in pairs)


def _in_other_forms(problem: CampaignProblem) -> list[CampaignProblem]:
    """Return the problem with an element in another form, or range, of the catalogue's, fitted to the rows."""
    work, repaired, found = problem.work, problem.repaired, []
    reference = reference_scales(work.rows)
    for place, each in enumerate(repaired.effects):
        for other in each.effect.variants if is_element(each) else ():
            if other == each.variant or other.names != each.variant.names:
                continue
            effects = list(repaired.effects)
            values = np.clip(each.values, *other.bounds(reference).T)
            effects[place] = replace(each, variant=other, values=values, within=None)
            fitted = _fitted(problem, effects, place)
            if not wrong_signs(other, fitted.effects[place].coefficients):
                found.append(replace(problem, repaired=fitted, work=replace(work, model=fitted.model)))
    return found


def _fitted(problem: CampaignProblem, effects: Sequence[FittedEffect], place: int) -> Repaired:
    """Return the repaired model with another form of one of its effects, all numbers fitted to the rows."""
    work = problem.work
    model = problem.repaired.model
    adding = [e for e in effects if not e.shifts]
    others = [e for e in adding if e is not effects[place]]
    new = refine_effect(GapRegression.build(work.rows, model, others, work.policy), effects[place])
    later = refit(work.rows, model, [new if e is effects[place] else e for e in adding], drops=False)
    by_name = {e.name: e for e in (*effects, *later.effects)}
    return replace(later, effects=tuple(by_name[e.name] for e in effects), dropped=problem.repaired.dropped)


def _rank(problem: CampaignProblem) -> list[int]:
    """Return which form of its effect each element has: the catalogue begins with the plainest."""
    ranks = []
    for each in problem.found:
        forms = [_formulas(variant) for variant in each.effect.variants]
        mine = _formulas(each.variant)
        ranks.append(forms.index(mine) if mine in forms else len(forms))
    return ranks


def _undetermined(best: CampaignProblem, others: Sequence[CampaignProblem]) -> tuple[str, ...]:
    """Return a note for each element that has another form in a model that is as like the measurement."""
    notes = []
    for place, mine in enumerate(best.found):
        forms = dict.fromkeys(_formulas(each.found[place].variant) for each in others)
        forms.pop(_formulas(mine.variant), None)
        if forms:
            notes.append(
                f"these runs do not determine the form of {mine.effect.name}: {_formulas(mine.variant)} is used, and "
                f"{' or '.join(forms)} fits as well; its numbers hold for the form used"
            )
    return tuple(notes)


def _formulas(variant: Variant) -> str:
    parts = [
        *(column.formula for column in variant.columns),
        *(f"{s.name}' = {formula_text(s.rate)}" for s in variant.states),
    ]
    return ", ".join(parts)
