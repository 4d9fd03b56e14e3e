"""Free motion: no moment is measured, and what counts is how the motion goes on."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from sindyjoint.diagnosis.campaign.numbers.whole import whole_model
from sindyjoint.diagnosis.campaign.repair import Repaired, refit, refit_nonlinear
from sindyjoint.diagnosis.campaign.rows.build import gap_runs
from sindyjoint.diagnosis.campaign.rows.run import GapRun
from sindyjoint.diagnosis.campaign.simulated_run import simulated
from sindyjoint.diagnosis.campaign.start import Work
from sindyjoint.diagnosis.effects.fitted import FittedEffect
from sindyjoint.equation.model import JointModel
from sindyjoint.errors import SindyJointError
from sindyjoint.record import Campaign
from sindyjoint.response.refinement import refine
from sindyjoint.states import ForceStates

FEWEST_SAMPLES = 50


def continuation_gap(work: Work, model: JointModel, effects: Sequence[FittedEffect]) -> float:
    """Return how far the rest of each run is from what a fit to its first part says of it, relative RMS.

    Coefficients and nonlinear parameters come from the first part; the simulation starts from the measured state where
    that part ends. NaN where no run can be simulated.
    """
    share, policy = work.policy.training_share, work.policy
    parts = [(_part(s, 0.0, share), _part(s, share, 1.0)) for s in work.states]
    if min(s.n_samples for pair in parts for s in pair) < FEWEST_SAMPLES:
        return float("nan")
    training = [first for first, _ in parts]
    rows = gap_runs(training, model, work.groups, policy, free=True)
    fitted = refit(rows, model, refit_nonlinear(rows, model, effects, policy))
    fitted = refined(work.campaign, training, rows, fitted)
    gap = own = 0.0
    for run, (_, rest) in zip(work.runs, parts, strict=True):
        result = simulated(run, rest, fitted.model, fitted.effects)
        if result is None or result.simulated_angle is None:
            continue
        gap += float(np.mean((result.angle - result.simulated_angle) ** 2))
        own += float(np.mean((result.angle - np.mean(result.angle)) ** 2))
    return float(np.sqrt(gap / own)) if own > 0 else float("nan")


def refined(
    campaign: Campaign, states: Sequence[ForceStates], rows: Sequence[GapRun], repaired: Repaired
) -> Repaired:
    """Return model and effects with coefficients refined on the simulated response, where they all are terms.

    Half-cycles are linear in the coefficients, and a simulation over many of them is not.
    """
    if not all(e.is_term and len(e.variant.columns) == 1 for e in repaired.effects):
        return repaired
    whole = whole_model(repaired, rows)
    if len(whole.terms) != len(repaired.model.terms) + len(repaired.effects):
        return repaired
    try:
        result = refine(whole, campaign, states=states)
    except SindyJointError:
        return repaired
    if not result.refined:
        return repaired
    later = result.model
    terms = tuple(replace(later[t.id], unique_share=t.unique_share) for t in repaired.model.terms)
    effects = tuple(
        replace(e, coefficients=np.array([later[e.effect.id].coefficient])) for e in repaired.effects
    )
    covariance = np.array(later.covariance)
    own = tuple(tuple(map(float, row[: len(terms)])) for row in covariance[: len(terms)])
    model = replace(repaired.model, terms=terms, covariance=own)
    return replace(repaired, model=model, effects=effects, covariance=covariance)


def _part(states: ForceStates, low: float, high: float) -> ForceStates:
    """Return a share of the samples."""
    chosen = slice(int(low * states.n_samples), int(high * states.n_samples))
    names = ("time", "angle", "rate", "acceleration", "moment", "moving", "block")
    return replace(states, replicate=None, **{name: getattr(states, name)[chosen] for name in names})
