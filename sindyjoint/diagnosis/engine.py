"""A diagnosis from the first gap to the verdict and to further runs, alike for a campaign and for a structure."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import chain
from typing import Any, Generic

import numpy as np

from sindyjoint.clock import Portion
from sindyjoint.diagnosis.evidence import Ranking
from sindyjoint.diagnosis.parts import NOT_DIVIDED
from sindyjoint.diagnosis.policy import DiagnosisPolicy
from sindyjoint.diagnosis.problem import P, Problem, Progress, Say, Start
from sindyjoint.diagnosis.result import (
    COMPLETE,
    NOT_NEEDED,
    STOPPED,
    Advice,
    AdviceSearch,
    Diagnosis,
    Gap,
    Step,
)
from sindyjoint.diagnosis.verdict import (
    UNDECIDED,
    Gaps,
    discount,
    grows,
    judge,
    with_falling_gaps,
)
from sindyjoint.text import percent, spelled

# The stages of one diagnosis that have a portion each, from every start together: the rounds of the loop and the
# starts themselves; what a verdict needs to know; the numbers refined on the simulated response; the parts of the first
# gap and where it lies. Advice has one of its own.
STAGES = {
    "search": "the search",
    "verdict": "the verdict",
    "numbers": "the refinement on the simulated response",
    "parts": "the division of the gap",
}


@dataclass(frozen=True, eq=False)
class Stages:
    """The portions of the stages of one diagnosis, and who hears which of them is running.

    Parameters
    ----------
    portions : dict of str to Portion
        Of each of :data:`STAGES`.
    say : callable
    """

    portions: dict[str, Portion]
    say: Say

    @classmethod
    def of(cls, policy: DiagnosisPolicy, say: Say) -> "Stages":
        """Return the portions that a policy gives."""
        works = policy.search_work, policy.verdict_work, policy.numbers_work, policy.parts_work
        portions = (Portion(work, work / policy.slowest) for work in works)
        return cls(dict(zip(STAGES, portions, strict=True)), say)

    @property
    def notes(self) -> tuple[str, ...]:
        """Return what each stage whose portion was used up left out."""
        return tuple(
            f"{STAGES[stage]} ended {portion.stopped}; left out: {', '.join(portion.left_out)}"
            for stage, portion in self.portions.items()
            if portion.stopped
        )


def advise(
    problem: Problem,
    steps: Sequence[Step],
    rankings: Mapping[str, Ranking[Any]],
    say: Say = lambda stage: None,
) -> tuple[tuple[Advice, ...], AdviceSearch]:
    """Return the runs that separate the class of each step that has rivals in it, and how far the search went."""
    classes = [step for step in steps if len(step.members) > 1 and step.effect in rankings]
    if not classes:
        return (), AdviceSearch(NOT_NEEDED)
    work = problem.policy.advice_work
    search = Portion(work, work / problem.policy.slowest)
    sought = (problem.separating_runs(step, rankings[step.effect], search, say) for step in classes)
    found, tried, planned = zip(*sought, strict=True)
    status = STOPPED if search.stopped else COMPLETE
    return tuple(chain(*found)), AdviceSearch(status, sum(tried), sum(planned), search.stopped)


@dataclass(frozen=True, eq=False)
class Explained(Generic[P]):
    """What the search from one start came to.

    Parameters
    ----------
    straight : Problem
        The problem of that start, its channels put right.
    progress : Progress
    gaps : Gaps
    verdict, reason : str
    start : str
        What it began with.
    """

    straight: P
    progress: Progress[P]
    gaps: Gaps
    verdict: str
    reason: str
    start: str

    @property
    def whole(self) -> bool:
        """Whether nothing remains to be explained."""
        return self.verdict in ("nothing_missing", "named", "ambiguous")

    @property
    def cost(self) -> float:
        """What the set of effects found costs: its negative score, and the price of its numbers."""
        return self.progress.problem.cost()


def explain_gap(
    first: P,
    most: int,
    say: Say,
    advised: bool = True,
    without_advice: Callable[[Diagnosis], None] = lambda d: None,
    refined: Callable[[P, bool], tuple[P, tuple[str, ...]]] = lambda p, explained: (p, ()),
) -> Diagnosis:
    """Add up to ``most`` effects that a model lacks, and return what that comes to; ``say`` hears each stage.

    Where the search from the model as it was given found a zero error, it is made again from the joint's own zero, and
    where something is left unexplained, from the best other start that the problem knows, or else from the channels
    aligned, should they have a delay that explains as much; the best end is used. Unless
    ``advised``, no runs are sought that would tell rivals apart; if so, ``without_advice`` is given the diagnosis
    before that begins. ``refined``, which is told whether nothing
    remains to be explained, may give the last problem other numbers, and notes on that.
    """
    stages = Stages.of(first.policy, say)
    say("the gap")
    straight, steps = first.corrected()
    best, note = _best_search(first, straight, steps, most, stages)
    verdict, reason = _of_search(best, stages.portions["search"])
    steps = discount(best.progress.steps, verdict, best.gaps, first.policy)
    last, final, notes = _with_last_numbers(best, refined, stages)
    if last is not best.progress.problem:
        # Figures and numbers belong to the model that is handed on.
        numbers = last.parameters
        steps = tuple(replace(s, parameters=numbers.get(s.effect, s.parameters)) for s in steps)
        steps = (*steps[:-1], *(replace(step, gap_after=final) for step in steps[-1:]))
    steps = with_falling_gaps(steps, best.gaps.initial)
    say("the parts of the gap")
    parts = stages.portions["parts"]
    found = {
        "verdict": verdict,
        "reason": reason,
        "initial": best.gaps.initial,
        "final": final,
        "noise_floor": best.gaps.floor,
        "uncertainty": best.gaps.uncertainty,
        "budget": parts.do(lambda: best.straight.budget(first, last), NOT_DIVIDED, "the parts of the gap"),
        "where": () if verdict == "nothing_missing" else parts.do(first.places, (), "where the gap lies"),
        "steps": steps,
        "advice": (),
    }
    result = last.diagnosis(first, found)
    result = replace(result, warnings=(*stages.notes, *filter(None, (note,)), *result.warnings, *notes))
    if not advised:
        return result
    if any(len(step.members) > 1 for step in steps):
        without_advice(result)
    say("advice")
    advice, search = advise(last, steps, best.progress.rankings, say)
    warnings = (*filter(None, (search.warning,)), *result.warnings)
    return replace(result, advice=advice, search=search, warnings=warnings)


def _with_last_numbers(
    best: Explained[P], refined: Callable[[P, bool], tuple[P, tuple[str, ...]]], stages: Stages
) -> tuple[P, Gap, tuple[str, ...]]:
    """Return the last problem with the numbers that are handed on, its gap, and notes on them."""
    found, known = best.progress.problem.without_needless(), best.gaps.final
    if found is not best.progress.problem:
        known = found.gap

    def fitted() -> tuple[P, Gap, tuple[str, ...]]:
        later, notes = refined(found.finished(), best.whole)
        if later is found or grows(best.gaps.initial, later.gap):
            return found, known, notes if later is found else ()
        return later, later.gap, notes

    stages.say("the numbers")
    return stages.portions["numbers"].do(fitted, (found, known, ()), "all of it")


def _of_search(best: Explained[P], search: Portion) -> tuple[str, str]:
    """Return verdict and reason: a search that did not end cannot know that no effect explains what remains."""
    if not search.stopped or best.verdict not in ("unknown", "partly_named"):
        return best.verdict, best.reason
    verdict = UNDECIDED if best.verdict == "unknown" else best.verdict
    return verdict, f"{best.reason}; the search ended {search.stopped}, before everything was tried"


def _best_search(
    first: P, straight: P, steps: tuple[Step, ...], most: int, stages: Stages
) -> tuple[Explained[P], str]:
    """Return the search that ended best, and what to say of other starts."""
    search, say = stages.portions["search"], stages.say
    ends = [_explain(first, Start(straight, steps), most, stages)]
    zero = search.do(
        lambda: first.zero_start(straight, ends[0].progress.problem, say), None, "the joint's own zero"
    )
    if zero is not None:
        ends.append(_explain(first, zero, most, stages))
    last = _best_of(first, ends)
    if not last.whole:
        other = search.do(
            lambda: first.other_start(straight, last.progress.problem, say), None, "other starts"
        )
        ends += [_explain(first, each, most, stages) for each in (other,) if each is not None]
    best = _best_of(first, ends)
    return best, _compare_starts(best, ends)


def _best_of(first: P, ends: Sequence[Explained[P]]) -> Explained[P]:
    """Return the end that costs least, of those whose gap is no larger than that of the model as it was given.

    One that cannot be simulated only where none can.
    """
    alike = first.policy.trivial_share
    kept = [each for each in ends if not grows(first.initial_gap, each.gaps.final, alike)]
    return min(kept, key=lambda each: (np.isnan(each.gaps.final.response), each.cost), default=ends[0])


def _explain(first: P, start: Start[P], most: int, stages: Stages) -> Explained[P]:
    """Return what the search from one start comes to; *undecided* where the verdict is not reached."""
    initial, given = first.initial_gap, start.problem
    before = start.steps[-1].gap_after if start.steps else initial
    begun = Progress(given, before, start.steps)
    progress = given.searched(begun, most + len(start.steps), stages.say, stages.portions["search"])
    if grows(initial, progress.gap, first.policy.trivial_share):
        progress = begun  # what predicts the runs left out worse than nothing is no answer
    final = progress.steps[-1].gap_after if progress.steps else progress.problem.gap
    straight, problem = start.before or start.problem, progress.problem
    words = start.words or "the model as it was given"

    def judged() -> Explained[P]:
        sure = problem.uncertainty(), problem.floor_is_bound, problem.moves_freely
        gaps = Gaps(initial, final, problem.noise_floor, *sure)
        said = judge(progress.steps, problem.residual(straight), gaps, first.policy)
        return Explained(straight, progress, gaps, *said, words)

    stages.say("the verdict")
    return stages.portions["verdict"].do(judged, None, "the verdict") or Explained(
        straight, progress, Gaps(initial, final, problem.noise_floor), UNDECIDED,
        "the calculations that a verdict needs did not end in time", words,
    )  # fmt: skip


def _compare_starts(best: Explained[P], ends: Sequence[Explained[P]]) -> str:
    """Return how the searches from other starts ended, beside the one that is used."""
    others = [f"from {each.start} {_end_of(each)}" for each in ends if each is not best]
    if not others or (best is ends[0] and best.whole):
        return ""
    return f"the search started from {best.start}, which ends with {_gaps_of(best)}; {'; '.join(others)}"


def _end_of(end: Explained[P]) -> str:
    names = ", ".join(spelled(step.effect) for step in end.progress.steps) or "no effect"
    return f"it ends with {_gaps_of(end)} ({end.verdict.replace('_', ' ')}: {names})"


def _gaps_of(end: Explained[P]) -> str:
    final = end.gaps.final
    of_response = f" and {percent(final.response)} of the response" if np.isfinite(final.response) else ""
    return f"a gap of {percent(end.gaps.figures()[1])}{'' if end.gaps.of_response else of_response}"
