"""Terms are chosen on states as measured, then on states completed by the model found, until they stay the same."""

from collections.abc import Callable, Collection, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import ArrayLike

from sindyjoint.discovery import fit_columns
from sindyjoint.discovery.delay import ChannelDelay, columns_of, law_coefficients, shifted
from sindyjoint.discovery.regression import TermRegression
from sindyjoint.equation.calibration import widened
from sindyjoint.equation.model import INERTIA, Fitted, JointModel, ModelTerm
from sindyjoint.equation.parsing import variable_symbols
from sindyjoint.errors import InputError
from sindyjoint.judgement.verdict import leaves_noise
from sindyjoint.limits import DISCOVERY, JUDGEMENT
from sindyjoint.numeric import Array
from sindyjoint.paper import TERMS as PAPER_TERMS
from sindyjoint.record import Campaign
from sindyjoint.states import ForceStates, moment_floor, regression_rows
from sindyjoint.text import quantities


@dataclass(frozen=True, eq=False)
class TermSearch:
    """What a search for terms came to.

    Parameters
    ----------
    regressor : TermRegression
    model : JointModel
    states : tuple of ForceStates
        As given, or completed by the model.
    """

    regressor: TermRegression
    model: JointModel
    states: tuple[ForceStates, ...]


def search_completed(
    first: TermSearch,
    campaign: Campaign,
    say: Callable[[str], None],
) -> TermSearch:
    """Choose the terms again on states completed by the model that was found, until they stay the same.

    States as measured have rounded corners, and terms that stand for these keep them in what they complete. Where
    more than the paper's terms were found, or too little, the search starts once more from the paper's law, which
    rounds nothing; of the two what predicts groups of runs better that were left out.
    """
    found = _completed_from(first.model, first, campaign, say)
    expected = {*PAPER_TERMS, INERTIA}
    if found is first or (leaves_noise(found.model) and expected.issuperset(found.model.ids)):
        return found
    law = regressed_with(_allowed(first, expected), first, campaign).model
    other = _completed_from(law, first, campaign, say)
    return min(found, other, key=error_left_out)


def search_response(found: TermSearch, campaign: Campaign, say: Callable[[str], None]) -> TermSearch:
    """Choose the terms of a free motion once more, and fit them, on its simulated response.

    What dissipates little is lost in the noise of an acceleration, and shows in every cycle of the motion. Fitted
    together are the paper's terms, and these with those found; what does not stand out of its error goes, the least
    sure first. A term more must be worth what one must stand out. As found where the simulation leaves clearly more
    than the noise: the law then lacks something, which other terms would stand in for.
    """
    paper = _allowed(found, {*PAPER_TERMS})
    starts = [paper] if paper.issuperset(found.model.ids) else [paper, paper | {*found.model.ids}]
    ends = [_on_response(terms, found, campaign, say) for terms in starts]
    samples = sum(state.n_samples for state in found.states)
    ends = [(end, misfit) for end, misfit in ends if misfit <= JUDGEMENT.clearly**2 * samples]
    if not ends:
        return found
    price = JUDGEMENT.significant**2 * min(misfit for _, misfit in ends) / samples
    return min(ends, key=lambda each: each[1] + price * len(each[0].model.terms))[0]


def _allowed(found: TermSearch, expected: set[str]) -> set[str]:
    """Return those of some terms that a search may have, and all that it must have."""
    regressor = found.regressor
    candidates = {term.id for term in regressor.terms_}
    return {*regressor.forced} | (candidates & expected - {*regressor.forbidden})


def _on_response(
    terms: Collection[str],
    found: TermSearch,
    campaign: Campaign,
    say: Callable[[str], None],
) -> tuple[TermSearch, float]:
    """Return the surely known of some terms as the response has them, and its misfit; infinite if it has none."""
    from sindyjoint.response.refinement import refine

    terms, less = {*terms}, list[tuple[JointModel, float]]()
    while terms:
        trial = regressed_with(terms, found, campaign)
        say("fitting the simulated response")
        result = refine(trial.model, campaign, states=found.states)
        if not result.refined:
            break
        forced = found.regressor.forced
        sure = {t.id: _sureness(t) for t in result.model.terms if t.id not in forced}
        weakest = min(sure, key=sure.__getitem__, default="")
        if not weakest or sure[weakest] >= JUDGEMENT.significant:
            model = result.model
            for fuller, sureness in less:
                beside = [fuller[name].coefficient for name in model.ids]
                model = widened(model, _omission(model, beside, sureness))
            return replace(trial, model=model), result.misfit
        if weakest in PAPER_TERMS:
            left_out = result.model[weakest]
            less.append((result.model, abs(left_out.coefficient) / left_out.standard_error))
        terms.discard(weakest)
    return found, np.inf


def with_omissions(found: TermSearch) -> TermSearch:
    """Return a search whose model's covariance holds what leaving out the inertia or a term of the paper does."""
    return replace(found, model=widened(found.model, _omissions(found)))


def _omissions(found: TermSearch) -> Array:
    """Return the covariance that the inertia and the paper's terms make which were left out.

    What does not stand out is left out, though nearly every joint has it, and the others make up for it. Its size is
    counted as far as it is not that of its own error.
    """
    model, evidence = found.model, found.regressor.evidence_
    fitted = [place for place, name in enumerate(model.ids) if name in evidence.ids]
    columns = [evidence.ids.index(model.ids[place]) for place in fitted]
    without, total = {*model.ids, *found.regressor.forbidden}, np.zeros((len(model.ids),) * 2)
    expected = (INERTIA, *PAPER_TERMS)
    for name in (each for each in expected if each in evidence.ids and each not in without):
        fuller = fit_columns(evidence, [*columns, evidence.ids.index(name)])
        beside = model.coefficients
        beside[fitted] = fuller.coefficients[:-1]
        total += _omission(model, beside, fuller.t_ratios[-1])
    return total


def on_response(found: TermSearch, campaign: Campaign, say: Callable[[str], None]) -> TermSearch:
    """Return a search whose numbers are fitted to the simulated response, where no run repeats.

    As found where moment or simulation leave clearly more than noise; :func:`search_response` has fitted free motions.
    """
    from sindyjoint.response.refinement import refine, told_by_response

    if campaign.moves_freely or not (leaves_noise(found.model) and told_by_response(found.states)):
        return found
    say("fitting the simulated response")
    result = refine(found.model, campaign, states=found.states)
    if not result.refined or result.misfit > JUDGEMENT.clearly**2 * result.residual.size:
        return found
    return replace(found, model=widened(result.model, _omissions(found)))


def _omission(model: JointModel, fuller: ArrayLike, sureness: float) -> Array:
    """Return the covariance that a term left out makes, from the coefficients beside it and how sure it was."""
    move = np.asarray(fuller) - model.coefficients
    return np.outer(move, move) * (1 - 1 / max(sureness, 1.0) ** 2)


def _sureness(term: ModelTerm) -> float:
    """Return how many standard errors a coefficient is from zero; none of an elastic moment within the accuracy.

    Sensors are not so linear, clocks not so even; neither gives off energy.
    """
    dissipates = variable_symbols()[1] in term.expression.free_symbols
    if not dissipates and term.unique_share < DISCOVERY.accuracy:
        return 0.0
    return abs(term.coefficient) / term.standard_error


def regressed_with(terms: Collection[str], found: TermSearch, campaign: Campaign) -> TermSearch:
    """Return what a regression of some terms comes to on the states of a search."""
    fitted = found.regressor.again()
    fitted.forced = tuple(terms)
    others = {*found.regressor.forbidden, *(term.id for term in found.regressor.terms_)}
    fitted.forbidden = tuple(others - {*terms})
    return searched(fitted, campaign, found.states)


def searched(regressor: TermRegression, campaign: Campaign, states: tuple[ForceStates, ...]) -> TermSearch:
    """Return what a regressor, which is fitted here, finds in states."""
    regressor.fit(**regression_rows(states, campaign.joint.inertia).fit_arguments())
    return TermSearch(regressor, campaign_model(regressor, campaign, states), states)


def error_left_out(found: TermSearch) -> float:
    """Return the root of the mean squared error of groups of runs left out, N·m; NaN with one group."""
    step = found.regressor.selection_result_.step
    return float("inf") if step is None else step.held_out_rms


def may_lack_inertia(found: TermSearch, campaign: Campaign, lag: float) -> bool:
    """Return whether a law may have a term, or a delay ``lag``, s, in the place of an error of the inertia."""
    own = {*found.model.ids} <= {*PAPER_TERMS} and leaves_noise(found.model)
    driven = not (campaign.moves_freely or campaign.quasi_static)
    return driven and bool(found.model.terms) and (lag != 0 or not own)


def denies_inertia(freed: TermSearch, plain: TermSearch, declared: float, lag: float) -> bool:
    """Return whether the runs give another inertia than is declared, with which the law is simpler, or predicts better.

    A declared inertia is known: noise alone must be left, and what the law has instead must not be as likely.
    """
    if INERTIA not in freed.model or not leaves_noise(freed.model):
        return False
    found = freed.model[INERTIA]
    # A stiffness that rises with the frequency is a negative one.
    if (
        found.coefficient <= 0
        or abs(found.coefficient - declared) < JUDGEMENT.significant * found.standard_error
    ):
        return False
    fewer = len(plain.model.terms) + (lag != 0) - len(freed.model.terms)
    better = error_left_out(freed) < error_left_out(plain)
    return fewer > 0 or not leaves_noise(plain.model) or (fewer == 0 and better)


def inertia_notes(campaign: Campaign, model: JointModel) -> list[str]:
    """Return a warning where a law was found with another inertia than the campaign declares."""
    declared = campaign.joint.inertia
    if declared is None or INERTIA not in model:
        return []
    term, name = model[INERTIA], quantities(model.joint.motion).inertia.lower()
    return [
        f"the declared {name} of {declared:g} {term.unit} is not that of these runs: they give {term.coefficient:.4g} "
        f"± {term.standard_error:.1g} {term.unit}, with which the law needs less; that is used; check what moves "
        "between sensor and joint, and whether a stiffness depends on the frequency (diagnose)"
    ]


def _completed_from(
    law: JointModel,
    first: TermSearch,
    campaign: Campaign,
    say: Callable[[str], None],
) -> TermSearch:
    """Return what states come to that are completed by a law, and by what is found on them, in turn."""
    from sindyjoint.response.completion import completed_states

    found, step = first, None
    # Rounds of completion and choice, until no coefficient changes by a tenth of its standard error.
    for _ in range(6):
        if not law.terms:
            return first
        try:
            states = completed_states(law, campaign.identification_runs, first.states)
        except InputError:
            return found
        if not any(state.completed for state in states):
            return found
        say("selecting terms with what the processing cuts off the motion")
        found = searched(first.regressor.again(), campaign, states)
        if law.ids != found.model.ids:
            law, step = found.model, None
            continue
        errors, last = found.model.standard_errors, step
        step = (found.model.coefficients - law.coefficients) / errors
        if np.all(np.abs(step) < 0.1):
            break
        law = found.model
        if last is not None and 0 < (ratio := float(step @ last / (last @ last))) < 1:
            # The steps shrink geometrically: what all that are still to come add up to.
            law, step = law.with_numbers(law.coefficients + ratio / (1 - ratio) * step * errors), None
    return found


def with_delay_uncertainty(found: TermSearch, delay: ChannelDelay) -> JointModel:
    """Return the model of states from which a delay was removed, its covariance with what that delay is unsure by."""
    by_id = {term.id: term for term in found.regressor.terms_}
    columns, inertia = columns_of([by_id[name] for name in found.model.ids]), found.model.joint.inertia
    late = [shifted(each, delay.standard_error) for each in found.states]
    move = np.subtract(*(law_coefficients(states, columns, inertia) for states in (late, found.states)))
    return widened(found.model, np.outer(move, move))


def campaign_model(
    regressor: TermRegression,
    campaign: Campaign,
    states: Sequence[ForceStates],
    counts: tuple[int, int] | None = None,
) -> JointModel:
    """Return the regressor's model with the joint and the data it came from; counted are the samples of the states."""
    model = regressor.model_
    inertia = campaign.joint.inertia
    if inertia is None and INERTIA in model:
        inertia = model[INERTIA].coefficient
    every = sum(each.n_samples for each in states)
    moving, samples = counts or (sum(int(np.count_nonzero(each.moving)) for each in states), every)
    fitted = Fitted(
        moment_rms=model.fitted.moment_rms,
        residual_rms=model.fitted.residual_rms,
        noise_floor=moment_floor(states, inertia or 0.0).moment,
        moving_fraction=moving / samples,
        samples=moving,
        runs=len(states),
        angle=model.fitted.angle,
        rate=model.fitted.rate,
        frequencies=tuple(sorted({round(s.frequency, 6) for s in states if s.frequency is not None})),
        simulated=campaign.simulated,
        mean_known=campaign.mean_known,
        quasi_static=campaign.quasi_static,
    )
    return replace(model, joint=campaign.joint, fitted=fitted)
