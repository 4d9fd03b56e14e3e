"""A whole model fitted again to the simulated response of a campaign: terms, elements, chosen errors of channels."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, fields, replace
from pathlib import Path
from typing import Any, ClassVar

import numpy as np

from sindyjoint.clock import single_threaded
from sindyjoint.discovery.delay import align_channels
from sindyjoint.equation.model import JointModel
from sindyjoint.equation.model_file import read_model
from sindyjoint.equation.test_record import TestNuisances
from sindyjoint.errors import InputError, checks_options
from sindyjoint.judgement.discovery import fitted_to
from sindyjoint.judgement.policy import POLICY
from sindyjoint.judgement.refined import estimated_errors
from sindyjoint.numeric import RNG
from sindyjoint.record import Campaign
from sindyjoint.response.compared import corrected, put_right
from sindyjoint.response.output_error_runs import Nuisance as Kind
from sindyjoint.response.refinement import Refinement
from sindyjoint.response.refinement import refine as refine_response
from sindyjoint.response.run import WINDOW
from sindyjoint.response.verification import Settings
from sindyjoint.response.verify_campaign import GIVEN, beyond_tested, seen_runs, verify_campaign
from sindyjoint.soundness.check import check_campaign, require_sound
from sindyjoint.states import ForceStates, campaign_states, one_after_another, transfer_noise
from sindyjoint.states.campaigns import content_hash
from sindyjoint.workflows.discover import the_campaign
from sindyjoint.workflows.verify import CheckedVerification


@dataclass(frozen=True)
class RefinedNumber:
    """A number of a model before and after the refinement, each with its standard error."""

    number: str
    before: tuple[float, float]
    after: tuple[float, float]
    unit: str


@dataclass(frozen=True, eq=False)
class RefinedModel(CheckedVerification):
    """A model refined on a campaign, and beside its response.

    Parameters
    ----------
    before : JointModel, optional
        As it was given.
    refinement : Refinement, optional
    """

    WRITTEN: ClassVar[dict[str, Any]] = {
        **CheckedVerification.WRITTEN,
        "refinement?": {
            "refined": "refined",
            "reason": "refinement.reason",
            "numbers": "numbers",
            "nuisances": "refinement.nuisance",
            "undetermined": "refinement.undetermined",
        },
    }
    before: JointModel | None = None
    refinement: Refinement | None = None

    @property
    def refined(self) -> bool:
        """Whether the refinement succeeded."""
        return self.refinement is not None and self.refinement.refined

    @property
    def numbers(self) -> tuple[RefinedNumber, ...]:
        """The numbers of the model."""
        if self.before is None:
            return ()
        rows = zip(number_labels(self.model), self.before.numbers, self.before.number_errors,
                   self.model.numbers, self.model.number_errors, strict=True)  # fmt: skip
        return tuple(RefinedNumber(name, (a, b), (c, d), unit) for (name, unit), a, b, c, d in rows)


def number_labels(model: JointModel) -> list[tuple[str, str]]:
    """Return name and unit of each of a model's numbers, in their order."""
    terms = [(term.id, term.unit) for term in model.terms]
    return terms + [(f"{n.name} of {each.id}", n.unit) for each in model.elements for n in each.numbers]


@checks_options()
@single_threaded()
def refine(
    model: JointModel | str | Path,
    campaign: Campaign | str | Path | Any,
    *,
    nuisance: Sequence[Kind] = (),
    accept: Sequence[str] = (),
    align: bool = False,
    window: float | None = None,
    tolerance: float = POLICY.verification_tolerance,
    draws: int = 0,
    rng: RNG = 0,
    progress: Callable[[str], None] | None = None,
) -> RefinedModel:
    """Fit the numbers of a given model, elements among them, to the simulated response of a campaign.

    Parameters
    ----------
    model : JointModel or path of a model.json
    campaign : Campaign, path of a campaign.toml, or None
        Fitted are the runs that may be used for identification; compared are those marked ``use = "validate"``, or all
        where none is. ``None``: the built-in virtual test.
    nuisance : sequence of {"delay", "gain", "offset"}
        What to estimate with the numbers; see :func:`sindyjoint.response.refinement.refine`. They become a part of the
        model's ``test``.
    accept, align, window, tolerance, draws, rng, progress
        As in :func:`~sindyjoint.workflows.verify.verify`.

    Returns
    -------
    RefinedModel

    Raises
    ------
    InputError, UnknownNameError, UnsoundError
    """
    say = progress or (lambda stage: None)
    if not isinstance(model, JointModel):
        model = read_model(model)
    if not (model.terms or model.elements):
        raise InputError("the model has no terms: there is nothing to refine; run discover first")
    given = the_campaign(campaign)
    say("checking the data")
    checked = require_sound(check_campaign(given, accept))
    usable, applied, notes = put_right(checked.usable, given, model)
    late, usable = usable, align_channels(usable) if align else usable
    say("force states")
    states = one_after_another(usable, campaign_states(usable))
    result = refine_response(
        model, usable, states=states, nuisance=nuisance, test=applied, window=window, progress=say
    )
    notes = (*notes, *beyond_tested(model, *states, whose=GIVEN))
    later, shown = result.model, usable
    if result.refined:
        estimated, lost = estimated_errors(result, states)
        known = model.test or TestNuisances(content_hash(given), given.joint.name)
        test = replace(known, nuisances=(*known.nuisances, *estimated))
        later = fitted_to(
            replace(tested_on(later, states, usable), test=test or None), given, model.fitted.seen
        )
        shown = corrected(TestNuisances("", nuisances=tuple(estimated)), usable)
        notes = (*notes, *lost)
    settings = Settings(tolerance, draws, np.random.default_rng(rng), window or WINDOW)
    verified = verify_campaign(
        later, align_channels(shown) if align else shown, settings, say, applied, seen_runs(later, given)
    )
    shared = {each.name: getattr(verified, each.name) for each in fields(verified)}
    shared["warnings"] = (*checked.warned(usable is not late), *notes, *result.notes, *verified.warnings)
    return RefinedModel(**shared, soundness=checked.soundness, before=model, refinement=result)


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
