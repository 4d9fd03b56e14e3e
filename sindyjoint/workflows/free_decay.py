"""Free motion: no moment is measured, and what counts is how the motion goes on.

Along a decay the moment is the inertia times a second derivative, whose noise hides a small dissipation; in the motion
itself that dissipation adds up from swing to swing. Coefficients are therefore refined on the simulated response.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from sindyjoint.discrepancy.repair import Repaired, is_term, whole_model
from sindyjoint.errors import SindyJointError
from sindyjoint.record import Campaign
from sindyjoint.workflows.diagnosis_start import Work
from sindyjoint.workflows.refine import refine


def is_free(campaign: Campaign) -> bool:
    """Return whether no run has a measured moment."""
    return all(np.ptp(run.moment) == 0 for run in campaign.identification_runs)


def refined_on_response(work: Work, repaired: Repaired) -> Repaired:
    """Return model and effects with coefficients refined on the simulated response, where they all are terms."""
    if not all(is_term(e.effect, e.variant) and len(e.variant.columns) == 1 for e in repaired.effects):
        return repaired
    whole = whole_model(repaired, work.rows)
    if len(whole.terms) != len(repaired.model.terms) + len(repaired.effects):
        return repaired
    try:
        result = refine(whole, work.campaign, states=work.states)
    except SindyJointError:
        return repaired
    if not result.refined:
        return repaired
    later = result.model
    terms = tuple(replace(later[t.id], unique_share=t.unique_share) for t in repaired.model.terms)
    effects = tuple(
        replace(e, coefficients=np.array([later[e.effect.id].coefficient])) for e in repaired.effects
    )
    count = len(terms)
    covariance = np.array(later.covariance)
    model = replace(
        repaired.model,
        terms=terms,
        covariance=tuple(tuple(map(float, r[:count])) for r in covariance[:count]),
    )
    return replace(repaired, model=model, effects=effects, covariance=covariance)
