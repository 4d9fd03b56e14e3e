"""How far a search has come; and the greedy search of a structure, where each candidate costs simulations."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any, Generic

from sindyjoint.clock import Portion
from sindyjoint.diagnosis.falling import grows
from sindyjoint.diagnosis.problem import Added, P, Say
from sindyjoint.diagnosis.ranking import Ranking
from sindyjoint.diagnosis.result import Gap, Step

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

    A round that does not end adds nothing: its best candidate may be one of those that it has not tried. What is
    returned has a gap no larger than that of the model as it was given.
    """
    been, refused = [start], frozenset[str]()
    while len(been[-1].steps) < most and not (been[-1].steps and been[-1].problem.is_noise):

        def one_round(here: Progress[P] = been[-1], refused: frozenset[str] = refused) -> Progress[P] | str:
            return _try_effect(here, refused, say)

        tried = search.do(one_round, None, "further effects")
        if isinstance(tried, Progress):
            been.append(tried)
        elif tried and len(refused) < start.problem.policy.most_refusals:
            refused |= {tried}
        else:
            say(
                "stopping: what the search may cost is used up"
                if tried is None
                else "stopping: nothing is likely"
            )
            break
    given = start.steps[0].gap_before if start.steps else start.gap
    return next(here for here in reversed(been) if here is start or not grows(given, here.gap))


def _try_effect(here: Progress[P], refused: frozenset[str], say: Say) -> Progress[P] | str:
    """Return the progress with the likeliest effect, or the id of one whose fit fails; empty where none is likely."""
    ranking = here.problem.propose(refused, say)
    if ranking is None or 1 - ranking.nothing < here.problem.policy.belief:
        return ""
    best = ranking.fitted[0]
    say(f"adding {best.name.replace('_', ' ')}")
    added = here.problem.add(best)
    return best.name if added is None else _accepted(here, ranking, added)


def _accepted(here: Progress[P], ranking: Ranking[Any], added: Added[P]) -> Progress[P]:
    """Return the progress with a step more, without those that it makes needless."""
    problem, after = added.problem, added.problem.gap
    kept = [step for step in here.steps if step.effect not in added.needless]
    steps = [*kept, step_of(problem, ranking, here.gap, after)]
    rankings = {step.effect: here.rankings[step.effect] for step in kept}
    rankings[steps[-1].effect] = ranking
    now = problem.parameters
    ends = [here.steps[0].gap_before if here.steps else here.gap, *(s.gap_after for s in steps)]
    renewed = tuple(
        replace(s, parameters=now.get(s.effect, s.parameters), gap_before=before)
        for s, before in zip(steps, ends, strict=False)
    )
    return Progress(problem, after, renewed, rankings)


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
