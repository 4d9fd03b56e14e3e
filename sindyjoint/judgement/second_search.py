"""The second search for terms, on completed states, and what the processing alone can make of the paper's law."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from sindyjoint.discovery.evidence import fit_columns
from sindyjoint.discovery.large.segments import SampleCount
from sindyjoint.equation.model import INERTIA, Fitted, JointModel, model_terms
from sindyjoint.errors import InputError, SimulationError
from sindyjoint.judgement.policy import POLICY
from sindyjoint.judgement.verdict import Verdict
from sindyjoint.paper import TERMS as PAPER_TERMS
from sindyjoint.record import Campaign
from sindyjoint.states import ForceStates, regression_rows
from sindyjoint.states.floor import moment_floor
from sindyjoint.text import in_words_of, quantities, spelled

if TYPE_CHECKING:
    from sindyjoint.bias.correction import Corrected
    from sindyjoint.discovery.regression import TermRegression

# The model that completes the states is itself found on incomplete ones: as often as its terms change, at most.
COMPLETIONS = 4
COMPLETED = (
    "the inertia makes weak harmonics of the motion matter: those not known to a tenth were taken from a simulation of "
    "the model, and the terms chosen again"
)


@dataclass(frozen=True, eq=False)
class TermSearch:
    """What a search for terms came to, the first or the second.

    Parameters
    ----------
    regressor : TermRegression
    model : JointModel
    states : tuple of ForceStates
        Completed where the second search was used, else as given.
    note : str
        What was done, with the residual of each end of the search; empty where nothing was.
    """

    regressor: TermRegression
    model: JointModel
    states: tuple[ForceStates, ...]
    note: str = ""


def search_again(
    first: TermSearch,
    campaign: Campaign,
    counts: Sequence[SampleCount],
    say: Callable[[str], None],
) -> TermSearch:
    """Choose the terms again on states whose weak harmonics are the model's, where those matter to the moment.

    The model that completes the states was itself found on incomplete ones: the search starts from it and from the
    paper's terms alone, and the end that leaves less of the moment unexplained is used.
    """
    best, ends = first, []
    starts = {"the terms found first": first.model} if first.model.terms else {}
    paper = paper_model(first.regressor, first.model)
    if paper is not None and set(paper.ids) != set(first.model.ids):
        starts["the paper's five terms"] = paper
    for name, start in starts.items():
        end, residual = _search_from(start, best, first, campaign, counts, say)
        if residual is not None:
            ends.append((name, residual))
        if end is not best:
            best, used = end, name
    if best is first:
        return best
    unit = quantities(campaign.joint.motion).moment_unit
    residuals = " and ".join(f"{1e3 * value:.4g} m{unit} from {name}" for name, value in ends)
    completed = in_words_of(campaign.joint.motion, COMPLETED)
    return replace(best, note=f"{completed}; residual: {residuals}; the end from {used} is used")


def _search_from(
    start: JointModel,
    best: TermSearch,
    first: TermSearch,
    campaign: Campaign,
    counts: Sequence[SampleCount],
    say: Callable[[str], None],
) -> tuple[TermSearch, float | None]:
    """Complete states and choose terms in turn; return the best so far and the least residual on the way."""
    from sindyjoint.bias.completion import completed_states
    from sindyjoint.response.laws import held_laws

    found, least = start, None
    for _ in range(COMPLETIONS):
        try:
            more = completed_states(
                held_laws(found, first.states), campaign.identification_runs, first.states
            )
        except (SimulationError, InputError):
            break
        if more is None:
            break
        say("selecting terms with the harmonics below the noise")
        fitted = first.regressor.again()
        fitted.fit(**regression_rows(more, campaign.joint.inertia).fit_arguments())
        before, found = found.ids, campaign_model(fitted, campaign, more, counts)
        if not found.terms:
            break
        residual = found.fitted.residual_rms
        least = residual if least is None else min(least, residual)
        if residual < best.model.fitted.residual_rms * POLICY.lower_residual:
            best = TermSearch(fitted, found, more)
        if found.ids == before:
            break
    return best, least


def paper_model(regressor: TermRegression, model: JointModel) -> JointModel | None:
    """Return the paper's five terms, and inertia where it is one, fitted to a regressor's data; None if not offered."""
    ids = regressor.evidence_.ids
    wanted = [*PAPER_TERMS, *([INERTIA] if INERTIA in ids else [])]
    if regressor.fixed or not set(wanted) <= set(ids):
        return None
    columns = sorted(ids.index(term) for term in wanted)
    fit = fit_columns(regressor.evidence_, columns)
    resolved = {term.id: term for term in regressor.terms_}
    kept = [resolved[ids[column]] for column in columns]
    terms = model_terms(
        kept, fit.coefficients, fit.covariance, fit.unique_share, fit.effective_degrees, model.joint.motion
    )
    fitted = replace(model.fitted, residual_rms=fit.residual_rms)
    return replace(model.with_terms(terms, fit.covariance), fitted=fitted)


def softened(
    verdict: Verdict,
    regressor: TermRegression,
    model: JointModel,
    campaign: Campaign,
    states: Sequence[ForceStates],
) -> Verdict:
    """Return *undecided* in the place of *refuted* where the processing makes the further terms of the paper's law."""
    paper = paper_model(regressor, model)
    if paper is None or not verdict.extra:
        return verdict
    if not _made_by_processing(paper, regressor, model, verdict, campaign, states):
        return verdict
    names = " and ".join(spelled(term, campaign.joint.motion) for term in verdict.extra)
    with_them, without = (1e3 * each.fitted.residual_rms for each in (model, paper))
    unit = quantities(campaign.joint.motion).moment_unit
    return replace(
        verdict,
        verdict="undecided",
        reason=f"{names} may be the processing's: of a simulated joint of the paper's five terms it makes as much "
        f"(residual {with_them:.4g} m{unit} with the terms found, {without:.4g} m{unit} with the paper's)",
    )


def _made_by_processing(
    paper: JointModel,
    regressor: TermRegression,
    model: JointModel,
    verdict: Verdict,
    campaign: Campaign,
    states: Sequence[ForceStates],
) -> bool:
    """Return whether the found terms beyond the paper's are what the processing makes of the paper's law."""
    from sindyjoint.bias.correction import measure_bias
    from sindyjoint.bias.policy import POLICY as BIAS

    terms = [term for term in regressor.terms_ if term.id in model]
    try:
        bias = measure_bias(paper, terms, campaign, states)
    except (SimulationError, InputError):
        return False
    for term in verdict.extra:
        at, found = bias.ids.index(term), model[term]
        error = np.hypot(
            found.standard_error, np.hypot(bias.pooled_error[at], BIAS.uncertain_share * bias.pooled[at])
        )
        if abs(found.coefficient - bias.pooled[at]) > regressor.significance * error:
            return False
    return True


def campaign_model(
    regressor: TermRegression,
    campaign: Campaign,
    states: Sequence[ForceStates],
    counts: Sequence[SampleCount],
) -> JointModel:
    """Return the regressor's model with the joint and the data it came from."""
    model = regressor.model_
    inertia = campaign.joint.inertia
    if inertia is None and INERTIA in model:
        inertia = model[INERTIA].coefficient
    moving = np.array([each.moving for each in counts], dtype=float)
    fitted = Fitted(
        moment_rms=model.fitted.moment_rms,
        residual_rms=model.fitted.residual_rms,
        noise_floor=moment_floor(states, inertia).moment,
        moving_fraction=float(moving.sum() / sum(each.samples for each in counts)),
        samples=int(moving.sum()),
        runs=len(states),
        angle=model.fitted.angle,
        rate=model.fitted.rate,
        frequencies=tuple(sorted({round(s.frequency, 6) for s in states if s.frequency is not None})),
        simulated=campaign.simulated,
        mean_known=campaign.mean_known,
        quasi_static=campaign.quasi_static,
    )
    return replace(model, joint=campaign.joint, fitted=fitted)


def without_bias(found: TermSearch, measured: TermRegression, campaign: Campaign) -> Corrected:
    """Take out of a model's coefficients what the processing does to them.

    ``measured`` was fitted to the states before their completion, which has moved the coefficients: a part of that
    stays uncertain, as of any correction.
    """
    from sindyjoint.bias.correction import corrected_model

    regressor, model = found.regressor, found.model
    chosen = [term for term in regressor.terms_ if term.id in model]
    fitted = [term for term in chosen if term.id in regressor.evidence_.ids]
    known = [term for term in chosen if term.id not in regressor.evidence_.ids]
    moved = None
    if measured is not regressor and {term.id for term in fitted} <= set(measured.evidence_.ids):
        columns = [measured.evidence_.ids.index(term.id) for term in fitted]
        before = fit_columns(measured.evidence_, columns).coefficients
        moved = np.array([model[term.id].coefficient for term in fitted]) - before
    return corrected_model(model, fitted, campaign, found.states, known=known, moved=moved)


def unmeasured_bias(fixed: Corrected | None) -> str:
    """Return a warning where the bias of the processing was to be taken out and could not be measured."""
    if fixed is None or not fixed.reason:
        return ""
    return f"the bias of the processing could not be measured ({fixed.reason}): the intervals hold the noise only"
