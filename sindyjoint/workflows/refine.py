"""A whole model fitted again to the simulated response of a campaign: terms, elements, chosen errors of channels."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, fields, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from sindyjoint.equation.element import JointElement, Value
from sindyjoint.equation.formula import formula_text
from sindyjoint.equation.model import JointModel
from sindyjoint.equation.model_file import read_model
from sindyjoint.errors import InputError
from sindyjoint.judgement.policy import POLICY
from sindyjoint.record import Campaign
from sindyjoint.response.nuisances import Enters, Nuisance, TestNuisances, read_test
from sindyjoint.response.output_error_parts import Nuisance as Kind
from sindyjoint.response.refine import Refinement
from sindyjoint.response.refine import refine as refine_response
from sindyjoint.response.run import WINDOW, pooled_nrmse, prescribed, simulate_run
from sindyjoint.response.verify_campaign import verify_campaign
from sindyjoint.soundness.check import check_campaign, require_sound
from sindyjoint.states import ForceStates, campaign_states, force_states, one_after_another, transfer_noise
from sindyjoint.states.campaigns import content_hash
from sindyjoint.threads import single_threaded
from sindyjoint.workflows.discover import fitted_to, the_campaign
from sindyjoint.workflows.verify import CampaignVerification, put_right

if TYPE_CHECKING:
    from sindyjoint.diagnosis.campaign.problem import CampaignProblem
    from sindyjoint.diagnosis.effects.fitted import FittedEffect

# What the estimated errors of the channels are in test.json; a gain has no place there.
STORED: dict[str, tuple[str, Enters, str]] = {
    "delay": ("channel_delay", "time shift", "tau"),
    "offset": ("angle_offset", "angle zero", "theta_0"),
}


@dataclass(frozen=True, eq=False)
class RefinedModel(CampaignVerification):
    """A model refined on a campaign, and beside its response.

    Parameters
    ----------
    before : JointModel, optional
        As it was given.
    refinement : Refinement, optional
    test : TestNuisances, optional
        Of this campaign: what was given with the model, and the errors of channels estimated with it.
    """

    before: JointModel | None = None
    refinement: Refinement | None = None
    test: TestNuisances | None = None

    @property
    def refined(self) -> bool:
        """Whether the refinement succeeded."""
        return self.refinement is not None and self.refinement.refined

    def to_dict(self) -> dict[str, Any]:
        """Return what ``--json`` prints."""
        assert self.before is not None and self.refinement is not None
        rows = zip(number_labels(self.model), self.before.numbers, self.before.number_errors,
                   self.model.numbers, self.model.number_errors, strict=True)  # fmt: skip
        return {
            **super().to_dict(),
            "refinement": {
                "refined": self.refined,
                "reason": self.refinement.reason,
                "numbers": [
                    {
                        "number": name,
                        "before": [float(a), float(b)],
                        "after": [float(c), float(d)],
                        "unit": unit,
                    }
                    for (name, unit), a, b, c, d in rows
                ],
                "nuisances": {name: list(pair) for name, pair in self.refinement.nuisance.items()},
                "undetermined": list(self.refinement.undetermined),
            },
        }


def number_labels(model: JointModel) -> list[tuple[str, str]]:
    """Return name and unit of each of a model's numbers, in their order."""
    terms = [(term.id, term.unit) for term in model.terms]
    return terms + [(f"{n.name} of {each.id}", n.unit) for each in model.elements for n in each.numbers]


@single_threaded()
def refine(
    model: JointModel | str | Path,
    campaign: Campaign | str | Path | None,
    *,
    test: TestNuisances | None = None,
    nuisance: Sequence[Kind] = (),
    accept: Sequence[str] = (),
    align: bool = False,
    window: float = WINDOW,
    tolerance: float = POLICY.verification_tolerance,
    draws: int = 0,
    random_state: int | np.random.Generator | None = 0,
    progress: Callable[[str], None] | None = None,
) -> RefinedModel:
    """Fit the numbers of a given model, elements among them, to the simulated response of a campaign.

    Parameters
    ----------
    model : JointModel or path of a model.json
    campaign : Campaign, path of a campaign.toml, or None
        Fitted are the runs that may be used for identification; compared are those marked ``use = "validate"``, or all
        where none is. ``None``: the built-in virtual test.
    test : TestNuisances, optional
        As in :func:`~sindyjoint.workflows.verify.verify`: default, those of ``test.json`` beside the model.
    nuisance : sequence of {"delay", "gain", "offset"}
        What to estimate with the numbers; see :func:`sindyjoint.response.refine.refine`. Delay and offset become a part
        of the result's ``test``.
    accept, align, window, tolerance, draws, random_state, progress
        As in :func:`~sindyjoint.workflows.verify.verify`.

    Returns
    -------
    RefinedModel

    Raises
    ------
    InputError, UnknownNameError, UnsoundError
    """
    from sindyjoint.discovery.delay import align_channels

    say = progress or (lambda stage: None)
    if not isinstance(model, JointModel):
        test = read_test(model) if test is None else test
        model = read_model(model)
    if not (model.terms or model.elements):
        raise InputError("the model has no terms: there is nothing to refine; run discover first")
    given = the_campaign(campaign)
    say("checking the data")
    checked = require_sound(check_campaign(given, accept))
    usable, applied, notes = put_right(checked.usable, given, test)
    usable = align_channels(usable) if align else usable
    say("force states")
    states = one_after_another(usable, campaign_states(usable))
    result = refine_response(
        model, usable, states=states, nuisance=nuisance, test=applied, window=window, progress=say
    )
    later = result.model
    if result.refined:
        later = fitted_to(tested_on(later, states, usable), given)
    found = _stored(result, applied or TestNuisances(content_hash(given), given.joint.name))
    shown = found.corrected(checked.usable) if found else usable
    verified = verify_campaign(
        later,
        align_channels(shown) if align else shown,
        tolerance,
        draws,
        window,
        np.random.default_rng(random_state),
        say,
        found,
    )
    known = {each.name: getattr(verified, each.name) for each in fields(verified)}
    if "gain" in result.nuisance:
        notes = (*notes, "the gain that was estimated is not applied where model and campaign are compared")
    known["warnings"] = (*checked.warnings, *notes, *result.notes, *verified.warnings)
    return RefinedModel(
        **known, soundness=checked.soundness, before=model, refinement=result, test=found if found else None
    )


def tested_on(model: JointModel, states: Sequence[ForceStates], campaign: Campaign) -> JointModel:
    """Return a model whose record of its data is that of these states."""
    inertia = model.inertia
    moments = np.concatenate([s.transfer_moment(inertia)[s.moving] for s in states])
    noise = [transfer_noise(s, inertia) for s in states]
    fitted = replace(
        model.fitted,
        moment_rms=float(np.sqrt(np.mean(moments**2))),
        noise_floor=float(np.sqrt(np.mean(np.square(noise)))),
        moving_fraction=moments.size / sum(s.n_samples for s in states),
        samples=moments.size,
        runs=len(states),
        angle=float(max(np.abs(s.angle).max() for s in states)),
        rate=float(max(np.abs(s.rate).max() for s in states)),
        frequencies=tuple(sorted({r.frequency for r in campaign.identification_runs if r.frequency})),
        simulated=campaign.simulated,
    )
    return replace(model, fitted=fitted)


def _stored(result: Refinement, test: TestNuisances) -> TestNuisances:
    """Return a test with the errors of the channels that were estimated; what was applied before stays."""
    found = list(test.nuisances)
    for name, (value, error) in result.nuisance.items() if result.refined else ():
        if name in STORED:
            id, enters, symbol = STORED[name]
            unit = "s" if name == "delay" else ("rad" if result.model.joint.motion == "rotation" else "m")
            ends = (value - 1.96 * error, value + 1.96 * error)
            found.append(Nuisance(id, enters, Value(symbol, value, error, ends, unit)))
    return replace(test, nuisances=tuple(found))


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
    campaign = test.corrected(usable)
    states = one_after_another(campaign, campaign_states(campaign))
    tried = [
        refine_response(model, campaign, states=states, test=test)
        for model in (whole, *other_forms(whole, problem.found))
    ]
    # One that did not succeed has no misfit.
    refinement = min(tried, key=lambda each: each.misfit if each.refined else np.inf)
    if not refinement.refined:
        return problem, refinement.notes
    before, after = (simulated_gap(model, campaign, test) for model in (whole, refinement.model))
    if not after <= (1 + POLICY.refined_gap) * before:
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


def simulated_gap(model: JointModel, campaign: Campaign, test: TestNuisances) -> float:
    """Return the response NRMSE over the validation runs, or all; NaN where a simulation fails."""
    runs = {run.name: run for run in campaign.validation_runs or campaign.runs}
    errors = []
    for states in one_after_another(campaign, [force_states(run) for run in runs.values()]):
        law = test.law(model, states)
        motion = prescribed(states, inertia=law.inertia)
        run = simulate_run(law, runs[states.run], states, drive="motion" if motion else None)
        errors.append(("moment" if motion else "angle", run.response_nrmse, run.response_scale))
    return pooled_nrmse(errors)
