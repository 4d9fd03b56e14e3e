"""A whole model fitted again to the simulated response of a campaign: terms, elements, chosen errors of channels."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, fields, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any, ClassVar

import numpy as np

from sindyjoint.discovery.delay import align_channels
from sindyjoint.equation.element import Value
from sindyjoint.equation.model import JointModel
from sindyjoint.equation.model_file import read_model
from sindyjoint.errors import InputError
from sindyjoint.judgement.discovery import fitted_to
from sindyjoint.judgement.policy import POLICY
from sindyjoint.record import Campaign
from sindyjoint.response.nuisances import Enters, Nuisance, TestNuisances, read_test
from sindyjoint.response.output_error_parts import Nuisance as Kind
from sindyjoint.response.refine import Refinement
from sindyjoint.response.refine import refine as refine_response
from sindyjoint.response.run import WINDOW
from sindyjoint.response.verification import Settings
from sindyjoint.response.verify_campaign import GIVEN, beyond_tested, verify_campaign
from sindyjoint.soundness.check import check_campaign, require_sound
from sindyjoint.states import ForceStates, campaign_states, one_after_another, transfer_noise
from sindyjoint.states.campaigns import content_hash
from sindyjoint.threads import single_threaded
from sindyjoint.workflows.discover import the_campaign
from sindyjoint.workflows.verify import CheckedVerification, put_right

if TYPE_CHECKING:
    pass

# What the estimated errors of the channels are in test.json; a gain has no place there.
STORED: dict[str, tuple[str, Enters, str]] = {
    "delay": ("channel_delay", "time shift", "tau"),
    "offset": ("angle_offset", "angle zero", "theta_0"),
}


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
    test : TestNuisances, optional
        Of this campaign: what was given with the model, and the errors of channels estimated with it.
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
    test: TestNuisances | None = None

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
    late, usable = usable, align_channels(usable) if align else usable
    say("force states")
    states = one_after_another(usable, campaign_states(usable))
    result = refine_response(
        model, usable, states=states, nuisance=nuisance, test=applied, window=window, progress=say
    )
    notes = (*notes, *beyond_tested(model, *states, whose=GIVEN))
    later = result.model
    if result.refined:
        later = fitted_to(tested_on(later, states, usable), given)
    found = _stored(result, applied or TestNuisances(content_hash(given), given.joint.name))
    shown = found.corrected(checked.usable) if found else usable
    settings = Settings(tolerance, draws, np.random.default_rng(random_state), window)
    verified = verify_campaign(later, align_channels(shown) if align else shown, settings, say, found)
    known = {each.name: getattr(verified, each.name) for each in fields(verified)}
    if "gain" in result.nuisance:
        notes = (*notes, "the gain that was estimated is not applied where model and campaign are compared")
    known["warnings"] = (*checked.warned(usable is not late), *notes, *result.notes, *verified.warnings)
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
