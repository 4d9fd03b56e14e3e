"""The loop of a diagnosis: rank what may be missing, accept or refuse the best, until a reason to stop."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from enum import Enum
from functools import partial
from typing import Any, Generic

import numpy as np

from sindyjoint.clock import Portion
from sindyjoint.diagnosis.falling import grows
from sindyjoint.diagnosis.inadmissible import Inadmissible, before_doubt
from sindyjoint.diagnosis.policy import DiagnosisPolicy
from sindyjoint.diagnosis.problem import Added, P, Proposal, Say
from sindyjoint.diagnosis.ranking import Ranking, admissible_part
from sindyjoint.diagnosis.result import Gap, Step

# Of the rivals of a step so many are reported, with more than this probability.
RIVALS, LEAST_RIVAL = 6, 1e-4


@dataclass(frozen=True, eq=False)
class Progress(Generic[P]):
    """How far the loop has come.

    Parameters
    ----------
    problem : Problem
        With the effects of all steps.
    gap : Gap
        From which the next effect must lead down.
    steps : tuple of Step
    rankings : mapping of str to Ranking
        By the effects named in the steps.
    doubt : Inadmissible, optional
        What would explain more than the steps do, and ended the search.
    """

    problem: P
    gap: Gap
    steps: tuple[Step, ...] = ()
    rankings: Mapping[str, Ranking[Any]] = field(default_factory=dict)
    doubt: Inadmissible | None = None


class Outcome(Enum):
    """What a round of the loop comes to."""

    ACCEPT = "accept"
    REFUSE = "refuse"
    STOP = "stop"


@dataclass(frozen=True, eq=False)
class Round(Generic[P]):
    """One round of the loop.

    Parameters
    ----------
    outcome : Outcome
    reason : str
    effect : str
        The one that was tried, if any.
    progress : Progress, optional
        Of an effect that was accepted.
    paired : bool
        Whether it was proposed because of a second one beside it.
    doubts : tuple of Inadmissible
        Candidates that explain more than any that physics admits.
    """

    outcome: Outcome
    reason: str
    effect: str = ""
    progress: Progress[P] | None = None
    paired: bool = False
    doubts: tuple[Inadmissible, ...] = ()


def add_effects(start: Progress[P], most: int, say: Say, search: Portion | None = None) -> Progress[P]:
    """Add effects until the gap is noise, nothing explains it, the count is reached, or the portion is used up.

    A round that does not end adds nothing: its best candidate may be one of those that it has not tried.
    """
    here, refused, been = start, frozenset[str](), [start]
    # Where a pair was begun: the first of it may win nothing until the second is there.
    begun: Progress[P] | None = None
    doubts: list[tuple[int, Inadmissible]] = []
    while True:
        one_round = partial(try_effect, here, refused, most, say)
        tried = one_round() if search is None else search.do(one_round, None, "further effects")
        if tried is None:
            say("stopping: what the search may cost is used up")
            break
        doubts += ((len(been) - 1, each) for each in tried.doubts)
        if tried.outcome is Outcome.REFUSE:
            say(f"refusing {tried.effect.replace('_', ' ')}: {tried.reason}")
            refused |= {tried.effect}
            continue
        if tried.outcome is Outcome.STOP or tried.progress is None:
            say(f"stopping: {tried.reason}")
            break
        later = tried.progress
        if begun is None:
            begun = here if tried.paired and not here.problem.noise_measured else None
        elif no_joint_gain(begun.gap, later.gap, here.problem.policy):
            say("stopping: the pair wins nothing together")
            break
        else:
            begun = None
        here = later
        been.append(here)
    kept = without_begun_pair(here, begun)
    last = without_idle_end(_response_kept(_gap_kept(been[: been.index(kept) + 1])))
    end, doubt = before_doubt(been[: been.index(last) + 1], doubts, start.problem.policy)
    if doubt is not None:
        say(f"in doubt: {doubt.words}")
    return replace(been[end], doubt=doubt)


def without_idle_end(been: Sequence[Progress[P]]) -> Progress[P]:
    """Return the last progress less the effects at its end that hardly help, where a remainder is left in any case.

    Beside what nothing explains such an effect stands in for a part of it.
    """
    *earlier, here = been
    policy = here.problem.policy
    if not earlier or not here.gap.moment > policy.within_floors * here.problem.floor().moment:
        return here
    pairs = zip(_figures(here.gap)[::2], _figures(earlier[-1].gap)[::2], strict=True)
    if any(not later > (1 - policy.least_help) * before for later, before in pairs if np.isfinite(before)):
        return here
    return without_idle_end(earlier)


def _gap_kept(been: Sequence[Progress[P]]) -> Sequence[Progress[P]]:
    """Return the way up to the last progress whose gap is no larger than that of the model as it was given."""
    start, here = been[0], been[-1]
    given = start.steps[0].gap_before if start.steps else start.gap
    return _gap_kept(been[:-1]) if len(been) > 1 and grows(given, here.gap) else been


def _response_kept(been: Sequence[Progress[P]]) -> Sequence[Progress[P]]:
    """Return the way up to the last progress whose response is no worse than at the start, where a remainder is left.

    What leaves much of the moment and simulates the joint worse than no effect does is not its law.
    """
    start, here = been[0], been[-1]
    most, floor = here.problem.policy.within_floors, here.problem.floor()
    remains = here.gap.moment > most * floor.moment
    if not remains or not here.gap.response > max(start.gap.response, np.nan_to_num(most * floor.response)):
        return been
    return _response_kept(been[:-1])


def without_begun_pair(here: Progress[P], begun: Progress[P] | None) -> Progress[P]:
    """Return where a pair was begun whose first effect wins nothing and whose second was never accepted."""
    if begun is not None and no_joint_gain(begun.gap, here.gap, here.problem.policy):
        return begun
    return here


def try_effect(here: Progress[P], refused: frozenset[str], most: int, say: Say) -> Round[P]:
    """Propose, add and judge one effect."""
    problem, policy = here.problem, here.problem.policy
    if len(here.steps) >= most:
        return Round(Outcome.STOP, f"{most} effects are enough")
    if here.steps and problem.is_noise:
        return Round(Outcome.STOP, "the residual is noise")
    proposal = problem.propose(refused, len(here.steps) + 2 <= most, say)
    if proposal is None or 1 - proposal.ranking.nothing < policy.belief:
        doubts = () if proposal is None else proposal.doubts
        return Round(Outcome.STOP, "nothing is believed to be missing", doubts=doubts)
    judged = _judge_proposal(here, proposal, refused, say)
    return replace(judged, doubts=(*proposal.doubts, *judged.doubts))


def _judge_proposal(here: Progress[P], proposal: Proposal, refused: frozenset[str], say: Say) -> Round[P]:
    """Add and judge the best of the candidates that physics admits."""
    problem, policy = here.problem, here.problem.policy
    ranking, complaint = admissible_part(proposal.ranking, problem.complaint)
    first = proposal.ranking.fitted[0]
    doubts = () if ranking is not None else (Inadmissible(first.name, complaint, here.gap),)
    if ranking is None:
        # Whatever the law is: that a sensor's zero is off can be seen, and may be what spoils the best candidate.
        ranking = problem.zero_errors(refused)
    if ranking is None:
        words = f"no admissible effect comes near the best candidate: {complaint}"
        return Round(Outcome.STOP, words, doubts=doubts)
    best = ranking.fitted[0]
    say(f"adding {best.name.replace('_', ' ')}")
    added = problem.add(best)
    may_refuse = len(refused) < policy.most_refusals
    refuse_or_stop = Outcome.REFUSE if may_refuse else Outcome.STOP
    if added is None:
        return Round(refuse_or_stop, "its fit fails", best.name)
    complaint = added.problem.complaint()
    if complaint and not problem.complaint():
        doubt = Inadmissible(best.name, complaint, here.gap, added.problem.gap)
        return Round(refuse_or_stop, complaint, best.name, doubts=(doubt,))
    after = added.problem.gap
    if overfits(here.gap, after, policy):
        return Round(refuse_or_stop, "runs left out are missed by far more with it", best.name)
    if not proposal.paired:
        if may_refuse and degrades_response(here.gap, after, policy):
            return Round(Outcome.REFUSE, "it makes the simulated response worse", best.name)
        if not problem.noise_measured and no_gain(here.gap, after, policy):
            return Round(Outcome.STOP, "it wins nothing on what was left out of the fit", best.name)
    later = _accepted(here, ranking, added, after)
    return Round(Outcome.ACCEPT, "the gap falls with it", best.name, later, proposal.paired)


def degrades_response(before: Gap, after: Gap, policy: DiagnosisPolicy) -> bool:
    """Return whether an effect wins little of the moment and loses much of the simulated response, or all of it."""
    kept = after.response <= policy.worse_response * before.response or np.isnan(before.response)
    return not kept and after.moment > policy.little_help * before.moment


def overfits(before: Gap, after: Gap, policy: DiagnosisPolicy) -> bool:
    """Return whether runs left out are missed by far more with an effect: it is determined by single runs only."""
    return after.moment > policy.worse_moment * before.moment and not after.response < before.response


def no_gain(before: Gap, after: Gap, policy: DiagnosisPolicy) -> bool:
    """Return whether no gap falls on what was left out of the fit."""
    pairs = zip(_figures(after), _figures(before), strict=True)
    return not any(later < (1 - policy.least_gain) * earlier for later, earlier in pairs)


def no_joint_gain(before: Gap, after: Gap, policy: DiagnosisPolicy) -> bool:
    """Return whether two effects that were found as a pair win nothing together: what one gap wins another loses."""
    later, earlier = (np.log(np.maximum(_figures(gap), 1e-300)) for gap in (after, before))
    return not float(np.nansum(later - earlier)) < np.log(1 - policy.least_gain)


def _figures(gap: Gap) -> tuple[float, float, float]:
    return gap.moment, gap.weighted, gap.response


def _accepted(here: Progress[P], ranking: Ranking[Any], added: Added[P], after: Gap) -> Progress[P]:
    """Return the progress with a step more; earlier ones under the names that they have beside it, or gone."""
    problem, rankings = added.problem, dict(here.rankings)
    # What made another effect needless was ranked again, in its place.
    ranking = added.again.get(ranking.fitted[0].name) or ranking
    steps = []
    # A term that discovery found is a step, too: needless beside what was added, or the same law with free numbers.
    gone = {*problem.dropped, ranking.fitted[0].name} - {f.name for f in here.problem.found}
    for step in here.steps:
        if step.effect in gone:
            continue
        again = added.again.get(step.effect)
        if step.effect not in added.again:
            steps.append(step)
        elif again is not None:
            del rankings[step.effect]
            steps.append(_step(problem, again, step.gap_before, step.gap_after))
            rankings[steps[-1].effect] = again
    steps.append(_step(problem, ranking, here.gap, after))
    rankings[steps[-1].effect] = ranking
    now = problem.parameters
    ends = [here.steps[0].gap_before if here.steps else here.gap, *(s.gap_after for s in steps)]
    renewed = tuple(
        replace(s, parameters=now.get(s.effect, s.parameters), gap_before=before)
        for s, before in zip(steps, ends, strict=False)
    )
    return Progress(problem, after, renewed, rankings)


def other_members(here: Progress[P]) -> Iterator[tuple[int, Any, P]]:
    """Yield the places of steps, another member of the class of each, and the problem with that in its place.

    What makes another step needless explains more than the one in whose place it would stand, and is no such member.
    """
    named = {step.effect for step in here.steps}
    for place, step in enumerate(here.steps):
        ranking = here.rankings.get(step.effect)
        for member in ranking.members if ranking else ():
            if member.name in named or here.problem.complaint(member):
                continue
            problem = here.problem.replaced(step.effect, member)
            if problem is not None and not problem.complaint() and not named & set(problem.dropped):
                yield place, member, problem


def led_by(here: Progress[P], place: int, member: Any, problem: P) -> Progress[P]:
    """Return the progress with another member of its class at the place of a step; later gaps are computed again."""
    step = here.steps[place]
    ranking = here.rankings[step.effect]
    order = sorted(range(len(ranking.fitted)), key=lambda i: ranking.fitted[i].name != member.name)
    led = replace(
        ranking,
        fitted=tuple(ranking.fitted[i] for i in order),
        probabilities=tuple(ranking.probabilities[i] for i in order),
        members=tuple(sorted(ranking.members, key=lambda each: each.name != member.name)),
    )
    # Its class was ranked beside a law that lacked what was found later: beside all of it the data may show more.
    again = problem.ranked_again(member.name, [each.name for each in ranking.members])
    led = led if again is None or again.fitted[0].name != member.name else again
    later = [_step(problem, led, step.gap_before, problem.gap), *here.steps[place + 1 :]]
    steps = (*here.steps[:place], *_with_gaps_renewed(later, step.gap_before, problem))
    rankings = {name: each for name, each in here.rankings.items() if name != step.effect}
    return replace(
        here, problem=problem, gap=problem.gap, steps=steps, rankings={**rankings, member.name: led}
    )


def without_needless_delay(here: Progress[P]) -> Progress[P]:
    """Return the progress without the delay of a channel that was removed first, where the law found needs none."""
    found = here.problem.without_delay()
    if found is None:
        return here
    problem, name = found
    policy = here.problem.policy
    if cost_of(problem.gap, problem, policy) > cost_of(here.gap, here.problem, policy) + policy.number_cost:
        return here
    place = next((i for i, step in enumerate(here.steps) if step.effect == name), len(here.steps))
    later = _with_gaps_renewed(
        here.steps[place + 1 :],
        here.steps[place].gap_before if place < len(here.steps) else here.gap,
        problem,
    )
    return replace(here, problem=problem, gap=problem.gap, steps=(*here.steps[:place], *later))


def cost_of(gap: Gap, problem: P, policy: DiagnosisPolicy) -> float:
    """Return the mean logarithm of a final gap, and what each number of the law costs."""
    figures = np.array([gap.moment, gap.response])
    known = figures[np.isfinite(figures)]
    misfit = float(np.mean(np.log(np.maximum(known, 1e-300))))
    return misfit + policy.number_cost * problem.numbers


def _with_gaps_renewed(steps: Sequence[Step], before: Gap, problem: P) -> list[Step]:
    """Return the last steps of a problem with the gaps that it has without those after each."""
    now, later = problem.parameters, list[Step]()
    for place, step in enumerate(steps, 1):
        after = problem.gap_without([s.effect for s in steps[place:]])
        numbers = now.get(step.effect, step.parameters)
        later.append(replace(step, parameters=numbers, gap_before=before, gap_after=after))
        before = after
    return later


def _step(problem: P, ranking: Ranking[Any], before: Gap, after: Gap) -> Step:
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
