"""A joint that sticks does not travel with the noise of its rate; a slow motion beyond the noise is kept."""

import numpy as np
import pytest

from sindyjoint.record import Run
from sindyjoint.states import force_states
from sindyjoint.states.mask import without_noise_travel

RATE, NOISE = 500.0, 0.003


def held_states(creep=0.0, noise=NOISE):
    """Half a period of motion, two seconds in which it is held (creeping there and back), and half a period more."""
    moving = np.arange(250) / RATE
    there = 0.5 - 0.5 * np.cos(2 * np.pi * moving)
    held = 1.0 + creep * np.sin(np.pi * np.arange(1000) / 1000)
    angle = np.concatenate([np.zeros(100), there, held, there[::-1], np.zeros(100)])
    angle = angle + noise * np.random.default_rng(3).standard_normal(angle.size)
    return force_states(Run("held", angle.copy(), angle, RATE), "broadband", 60.0)


def travel(rate):
    return float(np.sum(np.abs(rate))) / RATE


def test_noise_does_not_travel_while_the_joint_is_held():
    states = held_states()
    angle, rate = without_noise_travel(states, states.angle, states.rate, 1 / RATE)
    held = (states.time > 0.8) & (states.time < 2.6)
    assert travel(states.rate[held]) > 0.3
    assert travel(rate[held]) < 0.02
    assert np.max(np.abs(angle - states.angle)) < 3 * NOISE


def test_a_slow_motion_that_stands_out_of_the_noise_of_the_angle_is_kept():
    states = held_states(creep=0.1)
    angle, rate = without_noise_travel(states, states.angle, states.rate, 1 / RATE)
    held = (states.time > 0.7) & (states.time < 2.7)
    assert travel(rate[held]) == pytest.approx(0.2, abs=0.02)
    assert np.max(np.abs(angle - states.angle)) < 3 * NOISE


def test_a_motion_without_noise_stays_as_it_is():
    states = held_states(creep=0.1, noise=0.0)
    angle, rate = without_noise_travel(states, states.angle, states.rate, 1 / RATE)
    np.testing.assert_allclose(angle, states.angle, atol=1e-5)
    np.testing.assert_allclose(rate, states.rate, atol=2e-3)
