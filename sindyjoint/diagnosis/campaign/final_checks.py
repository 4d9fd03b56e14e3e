"""What a search looks at again at its end: zeros of the channels, a delay removed first, the members of a class."""

from __future__ import annotations

from collections.abc import Collection, Sequence
from dataclasses import replace
from typing import Any

from sindyjoint.diagnosis.campaign.add import add_effect
from sindyjoint.diagnosis.campaign.admissible import off_the_ends
from sindyjoint.diagnosis.campaign.candidates import fit_effects
from sindyjoint.diagnosis.campaign.gap import gap_of
from sindyjoint.diagnosis.campaign.joint_zero import CONSTANT, ZERO
from sindyjoint.diagnosis.campaign.regression import rank_effects
from sindyjoint.diagnosis.campaign.repair import Repaired, keeping, refit
from sindyjoint.diagnosis.campaign.start import Work
from sindyjoint.diagnosis.effects.fitted import FittedEffect
from sindyjoint.diagnosis.ranking import Ranking
from sindyjoint.diagnosis.result import Gap
from sindyjoint.discovery.delay import shifted
from sindyjoint.errors import SindyJointError

# The problem of a campaign is made of this module's functions: its class, which imports them, cannot be named here.
Problem = Any


def zero_errors(problem: Problem, refused: Collection[str]) -> Ranking[FittedEffect] | None:
    """Return the zero errors of the channels in order of probability; None where none is believed."""
    taken = {*refused, *(each.name for each in problem.found)}
    zeros = [e for e in problem.candidates if e.id in (CONSTANT, ZERO) and e.id not in taken]
    if not zeros:
        return None
    ranking = rank_effects(problem.regression, fit_effects(problem.regression, zeros))
    return ranking if 1 - ranking.nothing >= problem.policy.belief else None


def channel_error(problem: Problem, fitted: Sequence[FittedEffect]) -> Ranking[FittedEffect] | None:
    """Return an error of the channels beside the laws found, without the errors of their columns; None without one.

    Those are of laws, and hide what a channel does. Of a displacement counted from the joint's own zero the moment may
    have a zero error, too. A delay hardly shows in samples that move where hysteresis takes its place, but at every
    reversal of a prescribed motion: it is believed where the simulated response, far off without it, falls with it.
    """
    plain, policy = replace(problem.regression, inherited=0.0), problem.policy
    constant = [each for each in fitted if each.name == CONSTANT and problem.zero]
    if constant:
        return rank_effects(plain, constant)
    delay = [each for each in fitted if each.shifts]
    most = policy.response_floors * problem.noise_floor.response
    if not delay or not problem.found or not problem.gap.response > most:
        return None
    ranking = rank_effects(plain, delay)
    if 1 - ranking.nothing < policy.belief:
        return None
    try:
        if not _response_beside(problem, delay[0]) < problem.gap.response:
            return None
        # Without looking whether others are still needed: that is for when it is added.
        work, repaired, _ = add_effect(problem.work, problem.found, delay[0], ())
        beside = replace(problem, work=work, repaired=repaired).gap.response
    except SindyJointError:  # an inertia that is a term may become negative beside it: no law to simulate
        return None
    return ranking if beside <= policy.little_help * problem.gap.response else None


def _response_beside(problem: Problem, delay: FittedEffect) -> float:
    """Return the response gap with the channels moved by a delay as it was found, coefficients fitted anew."""
    others = [f for f in problem.found if not f.shifts]
    moved = tuple(shifted(s, delay.coefficients[0]) for s in problem.work.states)
    later = problem.work.again(problem.work.model, others, moved)
    fitted = refit(later.rows, later.model, others, keeping(problem.policy))
    repaired = replace(fitted, effects=(delay, *fitted.effects))
    beside = replace(problem, work=replace(later, model=fitted.model), repaired=repaired)
    return float(beside.gap.response)


def without_delay(work: Work, repaired: Repaired) -> tuple[Work, Repaired, str] | None:
    """Return work and law with the channels in their own time, and what the delay is called; None without one."""
    delay = next((f for f in repaired.effects if f.shifts), None)
    if delay is None:
        return None
    others = [f for f in repaired.effects if not f.shifts]
    back = tuple(shifted(s, -delay.coefficients[0]) for s in work.states)
    later = work.again(repaired.model, others, back)
    fitted = refit(later.rows, later.model, others, keeping(work.policy))
    return replace(later, model=fitted.model), fitted, delay.name


def ranked_again(problem: Problem, name: str, members: Collection[str]) -> Ranking[FittedEffect] | None:
    """Return the members of a class that one effect leads, ranked beside the others; None without any."""
    regression = problem.work.regression([f for f in problem.found if f.name != name and not f.shifts])
    fitted = fit_effects(regression, [each for each in problem.candidates if each.id in members])
    return off_the_ends(regression, rank_effects(regression, fitted)) if fitted else None


def gap_without(work: Work, found: Sequence[FittedEffect], names: Collection[str]) -> Gap:
    """Return the gap of the model without some of its effects, the others fitted anew."""
    kept = [f for f in found if f.name not in names]
    fitted = refit(work.rows, work.model, [f for f in kept if not f.shifts], work.policy)
    return gap_of(work, fitted.model, (*(f for f in kept if f.shifts), *fitted.effects))
