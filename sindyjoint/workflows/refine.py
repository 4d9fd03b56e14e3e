"""A discovery with coefficients refined on the simulated response."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

from sindyjoint.response.output_error_parts import Nuisance
from sindyjoint.response.refine import refine
from sindyjoint.workflows.discover import Discovery


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
    return replace(result, model=refinement.model, warnings=(*result.warnings, *refinement.notes))
