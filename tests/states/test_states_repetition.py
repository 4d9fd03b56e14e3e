"""Runs that repeat without being sinusoids: the period is found, averaged, and nothing else is taken for one."""

import numpy as np
import pytest

from sindyjoint.record import Run
from sindyjoint.states import force_states
from sindyjoint.states.repetition import mean_period, repetition

RATE = 500.0


def multisine(periods, noise=0.0, samples=1000, seed=0):
    """An angle of 20 tones and its acceleration as the moment; the period is ``samples`` long."""
    generator = np.random.default_rng(seed)
    time = np.arange(samples * periods) / RATE
    lines = np.arange(1, 21)
    phases = generator.uniform(0, 2 * np.pi, lines.size)
    w = 2 * np.pi * lines * RATE / samples
    angle = 1e-3 * np.sum(np.cos(np.outer(time, w) + phases), axis=1)
    moment = np.sum(-1e-3 * w**2 * np.cos(np.outer(time, w) + phases), axis=1)
    angle = angle + noise * np.std(angle) * generator.standard_normal(time.size)
    moment = moment + noise * np.std(moment) * generator.standard_normal(time.size)
    return Run("multisine", moment, angle, RATE)


@pytest.mark.parametrize("noise", [0.0, 0.01, 0.05])
def test_the_period_of_a_multisine_is_found(noise):
    assert repetition(multisine(5, noise)) == 1000


def test_what_does_not_repeat_has_no_period():
    time = np.arange(5000) / RATE
    decay = np.exp(-time) * np.cos(2 * np.pi * 3 * time)
    sweep = np.sin(2 * np.pi * (1 + time) * time)
    noise = np.random.default_rng(0).standard_normal(5000)
    for angle in (decay, sweep, noise):
        assert repetition(Run("run", np.gradient(np.gradient(angle)), angle, RATE)) is None


@pytest.mark.parametrize("noise", [0.0, 0.003])
def test_lines_without_a_common_period_do_not_repeat_though_they_come_near(noise):
    """After 2.5 s they differ by a tenth, after five by a fifth: their mean period would jump where it closes."""
    time = np.arange(5000) / RATE
    rng = np.random.default_rng(1)
    angle = sum(np.sin(2 * np.pi * f * time) for f in (0.4 * 1.01, 1.2, 2.0, 3.2 * 1.002))
    angle = angle + noise * np.std(angle) * rng.standard_normal(time.size)
    near = np.std(angle[1250:] - angle[:-1250]) / np.std(angle) / np.sqrt(2)
    assert 0.02 < near < 0.15
    assert repetition(Run("run", angle.copy(), angle, RATE)) is None


def test_two_periods_are_too_few_and_a_rest_that_is_lost_is_too_much():
    assert repetition(multisine(2)) is None
    whole = multisine(4)
    cut = Run("cut", whole.moment[:3700], whole.angle[:3700], RATE)
    assert repetition(cut) is None


def test_the_transient_is_left_out_and_noise_averages():
    clean, noisy = multisine(9), multisine(9, 0.05)
    disturbed = noisy.angle.copy()
    disturbed[:1000] += 2e-3 * np.exp(-np.arange(1000) / 200)
    mean, first = mean_period(Run("run", noisy.moment, disturbed, RATE), 1000)
    assert first == 1000
    left = mean.angle - clean.angle[:1000]
    # Eight periods: the noise falls by the square root of eight; five standard errors of an RMS over 1000 samples.
    assert np.std(left) == pytest.approx(0.05 * np.std(clean.angle) / np.sqrt(8), rel=5 / np.sqrt(2000))


def test_states_of_the_mean_period_follow_themselves_to_both_ends():
    run = multisine(5)
    states = force_states(run)
    assert states.repeated and states.n_samples == 1000
    # The kernel is cut at five standard deviations of its window: exp(-12.5) of its height.
    assert np.allclose(states.acceleration, run.moment[:1000], rtol=0, atol=5e-6 * np.std(run.moment))
