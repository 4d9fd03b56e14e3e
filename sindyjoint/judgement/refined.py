"""A discovery whose coefficients are fitted again to the simulated response."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from sindyjoint.equation.calibration import with_gain_uncertainty
from sindyjoint.equation.element import Value
from sindyjoint.equation.model import JointModel
from sindyjoint.equation.test_record import Enters, Nuisance, TestNuisances
from sindyjoint.judgement.discovery import Discovery
from sindyjoint.judgement.policy import POLICY
from sindyjoint.response.drive import prescribed
from sindyjoint.response.output_error_runs import Nuisance as Kind
from sindyjoint.response.refinement import Refinement, refine
from sindyjoint.states import ForceStates
from sindyjoint.states.build import content_hash, with_later_motion
from sindyjoint.text import spelled

# What the estimated errors of the channels are in the record of a test, by what the response is.
STORED: dict[tuple[str, str], tuple[str, Enters, str]] = {
    ("delay", "angle"): ("channel_delay", "time shift", "tau"),
    ("gain", "angle"): ("angle_gain", "angle gain", "g"),
    ("gain", "moment"): ("moment_gain", "moment gain", "g"),
    ("offset", "angle"): ("angle_offset", "angle zero", "theta_0"),
}


def refined(result: Discovery, nuisance: Sequence[Kind] = (), **options: object) -> Discovery:
    """Return a discovery whose coefficients are refined on the simulated response, with the notes of that."""
    if not result.found:
        return result
    # The states are those of channels that were aligned.
    runs = tuple(with_later_motion(run, result.lag) for run in result.campaign.runs) if result.lag else ()
    campaign = result.campaign.with_runs(runs) if runs else result.campaign
    refinement = refine(
        result.model,
        campaign,
        states=result.states,
        nuisance=nuisance,
        **options,  # type: ignore[arg-type]
    )
    apart = _warn_of_disagreement(result.model, refinement.model) if refinement.refined else ()
    # The intervals of a refinement hold noise alone.
    refined_model, lost = refinement.model, list[str]()
    if refinement.refined:
        estimated, lost = estimated_errors(refinement, result.states)
        measured = result.measured or result.campaign
        known = result.model.test or TestNuisances(content_hash(measured), measured.joint.name)
        test = replace(known, nuisances=(*known.nuisances, *estimated))
        refined_model = replace(refined_model, test=test or None)
        plain = replace(refined_model, fitted=replace(refined_model.fitted, gains=()))
        refined_model = with_gain_uncertainty(plain, result.campaign.gain_uncertainty)
    return replace(
        result,
        model=refined_model,
        warnings=(*result.warnings, *refinement.notes, *lost, *apart),
    )


def estimated_errors(result: Refinement, states: Sequence[ForceStates]) -> tuple[list[Nuisance], list[str]]:
    """Return errors of channels that a refinement estimated, and what is said of those that no one channel has."""
    responses = {"moment" if prescribed(s, spurious=True) else "angle" for s in states}
    found, lost = [], []
    for name, (value, error) in result.nuisance.items():
        # Of angle and moment together a number is of neither; a delay lies between them.
        channel = "angle" if name == "delay" else "".join(responses)
        if (name, channel) not in STORED:
            lost.append(f"the {name} that was estimated is not applied where model and campaign are compared")
            continue
        id, enters, symbol = STORED[name, channel]
        unit = {"delay": "s", "gain": "1"}.get(
            name, "rad" if result.model.joint.motion == "rotation" else "m"
        )
        ends = (value - 1.96 * error, value + 1.96 * error)
        found.append(Nuisance(id, enters, Value(symbol, value, error, ends, unit)))
    return found, lost


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
