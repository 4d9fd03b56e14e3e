"""How well the terms of a method predict the simulated response of runs that their fit never saw."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from sindyjoint.discovery.evidence import Evidence, Fit, fit_columns
from sindyjoint.equation.model import JointModel, model_terms
from sindyjoint.errors import InputError
from sindyjoint.judgement.comparison import Choice
from sindyjoint.judgement.discovery import Discovery
from sindyjoint.states.build import with_later_motion


def add_responses(found: Discovery, evidence: Evidence, choices: tuple[Choice, ...]) -> tuple[Choice, ...]:
    """Add the error of the simulated response of held-out frequencies, each distinct set of terms once."""
    known: dict[tuple[str, ...], tuple[float, str]] = {(): (float("nan"), "no model")}
    for choice in choices:
        if choice.ids not in known:
            known[choice.ids] = response_error(found, evidence, choice.ids)
    return tuple(
        replace(choice, response=known[choice.ids][0], not_simulated=known[choice.ids][1])
        for choice in choices
    )


def response_error(found: Discovery, evidence: Evidence, ids: tuple[str, ...]) -> tuple[float, str]:
    """Return the error of a set of terms, and why there is none; each run under the fit to the other groups."""
    from sindyjoint.response.laws import law_in_run
    from sindyjoint.response.run import simulate_run

    # The groups of a single run are parts of it, and a part has no steady response to compare with.
    if len(found.states) < 2:
        return float("nan"), "one run only: no other one can be held out"
    columns = [evidence.ids.index(name) for name in ids]
    runs = {run.name: with_later_motion(run, found.lag) for run in found.campaign.identification_runs}
    states = {state.run: state for state in found.states}
    errors = []
    for group in evidence.groups:
        fit = fit_columns(evidence.only([other for other in evidence.groups if other != group]), columns)
        try:
            fitted = _fitted_model(found, ids, fit)
            laws = {
                run.name: law_in_run(fitted, states[run.name]) for run in evidence.runs if run.group == group
            }
        except InputError as cause:
            return float("nan"), str(cause)
        for run in evidence.runs:
            if run.group == group:
                simulated = simulate_run(laws[run.name], runs[run.name], states[run.name], response_only=True)
                if simulated.failure:
                    return float("nan"), f"run {run.name!r}: {simulated.failure}"
                errors.append(simulated.response_nrmse)
    return float(np.sqrt(np.mean(np.square(errors)))), ""


def _fitted_model(found: Discovery, ids: tuple[str, ...], fit: Fit) -> JointModel:
    """Return the model of some of the candidates with the coefficients of a fit and given ones."""
    resolved = {term.id: term for term in found.regressor.terms_}
    terms = model_terms(
        [resolved[name] for name in ids], fit.coefficients, fit.covariance, fit.unique_share, fit.effective_degrees,
        found.campaign.joint.motion,
    )  # fmt: skip
    given = tuple(term for term in found.model.terms if term.id in (found.regressor.fixed or {}))
    return replace(found.model, terms=(*terms, *given), covariance=())
