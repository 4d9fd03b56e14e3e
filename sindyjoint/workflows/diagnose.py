"""Where model and measurement disagree, which effect that is, and how much smaller the gap is with it.

Of a joint tested alone, or of one that is simulated in a structure: the verbs open the data, the engine does the rest.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

from sindyjoint.clock import single_threaded
from sindyjoint.diagnosis.effects import OF_JOINT, Effect, load_effects
from sindyjoint.diagnosis.engine import explain_gap
from sindyjoint.diagnosis.policy import CAMPAIGN, IN_PLACE, STRUCTURE, DiagnosisPolicy
from sindyjoint.diagnosis.result import Diagnosis
from sindyjoint.discovery.delay import delay_to_remove, without_delay
from sindyjoint.equation.candidates import NO_DELAY, NO_RESPONSE, without_rate
from sindyjoint.equation.catalogue import Catalogue
from sindyjoint.equation.model import JointModel
from sindyjoint.errors import InputError, checks_options
from sindyjoint.judgement.tested import Tested, followed, no_surer_than, stopped
from sindyjoint.mechanics.rig_test import RigTest
from sindyjoint.numeric import RNG
from sindyjoint.parallel import spread
from sindyjoint.record import Campaign
from sindyjoint.soundness.check import check_accepted, check_data, require_sound
from sindyjoint.substructure.recovery import recover
from sindyjoint.workflows.check import the_campaign
from sindyjoint.workflows.discover import discover_rig, laws_of_rig

if TYPE_CHECKING:
    from sindyjoint.diagnosis.campaign.problem import CampaignProblem
    from sindyjoint.mechanics.excitation import Actuator
    from sindyjoint.mechanics.rigs import Rig


@checks_options()
@single_threaded()
def diagnose(
    campaign: Campaign | str | Path | Any = None,
    model: JointModel | None = None,
    *,
    accept: Sequence[str] = (),
    align: bool = False,
    base: str | Path | Catalogue | Sequence[str | Path | Catalogue] | None = None,
    library: Sequence[str | Path] = (),
    effects: Sequence[Effect] | None = None,
    max_effects: int = CAMPAIGN.most_effects,
    hold_out: Sequence[str] = (),
    advise: bool = True,
    actuator: Actuator | None = None,
    before_advice: Callable[[Diagnosis], None] | None = None,
    refine: bool = False,
    rng: RNG = None,
    progress: Callable[[str], None] | None = None,
    jobs: int = 1,
    workers: int | None = None,
    cluster: str | None = None,
    policy: DiagnosisPolicy = CAMPAIGN,
) -> Diagnosis:
    """Find where a model and a campaign disagree, name what is missing, add it, and show the gap shrink.

    Parameters
    ----------
    campaign : Campaign, path of a campaign.toml, or None
        ``None``: a virtual test in which ``rng`` hides an effect, revealed in the result.
    model : JointModel, optional
        Whose terms are the starting point; their coefficients are estimated anew. Default: the terms of ``base``.
    accept : sequence of str
        Ids of findings of the check of the data that shall not stop the work; see :func:`~sindyjoint.check`. Under any
        that would, the verdict is *undecided*.
    align : bool
        Remove a significant delay between the channels first, whatever the search would make of it.
    base : library or libraries, optional
        Terms to start from where no model is given. Default: the paper's five; where they and the effects leave
        something unexplained, the search is made once more from the start with the smallest gap: the terms that
        discovery finds or the five, a delay of the channels removed first or not.
    library : sequence of str or Path
        Further TOML files of effects; an id that is shipped is replaced.
    effects : sequence of Effect, optional
        Candidates; default: all shipped ones and those of ``library``.
    max_effects : int
        Most effects that are added.
    hold_out : sequence of str
        Names of runs that are kept out of the fit, as if marked ``use = "validate"``.
    advise : bool
        Whether runs are sought that would tell rivals apart; ``policy.advice_work`` ends that early.
    actuator : Actuator, optional
        What makes further runs: those that it can make are advised. Default: any prescribed angle up to the largest
        tested one, and moments where these drove.
    before_advice : callable, optional
        Called with the diagnosis, complete but for advice, before runs are sought; an interruption of that search then
        takes nothing with it.
    refine : bool
        Fit terms and elements of the whole model to the simulated response in the end, unless the response gap would
        grow by it. Steps, gaps and pictures are then those of the refined model.
    rng : int, Generator or None
    progress : callable, optional
        Called with the name of each stage.
    jobs, workers, cluster
        Where candidates and runs to advise are tried, by default on threads of this process; see
        :func:`~sindyjoint.parallel.executor`. The result is the same to the last digit.
    policy : DiagnosisPolicy
        The limits that decide the answer.

    Returns
    -------
    Diagnosis

    Raises
    ------
    InputError, UnknownNameError

    Examples
    --------
    >>> import sindyjoint
    >>> test = sindyjoint.simulate(frequencies=[3, 5], levels=[0.9, 0.5], duration=3.0, rng=0)
    >>> sindyjoint.diagnose(test, advise=False, max_effects=1).settled
    True
    """
    from sindyjoint.diagnosis.campaign.problem import CampaignProblem
    from sindyjoint.diagnosis.campaign.start import kept_out
    from sindyjoint.response import carried_errors, corrected
    from sindyjoint.response.verify_campaign import GIVEN, beyond_tested

    say = progress or (lambda stage: None)
    check_accepted(accept)
    known = [e for e in _known_effects(library, effects, max_effects) if e.enters in OF_JOINT]
    with spread(jobs, workers, cluster):
        hidden = None
        if campaign is None:
            from sindyjoint.diagnosis.campaign.designs import hidden_campaign

            say("simulating a virtual test with something hidden in it")
            campaign, hidden = hidden_campaign(rng)
        campaign = kept_out(the_campaign(campaign, rng), hold_out)
        if campaign.quasi_static:
            if align or refine:
                raise InputError(f"align: {NO_DELAY}" if align else f"refine: {NO_RESPONSE}")
            model = model if model is None else without_rate(model)[0]
        say("checking the data")
        checked = check_data(campaign, accept)
        if checked.stopping:
            return replace(stopped(checked, model), hidden=hidden)
        say("force states")
        carried, notes = carried_errors(model, campaign)
        usable = corrected(carried, checked.usable)
        delay = delay_to_remove(usable) if align else None
        if delay is not None:
            usable = without_delay(usable, delay)
        usable, lags = followed(usable, model)
        problem = CampaignProblem.build(usable, model, base, known, policy, actuator)
        beyond = () if model is None else beyond_tested(model, *problem.states, whose=GIVEN)
        tested = Tested(
            campaign, checked, delay, lags, hidden, (*notes, *beyond), carried,
            () if model is None else model.fitted.seen,
        )  # fmt: skip

        def refined(last: CampaignProblem, explained: bool) -> tuple[CampaignProblem, tuple[str, ...]]:
            from sindyjoint.diagnosis.campaign.refined import refined_problem

            if not (refine or (explained and last.better_simulated)):
                return last, ()
            return refined_problem(last, checked.usable, tested.nuisances(last.test), say)

        return _explained(problem, max_effects, say, advise, before_advice, tested.complete, refined)


def _explained(
    problem: Any,
    most: int,
    say: Callable[[str], None],
    advise: bool,
    before_advice: Callable[[Diagnosis], None] | None,
    complete: Callable[[Diagnosis], Diagnosis],
    *refined: Any,
) -> Diagnosis:
    """Return the diagnosis of a problem as it is completed; so it is, too, where it is handed on before advice."""
    keep = before_advice or (lambda result: None)
    return complete(explain_gap(problem, most, say, advise, lambda result: keep(complete(result)), *refined))


@checks_options()
@single_threaded()
def diagnose_structure(
    rig: Rig | str | Path,
    model: JointModel | None = None,
    *,
    library: Sequence[str | Path] = (),
    effects: Sequence[Effect] | None = None,
    max_effects: int = STRUCTURE.most_effects,
    hold_out: Sequence[Rig | str | Path] = (),
    advise: bool = True,
    before_advice: Callable[[Diagnosis], None] | None = None,
    rng: RNG = None,
    progress: Callable[[str], None] | None = None,
    policy: DiagnosisPolicy = STRUCTURE,
) -> Diagnosis:
    """Find where a model in the joint of a rig and the rig's pulse record disagree, and name what is missing.

    The candidates are the effects of the joint and those outside of it: material loss, stiffness and mass of the beams,
    lumped masses, the clamp, the pulse, the displacement sensor. Each is fitted on the simulated response beside the
    model's coefficients, which keep to their covariance: a gap that these can explain is no effect.

    Parameters
    ----------
    rig : Rig, path of a rig's TOML file, or name of a shipped rig
        Its ``[measured]`` records. Without one: a virtual pulse test in which ``rng`` hides an effect.
    model : JointModel, optional
        Default: the law that the rig gives for its joint, each term known to 0.5 %; of a joint without one
        (``law = "unknown"``) the law that :func:`~sindyjoint.discover_rig` finds in the same pulse.
    hold_out : sequence of Rig or path
        Other pulses of the same structure, which no fit sees; the gaps are those of them. Default: the second half of
        the time in which the record stands out of its noise.
    rng : int, Generator or None
        Of the virtual pulse test.
    library, effects, max_effects, advise, before_advice, progress, policy
        As in :func:`diagnose`; records are advised, not runs.

    Returns
    -------
    Diagnosis

    Raises
    ------
    InputError, UnitError, UnknownNameError, MissingInputError
        In one line.

    Examples
    --------
    >>> import sindyjoint
    >>> found = sindyjoint.diagnose_structure("pulse-rig", advise=False, max_effects=1, rng=5)
    >>> [step.effect for step in found.steps]
    ['lumped_mass']
    """
    from sindyjoint.diagnosis.structure.problem import StructureProblem

    say = progress or (lambda stage: None)
    known = _known_effects(library, effects, max_effects)
    found: tuple[str, ...] = ()
    if model is None and isinstance(rig, str | Path):
        model = _law_in_pulse(rig, rng, say)
        found = () if model is None else (LAW_OF_PULSE,)
    problem = StructureProblem.build(rig, model, known, hold_out, rng, policy, say)
    return _explained(
        problem, max_effects, say, advise, before_advice,
        lambda result: replace(result, warnings=(*found, *result.warnings)),
    )  # fmt: skip


LAW_OF_PULSE = (
    "no model was given: the law was found in the same pulse, and what it took up of a gap is not seen"
)


def _law_in_pulse(rig: str | Path, rng: RNG, say: Callable[[str], None]) -> JointModel | None:
    """Return the law that a rig's pulse shows of its joints where the file gives none and a response was measured."""
    from sindyjoint.diagnosis.structure.start import open_rig
    from sindyjoint.mechanics.rigs import UNKNOWN
    from sindyjoint.mechanics.virtual_rig import hinges

    opened = open_rig(rig)
    if opened.measured is None or all(hinge.law is not UNKNOWN for hinge in hinges(opened)):
        return None
    laws = discover_rig(rig, refine=False, rng=rng, progress=say).laws
    if len(laws) > 1 or not laws[0].found or laws[0].discovery is None:
        words = f"{len(laws)} kinds of joints" if len(laws) > 1 else laws[0].reason or "no law was found"
        raise InputError(f"{rig}: {words}; give the model that stands for the joint (--model)")
    return laws[0].discovery.model


@checks_options()
@single_threaded()
def diagnose_rig(
    rig: RigTest | str | Path,
    models: JointModel | Mapping[str, JointModel] | None = None,
    *,
    accept: Sequence[str] = (),
    library: Sequence[str | Path] = (),
    effects: Sequence[Effect] | None = None,
    max_effects: int = IN_PLACE.most_effects,
    advise: bool = True,
    before_advice: Callable[[Diagnosis], None] | None = None,
    rng: RNG = None,
    progress: Callable[[str], None] | None = None,
    policy: DiagnosisPolicy = IN_PLACE,
) -> Diagnosis:
    """Find what the laws of the joints in a structure lack, against what the structure lacks, from its sensors.

    The candidates are those of :func:`diagnose_structure`, without zero and drift of a sensor: effects of each kind of
    joint, and beams, masses, clamp, drive and sensors. Each is fitted on the simulated steady motion of every run
    beside the laws' numbers and the structure's uncertain ones, which keep to the priors of the file.

    Parameters
    ----------
    rig : RigTest or path of a rig.toml
        With sensors and recorded runs; of runs that do not repeat those segments are compared in which the joints move
        most. The gaps are those of runs that no fit sees: those marked
        ``use = "validate"``, or every third one.
    models : JointModel or mapping of str to JointModel, optional
        For every joint, or by kind of joint: from tests of the joint alone; numbers keep to their covariance. Default:
        the laws that :func:`~sindyjoint.discover_rig` finds in the same runs, with free numbers.
    accept : sequence of str
        Ids of findings of the check of the data that shall not stop the work; see :func:`~sindyjoint.check`. Under any
        that would, the verdict is *undecided*.
    library, effects, max_effects, advise, before_advice, rng, progress, policy
        As in :func:`diagnose_structure`; runs are not advised.

    Returns
    -------
    Diagnosis

    Raises
    ------
    InputError
        For runs that cannot be used, or joints in which no law is found.
    UnsoundError
        Where findings of the check stop the work.

    Examples
    --------
    >>> from dataclasses import replace
    >>> import sindyjoint
    >>> plan = sindyjoint.load_rig_plan("pulse-rig")
    >>> recorder = replace(plan.recorder, duration=4.0, settling=4.0)
    >>> test = sindyjoint.virtual_rig_test(plan.test, plan.drives[:2], recorder)
    >>> found = sindyjoint.diagnose_rig(test, advise=False, max_effects=1)
    >>> found.settled
    True
    """
    from sindyjoint.diagnosis.structure.in_place import RunsDiagnosis, divide_runs, runs_problem
    from sindyjoint.judgement.rig_discovery import described
    from sindyjoint.mechanics.rig_test_file import load_rig_test

    say = progress or (lambda stage: None)
    known_effects = _known_effects(library, effects, max_effects)
    test = rig if isinstance(rig, RigTest) else load_rig_test(rig)
    given = models is not None
    say("checking the data")
    checked = require_sound(check_data(test, accept))
    test = checked.usable
    own, others = divide_runs(test)
    if models is None:
        # Laws that have seen the runs kept out would be judged by what they know.
        found = laws_of_rig(replace(test, runs=tuple(own)), "extended", False, say, random_state=rng)
        lacking = [law for law in found.laws if not law.found]
        if lacking:
            raise InputError(
                f"no law was found of {lacking[0].kind}: give a model, or see what discover says"
            )
        test = replace(described(found), runs=test.runs)
        models = {law.kind: law.discovery.model for law in found.laws if law.discovery is not None}
    elif isinstance(models, JointModel):
        models = dict.fromkeys(test.kinds, models)
    say("the response with the models")
    fitted, kept = (
        runs_problem(
            test, [recover(test, run) for run in runs], models, given, policy, runs is own, policy.segments
        )
        if runs
        else None
        for runs in (own, others)
    )
    assert fitted is not None
    problem = RunsDiagnosis.of(fitted, kept, known_effects)
    return _explained(
        problem, max_effects, say, advise, before_advice, lambda result: no_surer_than(result, checked)
    )


def _known_effects(
    library: Sequence[str | Path], effects: Sequence[Effect] | None, most: int
) -> Sequence[Effect]:
    """Return the candidates; InputError where none may be added."""
    if most < 1:
        raise InputError(f"max_effects is {most}; expected at least 1")
    return load_effects(library) if effects is None else effects
