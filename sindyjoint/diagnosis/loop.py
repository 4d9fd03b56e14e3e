"""Steps of a search, and the greedy search where each candidate costs simulations."""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any, Generic

from sindyjoint.clock import Portion
from sindyjoint.diagnosis.evidence.policy import POLICY
from sindyjoint.diagnosis.evidence.score import Ranking
from sindyjoint.diagnosis.problem import P, Say
from sindyjoint.diagnosis.result import Gap, Step
from sindyjoint.diagnosis.verdict import grows

# Of the rivals of a step so many are reported, with more than this probability.
RIVALS, LEAST_RIVAL = 6, 1e-4


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
    if ranking is None or ranking.nothing > POLICY.chance:
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
    return Step(
        effect=best.name,
        family=best.family,
        members=tuple(f.name for f in ranking.members),
        probability=ranking.probabilities[0],
        rivals=tuple((f.name, p) for f, p in others if p > LEAST_RIVAL)[:RIVALS],
        parameters=best.parameters,
        terms_dropped=problem.dropped,
        gap_before=before,
        gap_after=after,
        units=problem.units(best),
    )
