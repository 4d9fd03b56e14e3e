"""Adding an effect to those found before: channels aligned, earlier names tested again, everything fitted together."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from sindyjoint.diagnosis.campaign.ranking import (
    FittedEffect,
    Problem,
    Ranking,
    fit_effects,
    rank,
    refine_effect,
)
from sindyjoint.diagnosis.campaign.repair import Repaired, refit
from sindyjoint.diagnosis.campaign.rows import gap_runs
from sindyjoint.diagnosis.campaign.start import Work
from sindyjoint.diagnosis.effects.catalogue import Effect
from sindyjoint.discovery.delay import shifted
from sindyjoint.equation.model import JointModel

# Nothing is claimed below this belief that something is missing.
BELIEF = 0.9
# A fall of χ² by so much says that a delay is not quite what it was taken for.
REALIGN = 4.0


@dataclass(frozen=True, eq=False)
class Added:
    """A model with one effect more.

    Parameters
    ----------
    work : Work
    effects : tuple of FittedEffect
        All of them, delays of the channels first.
    repaired : Repaired
    again : dict of str to Ranking or None
        Effects found before that were tested again: the candidates for their place, or None where they are needless.
    """

    work: Work
    effects: tuple[FittedEffect, ...]
    repaired: Repaired
    again: dict[str, Ranking | None]


def add_effect(
    work: Work, found: Sequence[FittedEffect], best: FittedEffect, candidates: Sequence[Effect]
) -> Added:
    """Return the model with an effect added to those found before.

    A delay is removed from the states, which decides anew what the effects before it were; any other effect is fitted
    beside them, and each of them is tested again against the ``candidates``, if there are any.
    """
    shifts = [f for f in found if _shifts(f)]
    others = [f for f in found if not _shifts(f)]
    if _shifts(best):
        work, best = _aligned(work, others, best)
        shifts = [*(f for f in shifts if f.effect.id != best.effect.id), best]
        others, again = _retested(work, others, others, candidates)
    else:
        others, again = _retested(work, [*others, best], others, candidates)
        for index, delay in enumerate(shifts):
            work, shifts[index] = _realigned(work, others, delay)
    repaired = refit(work.rows, work.model, others)
    work = Work.build(work.campaign, work.runs, work.states, work.groups, repaired.model, repaired.effects)
    if not all(run.folded for run in work.rows):
        # The rows are weighted anew by what is left now, and with them the inner parameters.
        later = refit(work.rows, repaired.model, refined(work, repaired.effects))
        repaired = replace(later, dropped=(*repaired.dropped, *later.dropped))
    work = replace(work, model=repaired.model)
    return Added(work, (*shifts, *repaired.effects), repaired, again)


def refined(work: Work, effects: Sequence[FittedEffect]) -> list[FittedEffect]:
    """Return effects with their inner parameters refitted beside one another."""
    later = list(effects)
    for index, each in enumerate(later):
        others = later[:index] + later[index + 1 :]
        later[index] = refine_effect(Problem.build(work.rows, work.model, others), each)
    return later


def _shifts(fitted: FittedEffect) -> bool:
    return fitted.effect.enters == "time shift"


def _aligned(work: Work, others: list[FittedEffect], delay: FittedEffect) -> tuple[Work, FittedEffect]:
    """Shift the states by the delay found, and correct what the linear estimate missed."""
    total = 0.0
    states, gain = work.states, delay.gain
    for _ in range(4):
        total += float(delay.coefficients[0])
        states = tuple(shifted(s, total) for s in work.states)
        model: JointModel = refit(gap_runs(states, work.model, work.groups), work.model, others).model
        problem = Problem.build(gap_runs(states, model, work.groups), model, others)
        left, coefficients = problem.gain(delay.variant, delay.values)
        delay = replace(delay, coefficients=coefficients)
        if left < 1.0:
            break
    delay = replace(delay, coefficients=np.array([total]), gain=gain)
    return Work.build(work.campaign, work.runs, states, work.groups, work.model, others), delay


def _realigned(work: Work, others: list[FittedEffect], delay: FittedEffect) -> tuple[Work, FittedEffect]:
    """Correct a delay that was removed while an effect was missing beside it."""
    gain, coefficients = Problem.build(work.rows, work.model, others).gain(delay.variant, delay.values)
    if gain < REALIGN:
        return work, delay
    work, more = _aligned(work, others, replace(delay, coefficients=coefficients))
    return work, replace(delay, coefficients=delay.coefficients + more.coefficients)


def _retested(
    work: Work, moving: list[FittedEffect], earlier: Sequence[FittedEffect], candidates: Sequence[Effect]
) -> tuple[list[FittedEffect], dict[str, Ranking | None]]:
    """Test the effects found earlier again: each keeps its place, gives it to a better one, or goes."""
    again: dict[str, Ranking | None] = {}
    if not earlier or not candidates:
        return moving, again
    moving = refined(work, moving)
    for name in [f.effect.id for f in earlier]:
        each = next(f for f in moving if f.effect.id == name)
        others = [f for f in moving if f is not each]
        problem = Problem.build(work.rows, work.model, others)
        taken = {f.effect.id for f in others}
        # Memory effects are many times dearer to fit: they are tried again only in the place of one of their own.
        trial = [
            e
            for e in candidates
            if e.id not in taken
            and e.enters != "time shift"
            and (e.family == each.effect.family or not e.variants[0].states)
        ]
        ranking = rank(problem, fit_effects(problem, trial))
        if 1 - ranking.nothing < BELIEF:
            moving, again[name] = others, None
        else:
            best = ranking.fitted[0]
            moving = [best if f is each else f for f in moving]
            again[name] = ranking
    return moving, again
