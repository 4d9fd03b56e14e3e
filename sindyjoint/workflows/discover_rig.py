"""The law of the joints inside an assembled structure, from the sensors of the structure."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from sindyjoint.bias.correction import corrected_model
from sindyjoint.discovery.estimator import JointRegressor
from sindyjoint.discovery.large.segments import SampleCount
from sindyjoint.equation.calibration import widened
from sindyjoint.equation.model import JointModel
from sindyjoint.equation.terms import Reference, ResolvedTerm, term_columns
from sindyjoint.errors import InputError
from sindyjoint.judgement.discovery import Discovery
from sindyjoint.judgement.second_search import campaign_model
from sindyjoint.judgement.verdict import judge
from sindyjoint.mechanics.rig_test import RigTest
from sindyjoint.numeric import scaled_least_squares
from sindyjoint.paper import TERMS as PAPER_TERMS
from sindyjoint.record import MINIMUM_SAMPLES, Campaign, Joint, Run
from sindyjoint.response.model_law import model_law
from sindyjoint.shown import Shown
from sindyjoint.soundness.warnings import list_warnings
from sindyjoint.states import ForceStates, regression_rows
from sindyjoint.substructure.recovery import Recovery, recover
from sindyjoint.substructure.replicates import RecoveredReplicate, recovered_replicate
from sindyjoint.substructure.states import joint_states, slow_part
from sindyjoint.substructure.transfer import static_moments
from sindyjoint.substructure.unseen import find_slow, with_slow
from sindyjoint.substructure.update import Update, update_structure, with_numbers
from sindyjoint.workflows.discover import fitted_to

Array = NDArray[np.float64]

# What no sensor of the structure tells from the angle at which the joint rests.
UNSEEN = "constant_moment"
RECOVERED = (
    "angle and moment were recovered from the structure's sensors; where these show no constant, the angle at which "
    "the joint rests is the law's, and a preload is not determined"
)
COLUMNS = ("angle", "rate", "moment")
# Searches for terms, each at the slow angles that the terms found before ask for.
SEARCHES = 4


@dataclass(frozen=True, eq=False)
class Recovered:
    """A joint's states in one run, with what they were made of; `unseen` is the slow part of its angle."""

    recovery: Recovery
    joint: int
    states: ForceStates
    mean_moment: float
    unseen: Array | None = None


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
    """

    kind: str
    joints: tuple[str, ...]
    discovery: Discovery | None
    reason: str
    recovered: tuple[Recovered, ...]


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
        recovered = tuple(
            found
            for recovery in recoveries
            for number in members
            if np.count_nonzero((found := _recovered(test, recovery, number)).states.moving)
            >= MINIMUM_SAMPLES
        )
        if not recovered:
            reason = "the joint does not move beyond the noise in any run: drive the structure harder"
            laws.append(JointLaw(kind, names, None, reason, ()))
            continue
        say(f"selecting terms of {kind}")
        laws.append(JointLaw(kind, names, *_find_law(test, kind, recovered, options)))
    return tuple(laws)


def _recovered(test: RigTest, recovery: Recovery, joint: int) -> Recovered:
    """Return the states of a joint in a run; the mean moment is that of equilibrium."""
    mean = static_moments(test.structure, test.at, float(recovery.spectra.mean[0]))
    name = f"{recovery.run.name} · {test.structure.hinges[joint].name}"
    moment = 0.0 if mean is None else float(mean[joint])
    return Recovered(recovery, joint, joint_states(recovery, joint, name, moment), moment)


def _find_law(
    test: RigTest, kind: str, recovered: tuple[Recovered, ...], options: dict[str, Any]
) -> tuple[Discovery, str, tuple[Recovered, ...]]:
    """Choose terms and the slow part of the angles in turn; return the discovery and the whole states."""
    options = {**options, "forbidden": (*options.get("forbidden", ()), UNSEEN)}
    states = tuple(each.states for each in recovered)
    slow = [slow_part(each.recovery, each.joint) for each in recovered]
    # Before terms are known the paper's stand for them: one of them bends as the stiffness does.
    allowed = set(PAPER_TERMS)
    for _ in range(SEARCHES):
        regressor = JointRegressor(**options)
        reference = Reference.of(*(np.concatenate([getattr(s, name) for s in states]) for name in COLUMNS))
        terms = [term for term in regressor.candidates(reference) if term.id in allowed]
        unseen = find_slow(states, slow, terms) if terms else tuple(each.start for each in slow)
        centred = tuple(map(with_slow, states, slow, unseen))
        regressor.fit(**regression_rows(centred, 0.0).fit_arguments())
        if allowed.issuperset(regressor.selected_):
            break
        allowed = {*PAPER_TERMS, *regressor.selected_}
    recovered = tuple(
        replace(each, states=state, unseen=values)
        for each, state, values in zip(recovered, centred, unseen, strict=True)
    )
    return _judged(test, kind, recovered, regressor), "", recovered


def _judged(
    test: RigTest, kind: str, recovered: tuple[Recovered, ...], regressor: JointRegressor
) -> Discovery:
    """Return what was found as a discovery, the bias of the recovery's noise taken out."""
    states = tuple(each.states for each in recovered)
    campaign = recovered_campaign(test, kind, states)
    counts = tuple(SampleCount(int(np.count_nonzero(s.moving)), s.n_samples) for s in states)
    model = campaign_model(regressor, campaign, states, counts)
    verdict = judge(regressor, model)

    def replicated(known: JointModel) -> list[RecoveredReplicate]:
        law = model_law(known)
        return [recovered_replicate(each.recovery, each.joint, each.states, law) for each in recovered]

    terms = [term for term in regressor.terms_ if term.id in model]
    fixed = corrected_model(model, terms, campaign, states, replicated=replicated)
    return Discovery(
        model=fitted_to(fixed.model, campaign),
        verdict=verdict,
        found=bool(model.terms),
        reason=regressor.selection_result_.reason,
        skew=None,
        warnings=tuple(list_warnings(campaign, states, fixed.model, None, False, regressor.indistinct_)),
        states=states,
        regressor=regressor,
        campaign=campaign,
        bias=fixed.bias,
    )


def recovered_campaign(test: RigTest, kind: str, states: Sequence[ForceStates]) -> Campaign:
    """Return recovered states as the campaign of a joint."""
    runs = tuple(
        Run(s.run, s.moment, s.angle, s.sample_rate, rate=s.rate, frequency=s.frequency, level=s.level)
        for s in states
    )
    joint = Joint(name=kind, motion=test.motion, inertia=0.0)
    return Campaign(joint, runs, simulated=test.simulated, notes=(RECOVERED,))


@dataclass(frozen=True, eq=False, repr=False)
class RigDiscovery(Shown):
    """The result of :func:`discover_rig`.

    Parameters
    ----------
    test : RigTest
        With the structure's numbers as they were updated.
    laws : tuple of JointLaw
    update : Update or None
        Of the structure's uncertain numbers; None where none is stated.
    recoveries : tuple of Recovery
    warnings : tuple of str
    """

    test: RigTest
    laws: tuple[JointLaw, ...]
    update: Update | None
    recoveries: tuple[Recovery, ...]
    warnings: tuple[str, ...]

    @property
    def found(self) -> bool:
        """Whether every kind of joint has a model."""
        return all(law.discovery is not None and law.discovery.found for law in self.laws)


def discover_rig(
    test: RigTest,
    *,
    progress: Callable[[str], None] | None = None,
    **options: Any,
) -> RigDiscovery:
    """Find the law of the joints in an assembled structure from its sensors.

    Parameters
    ----------
    test : RigTest
    progress : callable, optional
    **options
        Parameters of :class:`~sindyjoint.JointRegressor`: library, forced, forbidden, ...

    Raises
    ------
    InputError
        With too few sensors, or runs that are too short.
    """
    say = progress or (lambda stage: None)
    runs = test.identification_runs
    if not runs:
        raise InputError("no run is for identification; expected at least one [[run]] with use = 'identify'")
    say("recovering angles and moments of the joints")
    recoveries = tuple(recover(test, run) for run in runs)
    update = update_structure(test, recoveries)
    if update is not None:
        say("updating the structure's numbers")
        test = with_numbers(test, update.change)
        recoveries = tuple(recover(test, each.run, each.spectra) for each in recoveries)
    laws = find_laws(test, recoveries, say, **options)
    if update is not None:
        say("what the structure's numbers leave uncertain")
        laws = tuple(_with_uncertain_structure(law, test, update) for law in laws)
    return RigDiscovery(test, laws, update, recoveries, _warnings(recoveries))


def _with_uncertain_structure(law: JointLaw, test: RigTest, update: Update) -> JointLaw:
    """Return a law whose covariance holds what the uncertainty of the structure's numbers makes of its coefficients.

    The terms' coefficients are fitted once more with each number moved by its standard error.
    """
    if law.discovery is None or not law.discovery.found:
        return law
    model = law.discovery.model
    terms = [term for term in law.discovery.regressor.terms_ if term.id in model]
    at_rest = _fit_again(law, test, terms)
    errors = update.standard_error
    slopes = np.column_stack(
        [
            (_fit_again(law, with_numbers(test, error * unit), terms) - at_rest) / error
            for unit, error in zip(np.eye(errors.size), errors, strict=True)
        ]
    )
    return replace(
        law, discovery=replace(law.discovery, model=widened(model, slopes @ update.covariance @ slopes.T))
    )


def _fit_again(law: JointLaw, test: RigTest, terms: Sequence[ResolvedTerm]) -> Array:
    """Return the coefficients of some terms on the states that another structure gives, shape (k,)."""
    columns, targets = [], []
    made: dict[int, Recovery] = {}
    for each in law.recovered:
        old = each.recovery
        new = made.setdefault(id(old), recover(test, old.run, old.spectra))
        state = joint_states(new, each.joint, each.states.run, each.mean_moment)
        if each.unseen is not None:
            state = with_slow(state, slow_part(old, each.joint), each.unseen)
        keep = each.states.moving
        columns.append(term_columns(terms, state.angle[keep], state.rate[keep], state.acceleration[keep]))
        targets.append(state.moment[keep])
    return scaled_least_squares(np.vstack(columns), np.concatenate(targets))


# Weighted squares per degree of freedom beyond which sensors and structure disagree: noise alone makes 1.
DISAGREES = 2.0


def _warnings(recoveries: Sequence[Recovery]) -> tuple[str, ...]:
    misfit, degrees = sum(r.misfit for r in recoveries), sum(r.degrees for r in recoveries)
    if not degrees:
        return (
            "there are as many sensors as joints: nothing shows whether the structure is the one described",
        )
    if misfit <= DISAGREES * degrees:
        return ()
    return (
        f"what is left of the sensors is {np.sqrt(misfit / degrees):.1f} times their noise: the structure is not quite "
        "the one described; state how uncertain its stiffness and mass are, so that they are updated",
    )
