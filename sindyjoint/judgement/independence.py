"""Whether a joint's coefficients are the same at every excitation frequency."""

from __future__ import annotations

from collections.abc import Sequence

from sindyjoint.discovery.frequency import FrequencyTest, GroupEstimates, frequency_test, group_estimates
from sindyjoint.discovery.policy import POLICY as DISCOVERY
from sindyjoint.judgement.discovery import Discovery
from sindyjoint.states import ForceStates
from sindyjoint.states.rows import group_labels


def frequency_tests(
    discovery: Discovery, margin: float = DISCOVERY.frequency_margin
) -> tuple[FrequencyTest, ...]:
    """Test every term of a discovered model.

    Parameters
    ----------
    discovery : Discovery
        Of a campaign with three or more excitation frequencies; otherwise nothing is returned.
    margin : float
        Relative change over the band that would not matter.
    """
    frequency = frequency_of_groups(discovery.states)
    if len(set(frequency.values())) < 3 or not discovery.model.terms:
        return ()
    found = estimates_by_group(discovery)
    values, errors = found.coefficients, found.standard_errors
    hertz = [frequency[group] for group in found.groups]
    return tuple(
        frequency_test(term, hertz, values[:, i], errors[:, i], found.degrees, margin)
        for i, term in enumerate(found.ids)
    )


def estimates_by_group(discovery: Discovery) -> GroupEstimates:
    """Return fits of the model's terms to each single group."""
    evidence = discovery.regressor.evidence_
    columns = [evidence.ids.index(term) for term in discovery.model.ids if term in evidence.ids]
    return group_estimates(evidence, columns)


def frequency_of_groups(states: Sequence[ForceStates]) -> dict[str, float]:
    """Return the excitation frequency of each group, Hz; empty where runs have none."""
    if any(state.frequency is None for state in states):
        return {}
    return {
        label: float(state.frequency or 0.0)
        for label, state in zip(group_labels(states), states, strict=True)
    }
