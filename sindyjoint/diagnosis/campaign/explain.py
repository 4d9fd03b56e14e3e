"""What a campaign's model lacks: the set of effects with the best predictive score, its classes and probabilities."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from sindyjoint.diagnosis.campaign.add import aligned, fitted_together
from sindyjoint.diagnosis.campaign.joint_zero import CONSTANT
from sindyjoint.diagnosis.campaign.measure import CampaignEvidence
from sindyjoint.diagnosis.campaign.numbers.own_zero import with_zero_fitted
from sindyjoint.diagnosis.campaign.other_starts import with_delay
from sindyjoint.diagnosis.campaign.repair import keeping, refit
from sindyjoint.diagnosis.campaign.start import Work, is_free
from sindyjoint.diagnosis.effects.catalogue import Effect
from sindyjoint.diagnosis.effects.fitted import FittedEffect
from sindyjoint.diagnosis.loop import Progress, step_of, with_gaps_renewed
from sindyjoint.diagnosis.problem import Say
from sindyjoint.diagnosis.ranking import Ranking
from sindyjoint.evidence.search import Candidate, Chosen, Search, deviate

# The problem of a campaign is made of this module's functions: its class, which imports them, cannot be named here.
Problem = Any

# States are made again where a channel is put right, and the search with them.
ROUNDS = 3


@dataclass(frozen=True)
class Searched:
    """Held-out χ² of the model alone and with the effects found, of so many rows, and the cost of the set, nats."""

    before: float
    after: float
    rows: int
    cost: float


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
    least : float
        What a member must win, nats.
    total : float
        The score, nats.
    """

    work: Work
    shifts: list[FittedEffect]
    effects: list[FittedEffect]
    rankings: list[Ranking[FittedEffect]]
    misfit: tuple[float, float]
    least: float
    total: float
    rows: int

    def cost(self, rows: int) -> float:
        """Return the negative score and the price, nats, for so many rows.

        States that are made again with a delay have other moving samples: scores compare as means over the rows.
        """
        return self.least * len(self.rankings) - self.total * rows / self.rows


def find_effects(problem: Problem, most: int, say: Say) -> Found:
    """Return the best set of at most so many effects.

    A correction of a channel changes the states: they are made again with it, and searched again. Its column says what
    that would come to only where it is small; so searches without a delay, and from the channels aligned first, stand
    beside.
    """
    work, candidates = problem.work, problem.candidates
    delayed = None if is_free(work.campaign) else with_delay(problem)
    if delayed is None:
        plain = _round(work, candidates, most, say, [], [])
        if not plain.shifts:
            return plain
        ids = {each.name for each in plain.shifts}
        others = [each for each in candidates if each.id not in ids]
        found = [plain, _round(work, others, most, say, [], [])]
        return min(found, key=lambda each: each.cost(plain.rows))
    own, aligned_ = _in_common(work, delayed.problem.work)
    plain = _round(own, [each for each in candidates if each.enters != "time shift"], most, say, [], [])
    before, after = (_alone(each) for each in (own, aligned_))
    ranking = Ranking((delayed.delay,), (delayed.belief,), 1 - delayed.belief, (delayed.delay,))
    won = max(after[0] - before[0], 0.0)
    straight = _round(aligned_, candidates, most, say, [delayed.delay], [ranking], won, before[1])
    if straight.cost(plain.rows) < plain.cost(plain.rows):
        return replace(straight, work=delayed.problem.work)
    return replace(plain, work=work)


def _in_common(one: Work, other: Work) -> tuple[Work, Work]:
    """Return two works with those samples alone that move in both: scores compare over the same rows."""
    moving = [a.moving & b.moving for a, b in zip(one.states, other.states, strict=True)]
    return tuple(  # type: ignore[return-value]
        each.again(
            each.model,
            (),
            tuple(replace(s, moving=m) for s, m in zip(each.states, moving, strict=True)),
        )
        for each in (one, other)
    )


def _alone(work: Work) -> tuple[float, float, int]:
    """Return score and held-out χ² of the model alone, and its rows."""
    ev = CampaignEvidence(work.plain, work.model, ())
    score = ev.evidence.score(ev.base)
    return score.total, float(score.chi_square.sum()), ev.evidence.target.size


def _round(
    work: Work,
    candidates: Sequence[Effect],
    most: int,
    say: Say,
    shifts: list[FittedEffect],
    rankings: list[Ranking[FittedEffect]],
    won: float = 0.0,
    first: float | None = None,
    before: frozenset[str] = frozenset(),
    rounds: int = ROUNDS,
) -> Found:
    """Return the best set on some states, from which delays were removed before."""
    say("trying sets of effects")
    taken = {each.name for each in shifts}
    ev = CampaignEvidence(work.plain, work.model, [e for e in candidates if e.id not in taken])
    search = ev.search(won)
    none = search.chosen(())
    first = mean_square(none) if first is None else first
    best = simplest(search, search.run(most=most - len(shifts)))
    fitted = ev.fitted(best)
    ranked_here = [ranked(ev, search, best, member) for member in best.members]
    moved = [i for i, each in enumerate(fitted) if each.shifts]
    keep = [i for i, each in enumerate(fitted) if not each.shifts]
    others = [fitted[i] for i in keep]
    corrected = bool(moved) or any(each.effect.enters != "moment" for each in fitted)
    if not corrected or rounds == 1 or (best.names == before and not moved):
        return Found(
            work,
            shifts,
            others,
            [*rankings, *(ranked_here[i] for i in keep)],
            (first, mean_square(best)),
            search.limits[0],
            best.score.total,
            ev.evidence.target.size,
        )
    for i in moved:
        without = search.chosen([m for m in best.members if m is not best.members[i]])
        won += best.score.total - without.score.total
        work, shift = aligned(work, others, fitted[i])
        shifts, rankings = [*shifts, shift], [*rankings, ranked_here[i]]
    later = refit(work.plain, work.model, others, keeping(work.policy))
    work = work.again(later.model, later.effects)
    return _round(work, candidates, most, say, shifts, rankings, won, first, best.names, rounds - 1)


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
            simpler = min(fewer, key=lambda each: (cost(each.members[-1]), -each.score.total))
            return simplest(search, search.without_needless(simpler))
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
    rows = sum(run.white_size for run in problem.work.plain)
    found = find_effects(problem, most - len(begun.steps), say)
    cost = found.cost(rows) + found.least * len(begun.steps)
    problem = replace(problem, search=Searched(*found.misfit, found.rows, cost))
    if not found.rankings:
        return replace(begun, problem=problem)
    work, repaired = fitted_together(found.work, found.shifts, found.effects)
    problem = replace(problem, work=work, repaired=repaired)
    rankings = found.rankings
    if problem.zero:
        problem, needless = with_zero_fitted(problem)
        rankings = [each for each in rankings if not (needless and each.fitted[0].name == CONSTANT)]
    steps = [step_of(problem, ranking, begun.gap, problem.gap) for ranking in rankings]
    by_name = {each.fitted[0].name: each for each in rankings}
    later = with_gaps_renewed(steps, begun.gap, problem)
    return Progress(problem, problem.gap, (*begun.steps, *later), {**begun.rankings, **by_name})
