"""Terms are chosen on states as measured, then on states completed by the model found, until they stay the same."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np

from sindyjoint.discovery.delay import ChannelDelay, columns_of, law_coefficients, shifted
from sindyjoint.discovery.large.segments import SampleCount
from sindyjoint.discovery.regression import TermRegression
from sindyjoint.equation.calibration import widened
from sindyjoint.equation.model import INERTIA, Fitted, JointModel
from sindyjoint.errors import InputError
from sindyjoint.record import Campaign
from sindyjoint.states import ForceStates, moment_floor, regression_rows

# Rounds of completion and choice, at most, and the change in standard errors below which coefficients stay the same.
ROUNDS, STAYS = 6, 0.1


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
    counts: Sequence[SampleCount],
    say: Callable[[str], None],
) -> TermSearch:
    """Choose the terms again on states completed by the model that was found, until they stay the same."""
    from sindyjoint.response.completion import completed_states

    found = first
    for _ in range(ROUNDS):
        if not found.model.terms:
            return first
        try:
            states = completed_states(found.model, campaign.identification_runs, first.states)
        except InputError:
            return found
        if not any(state.completed for state in states):
            return found
        say("selecting terms with what the processing cuts off the motion")
        fitted = first.regressor.again()
        fitted.fit(**regression_rows(states, campaign.joint.inertia).fit_arguments())
        before, found = found, TermSearch(fitted, campaign_model(fitted, campaign, states, counts), states)
        if _stays(before.model, found.model):
            break
    return found


def _stays(before: JointModel, after: JointModel) -> bool:
    if before.ids != after.ids:
        return False
    return bool(np.all(np.abs(after.coefficients - before.coefficients) < STAYS * after.standard_errors))


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
        noise_floor=moment_floor(states, inertia or 0.0).moment,
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
