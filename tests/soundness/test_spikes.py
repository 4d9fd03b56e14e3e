"""What is a spike, and what is a joint that jumps within a sample."""

import numpy as np
import pytest

from sindyjoint import Campaign, Joint, Run
from tests.soundness.faults import findings_of

RATE = 1000.0
TIME = np.arange(0, 4, 1 / RATE)
ANGLE = 1e-3 * np.sin(2 * np.pi * 3 * TIME + 0.1)
INWARDS = [130, 300, 630, 960, 1470]  # samples after a crest


def spikes_of(run):
    found = findings_of(Campaign(Joint(inertia=0.0), (run,)))
    return [(f.id, f.channel) for f in found if f.id == "spikes"]


def spiked(at, values):
    angle = ANGLE + 1e-6 * np.random.default_rng(1).standard_normal(TIME.size)
    angle[at] = values
    return spikes_of(Run("run", 100 * ANGLE, angle, RATE, frequency=3.0))


def test_a_joint_that_jumps_back_and_forth_on_its_way_in_has_no_spikes():
    assert spiked(INWARDS, -0.9 * ANGLE[INWARDS]) == []


@pytest.mark.parametrize(
    ("at", "values"),
    [
        (INWARDS, 0.0 * ANGLE[INWARDS]),  # dropouts end at one value
        (INWARDS, -3.0 * ANGLE[INWARDS]),  # beyond the range of the motion
        (INWARDS[:1], -ANGLE[INWARDS[:1]]),  # one alone
        ([130, 570, 300, 720], -ANGLE[[130, 570, 300, 720]]),  # whichever way the joint goes
    ],
)
def test_what_knows_nothing_of_the_motion_is_a_spike(at, values):
    assert spiked(at, values) == [("spikes", "angle")]


@pytest.mark.parametrize(("stops", "ids"), [(True, []), (False, [("spikes", "moment")])])
def test_a_blow_that_stops_the_motion_is_no_spike(stops, ids):
    angle = np.minimum(TIME, 2.0) if stops else TIME
    noise = np.random.default_rng(1).standard_normal((2, TIME.size))
    moment = np.sin(TIME) + 0.01 * noise[0]
    moment[2000] += 4
    assert spikes_of(Run("run", moment, angle + 1e-5 * noise[1], RATE)) == ids


def test_the_crests_of_a_motion_that_soon_dies_out_are_no_spikes():
    angle = np.exp(-40 * TIME) * np.cos(2 * np.pi * 50 * TIME)
    noise = 1e-3 * np.random.default_rng(1).standard_normal(TIME.size)
    assert spikes_of(Run("run", 0 * TIME, angle + noise, RATE)) == []
    assert spikes_of(Run("run", 0 * TIME, angle + noise + (TIME == 1.5), RATE)) == [("spikes", "angle")]
