"""The loop of a diagnosis: rank what may be missing, add the best, look again, until nothing more is there."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np

from sindyjoint.diagnosis.campaign.add import BELIEF, Added, add_effect
from sindyjoint.diagnosis.campaign.gap import gap_of
from sindyjoint.diagnosis.campaign.pairs import hidden_pair
from sindyjoint.diagnosis.campaign.ranking import FittedEffect, Problem, Ranking, fit_effects, rank
from sindyjoint.diagnosis.campaign.repair import Repaired
from sindyjoint.diagnosis.campaign.start import Work
from sindyjoint.diagnosis.effects.catalogue import Effect
from sindyjoint.diagnosis.result import Gap, Step

# An effect that helps the moment but makes the simulated response worse by this factor stands in for something else.
WORSE_RESPONSE = 1.5
LITTLE_HELP = 0.7
# An effect with which runs left out are missed by so much more is none.
WORSE_MOMENT = 2.0
# Where nothing repeats, an effect must win this share of a gap on what it never saw to be added.
LEAST_GAIN = 0.05
MOST_REFUSALS = 2


def add_effects(
    work: Work,
    candidates: Sequence[Effect],
    most: int,
    steps: list[Step],
    before: Gap,
    say: Callable[[str], None],
) -> tuple[Repaired, list[Step], Work]:
    """Add effects until the gap is noise, nothing explains it, or the count is reached."""
    found: list[FittedEffect] = []
    repaired = Repaired(work.model, ())
    steps = list(steps)
    refused: set[str] = set()
    # Where a pair was begun: the first of it may win nothing until the second is there.
    begun: tuple[Work, list[FittedEffect], Repaired, list[Step], Gap] | None = None
    while True:
        problem = Problem.build(work.rows, work.model, found)
        if len(steps) >= most:
            break
        open_ones = [e for e in candidates if e.id not in refused]
        ranking, paired = _ranked(work, problem, open_ones, found, say, len(steps) + 2 <= most)
        if ranking is None or 1 - ranking.nothing < BELIEF:
            break
        best = ranking.fitted[0]
        say(f"adding {best.effect.name}")
        added = add_effect(work, found, best, candidates)
        after = gap_of(added.work, added.repaired.model, added.effects)
        bursts = _bursts(before, after)
        if bursts and len(refused) >= MOST_REFUSALS:
            break
        if bursts or (not paired and _harms(before, after) and len(refused) < MOST_REFUSALS):
            refused.add(best.effect.id)
            continue
        if not paired and _idle(problem, before, after):
            break
        if begun is None and paired and not _repeats(problem):
            begun = work, found, repaired, steps, before
        elif begun is not None and _vain(begun[-1], after):
            break
        else:
            begun = None
        work, found, repaired = added.work, list(added.effects), added.repaired
        steps = _renamed(steps, added)
        steps.append(_step(ranking, found, repaired, before, after))
        before = after
    if begun is not None and _vain(begun[-1], before):
        work, found, repaired, steps, before = begun
    return replace(repaired, effects=tuple(found)), steps, work


def _harms(before: Gap, after: Gap) -> bool:
    """Return whether an effect wins little of the moment and loses much of the simulated response, or all of it."""
    kept = after.response <= WORSE_RESPONSE * before.response or np.isnan(before.response)
    return not kept and after.moment > LITTLE_HELP * before.moment


def _bursts(before: Gap, after: Gap) -> bool:
    """Return whether runs left out are missed by far more with an effect: it is determined by single runs only."""
    return after.moment > WORSE_MOMENT * before.moment and not after.response < before.response


def _repeats(problem: Problem) -> bool:
    """Return whether repetition has measured the noise of every row."""
    return all(run.folded for run in problem.runs)


def _idle(problem: Problem, before: Gap, after: Gap) -> bool:
    """Return whether an effect wins nothing on runs it never saw, where repetition has not measured the noise."""
    if _repeats(problem):
        return False
    pairs = zip(
        (after.moment, after.weighted, after.response),
        (before.moment, before.weighted, before.response),
        strict=True,
    )
    return not any(later < (1 - LEAST_GAIN) * earlier for later, earlier in pairs)


def _vain(before: Gap, after: Gap) -> bool:
    """Return whether two effects that were found as a pair win nothing together: what one gap wins another loses."""
    later, earlier = ([gap.moment, gap.weighted, gap.response] for gap in (after, before))
    won = np.nansum(np.log(np.maximum(later, 1e-300)) - np.log(np.maximum(earlier, 1e-300)))
    return not float(won) < np.log(1 - LEAST_GAIN)


def _ranked(
    work: Work,
    problem: Problem,
    candidates: Sequence[Effect],
    found: Sequence[FittedEffect],
    say: Callable[[str], None],
    pairs: bool,
) -> tuple[Ranking | None, bool]:
    """Return the candidates in order, and whether the first of them was put there by a second beside it."""
    taken = {each.effect.id for each in found}
    open_ones = [effect for effect in candidates if effect.id not in taken]
    say(f"trying {len(open_ones)} effects")
    fitted = fit_effects(problem, open_ones)
    if not fitted:
        return None, False
    pair = hidden_pair(problem, fitted) if pairs else None
    if pair is not None:
        first, second = pair
        say(f"trying them beside {second.effect.name}")
        both = Problem.build(work.rows, work.model, [*found, second])
        beside = rank(both, fit_effects(both, [f.effect for f in fitted if f is not second]))
        if beside.fitted[0].effect.id == first.effect.id:
            return beside, True
    return rank(problem, fitted), False


def _renamed(steps: Sequence[Step], added: Added) -> list[Step]:
    """Return earlier steps under the names that they have beside the effect just added; a dropped one goes."""
    later: list[Step] = []
    for step in steps:
        if step.effect not in added.again:
            later.append(step)
        elif (ranking := added.again[step.effect]) is not None:
            later.append(_step(ranking, added.effects, added.repaired, step.gap_before, step.gap_after))
    return later


def _step(
    ranking: Ranking, found: Sequence[FittedEffect], repaired: Repaired, before: Gap, after: Gap
) -> Step:
    best = ranking.fitted[0]
    now = next((f for f in found if f.effect.id == best.effect.id), best)
    others = [
        (f.effect.id, p)
        for f, p in zip(ranking.fitted[1:], ranking.probabilities[1:], strict=True)
        if p > 1e-4
    ]
    return Step(
        effect=best.effect.id,
        family=best.effect.family,
        members=tuple(f.effect.id for f in ranking.members()),
        probability=ranking.probabilities[0],
        rivals=tuple(others[:6]),
        parameters=now.parameters,
        terms_dropped=repaired.dropped,
        gap_before=before,
        gap_after=after,
        units=now.variant.units(repaired.model.joint.motion),
    )
