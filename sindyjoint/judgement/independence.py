"""Whether a joint's coefficients are the same at every excitation frequency."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from sindyjoint.bias.correction import Bias
from sindyjoint.bias.policy import POLICY as BIAS
from sindyjoint.discovery.frequency import FrequencyTest, GroupEstimates, frequency_test, group_estimates
from sindyjoint.discovery.policy import POLICY as DISCOVERY
from sindyjoint.judgement.discovery import Discovery
from sindyjoint.numeric import Array
from sindyjoint.states import ForceStates
from sindyjoint.states.rows import group_labels


def frequency_tests(
    discovery: Discovery, bias: Bias | None = None, margin: float = DISCOVERY.frequency_margin
) -> tuple[FrequencyTest, ...]:
    """Test every term of a discovered model.

    Parameters
    ----------
    discovery : Discovery
        Of a campaign with three or more excitation frequencies; otherwise nothing is returned.
    bias : Bias, optional
        Taken from each frequency's estimates, and a quarter of it added to their errors: a difference between
        frequencies that the processing causes is not the joint's.
    margin : float
        Relative change over the band that would not matter.
    """
    frequency = frequency_of_groups(discovery.states)
    if len(set(frequency.values())) < 3 or not discovery.model.terms:
        return ()
    found, values, errors = estimates_by_group(discovery, bias)
    hertz = [frequency[group] for group in found.groups]
    return tuple(
        frequency_test(term, hertz, values[:, i], errors[:, i], found.degrees, margin)
        for i, term in enumerate(found.ids)
    )


def estimates_by_group(discovery: Discovery, bias: Bias | None) -> tuple[GroupEstimates, Array, Array]:
    """Return fits of the model's terms to each single group, and their values and errors, less the known bias.

    Shape (groups, k). A quarter of the bias is added to the errors.
    """
    evidence = discovery.regressor.evidence_
    columns = [evidence.ids.index(term) for term in discovery.model.ids if term in evidence.ids]
    found = group_estimates(evidence, columns)
    values, variance = found.coefficients, found.standard_errors**2
    if bias is not None and bias.groups == found.groups:
        order = [bias.ids.index(term) for term in found.ids]
        shift = bias.by_group[:, order]
        values = values - shift
        variance = variance + bias.by_group_error[:, order] ** 2 + (BIAS.uncertain_share * shift) ** 2
    return found, values, np.sqrt(variance)


def frequency_of_groups(states: Sequence[ForceStates]) -> dict[str, float]:
    """Return the excitation frequency of each group, Hz; empty where runs have none."""
    if any(state.frequency is None for state in states):
        return {}
    return {
        label: float(state.frequency or 0.0)
        for label, state in zip(group_labels(states), states, strict=True)
    }
