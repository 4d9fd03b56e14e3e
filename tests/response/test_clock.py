"""Laws in which time runs: their clock is that of the record, though the first samples are no states."""

import numpy as np
import pytest

from sindyjoint import simulate
from sindyjoint.response import Instant, Part, along_motion, sum_law
from sindyjoint.states import force_states
from tests.conftest import effects_named


@pytest.fixture(scope="module")
def states():
    campaign = simulate(drive="displacement", frequencies=[3.0], levels=[0.8], duration=3.0, random_state=1)
    return force_states(campaign.runs[0], "broadband")


def test_time_runs_from_the_first_sample_along_which_internal_states_are_brought(states):
    early = states.lead[0].size
    assert states.time[0] > 0 and early > 0
    clock = Instant.of(states)
    assert clock.runs and clock.time + early / states.sample_rate == pytest.approx(states.time[0])


def test_a_stiffness_that_drifts_is_simulated_at_the_time_of_the_record(states):
    (drift,) = effects_named("stiffness_drift")
    law = sum_law([Part(drift.variants[0], np.empty(0), np.array([250.0]))], instant=Instant.of(states))
    moment, _ = along_motion(law, states, states.sample_rate)
    exact = 250.0 * states.time * states.angle
    assert moment == pytest.approx(exact, abs=1e-9 * np.abs(exact).max())
