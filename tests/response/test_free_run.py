"""A run simulated without restart, from a state that its first samples tell."""

from dataclasses import replace

import numpy as np
import pytest

from sindyjoint.errors import InputError
from sindyjoint.mechanics import FunctionLaw, PaperLaw, SumLaw, sampled, simulate, transfer_moment
from sindyjoint.numeric import rms
from sindyjoint.record import Run
from sindyjoint.response import simulate_run
from sindyjoint.states import force_states

RATE = 500.0
SPRING = PaperLaw(k1=400.0, c1=0.3, inertia=0.02)
SLIDE = PaperLaw(k1=0.0, c1=3.0, inertia=0.02)


def dahl(theta, omega, direction, state, p, out):
    """A friction that yields over p[1]."""
    out[0] = p[0] * state[0]
    out[1] = omega / p[1] - abs(omega) / p[1] * state[0]


HYSTERETIC = SumLaw(SPRING, FunctionLaw(dahl, (6.0, 0.004), 1))


def clock(theta, omega, direction, state, p, out):
    """A moment that grows with time."""
    out[0] = p[0] * state[0]
    out[1] = 1.0


def run_of(law, noise=0.0, seed=0, seconds=12.0, level=8.0):
    """A run that begins in the middle of a motion."""
    lines = np.arange(1, 40) * 0.37
    phases = np.random.default_rng(seed).uniform(0, 2 * np.pi, lines.size)
    time = np.arange(0, seconds + 4.0, 1 / RATE)
    values = np.cos(2 * np.pi * np.outer(time, lines) + phases).sum(axis=1)
    drive = sampled(level * values / np.abs(values).max(), RATE)
    motion = simulate(law, drive, seconds + 4.0, RATE, limits=None)
    kept = slice(int(4.0 * RATE), None)
    generator = np.random.default_rng(seed)
    angle, moment = motion.angle[kept], motion.moment[kept]
    scatter = noise * np.std(angle) * generator.standard_normal(angle.size)
    return Run("one", moment, angle + scatter, RATE)


def free(law, run, samples):
    return simulate_run(law, run, force_states(run, "broadband"), free_run=samples)


@pytest.mark.parametrize("law", [SPRING, SLIDE, HYSTERETIC], ids=["spring", "slide", "hysteretic"])
def test_the_true_law_follows_a_run_to_its_end(law):
    found = free(law, run_of(law), 600)
    assert found.drive == "free run" and found.time[0] == pytest.approx(600 / RATE)
    assert found.response_nrmse < 0.003


@pytest.mark.parametrize("law", [SPRING, SLIDE], ids=["spring", "slide"])
def test_noise_of_the_angle_stays_noise(law):
    """A rate that is off by its own noise would let a slide drift away."""
    found = free(law, run_of(law, noise=0.01), 600)
    assert found.response_nrmse == pytest.approx(0.01, rel=0.15)


def test_internal_states_settle_first():
    run = run_of(HYSTERETIC, level=4.0)
    # A friction at rest that the run does not begin with stays for good where little slips.
    at_once = simulate_run(HYSTERETIC, run, force_states(run, "broadband"), drive="moment")
    settled = free(HYSTERETIC, run, 600)
    late = settled.time[0] - at_once.time[0]
    rest = slice(round(late * RATE), None)
    assert settled.response_nrmse < 0.5 * rms((at_once.simulated_angle - at_once.angle)[rest]) / np.std(
        run.angle
    )


@pytest.mark.parametrize("samples", [20, 100])
def test_a_swing_that_begins_at_a_turning_point_starts_at_rest(samples):
    """A line through the first eighth of its cycle is steeper than its whole decay by RMS; there it stands still."""
    law = PaperLaw(k1=40.0, c1=0.02, inertia=0.02)
    motion = simulate(law, sampled(np.zeros(3000), RATE), 6.0, RATE, initial=(0.03, 0.0), limits=None)
    found = free(law, Run("swing", np.zeros(3000), motion.angle, RATE), samples)
    assert found.drive == "free run" and found.response_nrmse < 1e-4


def test_a_wrong_law_is_told_by_it():
    run = run_of(SPRING)
    wrong = free(replace(SPRING, k1=1.02 * SPRING.k1), run, 600)
    assert wrong.response_nrmse > 5 * free(SPRING, run, 600).response_nrmse


def test_without_inertia_the_moment_is_compared():
    law = replace(SPRING, inertia=0.0)
    run = run_of(SPRING)
    moment, _ = transfer_moment(law, run.angle, np.gradient(run.angle, 1 / RATE), RATE)
    found = free(law, replace(run, moment=moment), 600)
    assert found.drive == "motion" and found.response_nrmse < 0.02
    assert found.measured_response.size == found.simulated_moment.size


@pytest.mark.parametrize("samples", [0, 3, 5999, 100_000])
def test_too_few_samples_or_too_many_are_refused(samples):
    with pytest.raises(InputError, match=rf"run 'one': free_run is {samples} samples; expected \d+ to \d+"):
        free(SPRING, run_of(SPRING), samples)


def test_the_approach_to_the_first_angle_does_not_advance_a_clock():
    law = SumLaw(HYSTERETIC, FunctionLaw(clock, (1.0,), 1))
    time = np.arange(400) / RATE
    angle, rate = 0.02 * np.cos(6 * time), -0.12 * np.sin(6 * time)
    _, states = transfer_moment(law, angle, rate, RATE)
    assert states[0, 0] != 0.0
    np.testing.assert_allclose(states[1], time, atol=1e-12)
