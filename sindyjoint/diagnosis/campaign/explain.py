"""What a campaign's model lacks: the set of effects with the best predictive score, its classes and probabilities."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from sindyjoint.diagnosis.campaign.add import aligned, fitted_together
from sindyjoint.diagnosis.campaign.measure import CampaignEvidence
from sindyjoint.diagnosis.campaign.repair import keeping, refit
from sindyjoint.diagnosis.campaign.start import Work
from sindyjoint.diagnosis.effects.fitted import FittedEffect
from sindyjoint.diagnosis.loop import Progress, _with_gaps_renewed, _step
from sindyjoint.diagnosis.problem import Say
from sindyjoint.diagnosis.ranking import Ranking
from sindyjoint.equation.model import JointModel
from sindyjoint.evidence.search import Candidate, Chosen, Search, deviate
from sindyjoint.numeric import Array

# The problem of a campaign is made of this module's functions: its class, which imports them, cannot be named here.
Problem = Any

# States are made again where a channel is put right, and the search with them.
ROUNDS = 3


@dataclass(frozen=True, eq=False)
class Found:
    """What a search came to.

    Parameters
    ----------
    work : Work
        Its states, delays removed.
    shifts, effects : list of FittedEffect
    rankings : list of Ranking
        Of both, in that order.
    misfit : (float, float)
        Held-out χ² per row of the model alone and with the effects, in units of what noise makes expected.
    cost : float
        The negative score, nats, and what each member must win at least.
    """

    work: Work
    shifts: list[FittedEffect]
    effects: list[FittedEffect]
    rankings: list[Ranking[FittedEffect]]
    misfit: tuple[float, float]
    cost: float
    rows: int


def find_effects(problem: Problem, most: int, say: Say) -> Found:
    """Return the best set of at most so many effects."""
    work, model = problem.work, problem.work.model
    shifts: list[FittedEffect] = []
    shift_rankings: list[Ranking[FittedEffect]] = []
    first = None
    before: frozenset[str] = frozenset()
    for _ in range(ROUNDS):
        say("trying sets of effects")
        taken = {each.name for each in shifts}
        ev = CampaignEvidence(work.plain, model, [e for e in problem.candidates if e.id not in taken])
        search = ev.search()
        none = search.chosen(())
        first = first if first is not None else mean_square(none)
        best = simplest(search, search.run(most=most - len(shifts)))
        fitted = ev.fitted(best)
        rankings = [ranked(ev, search, best, member) for member in best.members]
        moved = [i for i, each in enumerate(fitted) if each.shifts]
        again = bool(moved) or any(each.effect.enters != "moment" for each in fitted)
        if not again or (best.names == before and not moved):
            break
        before = best.names
        others = [each for each in fitted if not each.shifts]
        for i in moved:
            work, shift = aligned(work, others, fitted[i])
            shifts.append(shift)
            shift_rankings.append(rankings[i])
        later = refit(work.plain, model, others, keeping(work.policy))
        model = later.model
        work = work.again(model, later.effects)
    keep = [i for i, each in enumerate(fitted) if not each.shifts]
    return Found(
        work,
        shifts,
        [fitted[i] for i in keep],
        [*shift_rankings, *(rankings[i] for i in keep)],
        (first, mean_square(best)),
        search.limits[0] * len(best.members) - best.score.total,
        ev.evidence.target.size,
    )


def mean_square(found: Chosen) -> float:
    """Return held-out χ² per group-weighted row."""
    return float(found.score.chi_square.sum())


def cost(member: Candidate) -> tuple[int, bool]:
    """Return what makes one effect simpler than another: fewer numbers, and no correction of a channel."""
    return member.numbers, member.corrects


def simplest(search: Search, best: Chosen) -> Chosen:
    """Return a set in which each member gives its place to one with fewer numbers that the data cannot tell from it."""
    for member in best.members:
        fewer = [
            each
            for each in search.rivals(best, member)
            if cost(each.members[-1]) < cost(member) and search.alike(best, each)
        ]
        if fewer:
            return simplest(search, min(fewer, key=lambda each: (cost(each.members[-1]), -each.score.total)))
    return best


def ranked(ev: CampaignEvidence, search: Search, best: Chosen, member: Candidate) -> Ranking[FittedEffect]:
    """Return the effects that may stand in the place of a member, itself first, with their probabilities."""
    rivals = search.rivals(best, member)
    without = search.chosen([m for m in best.members if m is not member])
    own = Chosen((*without.members, member), best.score)
    sets = [own, *rivals]
    odds = np.array([odds_of(best, each) for each in sets])
    nothing = odds_of(best, without)
    fitted = [ev.fitted(each)[-1] for each in sets]
    alike = [True, *(search.alike(best, each) for each in rivals)]
    whole = odds.sum() + nothing
    return Ranking(
        fitted=tuple(fitted),
        probabilities=tuple((odds / whole).tolist()),
        nothing=float(nothing / whole),
        members=tuple(f for f, a in zip(fitted, alike, strict=True) if a),
    )


def odds_of(best: Chosen, other: Chosen) -> float:
    """Return the odds of a set beside the best one."""
    from scipy.special import ndtr

    rises = best.score.by_group - other.score.by_group
    return float(max(np.exp(-max(rises.sum(), 0.0)), 2 * ndtr(-max(deviate(rises), 0.0))))


def with_found(begun: Progress[Any], most: int, say: Say) -> Progress[Any]:
    """Return the progress with the best set of effects that the data show, fitted together, as steps."""
    problem = begun.problem
    found = find_effects(problem, most - len(begun.steps), say)
    problem = replace(problem, misfit=(*found.misfit, found.rows, found.cost + 10.0 * (problem.zero != 0.0)))
    if not found.rankings:
        return replace(begun, problem=problem)
    work, repaired = fitted_together(found.work, found.shifts, found.effects)
    problem = replace(problem, work=work, repaired=repaired)
    names = [ranking.fitted[0].name for ranking in found.rankings]
    last = problem.gap
    steps = [
        _step(problem, ranking, begun.gap, last) for ranking in found.rankings
    ]
    steps = _with_gaps_renewed(steps, begun.gap, problem)
    return Progress(
        problem, last, (*begun.steps, *steps), {**begun.rankings, **dict(zip(names, found.rankings, strict=True))}
    )
