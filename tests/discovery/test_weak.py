"""The weak form: pysindy's test functions on moving segments of force states."""

import numpy as np
import pysindy
import pytest

from sindyjoint import simulate
from sindyjoint.discovery.library import integral_weights, weak_evidence
from sindyjoint.discovery.uncertainty import find
from sindyjoint.errors import InputError, MissingExtraError
from sindyjoint.paper import TERMS as PAPER
from tests.discovery.conftest import TRUTH


def test_integrals_of_a_derivative_are_those_by_parts():
    time = 1e-3 * np.arange(200)
    weights, slopes = integral_weights(200, 1e-3)
    # φ vanishes at both ends: ∫φ·(t³)′ dt = −∫φ′·t³ dt. Both are exact for what is linear between samples; a cubic is
    # so within h²/12 of its curvature.
    np.testing.assert_allclose(slopes @ time**3, weights @ (3 * time**2), rtol=1e-3)
    assert np.all(weights >= 0) and np.all(weights.sum(axis=1) > 0)


def test_places_of_test_functions_are_seeded_and_the_global_generator_is_left_alone():
    np.random.seed(3)
    expected = np.random.uniform()
    np.random.seed(3)
    first, again, other = (
        integral_weights(60, 1e-3),
        integral_weights(60, 1e-3),
        integral_weights(60, 1e-3, seed=1),
    )
    assert np.random.uniform() == expected
    assert np.array_equal(first[0], again[0]) and not np.array_equal(first[0], other[0])


def test_it_finds_the_law_without_an_acceleration(found, inter_panel):
    regressor = found.regressor
    evidence = weak_evidence(regressor.terms_, found.states, inter_panel.joint.inertia)
    weak = find(evidence, significance=regressor.significance, least_share=regressor.least_share_)
    assert set(weak.law) == set(PAPER)
    # At 1 % noise; the quadratic stiffness carries the least.
    np.testing.assert_allclose([weak.law[name] for name in PAPER], TRUTH, rtol=0.05)


def test_an_unknown_inertia_is_a_term_whose_integral_is_taken_by_parts():
    from dataclasses import replace

    from sindyjoint import discover

    plan = dict(frequencies=[3, 6], levels=[0.9, 0.5], duration=4.0, noise=0.001, random_state=0)
    campaign = simulate("inter-panel", **plan)
    found = discover(replace(campaign, joint=replace(campaign.joint, inertia=None)), correct=False)
    spoilt = [replace(state, acceleration=np.zeros_like(state.acceleration)) for state in found.states]
    terms = found.regressor.terms_
    evidence = weak_evidence(terms, found.states, None)
    np.testing.assert_array_equal(
        evidence.pooled.triangle, weak_evidence(terms, spoilt, None).pooled.triangle
    )


def test_a_run_of_short_segments_is_one_line(found):
    from dataclasses import replace

    state = found.states[0]
    gaps = replace(state, moving=state.moving & (np.arange(state.moving.size) % 14 != 0))
    with pytest.raises(InputError, match="no segment of 16 samples in which the joint moves one way"):
        weak_evidence(found.regressor.terms_, [gaps, *found.states[1:]], 0.02)


def test_without_a_weak_library_is_one_line(monkeypatch):
    monkeypatch.delattr(pysindy, "WeakPDELibrary")
    with pytest.raises(MissingExtraError, match="which pysindy 2.* does not have; leave 'weak' out"):
        integral_weights(50, 1e-3)
