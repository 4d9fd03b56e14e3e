"""The law of each kind of joint from the states that were recovered of it in a structure."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from sindyjoint.bias.correction import corrected_model
from sindyjoint.discovery.estimator import JointRegressor
from sindyjoint.discovery.evidence import fit_columns
from sindyjoint.discovery.frequency import heterogeneity
from sindyjoint.discovery.large.segments import SampleCount
from sindyjoint.equation.calibration import widened
from sindyjoint.equation.model import JointModel
from sindyjoint.equation.terms import Reference, ResolvedTerm, term_columns
from sindyjoint.judgement.discovery import Discovery, fitted_to
from sindyjoint.judgement.policy import POLICY
from sindyjoint.judgement.second_search import campaign_model
from sindyjoint.judgement.verdict import Verdict, judge
from sindyjoint.mechanics.rig_test import RigTest
from sindyjoint.numeric import scaled_least_squares
from sindyjoint.paper import TERMS as PAPER_TERMS
from sindyjoint.record import MINIMUM_SAMPLES, Campaign, Joint, Run
from sindyjoint.response.model_law import model_law
from sindyjoint.soundness.warnings import list_warnings
from sindyjoint.states import ForceStates, regression_rows
from sindyjoint.substructure.recovery import Recovery, recover
from sindyjoint.substructure.replicates import RecoveredReplicate, recovered_replicate
from sindyjoint.substructure.states import joint_states, kept_of, slow_part
from sindyjoint.substructure.transfer import static_moments
from sindyjoint.substructure.unseen import find_slow, with_slow
from sindyjoint.substructure.update import Update, with_numbers

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
# Noise of a run's states, as a share of the moment, below which less of it gives the run no more weight.
WELL_KNOWN = 0.01


@dataclass(frozen=True, eq=False)
class Recovered:
    """A joint's states in one run, with what they were made of; `unseen` is the slow part of its angle."""

    recovery: Recovery
    joint: int
    states: ForceStates
    mean_moment: float
    unseen: Array | None = None
    weight: float = 1.0


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
        recovered = tuple(
            each for each in every if each and np.count_nonzero(each.states.moving) >= MINIMUM_SAMPLES
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
    if not all(kept.any() for kept in kept_of(recovery, joint)):
        return None
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
    weights = run_weights(states)
    # Before terms are known the paper's stand for them: one of them bends as the stiffness does.
    allowed = set(PAPER_TERMS)
    for _ in range(SEARCHES):
        regressor = JointRegressor(**options)
        reference = Reference.of(*(np.concatenate([getattr(s, name) for s in states]) for name in COLUMNS))
        terms = [term for term in regressor.candidates(reference) if term.id in allowed]
        unseen = find_slow(states, slow, terms) if terms else tuple(each.start for each in slow)
        centred = tuple(map(with_slow, states, slow, unseen))
        rows = regression_rows(centred, 0.0).fit_arguments()
        regressor.fit(**rows, sample_weight=np.repeat(weights, [np.count_nonzero(s.moving) for s in centred]))
        if allowed.issuperset(regressor.selected_):
            break
        allowed = {*PAPER_TERMS, *regressor.selected_}
    recovered = tuple(
        replace(each, states=state, unseen=values, weight=float(weight))
        for each, state, values, weight in zip(recovered, centred, unseen, weights, strict=True)
    )
    return _judged(test, kind, recovered, regressor), "", recovered


def run_weights(states: Sequence[ForceStates]) -> Array:
    """Return what rows of each run count, by the noise of its states, shape (runs,); one in the mean of all rows.

    In moment the noise of angle and rate is that of the stiffness and damping that go with the best-known run. What
    noise is below the scatter that any law leaves, a hundredth of the moment, does not matter.
    """
    best = min(states, key=lambda s: s.noise.rate / np.std(s.rate))
    largest = float(np.std(best.moment))
    by_angle, by_rate = largest / np.std(best.angle), largest / np.std(best.rate)
    noise = np.array(
        [
            np.hypot(by_angle * s.noise.angle, by_rate * s.noise.rate) ** 2
            + s.noise.moment**2 / (s.block[-1] + 1)
            for s in states
        ]
    )
    weight = 1 / (noise + (WELL_KNOWN * largest) ** 2)
    rows = np.array([np.count_nonzero(s.moving) for s in states])
    return np.asarray(weight * rows.sum() / (weight @ rows))


def _judged(
    test: RigTest, kind: str, recovered: tuple[Recovered, ...], regressor: JointRegressor
) -> Discovery:
    """Return what was found as a discovery, the bias of the recovery's noise taken out."""
    states = tuple(each.states for each in recovered)
    campaign = recovered_campaign(test, kind, states)
    counts = tuple(SampleCount(int(np.count_nonzero(s.moving)), s.n_samples) for s in states)
    model = campaign_model(regressor, campaign, states, counts)
    verdict = within_the_states(judge(regressor, model), states)

    def replicated(known: JointModel) -> list[RecoveredReplicate]:
        law = model_law(known)
        return [
            recovered_replicate(each.recovery, each.joint, each.states, law, each.weight)
            for each in recovered
        ]

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


def within_the_states(verdict: Verdict, states: Sequence[ForceStates]) -> Verdict:
    """Return a verdict that is no surer than the states: undecided where their angle is known less well than a term.

    An error of the angle is one of the elastic moment of the same share: beyond the share below which a term counts as
    absent, neither absence nor presence follows from what fits best.
    """
    share = float(np.sqrt(np.mean([(s.noise.angle / np.std(s.angle)) ** 2 for s in states])))
    if share <= POLICY.negligible_share or verdict.verdict == "undecided":
        return verdict
    reason = (
        f"the sensors show the angle of the joint only within {100 * share:.1f} % of itself, and terms are judged down "
        f"to {100 * POLICY.negligible_share:.0f} % of the moment: sensors of displacement, longer runs or sines would "
        f"tell; without that: {verdict.verdict}, {verdict.reason}"
    )
    return replace(verdict, verdict="undecided", reason=reason)


def recovered_campaign(test: RigTest, kind: str, states: Sequence[ForceStates]) -> Campaign:
    """Return recovered states as the campaign of a joint."""
    runs = tuple(
        Run(s.run, s.moment, s.angle, s.sample_rate, rate=s.rate, frequency=s.frequency, level=s.level)
        for s in states
    )
    joint = Joint(name=kind, motion=test.motion, inertia=0.0)
    return Campaign(joint, runs, simulated=test.simulated, notes=(RECOVERED,))


def with_uncertain_structure(law: JointLaw, test: RigTest, update: Update) -> JointLaw:
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
    columns, targets, weights = [], [], []
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
        weights.append(np.full(np.count_nonzero(keep), np.sqrt(each.weight)))
    root = np.concatenate(weights)
    return scaled_least_squares(np.vstack(columns) * root[:, None], np.concatenate(targets) * root)


# Level at which joints that are declared alike are said to differ.
DIFFER = 0.01


def _test_alike(law: JointLaw) -> str:
    """Say whether the joints of one kind have the same coefficients."""
    assert law.discovery is not None
    evidence, model = law.discovery.regressor.evidence_, law.discovery.model
    columns = [evidence.ids.index(term.id) for term in model.terms if term.id in evidence.ids]
    numbers: dict[int, set[str]] = {}
    for each in law.recovered:
        numbers.setdefault(each.joint, set()).add(each.states.run)
    fits = []
    for runs in numbers.values():
        own = replace(evidence, runs=tuple(run for run in evidence.runs if run.name in runs))
        fits.append(fit_columns(own, columns))
    least = 1.0
    for index in range(len(columns)):
        values = np.array([fit.coefficients[index] for fit in fits])
        errors = np.sqrt([fit.covariance[index, index] for fit in fits])
        degrees = np.array([max(fit.degrees, 1) for fit in fits], dtype=float)
        least = min(least, heterogeneity(values, errors, degrees)[1])
    p = min(1.0, least * len(columns))
    joints = " and ".join(law.joints)
    if p < DIFFER:
        return f"{joints} are declared alike and differ (p = {p:.1g}): give them kinds of their own"
    return f"{joints} have one law within their errors (p = {p:.2g})"
