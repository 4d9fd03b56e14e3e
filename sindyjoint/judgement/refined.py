"""A discovery whose coefficients are fitted again to the simulated response."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from sindyjoint.equation.calibration import with_gain_uncertainty
from sindyjoint.equation.model import JointModel
from sindyjoint.judgement.discovery import Discovery
from sindyjoint.judgement.policy import POLICY
from sindyjoint.response.refine import refine
from sindyjoint.text import spelled

if TYPE_CHECKING:
    from sindyjoint.response.output_error_parts import Nuisance


def refined(result: Discovery, nuisance: Sequence[Nuisance] = (), **options: object) -> Discovery:
    """Return a discovery whose coefficients are refined on the simulated response, with the notes of that."""
    if not result.found:
        return result
    refinement = refine(
        result.model,
        result.campaign,
        states=result.states,
        nuisance=nuisance,
        **options,  # type: ignore[arg-type]
    )
    apart = _warn_of_disagreement(result.model, refinement.model) if refinement.refined else ()
    # The intervals of a refinement hold noise alone.
    refined_model = refinement.model
    if refinement.refined:
        plain = replace(refined_model, fitted=replace(refined_model.fitted, gains=()))
        refined_model = with_gain_uncertainty(plain, result.campaign.gain_uncertainty)
    return replace(
        result,
        model=refined_model,
        warnings=(*result.warnings, *refinement.notes, *apart),
        # What was taken out of the coefficients of the regression says nothing of these.
        bias=None if refinement.refined else result.bias,
    )


def _warn_of_disagreement(before: JointModel, after: JointModel) -> tuple[str, ...]:
    """Return a warning for terms that regression and simulation give values that their errors do not reconcile."""
    apart = []
    for term in after.terms:
        if term.id not in before:
            continue
        other = before[term.id]
        error = float(np.hypot(term.standard_error, other.standard_error))
        if abs(term.coefficient - other.coefficient) > POLICY.refined_apart * error:
            apart.append(
                f"{spelled(term.id)} ({other.coefficient:.4g} ± {other.standard_error:.2g} by regression, "
                f"{term.coefficient:.4g} ± {term.standard_error:.2g} on the response)"
            )
    if not apart:
        return ()
    return (
        f"regression and simulated response disagree by more than {POLICY.refined_apart:g} standard errors: "
        f"{'; '.join(apart)}; the model lacks something, or samples are too few for derivatives",
    )
