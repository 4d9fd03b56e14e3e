"""What was found of the joints inside an assembled structure from its sensors, and their laws fitted again to these."""

from collections.abc import Callable, Collection, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import ClassVar

import numpy as np

from sindyjoint.described import Maybe, Shown, same
from sindyjoint.diagnosis.structure import Fit, fit
from sindyjoint.diagnosis.structure.in_place import runs_problem
from sindyjoint.equation.model import JointModel
from sindyjoint.errors import InputError
from sindyjoint.judgement.headlines import MOST_STEPS
from sindyjoint.judgement.joint_laws import JointLaw, place_of_kind, terms_by_kind, told_terms, with_terms
from sindyjoint.judgement.trust import judge_soundness
from sindyjoint.judgement.verdict import undecided_by_data
from sindyjoint.limits import SUBSTRUCTURE
from sindyjoint.mechanics.rig_test import RigTest
from sindyjoint.numeric import Array
from sindyjoint.paper import TERMS as PAPER_TERMS
from sindyjoint.soundness import Soundness
from sindyjoint.soundness.check import Check
from sindyjoint.substructure.recovery import Recovery, Update, UpdatedNumber, recover, with_numbers
from sindyjoint.substructure.states import JointSeen
from sindyjoint.text import list_some
from sindyjoint.trust import ORDER, Light, Trust

ITERATIONS = 8
# Further starts are so many standard errors away from what the regression found.
SPREAD = 4.0
# Two ends whose χ² differs by less than this are one.
SAME_END = 1.0


@dataclass(frozen=True, eq=False)
class RigRefinement:
    """The result of :func:`refine_rig`.

    Parameters
    ----------
    refined : bool
    reason : str
        Why it did not succeed; empty where it did.
    models : dict of str to JointModel
        By kind of joint, with covariance; those given where it did not succeed.
    update : Update or None
        Of the structure's uncertain numbers.
    before, after : float
        Root mean square of simulated less measured in their noise, with the laws as given and as refined.
    ends : tuple of float
        χ² at which the search ended from each start, the given laws first; NaN where it failed.
    """

    WRITTEN: ClassVar = same("refined", "reason", "before", "after", "ends")
    refined: bool
    reason: str
    models: dict[str, JointModel]
    update: Update | None
    before: Maybe
    after: Maybe
    ends: tuple[Maybe, ...] = ()

    @property
    def notes(self) -> tuple[str, ...]:
        """What to know of it, in words."""
        if not self.refined:
            return (f"not refined on the simulated response: {self.reason}",)
        other = sum(not end < min(self.ends) + SAME_END for end in self.ends)
        found = f"; {len(self.ends)} starts end alike" if len(self.ends) > 1 else ""
        if other:
            found = f"; {other} of {len(self.ends)} starts end worse, or cannot be simulated"
        words: tuple[str, ...] = (
            f"refined on the simulated response: {self.before:.2f} times the noise before, {self.after:.2f} after"
            f"{found}",
        )
        if self.after**2 > SUBSTRUCTURE.contradicts:
            words += (
                f"the simulated response is {self.after:.1f} times the noise off: laws or structure lack something; "
                "diagnose the rig",
            )
        return words


def refine_rig(
    test: RigTest,
    recoveries: Sequence[Recovery],
    models: dict[str, JointModel],
    *,
    starts: int = 3,
    random_state: int | np.random.Generator | None = 0,
    progress: Callable[[str], None] | None = None,
) -> RigRefinement:
    """Fit the numbers of models in the joints of a structure to what its sensors showed.

    Simulated is the whole structure under the measured drive: its steady motion where the drive repeats, else its
    motion in segments. The structure's uncertain numbers are fitted too, under the priors that its file states, which
    runs at a level at which the joints stick narrow before.

    Parameters
    ----------
    test : RigTest
        The structure as it is described.
    recoveries : sequence of Recovery
        Of the runs that are fitted.
    models : dict of str to JointModel
        By kind of joint.
    starts : int
        How many starts, the given laws among them.
    random_state : int, Generator or None
        Of the further starts.
    progress : callable, optional
    """
    say = progress or (lambda stage: None)
    try:
        problem = runs_problem(test, recoveries, models)
    except InputError as error:
        return RigRefinement(False, str(error), models, None, np.nan, np.nan)
    start = problem.start()
    first = problem.residuals(start)
    assert first is not None
    generator = np.random.default_rng(random_state)
    found: list[Fit | None] = []
    for number in range(starts):
        say(f"refining on the simulated response, start {number + 1} of {starts}")
        shift = generator.normal(size=start.size) * (SPREAD if number else 0.0)
        shift[: problem.numbers] /= SPREAD
        found.append(fit(problem, shift, problem.duration, iterations=ITERATIONS))
    best = min((each for each in found if each is not None), key=lambda each: each.cost, default=None)
    if best is None:
        return RigRefinement(False, "no start could be simulated", models, None, np.nan, np.nan)
    # Fits to the response at most, residuals whitened anew before each, until one finds no better end.
    for _ in range(5):
        problem = problem.whitened(best.x)
        begun = problem.residuals(best.x)
        again = fit(problem, best.x, problem.duration, iterations=ITERATIONS)
        if begun is None or again is None:
            break
        best = again
        if begun @ begun - again.cost < SAME_END:
            break
    covariance = problem.covariance(best.x)
    degrees = max(problem.rows() - best.x.size, 1.0)
    last = problem.residuals(best.x)
    assert last is not None
    return RigRefinement(
        True, "", problem.models(best.x, covariance), problem.update(best.x, covariance),
        float(np.sqrt(first @ first / degrees)), float(np.sqrt(last @ last / degrees)),
        tuple(np.nan if each is None else each.cost for each in found),
    )  # fmt: skip


@dataclass(frozen=True)
class SensorWorth:
    """What a sensor is worth.

    Parameters
    ----------
    name : str
    worth : tuple of float
        By what factor the error of each joint's moment grows without it; infinite where that is no longer determined.
    """

    name: str
    worth: tuple[Maybe, ...]


@dataclass(frozen=True, eq=False, repr=False)
class RigDiscovery(Shown):
    """The result of :func:`~sindyjoint.discover_rig`.

    Parameters
    ----------
    test : RigTest
        With the structure's numbers as they were updated.
    laws : tuple of JointLaw
    update : Update or None
        Of the structure's uncertain numbers; None where none is stated.
    recoveries : tuple of Recovery
    seen : tuple of JointSeen
        How well each joint is shown.
    worth : ndarray, shape (joints, sensors)
        By what factor the error of each joint's moment grows without each sensor.
    warnings : tuple of str
    refinement : RigRefinement, optional
        Of the laws on the simulated response, where it was asked for.
    soundness : Soundness
        Of the data.
    """

    SCHEMA: ClassVar = 1
    WRITTEN: ClassVar = {
        "rig": "test.name",
        "laws": "laws",
        "joints": "seen",
        "trust": "trust",
        **same("sensors", "structure", "misfit", "refinement", "warnings", "soundness"),
    }
    test: RigTest
    laws: tuple[JointLaw, ...]
    update: Update | None
    recoveries: tuple[Recovery, ...]
    seen: tuple[JointSeen, ...]
    worth: Array
    warnings: tuple[str, ...]
    refinement: RigRefinement | None = None
    soundness: Soundness = Soundness()

    @property
    def found(self) -> bool:
        """Whether every kind of joint has a model."""
        return all(law.found for law in self.laws)

    @property
    def simulated(self) -> bool:
        """Whether the runs come from a virtual test."""
        return self.test.simulated

    @cached_property
    def trust(self) -> Trust:
        """Whether to trust the laws: of each question the worst answer of a kind of joint."""
        every = [
            (law.kind, (Light("explained", "poor", law.reason),), (MOVE_MORE,))
            if law.discovery is None
            else (law.kind, law.discovery.trust.lights, _steps_of(law.kind, law.discovery.trust))
            for law in self.laws
        ]
        worst: dict[str, Light] = {}
        for kind, lights, _ in every:
            for light in lights:
                of_kind = (
                    f"{kind}: {light.sentence}" if len(every) > 1 and light.name != "data" else light.sentence
                )
                if light.name not in worst or ORDER.index(light.colour) > ORDER.index(
                    worst[light.name].colour
                ):
                    worst[light.name] = replace(light, sentence=of_kind)
        steps = dict.fromkeys(step for _, _, steps in every for step in steps)
        return Trust(tuple(worst.values()), tuple(steps)[:MOST_STEPS])

    @property
    def misfit(self) -> Maybe:
        """Residual of the sensors, in their noise; NaN where there are no more sensors than joints."""
        degrees = sum(recovery.degrees for recovery in self.recoveries)
        return float(np.sqrt(sum(r.misfit for r in self.recoveries) / degrees)) if degrees else float("nan")

    @property
    def sensors(self) -> tuple[SensorWorth, ...]:
        """What each sensor is worth."""
        return tuple(
            SensorWorth(s.name, tuple(column))
            for s, column in zip(self.test.sensors, self.worth.T, strict=True)
        )

    @property
    def structure(self) -> tuple[UpdatedNumber, ...]:
        """The structure's uncertain numbers."""
        return () if self.update is None else self.update.numbers


def misfit_warnings(recoveries: Sequence[Recovery]) -> tuple[str, ...]:
    """Say where sensors and structure disagree, or that nothing shows whether they do."""
    misfit, degrees = sum(r.misfit for r in recoveries), sum(r.degrees for r in recoveries)
    if not degrees:
        return (
            "there are as many sensors as joints: nothing shows whether the structure is the one described",
        )
    if misfit <= SUBSTRUCTURE.contradicts * degrees:
        return ()
    return (
        f"the residual of the sensors is {np.sqrt(misfit / degrees):.1f} times their noise: the structure is not quite "
        "the one described; state how uncertain its stiffness and mass are, so that they are updated",
    )


def unstated_numbers(update: Update) -> str:
    """Say which numbers of a structure are other than its file has them, though it states none as uncertain."""
    standing = [n for n in update.numbers if abs(n.change) > SUBSTRUCTURE.significant * n.standard_error]
    words = [f"{n.name} {100 * n.change:+.2g} ± {200 * n.standard_error:.1g} %" for n in standing]
    named = list_some(words, "numbers")
    return (
        f"the sensors contradict the structure as its file describes it, and agree with one changed by {named}; the "
        "laws are those in the changed one; measure these numbers, or state how uncertain they are"
    )


MOVE_MORE = ("record runs that move the joints more", "find their laws")


def _steps_of(kind: str, trust: Trust) -> tuple[tuple[str, str], ...]:
    """Return what to do next with a law, of which the model stands in the folder of its kind."""
    model = f"export RESULTS/{place_of_kind(kind)}"
    return tuple((do.replace("export RESULTS", model), to) for do, to in trust.next_steps)


def with_terms_of_the_response(
    found: RigDiscovery,
    first: RigRefinement,
    refine: Callable[[dict[str, JointModel]], RigRefinement],
    forbidden: Collection[str] = (),
) -> tuple[RigDiscovery, RigRefinement]:
    """Return a discovery and its refinement with the paper's terms that the simulated response tells alone.

    Where a joint hardly moves, or all runs are blows, recovered states do not tell a term from nothing that the
    response shows by far; without it the other numbers make up for it.
    """
    known = terms_by_kind(found.laws)
    fuller = terms_by_kind(found.laws, {*PAPER_TERMS} - {*forbidden})

    def refined_with(terms: dict[str, set[str]]) -> tuple[RigDiscovery, RigRefinement]:
        laws = tuple(with_terms(law, terms[law.kind]) if law.kind in terms else law for law in found.laws)
        models = {law.kind: law.discovery.model for law in laws if law.discovery is not None}
        return replace(found, laws=laws), refine(models)

    if not first.refined or fuller == known:
        return found, first
    tried = refined_with(fuller)
    told = {kind: known[kind] | told_terms(tried[1].models[kind]) & fuller[kind] for kind in known}
    if not tried[1].refined or told == known:
        return found, first
    return tried if told == fuller else refined_with(told)


def with_refinement(found: RigDiscovery, result: RigRefinement) -> RigDiscovery:
    """Return a discovery in a structure with refined laws, and the structure's numbers as the refinement has them."""
    if not result.refined:
        unsure = (
            found if any(each.run.frequency for each in found.recoveries) else with_narrow_intervals(found)
        )
        return replace(unsure, refinement=result)
    test, recoveries = found.test, found.recoveries
    if result.update is not None:
        test = with_numbers(described(found), result.update.change)
        recoveries = tuple(recover(test, each.run, each.spectra) for each in recoveries)
    laws = tuple(_with_model(law, result.models[law.kind], result.notes) for law in found.laws)
    return replace(
        found, test=test, recoveries=recoveries, laws=laws, update=result.update, refinement=result
    )


NARROW = (
    "no run repeats: intervals of the regression include the sensors' noise, but not the errors of the states from the "
    "ends of the records and the band of the sensors; use --refine"
)


def with_narrow_intervals(found: RigDiscovery) -> RigDiscovery:
    """Return a discovery of runs that do not repeat with a warning that intervals by regression are too narrow."""
    return replace(found, warnings=(*found.warnings, NARROW))


def described(found: RigDiscovery) -> RigTest:
    """Return the test with the structure as its file describes it, before any update of its numbers."""
    return found.test if found.update is None else with_numbers(found.test, -found.update.change)


def _with_model(law: JointLaw, model: JointModel, notes: Sequence[str]) -> JointLaw:
    assert law.discovery is not None
    warnings = (*law.discovery.warnings, *notes)
    return replace(law, discovery=replace(law.discovery, model=model, warnings=warnings))


def of_data(found: RigDiscovery, checked: Check[RigTest]) -> RigDiscovery:
    """Return a discovery that says what was found of its data, its verdicts no surer than these allow."""
    faults, data = checked.undecided_by(), _judge_data(found, checked)
    laws = tuple(
        law
        if law.discovery is None
        else replace(
            law,
            discovery=replace(
                law.discovery,
                verdict=undecided_by_data(law.discovery.verdict, faults),
                soundness=checked.soundness,
                data=data,
            ),
        )
        for law in found.laws
    )
    warnings = (*checked.warnings, *found.warnings)
    return replace(found, laws=laws, soundness=checked.soundness, warnings=warnings)


def _judge_data(found: RigDiscovery, checked: Check[RigTest]) -> Light:
    """Return what the check found, and whether the structure is the one that its file describes."""
    light = judge_soundness(checked.soundness, found.simulated, found.test.motion)
    refined = 0.0 if found.refinement is None else found.refinement.after
    left = np.nanmax([found.misfit, refined])
    if left**2 > SUBSTRUCTURE.contradicts:
        return Light(
            "data",
            "poor",
            f"the residual of the sensors under structure and laws is {left:.1f} times their noise",
        )
    if found.update is None or checked.usable.uncertain or light.colour == "poor":
        return light
    return Light(
        "data",
        "fair",
        "the sensors contradict the structure as its file describes it, and agree with a changed one",
    )
