"""The joint's own zero: where its kinks and its even and odd laws have their middle.

The five terms and a constant are closed under a shift of the displacement (Taylor); a clearance, a stop, or a damping
that grows with the angle are not. With a sensor's zero elsewhere they are described by several effects at the wrong
place. The zero is therefore searched at which one effect of angle and rate, beside terms and constant, explains most.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from sindyjoint.diagnosis.campaign.measure import CampaignEvidence
from sindyjoint.diagnosis.campaign.repair import Repaired, keeping, refit, rest_angle
from sindyjoint.diagnosis.campaign.rows.run import GapRun
from sindyjoint.diagnosis.campaign.start import Work, first_model
from sindyjoint.diagnosis.effects.catalogue import Effect
from sindyjoint.diagnosis.effects.fitted import FittedEffect
from sindyjoint.diagnosis.result import Step
from sindyjoint.states import ForceStates

# The problem of a campaign is made of this module's functions: its class, which imports them, cannot be named here.
Problem = Any

CONSTANT, ZERO = "constant_moment", "angle_offset"
# Zeros that are tried, as shares of the largest angle, about that of the terms and a constant; then half as far apart.
REACH, POINTS, HALVINGS = 0.16, 9, 6


def zero_start(straight: Problem, last: Problem) -> tuple[Problem, tuple[Step, ...]] | None:
    """Return the problem with its displacement counted from the joint's own zero, and that step.

    None where the search that ended in ``last`` found no zero error, or nothing beside one that has a middle.
    """
    zeros = [e for e in last.found if e.name in (CONSTANT, ZERO)]
    others = [e for e in last.found if e.family != "measurement"]
    constant = next((e for e in straight.candidates if e.id == CONSTANT), None)
    offset = next((e for e in straight.candidates if e.id == ZERO), None)
    centred = [e for e in straight.candidates if has_middle(e)]
    # An odd and an even law beside each other may be one law about another middle.
    centres = [e for e in last.found if e.name in {each.id for each in centred}]
    if not (zeros or len(centres) > 1) or constant is None or offset is None or not centred:
        return None
    if not others and last.gap.moment <= straight.policy.within_floors * last.noise_floor.moment:
        return None
    beside = [e for e in others if e.effect.enters == "moment" and e not in centres]
    middle, gain, least = _best_zero(last.work, beside, constant, centred)
    if not middle or gain < least:
        return None
    later = counted_from(straight, middle)
    fitted = FittedEffect(offset, offset.variants[0], np.empty(0), np.array([middle]), gain)
    step = Step(
        ZERO,
        offset.family,
        (ZERO,),
        float(1 / (1 + np.exp(-min(gain, 1e3)))),
        (),
        fitted.parameters,
        (),
        straight.gap,
        later.gap,
        straight.units(fitted),
    )
    return later, (step,)


def has_middle(effect: Effect) -> bool:
    """Return whether an effect is a function of angle and rate that a shift of the angle changes."""
    return effect.enters == "moment" and all(
        not v.states and "theta" in v.uses and v.uses <= {"theta", "omega", *v.names} for v in effect.variants
    )


def _best_zero(
    work: Work, beside: Sequence[FittedEffect], constant: Effect, candidates: Sequence[Effect]
) -> tuple[float, float, float]:
    """Return the zero at which one candidate explains most, its score over that without a shift, and what is chance."""
    largest = max(float(np.abs(run.angle).max()) for run in work.plain)

    def best_at(zero: float, effects: Sequence[Effect]) -> tuple[float, str, float]:
        rows = [shifted_run(run, zero) for run in work.plain]
        search = CampaignEvidence(rows, work.model, [constant, *effects], beside).search()
        always = search.chosen([each for each in search.candidates if each.name == constant.id])
        later = search.extended(always)
        if not later:
            return always.score.total, "", search.limits[0]
        return later[0].score.total, later[0].members[-1].name, search.limits[0]

    rest = rest_angle(work.plain, work.model)
    begin = float(np.mean([run.motion.angle.mean() for run in work.plain])) if rest is None else rest
    spacing = REACH * largest / (POINTS // 2)
    places = [begin + spacing * k for k in range(-(POINTS // 2), POINTS // 2 + 1)]
    known = {place: best_at(place, candidates) for place in places}
    best = max(known, key=lambda place: known[place][0])
    last = [e for e in candidates if e.id == known[best][1]]
    for _ in range(HALVINGS):
        spacing /= 2
        known.update({place: best_at(place, last) for place in (best - spacing, best + spacing)})
        best = max(known, key=lambda place: known[place][0])
    score, _, least = known[best]
    return best, score - best_at(0.0, candidates)[0], least


def shifted_run(run: GapRun, zero: float) -> GapRun:
    """Return a run with its displacement counted from another zero."""
    motion = run.motion
    return replace(run, motion=replace(motion, angle=motion.angle - zero, centre=motion.centre - zero))


def counted_from(straight: Problem, zero: float, repaired: Repaired | None = None) -> Problem:
    """Return the problem of the same runs with every displacement counted from another zero.

    With a law ``repaired`` about that zero; default: its model, fitted anew, without effects.
    """
    work, policy = straight.work, straight.policy
    campaign = work.campaign.with_runs(
        tuple(replace(r, angle=r.angle - zero, source=None) for r in work.campaign.runs)
    )
    runs = [replace(r, angle=r.angle - zero, source=None) for r in work.runs]
    states = [_counted(s, zero) for s in work.states]
    if repaired is None:
        repaired = Repaired(first_model(campaign, states, work.model, None, policy).model, ())
    later = Work.build(campaign, runs, states, work.groups, repaired.model, repaired.effects, policy)
    if repaired.effects:
        # Rows have their weights by the law that they are about.
        again = refit(later.rows, repaired.model, repaired.effects, keeping(policy))
        repaired = replace(again, dropped=straight.dropped)
    return replace(
        straight,
        work=replace(later, model=repaired.model),
        repaired=repaired,
        zero=straight.zero + zero,
        candidates=tuple(each for each in straight.candidates if each.id != ZERO),
        states=tuple(_counted(s, zero) for s in straight.states),
    )


def _counted(states: ForceStates, zero: float) -> ForceStates:
    lead, replicate = states.lead, states.replicate
    return replace(
        states,
        angle=states.angle - zero,
        lead=None if lead is None else (lead[0] - zero, lead[1]),
        replicate=None if replicate is None else (replicate[0] - zero, *replicate[1:]),
    )
