"""What a campaign's model lacks: the set of effects with the best predictive score, its classes and probabilities."""

from collections.abc import Collection, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import scipy

from sindyjoint.diagnosis.campaign.gap_rows import gap_runs
from sindyjoint.diagnosis.campaign.measure import CampaignEvidence, score_of
from sindyjoint.diagnosis.campaign.numbers import is_element
from sindyjoint.diagnosis.campaign.other_starts import CONSTANT, with_delay, with_zero_fitted
from sindyjoint.diagnosis.campaign.refined import one_by_response, told_by_response
from sindyjoint.diagnosis.campaign.regression import GapRegression
from sindyjoint.diagnosis.campaign.repair import Repaired, refit, refit_nonlinear
from sindyjoint.diagnosis.campaign.start import Work
from sindyjoint.diagnosis.effects import Effect
from sindyjoint.diagnosis.effects.fitted import Corrections, FittedEffect
from sindyjoint.diagnosis.evidence import Ranking, Score
from sindyjoint.diagnosis.evidence.search import Candidate, Chosen, Search, deviate
from sindyjoint.diagnosis.problem import Progress, Say, step_of, with_gaps_renewed
from sindyjoint.discovery.delay import shifted
from sindyjoint.equation.model import JointModel
from sindyjoint.limits import DISCOVERY
from sindyjoint.numeric import Array

LONGEST = DISCOVERY.longest_delay  # that the linear steps may reach
# Nats by which rows may prefer a foreign form of hysteresis: 158 were seen under sweeps, 41 where runs repeat.
FAVOURED = 170.0


def fitted_together(
    work: Work, shifts: list[FittedEffect], others: list[FittedEffect]
) -> tuple[Work, Repaired]:
    """Return the model with delays, which are removed from the states of ``work``, and effects, all fitted together."""
    work, shifts, others = _settled(work, shifts, others)
    folded = all(run.folded for run in work.rows)
    # Under weights of the model before, whose error the effect was, its terms do not stand out of their errors.
    repaired = refit(work.rows, work.model, others, drops=folded and bool(others))
    work = work.again(repaired.model, repaired.effects)
    if not folded:
        # The rows are weighted anew by the residual, and with them the nonlinear parameters.
        effects = refit_nonlinear(work.rows, repaired.model, repaired.effects, work.policy)
        repaired = refit(work.rows, repaired.model, effects)
    work, repaired = counted_from_zero(work, repaired)
    work = replace(work, model=repaired.model)
    return work, replace(repaired, effects=(*shifts, *repaired.effects))


def counted_from_zero(work: Work, repaired: Repaired) -> tuple[Work, Repaired]:
    """Correct what one linear step missed of a zero error of the angle or its drift: the secant is of the law found.

    Errors that do not settle are those of a law that lacks something else, and stay as they are.
    """
    later, fitted = work, repaired
    for _ in range(12):
        before = _angle_errors(fitted)
        if not before.any():
            break
        later = later.again(fitted.model, fitted.effects)
        fitted = refit(later.rows, later.model, fitted.effects, drops=False)
        # A zero error or a drift that changes by less of itself has settled.
        if np.all(np.abs(_angle_errors(fitted) - before) <= 1e-4 * np.abs(before)):
            return later, fitted
    return work, repaired


def _angle_errors(repaired: Repaired) -> Array:
    found = Corrections.of(repaired.effects)
    return np.array([found.zero, found.drift])


def aligned(work: Work, others: list[FittedEffect], delay: FittedEffect) -> tuple[Work, FittedEffect]:
    """Shift the states by the delay found, and correct what the linear estimate missed."""
    total, policy, gain = 0.0, work.policy, delay.gain
    states = work.states
    for _ in range(4):
        total = float(np.clip(total + delay.coefficients[0], -LONGEST, LONGEST))
        states = tuple(shifted(s, total) for s in work.states)
        rows = gap_runs(states, work.model, work.groups, policy)
        model: JointModel = refit(rows, work.model, others).model
        rows = gap_runs(states, model, work.groups, policy)
        more, coefficients = GapRegression.build(rows, model, others, policy).gain(
            delay.variant, delay.values
        )
        delay = replace(delay, coefficients=coefficients)
        if more < 1.0:
            break
    delay = replace(delay, coefficients=np.array([total]), gain=gain)
    return work.again(work.model, others, states), delay


def _settled(
    work: Work, shifts: list[FittedEffect], others: list[FittedEffect]
) -> tuple[Work, list[FittedEffect], list[FittedEffect]]:
    """Correct delays and the nonlinear parameters beside them in turn: neither is right while the other is not."""
    # Delays and nonlinear parameters in turn; the third turn changes neither by its error.
    for _ in range(4):
        before = work
        for index, delay in enumerate(shifts):
            work, shifts[index] = _realigned(work, others, delay)
        if work is before or not any(each.values.size for each in others):
            break
        others = refit_nonlinear(work.rows, work.model, others, work.policy)
    return work, shifts, others


def _realigned(work: Work, others: list[FittedEffect], delay: FittedEffect) -> tuple[Work, FittedEffect]:
    """Correct a delay that was removed while an effect was missing beside it, where that leaves less of the moment."""
    before = GapRegression.build(work.plain, work.model, others, work.policy)
    gain, coefficients = before.gain(delay.variant, delay.values)
    if gain < work.policy.likely**2:
        return work, delay
    later, more = aligned(work, others, replace(delay, coefficients=coefficients))
    after = GapRegression.build(later.plain, later.model, others, work.policy)
    if after.chi_square / after.target.size > before.chi_square / before.target.size:
        return work, delay
    return later, replace(delay, coefficients=delay.coefficients + more.coefficients)


Problem = Any  # the class of a campaign's problem, which imports this module


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


@dataclass(frozen=True, eq=False)
class Begun:
    """Where a search begins.

    Parameters
    ----------
    work : Work
    candidates : sequence of Effect
    given : sequence of FittedEffect
        Effects that are there in any case.
    shifts : tuple of FittedEffect
        Delays that were removed from the states, with their ``rankings``.
    won : float
        What they won, nats.
    before : float, optional
        Held-out χ² of the model alone, without them.
    names : frozenset of str
        What was found on the states before these.
    """

    work: Work
    candidates: Sequence[Effect]
    given: Sequence[FittedEffect]
    shifts: tuple[FittedEffect, ...] = ()
    rankings: tuple[Ranking[FittedEffect], ...] = ()
    won: float = 0.0
    before: float | None = None
    names: frozenset[str] = frozenset()

    def without(self, ids: Collection[str]) -> "Begun":
        """Return this less some candidates."""
        return replace(self, candidates=[each for each in self.candidates if each.id not in ids])

    def alone(self) -> Score:
        """Return the score of the model with what is there in any case."""
        return score_of(self.work.plain, self.work.model, self.given)


def find_effects(problem: Problem, most: int, say: Say) -> Found:
    """Return the best set of at most so many effects.

    A correction of a channel changes the states: they are made again with it, and searched again. Its column says what
    that would come to only where it is small; so searches without a delay, and from the channels aligned first, stand
    beside.
    """
    given = [each for each in problem.found if not each.shifts]
    known = {*(each.name for each in problem.found), *problem.work.model.ids}
    begun = Begun(problem.work, problem.candidates, given).without(known)
    settled = problem.work.campaign.moves_freely or len(given) < len(problem.found)
    delayed = None if settled else with_delay(problem)
    own, straight = (begun.work,) * 2 if delayed is None else _in_common(begun.work, delayed[0])
    plain = _found(replace(begun, work=own), most, say)
    found = [plain]
    if plain.shifts:
        found.append(
            _found(replace(begun, work=own).without([each.name for each in plain.shifts]), most, say)
        )
    if delayed is not None:
        before, ranking = replace(begun, work=own).alone(), delayed[1]
        aligned_ = replace(
            begun.without([each.name for each in ranking.fitted]),
            work=straight,
            shifts=ranking.fitted,
            rankings=(ranking,),
            before=float(before.chi_square.sum()),
        )
        aligned_ = replace(aligned_, won=max(aligned_.alone().total - before.total, 0.0))
        found.append(_found(aligned_, most, say))
    best = min(found, key=lambda each: each.cost(plain.rows))
    if delayed is not None and best is found[-1]:
        return replace(best, work=delayed[0])
    return best if best.shifts else replace(best, work=problem.work)


def _in_common(one: Work, other: Work) -> tuple[Work, Work]:
    """Return two works with those samples alone that move in both: scores compare over the same rows."""
    moving = [a.moving & b.moving for a, b in zip(one.states, other.states, strict=True)]

    def masked(work: Work) -> Work:
        states = [replace(s, moving=m) for s, m in zip(work.states, moving, strict=True)]
        return work.again(work.model, (), tuple(states))

    return masked(one), masked(other)


# States are made again where a channel is put right, and the search with them.
def _found(begun: Begun, most: int, say: Say, rounds: int = 3) -> Found:
    """Return the best set on some states; where it corrects a channel, on the states that are made again with that."""
    say("trying sets of effects")
    work = begun.work
    ev = CampaignEvidence(work.plain, work.model, begun.candidates, begun.given, work.policy.sticking_share)
    search = ev.search(begun.won)
    before = float(search.chosen(()).score.chi_square.sum()) if begun.before is None else begun.before
    best = simplest(search, search.run(most=most - len(begun.shifts)))
    fitted = ev.fitted(best)
    rankings = [ranked(ev, search, best, member) for member in best.members]
    moved = [i for i, each in enumerate(fitted) if each.shifts]
    others = [each for each in fitted if not each.shifts]
    corrected = bool(moved) or any(each.effect.enters != "moment" for each in fitted)
    # What smoothing takes off the corners is known once the law is.
    corrected |= any(not run.folded and run.half_cycles is None for run in work.plain)
    if not corrected or rounds == 1 or (best.names == begun.names and not moved):
        return Found(
            work,
            [*begun.shifts],
            others,
            [*begun.rankings, *(r for r, each in zip(rankings, fitted, strict=True) if not each.shifts)],
            (before, float(best.score.chi_square.sum())),
            search.limits[0],
            best.score.total,
            ev.evidence.target.size,
        )
    won, shifts = begun.won, [*begun.shifts]
    for i in moved:
        without = search.chosen([m for m in best.members if m is not best.members[i]])
        won += best.score.total - without.score.total
        work, shift = aligned(work, [*begun.given, *others], fitted[i])
        shifts.append(shift)
    later = refit(work.plain, work.model, [*begun.given, *others], drops=False)
    again = replace(
        begun.without([shift.name for shift in shifts]),
        work=work.again(later.model, later.effects),
        shifts=tuple(shifts),
        rankings=(*begun.rankings, *(rankings[i] for i in moved)),
        won=won,
        before=before,
        names=best.names,
    )
    return _found(again, most, say, rounds - 1)


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
    near = [each.score.total > best.score.total - FAVOURED for each in sets]
    whole = odds.sum() + nothing
    return Ranking(
        fitted=tuple(fitted),
        probabilities=tuple((odds / whole).tolist()),
        nothing=float(nothing / whole),
        members=tuple(f for f, a in zip(fitted, alike, strict=True) if a),
        near=tuple(f for f, n in zip(fitted, near, strict=True) if n and is_element(f)),
    )


def odds_of(best: Chosen, other: Chosen) -> float:
    """Return the odds of a set beside the best one."""
    rises = best.score.by_group - other.score.by_group
    return float(max(np.exp(-max(rises.sum(), 0.0)), 2 * scipy.special.ndtr(-max(deviate(rises), 0.0))))


def _needless(work: Work, repaired: Repaired, found: Found) -> frozenset[str]:
    """Return which of several effects do not win, at the numbers that all have together, what they must."""
    names, gone = [each.name for each in found.effects], frozenset[str]()
    adding = [each for each in repaired.effects if not each.shifts]
    whole = score_of(work.plain, repaired.model, adding)
    while len(names) - len(gone) > 1:
        without = {}
        for name in (n for n in names if n not in gone):
            others = [e for e in adding if e.name != name and e.name not in gone]
            others = refit_nonlinear(work.plain, repaired.model, others, work.policy)
            without[name] = score_of(work.plain, repaired.model, others)
        name = max(without, key=lambda each: without[each].total)
        if whole.total - without[name].total > found.least * max(whole.excess, 1.0):
            break
        gone, whole = gone | {name}, without[name]
    return gone


def with_found(begun: Progress[Any], most: int, say: Say) -> Progress[Any]:
    """Return the progress with the best set of effects that the data show, fitted together, as steps."""
    problem = begun.problem
    found: Found = one_by_response(problem, find_effects(problem, most - len(begun.steps), say), say)
    cost = found.cost(problem.rows) + found.least * len(begun.steps)
    problem = replace(problem, search=Searched(*found.misfit, found.rows, cost))
    if not found.rankings:
        return replace(begun, problem=problem)
    moved, given = ([e for e in problem.found if e.shifts is kind] for kind in (True, False))
    found = told_by_response(found, given, say)
    work, repaired = fitted_together(found.work, [*moved, *found.shifts], [*given, *found.effects])
    idle = _needless(work, repaired, found)
    if idle:
        effects = [e for e in found.effects if e.name not in idle]
        work, repaired = fitted_together(found.work, [*moved, *found.shifts], [*given, *effects])
    problem = replace(problem, work=work, repaired=repaired)
    rankings = [each for each in found.rankings if each.fitted[0].name not in idle]
    if problem.zero:
        problem, needless = with_zero_fitted(problem)
        rankings = [each for each in rankings if not (needless and each.fitted[0].name == CONSTANT)]
    now = problem.parameters
    kept = [
        replace(step, parameters=now.get(step.effect, step.parameters))
        for step in begun.steps
        if step.effect not in problem.dropped
    ]
    steps = [step_of(problem, ranking, begun.gap, problem.gap) for ranking in rankings]
    by_name = {each.fitted[0].name: each for each in rankings}
    later = with_gaps_renewed(steps, begun.gap, problem)
    return Progress(problem, problem.gap, (*kept, *later), {**begun.rankings, **by_name})
