"""What the law of a free motion lacks: no moment is measured, and every law is fitted to the motion that it simulates.

Energies and timings of half-cycles are linear in what is missing, and say where a fit of each effect begins; which of
them the motion goes on by, phase by phase over all its cycles, its simulation says, where half-cycles say nothing too.
"""

from collections.abc import Collection, Sequence
from contextlib import suppress
from dataclasses import replace

import numpy as np

from sindyjoint.diagnosis.campaign.measure import CampaignEvidence
from sindyjoint.diagnosis.campaign.numbers import is_element, with_numbers
from sindyjoint.diagnosis.campaign.repair import Repaired, refit, simulated, without
from sindyjoint.diagnosis.campaign.start import Work
from sindyjoint.diagnosis.effects.catalogue import Effect
from sindyjoint.diagnosis.effects.fitted import FittedEffect
from sindyjoint.diagnosis.evidence.score import Ranking, Score, rank
from sindyjoint.equation.model import JointModel
from sindyjoint.errors import SindyJointError
from sindyjoint.limits import EVIDENCE
from sindyjoint.numeric import Array, kept
from sindyjoint.response.refinement import Refinement, misfit_nearby, refine

# Effects that lead after a few steps and are fitted to the simulated motion to the end.
FITTED = 3


def on_response(work: Work, repaired: Repaired) -> Repaired:
    """Return model and effects with all numbers, those within effects too, fitted to the simulated motion.

    As they are where an effect is none of the law, or the motion cannot be simulated.
    """
    law = _law(repaired)
    result = None if law is None else _refinement(work, law)
    if result is None or not result.refined:
        return repaired
    later = with_numbers(repaired, result.model.numbers, np.array(result.model.covariance))
    return replace(later, residual=result.residual)


# The same law is asked for its gap, its verdict, and beside each effect more.
@kept
def _refinement(work: Work, law: JointModel) -> Refinement | None:
    """Return a law fitted to the simulated motion; None where that fails."""
    with suppress(SindyJointError):
        # Whether runs kept for validation go on so is asked of the gap.
        return refine(law, work.campaign.with_runs(work.runs), states=work.states)
    return None


def _law(repaired: Repaired) -> JointModel | None:
    """Return the law of a model with all effects as elements, whose numbers are all free; None where one is none."""
    model, effects = repaired.model, repaired.effects
    if not all(each.is_term or is_element(each) for each in effects):
        return None
    elements = tuple(each.element(model.joint.motion) for each in effects)
    return replace(model, elements=elements, covariance=())


def simplest(work: Work, repaired: Repaired) -> Repaired:
    """Return the same less the terms that do not stand out of their errors, the least sure first."""
    found, dropped = on_response(work, repaired), list[str]()
    while found.residual is not None and len(found.model.terms) > 1:
        sure = {t.id: abs(t.coefficient) / max(t.standard_error, 1e-300) for t in found.model.terms}
        weakest = min(sure, key=sure.__getitem__)
        fewer = Repaired(without(found.model, {weakest}), found.effects)
        if sure[weakest] >= EVIDENCE.significant or (later := on_response(work, fewer)).residual is None:
            break
        found, dropped = later, [*dropped, weakest]
    return replace(found, dropped=tuple(dropped))


def score_on_response(repaired: Repaired, unit: float) -> Score:
    """Return the score of a simulated motion, whose noise has ``unit`` times the variance that it was known to have."""
    assert repaired.residual is not None
    rows = repaired.residual.size
    numbers = len(repaired.model.terms) + sum(e.variant.degrees for e in repaired.effects)
    chi_square = float(repaired.residual @ repaired.residual)
    total = -0.5 * (chi_square / unit + numbers * np.log(rows))
    return Score(np.array([total]), np.array([chi_square]), 0.0, 1.0)


def ranked_on_response(
    work: Work, now: Repaired, candidates: Sequence[Effect], refused: Collection[str]
) -> Ranking[FittedEffect] | None:
    """Return the effects that lead by half-cycles in the order of their simulated motions."""
    if now.residual is None:
        return None
    known = {*refused, *now.model.ids, *(each.name for each in now.effects)}
    ev = CampaignEvidence(
        work.plain,
        now.model,
        [e for e in candidates if e.id not in known and e.enters == "moment"],
        now.effects,
    )
    search = ev.search()
    alone = search.chosen(())
    leading = search.with_numbers(search.extended(alone), alone.score.total)
    begun = [begun_with(work, now, ev.fitted(each)) for each in leading]
    nearby = sorted(((_misfit_nearby(work, each), i) for i, each in enumerate(begun)))[:FITTED]
    least, done = float(now.residual @ now.residual) + 2 * np.log(EVIDENCE.chance), list[Repaired]()
    for misfit, i in nearby:
        if misfit < least and (fitted := on_response(work, begun[i])).residual is not None:
            # What a few steps leave clearly behind that end is not fitted to its own.
            least = min(least, work.policy.clearly**2 * float(fitted.residual @ fitted.residual))
            done.append(fitted)
    if not done:
        return None
    unit = min(mean_square(each) for each in (now, *done))
    scored = [(each.effects[-1], score_on_response(each, unit)) for each in done]
    scored.sort(key=lambda pair: pair[0].variant.degrees)
    return rank(scored, score_on_response(now, unit), work.policy.rival_nats)


def begun_with(work: Work, now: Repaired, effects: Sequence[FittedEffect]) -> Repaired:
    """Return a model with further effects, all coefficients by half-cycles: where a fit of the motion begins."""
    return refit(work.plain, now.model, (*now.effects, *effects), drops=False)


def _misfit_nearby(work: Work, repaired: Repaired) -> float:
    law = _law(repaired)
    with suppress(SindyJointError):
        return np.inf if law is None else misfit_nearby(law, work.runs, work.states)
    return np.inf


def mean_square(repaired: Repaired) -> float:
    """Return what a simulated motion leaves, in units of the noise; infinite where it could not be simulated."""
    residual: Array | None = repaired.residual
    return np.inf if residual is None else float(residual @ residual) / residual.size


def continuation_gap(work: Work, model: JointModel, effects: Sequence[FittedEffect]) -> float:
    """Return what a fit to the first part of each run leaves there and misses of the rest, RMS relative to the motion.

    All numbers come from the first part; the simulation of the rest starts from the measured state where that part
    ends. A decay has no more than noise at its end, where any law goes on well. NaN where no run can be simulated.
    """
    share = work.policy.training_share
    parts = [(s.part(0.0, share), s.part(share, 1.0)) for s in work.states]
    if min(s.n_samples for pair in parts for s in pair) < 50:
        return float("nan")
    training = replace(work, states=tuple(first for first, _ in parts))
    fitted = on_response(training, Repaired(model, tuple(effects)))
    left = mean_square(fitted) if fitted.residual is not None else 1.0
    gap = own = 0.0
    for run, states, (_, rest) in zip(work.runs, work.states, parts, strict=True):
        result = simulated(run, rest, fitted.model, fitted.effects)
        if result is None or result.simulated_angle is None:
            continue
        missed = float(np.mean((result.angle - result.simulated_angle) ** 2))
        gap += share * left * states.noise.angle**2 + (1 - share) * missed
        own += float(np.var(states.angle))
    return float(np.sqrt(gap / own)) if own > 0 else float("nan")
