"""The law of each kind of joint from the states that were recovered of it in a structure."""

from collections.abc import Callable, Collection, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any, ClassVar

import numpy as np

from sindyjoint.described import same
from sindyjoint.discovery.frequency import heterogeneity
from sindyjoint.discovery.regression import TermRegression
from sindyjoint.equation.calibration import widened
from sindyjoint.equation.candidates import catalogue_of
from sindyjoint.equation.model import JointModel
from sindyjoint.equation.terms import ResolvedTerm
from sindyjoint.judgement import RECOVERED
from sindyjoint.judgement.changed import MANY
from sindyjoint.judgement.discovery import Discovery, fitted_to
from sindyjoint.judgement.joint_search import beyond, exchanged, moving_as, search, terms_of, weakest
from sindyjoint.judgement.term_search import TermSearch, campaign_model, regressed_with
from sindyjoint.judgement.verdict import (
    few_rows,
    judge,
    of_many_rows,
    of_one_run,
    of_slight_terms,
    within_the_states,
)
from sindyjoint.limits import DISCOVERY, SUBSTRUCTURE
from sindyjoint.mechanics.rig_test import RigTest
from sindyjoint.record import MINIMUM_SAMPLES, Campaign, Joint, Run
from sindyjoint.soundness.warnings import list_warnings
from sindyjoint.states import ForceStates, signals_hash
from sindyjoint.substructure import static_moments
from sindyjoint.substructure.law_errors import LawErrors, Recovered, law_errors
from sindyjoint.substructure.recovery import Recovery, Update, recover, with_numbers
from sindyjoint.substructure.states import joint_states, kept_of, slow_part
from sindyjoint.substructure.unseen import LawRows, find_slow, run_weights, with_slow
from sindyjoint.text import spelled

# What no sensor of the structure distinguishes from the angle at which the joint rests.
UNSEEN = "constant_moment"


@dataclass(frozen=True, eq=False)
class JointLaw:
    """What was found of the joints of one kind.

    Parameters
    ----------
    kind : str
    joints : tuple of str
        Names of the joints in the structure.
    discovery : Discovery or None
        None where no run moves them enough.
    reason : str
        Why nothing was sought; empty where it was.
    recovered : tuple of Recovered
        States of every joint in every run in which it moves.
    errors : LawErrors or None
        How the coefficients follow errors of what was recovered.
    """

    WRITTEN: ClassVar = same("kind", "joints", "found", "reason", "alike", "discovery")
    kind: str
    joints: tuple[str, ...]
    discovery: Discovery | None
    reason: str
    recovered: tuple[Recovered, ...]
    errors: LawErrors | None = None

    @property
    def found(self) -> bool:
        """Whether there is a model."""
        return self.discovery is not None and self.discovery.found

    @cached_property
    def alike(self) -> str:
        """Whether joints that are declared alike have one law, in words; empty for one joint.

        Each joint's coefficients of the common terms against the others': Cochran's Q by the largest of all terms, with
        Bonferroni's correction.
        """
        if (
            self.discovery is None
            or not self.discovery.found
            or len({each.joint for each in self.recovered}) < 2
        ):
            return ""
        return _test_alike(self)


def place_of_kind(kind: str) -> str:
    """Return the folder within the results of a kind of joint."""
    return "".join(c if c.isalnum() else "-" for c in kind).strip("-") or "joint"


def find_laws(
    test: RigTest,
    recoveries: Sequence[Recovery],
    say: Callable[[str], None] = lambda stage: None,
    **options: Any,
) -> tuple[JointLaw, ...]:
    """Find the law of each kind of joint in a structure.

    Parameters
    ----------
    test : RigTest
    recoveries : sequence of Recovery
        Of its runs.
    say : callable
        Told of each stage.
    **options
        Parameters of :class:`~sindyjoint.JointRegressor`.
    """
    laws = []
    for kind in dict.fromkeys(test.kinds):
        members = [number for number, other in enumerate(test.kinds) if other == kind]
        names = tuple(test.structure.hinges[number].name for number in members)
        every = (_recovered(test, recovery, number) for recovery in recoveries for number in members)
        recovered = _telling(
            [each for each in every if each and np.count_nonzero(each.states.moving) >= MINIMUM_SAMPLES]
        )
        if not recovered:
            reason = "the joint does not move beyond the noise in any run: drive the structure harder"
            laws.append(JointLaw(kind, names, None, reason, ()))
            continue
        say(f"selecting terms of {kind}")
        laws.append(JointLaw(kind, names, *_find_law(test, kind, recovered, options)))
    return tuple(laws)


def _recovered(test: RigTest, recovery: Recovery, joint: int) -> Recovered | None:
    """Return the states of a joint in a run, None where it does not move; the mean moment is that of equilibrium."""
    if not kept_of(recovery, joint).any():
        return None
    mean = static_moments(test.structure, test.at, float(recovery.spectra.mean[0]))
    name = f"{recovery.run.name} · {test.structure.hinges[joint].name}"
    moment = 0.0 if mean is None else float(mean[joint])
    return Recovered(recovery, joint, joint_states(recovery, joint, name, moment))


def _telling(recovered: Sequence[Recovered]) -> tuple[Recovered, ...]:
    """Return the runs that tell more than the slow part of their own angle; all where none does."""
    telling = [
        each
        for each in recovered
        if not few_rows(
            int(np.count_nonzero(each.states.moving)), slow_part(each.recovery, each.joint).start.size
        )
    ]
    return tuple(telling or recovered)


def _find_law(
    test: RigTest, kind: str, recovered: tuple[Recovered, ...], options: dict[str, Any]
) -> tuple[Discovery, str, tuple[Recovered, ...], LawErrors | None]:
    """Return the discovery, why there is none, the whole states, and how the coefficients err.

    A term that stands out of the known noise of the sensors is in the law, however little of the moment it carries; one
    whose interval holds zero, by that noise, is not.
    """
    if UNSEEN in catalogue_of(options.get("library", "extended")):
        options = {**options, "forbidden": (*options.get("forbidden", ()), UNSEEN)}
    states = tuple(each.states for each in recovered)
    slow = [slow_part(each.recovery, each.joint) for each in recovered]
    weights = run_weights(states)
    forced, forbidden = tuple(options.get("forced", ())), tuple(options.get("forbidden", ()))
    added: tuple[str, ...] = ()
    instead: tuple[str, ...] = ()
    dropped: list[ResolvedTerm] = []
    found = None
    # What was taken out never comes back: the search ends.
    while True:
        asked = {**options, "forced": (*forced, *added, *instead), "forbidden": forbidden}
        found = search(states, slow, weights, asked, found)
        recovered = tuple(
            replace(each, states=state, unseen=values, weight=float(weight))
            for each, state, values, weight in zip(
                recovered, found.states, found.unseen, weights, strict=True
            )
        )
        rows, errors, more = found.rows, None, ""
        if rows is not None:
            errors, more = beyond(found, rows, states, recovered, slow, dropped)
        few = few_rows(*_counted(recovered))
        gone, put = None if errors is None else weakest(found, errors, forced), tuple[str, ...]()
        if errors is not None and gone is None:
            gone, put = exchanged(found, states, recovered, slow, errors, forced)
        if gone is not None:
            added, instead = (tuple(n for n in names if n != gone.id) for names in (added, instead))
            instead += put
            forbidden, dropped = (*forbidden, gone.id), [*dropped, gone]
        # Terms that may be added one after another for they stand out of the sensors' noise.
        elif more and not few and len(added) < 3:
            added = (*added, more)
        else:
            break
    discovery = _judged(test, kind, recovered, found.regressor, rows, errors)
    words = [few] if few else []
    if added:
        words.append(
            f"{' and '.join(map(spelled, added))}: small beside the moment, yet large beside the sensors' noise"
        )
    discovery = replace(discovery, warnings=(*discovery.warnings, *words))
    return discovery, "", recovered, errors


def _counted(recovered: Sequence[Recovered]) -> tuple[int, int]:
    """Return in how many samples joints move, and how many numbers of their slow angles are found with the law."""
    moving = sum(int(np.count_nonzero(each.states.moving)) for each in recovered)
    return moving, sum(each.unseen.size for each in recovered)


def _judged(
    test: RigTest,
    kind: str,
    recovered: tuple[Recovered, ...],
    regressor: TermRegression,
    rows: LawRows | None,
    errors: LawErrors | None,
) -> Discovery:
    """Return what was found as a discovery."""
    states = tuple(each.states for each in recovered)
    campaign = recovered_campaign(test, kind, states)
    model = campaign_model(regressor, campaign, states)
    if errors is not None:
        # Noise of the angle is in the rows, too.
        floor = model.fitted.residual_rms / np.sqrt(max(1.0, errors.excess))
        floor = max(floor, float(np.nan_to_num(model.fitted.noise_floor)))
        model = replace(model, fitted=replace(model.fitted, noise_floor=floor))
    verdict = of_one_run(judge(regressor, model), len({each.recovery.run.name for each in recovered}))
    verdict = of_slight_terms(of_many_rows(verdict, *_counted(recovered)), model)
    if rows is not None and errors is not None:
        verdict = within_the_states(verdict, errors.angle_share, float(errors.hidden.max(initial=0.0)))
        model = model.with_numbers(rows.coefficients, errors.covariance)

    return Discovery(
        model=_recorded(fitted_to(model, campaign), recovered),
        verdict=verdict,
        found=bool(model.terms),
        reason=regressor.selection_result_.reason,
        skew=None,
        warnings=tuple(list_warnings(campaign, states, model, None, False, regressor.indistinct_)),
        states=states,
        regressor=regressor,
        campaign=campaign,
    )


def recovered_campaign(test: RigTest, kind: str, states: Sequence[ForceStates]) -> Campaign:
    """Return recovered states as the campaign of a joint."""
    runs = tuple(
        Run(s.run, s.moment, s.angle, s.sample_rate, rate=s.rate, frequency=s.frequency, level=s.level)
        for s in states
    )
    joint = Joint(name=kind, motion=test.motion, inertia=0.0)
    return Campaign(joint, runs, simulated=test.simulated, notes=(RECOVERED,))


def with_terms(law: JointLaw, terms: Collection[str]) -> JointLaw:
    """Return a law with such terms instead, as a regression of its states has them; itself where it has them."""
    found = law.discovery
    if found is None or {*found.model.ids} == {*terms}:
        return law
    other = regressed_with(terms, TermSearch(found.regressor, found.model, found.states), found.campaign)
    more = " and ".join(spelled(each) for each in other.model.ids if each not in found.model.ids)
    words = (f"{more}: told by the simulated response, not by the recovered states",) if more else ()
    model = _recorded(fitted_to(other.model, found.campaign), law.recovered)
    return replace(
        law,
        discovery=replace(found, model=model, regressor=other.regressor, warnings=(*found.warnings, *words)),
    )


def terms_by_kind(laws: Sequence[JointLaw], more: Collection[str] = ()) -> dict[str, set[str]]:
    """Return the terms of each law that was found, and those of `more` that were its candidates."""
    found = {
        law.kind: law.discovery for law in laws if law.discovery is not None and law.discovery.model.terms
    }
    return {
        kind: {*each.model.ids} | ({term.id for term in catalogue_of(each.regressor.library)} & {*more})
        for kind, each in found.items()
    }


def told_terms(model: JointModel) -> set[str]:
    """Return the terms of a model that stand out of their errors."""
    return {
        term.id
        for term in model.terms
        if abs(term.coefficient) > DISCOVERY.term_significance * term.standard_error
    }


def with_uncertain_structure(law: JointLaw, test: RigTest, update: Update) -> JointLaw:
    """Return a law whose covariance holds what the uncertainty of the structure's numbers makes of its coefficients.

    Each number is moved by its standard error, and the coefficients follow what is then recovered.
    """
    if law.discovery is None or not law.discovery.found:
        return law
    assert law.errors is not None
    model = law.discovery.model
    columns = []
    for error, unit in zip(update.standard_error, np.eye(update.prior.size), strict=True):
        moved = with_numbers(test, error * unit)
        made: dict[int, Recovery] = {}
        for each in law.recovered:
            old = each.recovery
            made.setdefault(id(old), recover(moved, old.run, old.spectra))
        columns.append(law.errors.change([made[id(each.recovery)] for each in law.recovered]) / error)
    slopes = np.column_stack(columns)
    return replace(
        law, discovery=replace(law.discovery, model=widened(model, slopes @ update.covariance @ slopes.T))
    )


def _test_alike(law: JointLaw) -> str:
    """Say whether the joints of one kind have the same coefficients."""
    assert law.discovery is not None
    terms = terms_of(law.discovery.regressor)
    fits = []
    for joint in dict.fromkeys(each.joint for each in law.recovered):
        own = [each for each in law.recovered if each.joint == joint]
        slow = [slow_part(each.recovery, each.joint) for each in own]
        whole = [each.states for each in own]
        bare = moving_as([with_slow(e.states, s, -e.unseen) for e, s in zip(own, slow, strict=True)], whole)
        weights = np.array([each.weight for each in own])
        rows = find_slow(bare, slow, terms, weights, [each.unseen for each in own])
        errors = law_errors(rows, own, slow)
        fits.append((rows.coefficients, np.sqrt(np.diag(errors.covariance))))
    values, spread = (np.array(part) for part in zip(*fits, strict=True))
    degrees = np.full(len(fits), MANY)
    least = min(heterogeneity(v, e, degrees)[1] for v, e in zip(values.T, spread.T, strict=True))
    p = min(1.0, least * len(terms))
    joints = " and ".join(law.joints)
    if p < SUBSTRUCTURE.strict_level:
        return f"{joints} are declared alike and differ (p = {p:.1g}): give them kinds of their own"
    return f"{joints} have one law within their errors (p = {p:.2g})"


def _recorded(model: JointModel, recovered: Sequence[Recovered]) -> JointModel:
    """Return a model that has seen the runs of the structure, not those that were recovered of them."""
    runs = [each.recovery.run for each in recovered]
    seen = {signals_hash(run.sample_rate, [run.signals]) for run in runs}
    return replace(model, fitted=replace(model.fitted, seen=tuple(sorted(seen))))
