"""A model simulated against measured response, with a verdict; or fitted to it again."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, fields, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any, ClassVar

import numpy as np

from sindyjoint.clock import single_threaded
from sindyjoint.discovery.delay import align_channels
from sindyjoint.equation.candidates import NO_DELAY, NO_RESPONSE, without_rate
from sindyjoint.equation.catalogue_file import as_model, read_model, read_models
from sindyjoint.equation.model import JointModel
from sindyjoint.equation.test_record import TestNuisances
from sindyjoint.errors import InputError, MissingInputError, checks_options, refuse
from sindyjoint.files import load_campaign
from sindyjoint.judgement.comparison import GivenModel
from sindyjoint.judgement.discovery import estimated_errors, fitted_to, with_errors
from sindyjoint.judgement.headlines import judge_verification
from sindyjoint.judgement.trust import assess
from sindyjoint.limits import JUDGEMENT
from sindyjoint.mechanics.rig_file import has_measured_runs, is_rig_test, rig_path, shipped_rigs
from sindyjoint.mechanics.rig_test import RigTest
from sindyjoint.numeric import RNG
from sindyjoint.record import Campaign
from sindyjoint.response import corrected, put_right
from sindyjoint.response.output_error_runs import Nuisance as Kind
from sindyjoint.response.refinement import Refinement
from sindyjoint.response.refinement import refine as refine_response
from sindyjoint.response.run import WINDOW
from sindyjoint.response.verification import Settings, Verification
from sindyjoint.response.verify_campaign import GIVEN, beyond_tested, seen_runs, verify_campaign
from sindyjoint.soundness import DELAY, Soundness
from sindyjoint.soundness.check import check_data, require_sound
from sindyjoint.soundness.warnings import warn_of_negative_inertia
from sindyjoint.states import ForceStates, campaign_states, one_after_another, transfer_noise
from sindyjoint.text import percent
from sindyjoint.trust import Trust
from sindyjoint.workflows.check import the_campaign

if TYPE_CHECKING:
    from sindyjoint.mechanics.rigs import Rig


@dataclass(frozen=True, eq=False, repr=False)
class CheckedVerification(Verification):
    """A verification against measured runs, with what the check of their data found.

    Parameters
    ----------
    soundness : Soundness
    """

    # Not of a model against a rig, which has no data.
    WRITTEN: ClassVar[dict[str, Any]] = {**Verification.WRITTEN, "soundness?": "soundness"}
    soundness: Soundness = Soundness()


@checks_options()
@single_threaded()
def verify(
    model: JointModel | Sequence[JointModel] | str | Path,
    against: Rig | RigTest | Campaign | str | Path,
    *,
    accept: Sequence[str] = (),
    align: bool = False,
    tolerance: float = JUDGEMENT.tolerated,
    draws: int = 20,
    window: float = WINDOW,
    free_run: int | None = None,
    noise: float | None = None,
    presliding: float | None = None,
    loss_factor: float | None = None,
    rng: RNG = 0,
    progress: Callable[[str], None] | None = None,
) -> Verification:
    """Simulate a model and compare it with measured response.

    Parameters
    ----------
    model : JointModel, several of them, or path of a model.json
        Several only of a rig with runs: of its kinds of joint, as a folder that ``discover RIG`` wrote holds them.
    against : Rig, RigTest, Campaign, or path
        A campaign: its runs marked ``use = "validate"``; where none is those that no fit of the model has seen, or all.
        Errors of channels that the model knows of the rig are put right first. A rig (or the name of a
        shipped one): the response it names as measured; without one, a virtual pulse test of the rig as it is
        written, in which the model then replaces the joint. A rig with sensors and recorded runs: those marked
        ``use = "validate"``, or all of them.
    accept : sequence of str
        Ids of findings of the check of the data that shall not stop the work; see :func:`~sindyjoint.check`.
    align : bool
        Remove a significant delay between the channels of a campaign first.
    tolerance : float
        Largest response NRMSE beyond the noise floor that passes.
    draws : int
        Sets of coefficients drawn from the model's covariance for the band; 0: no band.
    window : float
        Length of a multiple-shooting segment, for joints without restoring moment, s.
    free_run : int, optional
        Simulate each run of a campaign without restart, its initial state estimated on this many first samples: as
        others report such sets. They are not compared.
    noise, presliding, loss_factor : float, optional
        Of the virtual pulse test: sensor noise (fraction of RMS, 0.01), elastic presliding of the friction (rad) and
        the beams' loss factor.
    rng : int, Generator or None
    progress : callable, optional

    Returns
    -------
    Verification

    Raises
    ------
    InputError
        For input that cannot be used.
    UnknownNameError
        For an accepted id that no finding has.
    UnsoundError
        Where the check of the data finds what stops the work.

    Examples
    --------
    >>> import sindyjoint
    >>> test = sindyjoint.simulate(frequencies=[3, 5], levels=[0.9, 0.5], duration=3.0, rng=0)
    >>> found = sindyjoint.discover(test, "paper", correct=False)
    >>> sindyjoint.verify(found.model, test, draws=2).passed
    True
    """
    say = progress or (lambda stage: None)
    refuse(
        [
            (not 0 < tolerance < np.inf, f"tolerance is {tolerance!r}; expected a number above zero"),
            (draws < 0, f"draws is {draws!r}; expected a number that is not negative"),
        ]
    )
    against = _open_input(against)
    if not isinstance(model, JointModel | Sequence) or isinstance(model, str):
        model = read_models(model) if isinstance(against, RigTest) else read_model(model)
    models = [model] if isinstance(model, JointModel) else list(model)
    settings = Settings(tolerance, draws, np.random.default_rng(rng), window, free_run)
    given = {"noise": noise, "presliding": presliding, "loss_factor": loss_factor}
    truth = {name: value for name, value in given.items() if value is not None}
    measured, recorded, pulse = isinstance(against, Campaign), isinstance(against, RigTest), ", ".join(truth)
    refuse(
        [
            (
                not all(each.terms or each.elements for each in models),
                "the model has no terms: there is nothing to simulate; run discover first",
            ),
            (
                not recorded and len(models) != 1,
                f"{len(models)} models were given; expected one, or a rig with runs and several kinds of joint",
            ),
            *((True, said) for each in models for said in warn_of_negative_inertia(each)),
            (
                truth and measured,
                f"{pulse}: belong(s) to a virtual pulse test of a rig; a campaign is given",
            ),
            (
                free_run is not None and not measured,
                f"free_run is {free_run}: belongs to a campaign, whose runs have an initial state; a rig is given",
            ),
            (
                align and not measured,
                "align belongs to a campaign, which has two channels; a rig is given",
            ),
            (
                truth and recorded,
                f"{pulse}: belong(s) to a virtual pulse test; the rig has recorded runs",
            ),
            (
                accept and not (measured or recorded),
                f"accept is {', '.join(accept)}: belongs to data that are checked; a pulse test is given",
            ),
        ]
    )
    if isinstance(against, Campaign):
        return _of_campaign(models[0], against, accept, align, settings, say)
    if isinstance(against, RigTest):
        from sindyjoint.substructure.simulated.verified import verify_runs

        say("checking the data")
        found = require_sound(check_data(against, accept))
        result: Verification = _with_check(
            verify_runs(models, found.usable, settings, say), found.soundness, found.warnings
        )
        return replace(result, trust=judge_verification(result, against.simulated, found.soundness))
    from sindyjoint.response.verify_rig import verify_rig

    result = verify_rig(models[0], against, settings, truth, say)
    return replace(result, trust=judge_verification(result, False, None))


def _of_campaign(
    model: JointModel,
    against: Campaign,
    accept: Sequence[str],
    align: bool,
    settings: Settings,
    say: Callable[[str], None],
) -> Verification:
    say("checking the data")
    checked = require_sound(check_data(against, accept))
    untimed = ""
    if against.quasi_static:
        if align or settings.free_run is not None:
            raise InputError(f"align: {NO_DELAY}" if align else f"free_run: {NO_RESPONSE}")
        model, untimed = without_rate(model)
    seen = seen_runs(model, against)
    usable, applied, notes = put_right(checked.usable, against, model)
    put = align_channels(usable) if align else usable
    result = verify_campaign(model, put, settings, say, applied, seen)
    if usable is not checked.usable or applied:
        as_read = align_channels(checked.usable) if align else checked.usable
        bare = verify_campaign(model, as_read, replace(settings, draws=0), say, TestNuisances(""), seen)
        notes = (*notes, f"without what was put right the response error is {percent(bare.response_nrmse)}, with it "
                         f"{percent(result.response_nrmse)}")  # fmt: skip
    # What was found in this very campaign is put right: its delay is none any more.
    in_time = applied is model.test and DELAY in {each.id for each in applied.nuisances}
    before = (*checked.warned(put is not usable or in_time), *notes, *filter(None, (untimed,)))
    result = _with_check(result, checked.soundness, before)
    say("whether to trust the model")
    measured = None if put is checked.usable else checked.usable
    lights = assess(model, put, checked.soundness, seen, applied, as_measured=measured)
    result = replace(result, trust=Trust(lights))
    return replace(result, trust=judge_verification(result, against.simulated, checked.soundness))


def _with_check(result: Verification, soundness: Soundness, before: Sequence[str]) -> CheckedVerification:
    known = {each.name: getattr(result, each.name) for each in fields(result)}
    known["warnings"] = (*before, *result.warnings)
    return CheckedVerification(**known, soundness=soundness)


def _open_input(against: Rig | RigTest | Campaign | str | Path) -> Rig | RigTest | Campaign:
    """Return the rig, with recorded runs or without, or the campaign that a path means."""
    if isinstance(against, Campaign | RigTest):
        return against
    # What simulates a structure is loaded where one is given.
    if not isinstance(against, str | Path):
        from sindyjoint.mechanics.rigs import Rig

        return against if isinstance(against, Rig) else the_campaign(against)
    path = Path(against)
    if has_measured_runs(path) and str(against) not in shipped_rigs():
        from sindyjoint.mechanics.rig_test_file import load_rig_test

        return load_rig_test(path)
    ships = str(against) in shipped_rigs() and not path.is_dir()
    if not ships and not path.exists():
        raise MissingInputError(
            f"{str(against)!r}: no such file or folder; expected a campaign.toml, its folder, a rig's TOML file or one "
            f"of the shipped rigs ({', '.join(shipped_rigs())})"
        )
    if ships or is_rig_test(path):
        from sindyjoint.mechanics.rigs import PLACEHOLDERS, load_rig

        return load_rig(str(against)) if ships else load_rig(rig_path(path), PLACEHOLDERS)
    return load_campaign(path)


def given_model(model: JointModel | str | Path, campaign: Campaign, accept: Sequence[str]) -> GivenModel:
    """Return how a whole model does on the runs of a campaign, for a comparison."""
    checked = verify(model, campaign, accept=accept, draws=0)
    known = as_model(model)
    return GivenModel(
        known.ids,
        tuple(element.id for element in known.elements),
        np.nan if checked.moment_nrmse is None else checked.moment_nrmse,
        np.nan if checked.response_nrmse is None else checked.response_nrmse,
        any(seen_runs(known, campaign).values()),
    )


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
        labels = [(term.id, term.unit) for term in self.model.terms]
        labels += [(f"{n.name} of {each.id}", n.unit) for each in self.model.elements for n in each.numbers]
        rows = zip(labels, self.before.numbers, self.before.number_errors,
                   self.model.numbers, self.model.number_errors, strict=True)  # fmt: skip
        return tuple(RefinedNumber(name, (a, b), (c, d), unit) for (name, unit), a, b, c, d in rows)


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
    tolerance: float = JUDGEMENT.tolerated,
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

    Examples
    --------
    >>> import sindyjoint
    >>> test = sindyjoint.simulate(frequencies=[3, 5], levels=[0.9, 0.5], duration=3.0, rng=0)
    >>> found = sindyjoint.discover(test, "paper", correct=False)
    >>> refined = sindyjoint.refine(found.model, test)
    >>> refined.refined
    True
    """
    say = progress or (lambda stage: None)
    if not isinstance(model, JointModel):
        model = read_model(model)
    if not (model.terms or model.elements):
        raise InputError("the model has no terms: there is nothing to refine; run discover first")
    given = the_campaign(campaign)
    say("checking the data")
    checked = require_sound(check_data(given, accept))
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
        later = with_errors(tested_on(later, states, usable), estimated, given)
        later = fitted_to(later, given, model.fitted.seen)
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
