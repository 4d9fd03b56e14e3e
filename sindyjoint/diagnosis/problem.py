"""What a diagnosis asks of its data, campaign or pulse record; steps of a search; the greedy one that simulates."""

from collections.abc import Callable, Collection, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any, Generic, Protocol, Self, TypeVar

from sindyjoint.clock import Portion
from sindyjoint.diagnosis.evidence import Candidate, Ranking
from sindyjoint.diagnosis.parts import Budget, Place
from sindyjoint.diagnosis.policy import DiagnosisPolicy
from sindyjoint.diagnosis.result import Advice, Diagnosis, Gap, Step
from sindyjoint.diagnosis.verdict import Residual, grows

Say = Callable[[str], None]


P = TypeVar("P", bound="Problem")


@dataclass(frozen=True)
class Start(Generic[P]):
    """Where a search begins.

    Parameters
    ----------
    problem : Problem
    steps : tuple of Step
        What it has found before: they do not count among the effects that may be added.
    words : str
        How it differs from the model as it was given.
    before : Problem, optional
        The problem without those steps.
    """

    problem: P
    steps: tuple[Step, ...] = ()
    words: str = ""
    before: P | None = None


class Problem(Protocol):
    """A gap to explain, and the effects added to the model so far. Immutable: adding one gives another problem."""

    @property
    def policy(self) -> DiagnosisPolicy:
        """Its limits."""

    @property
    def found(self) -> Sequence[Candidate]:
        """The effects added, with the numbers of the last fit."""

    @property
    def parameters(self) -> dict[str, dict[str, float]]:
        """Numbers of the effects added, by the effects' names."""
        return {each.name: dict(each.parameters) for each in self.found}

    @property
    def dropped(self) -> tuple[str, ...]:
        """Terms of the model that the last effect made needless."""
        return ()

    @property
    def is_noise(self) -> bool:
        """Whether it is sure, without a further search, that nothing but noise remains."""
        return False

    @property
    def gap(self) -> Gap:
        """On data left out of the fit, with the effects."""

    @property
    def initial_gap(self) -> Gap:
        """On data left out of the fit, of the model as it was given."""
        return self.gap

    @property
    def noise_floor(self) -> Gap:
        """What does not repeat."""

    @property
    def floor_is_bound(self) -> bool:
        """Whether that is only an upper bound."""
        return False

    def gap_without(self, names: Collection[str]) -> Gap:
        """Return the gap without some of the effects, the others fitted anew."""
        return self.gap

    def uncertainty(self) -> Gap:
        """Return the gap of the response that noise alone leaves, beside the floor, by numbers and drive."""
        return Gap(0.0, 0.0)

    def corrected(self) -> tuple[Self, tuple[Step, ...]]:
        """Return the problem with channels put right that drift for all to see, and the steps that this took."""
        return self, ()

    def searched(self, begun: Any, most: int, say: Say, search: Portion) -> Any:
        """Return the progress with the effects that the data show, at most so many, as far as the portion goes."""
        return add_effects(begun, most, say, search)

    def cost(self) -> float:
        """Return what the set of effects found costs, the less the better the data are predicted."""
        return 0.0

    def propose(self, refused: Collection[str], say: Say) -> Ranking[Any] | None:
        """Return the candidates in order of probability; None where there are none."""
        return None

    def add(self, best: Any) -> Self | None:
        """Return the problem with an effect more, less those that it makes needless; None where the fit fails."""
        return None

    def units(self, fitted: Any) -> dict[str, str]:
        """Return the units of an effect's parameters."""

    @property
    def moves_freely(self) -> bool:
        """Whether no moment was measured, so that only the motion tells what is missing."""
        return False

    def without_needless(self) -> Self:
        """Return the problem without terms that nobody asked for and the data do not need."""
        return self

    def finished(self) -> Self:
        """Return the problem after a last refinement of its numbers."""
        return self

    def other_start(self, straight: Self, last: Self, say: Say) -> Start[Self] | None:
        """Return another start worth a search, where those so far left a remainder in ``last``; None without one."""
        return None

    def zero_start(self, straight: Self, last: Self, say: Say) -> Start[Self] | None:
        """Return the start with displacements counted from the joint's own zero; None where no zero error was found."""
        return None

    def residual(self, straight: Self) -> Residual:
        """Return what the effects leave of the gap that channels put right had."""

    def budget(self, first: Self, last: Self) -> Budget:
        """Return the parts of the first problem's gap; this one is it with its channels put right."""

    def places(self) -> tuple[Place, ...]:
        """Return where the gap of the model as it was given lies."""

    def separating_runs(
        self, step: Step, ranking: Ranking[Any], search: Portion, say: Say
    ) -> tuple[tuple[Advice, ...], int, int]:
        """Return the runs that would tell the members of a class apart, how many were tried, and of how many."""
        return (), 0, 0

    def diagnosis(self, first: Self, found: Mapping[str, Any]) -> Diagnosis:
        """Return the result: what was found, completed by model, effects, pictures and warnings."""


@dataclass(frozen=True, eq=False)
class Progress(Generic[P]):
    """How far a search has come.

    Parameters
    ----------
    problem : Problem
        With the effects of all steps.
    gap : Gap
        From which the next effect must lead down.
    steps : tuple of Step
    rankings : mapping of str to Ranking
        By the effects named in the steps.
    """

    problem: P
    gap: Gap
    steps: tuple[Step, ...] = ()
    rankings: Mapping[str, Ranking[Any]] = field(default_factory=dict)


def add_effects(start: Progress[P], most: int, say: Say, search: Portion) -> Progress[P]:
    """Add the likeliest effect until the gap is noise, nothing explains it, the count is reached, or time is up.

    A round that does not end adds nothing: its best candidate may be one of those that it has not tried. What cannot be
    fitted, or a later effect has made needless, is not proposed again. What is returned has a gap no larger than that
    of the model as it was given.
    """
    been, out = [start], set[str]()
    while len(been[-1].steps) < most and not (been[-1].steps and been[-1].problem.is_noise):

        def one_round(
            here: Progress[P] = been[-1], out: frozenset[str] = frozenset(out)
        ) -> Progress[P] | str | None:
            return _try_effect(here, out, say)

        tried = search.do(one_round, None, "further effects")
        if isinstance(tried, Progress):
            out |= {step.effect for step in been[-1].steps} - {step.effect for step in tried.steps}
            been.append(tried)
        elif tried is not None:
            out.add(tried)
        else:
            say(
                f"stopping: {'what the search may cost is used up' if search.stopped else 'nothing is likely'}"
            )
            break
    given = start.steps[0].gap_before if start.steps else start.gap
    return next(here for here in reversed(been) if here is start or not grows(given, here.gap))


def _try_effect(here: Progress[P], out: Collection[str], say: Say) -> Progress[P] | str | None:
    """Return the progress with the likeliest effect, or the id of one whose fit fails; None where none is likely."""
    ranking = here.problem.propose(out, say)
    if ranking is None or ranking.nothing > here.problem.policy.chance:
        return None
    best = ranking.fitted[0]
    say(f"adding {best.name.replace('_', ' ')}")
    added = here.problem.add(best)
    return best.name if added is None else _accepted(here, ranking, added)


def _accepted(here: Progress[P], ranking: Ranking[Any], added: P) -> Progress[P]:
    """Return the progress with a step more, without those that it makes needless."""
    kept = [step for step in here.steps if step.effect in added.parameters]
    before = here.steps[0].gap_before if here.steps else here.gap
    rankings = {name: here.rankings[name] for name in (step.effect for step in kept)}
    step = step_of(added, ranking, here.gap, added.gap)
    now, later = added.parameters, list[Step]()
    for each in (*kept, step):
        later.append(replace(each, parameters=now.get(each.effect, each.parameters), gap_before=before))
        before = each.gap_after
    return Progress(added, added.gap, tuple(later), {**rankings, step.effect: ranking})


def with_gaps_renewed(steps: Sequence[Step], before: Gap, problem: P) -> list[Step]:
    """Return the steps of a problem with the gaps that it has without those after each."""
    now, later = problem.parameters, list[Step]()
    for place, step in enumerate(steps, 1):
        after = problem.gap_without([s.effect for s in steps[place:]])
        numbers = now.get(step.effect, step.parameters)
        later.append(replace(step, parameters=numbers, gap_before=before, gap_after=after))
        before = after
    return later


def step_of(problem: P, ranking: Ranking[Any], before: Gap, after: Gap) -> Step:
    """Return the first candidate of a ranking as a step."""
    best = ranking.fitted[0]
    others = zip(ranking.fitted[1:], ranking.probabilities[1:], strict=True)
    # Of the rivals of a step so many are reported, with more than this probability.
    return Step(
        effect=best.name,
        family=best.family,
        members=tuple(f.name for f in ranking.members),
        probability=ranking.probabilities[0],
        rivals=tuple((f.name, p) for f, p in others if p > 1e-4)[:6],
        parameters=best.parameters,
        terms_dropped=problem.dropped,
        gap_before=before,
        gap_after=after,
        units=problem.units(best),
    )
