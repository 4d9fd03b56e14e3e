"""A stiffness that changes in time: seen, cut into segments, named, and told from channels that drift."""

from dataclasses import replace

import numpy as np
import pytest

from sindyjoint import diagnose
from sindyjoint.diagnosis import FittedEffect, effect_law, load_effects, select_effects
from sindyjoint.diagnosis.campaign.change import changes, segments, steady_before
from sindyjoint.diagnosis.effects.fitted import Instant
from sindyjoint.record import Run
from sindyjoint.states import force_states
from tests.diagnosis.hidden_effects import hide

RATE, FREQUENCY, DURATION = 1000.0, 4.0, 8.0


def drifting_run(growth=0.1, ramp=0.0, noise=0.01, seed=0):
    """M = k(t)·θ + c·θ̇, k = 6000·(1 + growth·(t/T − ½)), under a prescribed sinusoid; the moment's zero may move."""
    rng = np.random.default_rng(seed)
    time = np.arange(0, DURATION, 1 / RATE)
    w = 2 * np.pi * FREQUENCY
    angle, rate = 1e-3 * np.sin(w * time + 0.3), 1e-3 * w * np.cos(w * time + 0.3)
    moment = 6000 * (1 + growth * (time / DURATION - 0.5)) * angle + 40 * rate + ramp * time / DURATION
    spread = (np.std(moment), np.std(angle))
    moment, angle = (
        x + noise * s * rng.standard_normal(time.size) for x, s in zip((moment, angle), spread, strict=True)
    )
    return Run("drifting", moment, angle, RATE, frequency=FREQUENCY)


@pytest.mark.parametrize(
    "growth, ramp, seen", [(0.0, 0.0, False), (0.02, 0.0, True), (0.1, 0.0, True), (0.0, 2.0, False)]
)
def test_a_change_of_stiffness_is_seen_and_a_drift_of_the_zero_is_none(growth, ramp, seen):
    """Noise of 1 % leaves the stiffness of a quarter run uncertain by 0.05 %; the ramp is half the moment's RMS."""
    for seed in range(5):
        run = drifting_run(growth, ramp, seed=seed)
        assert changes([run], [force_states(run)]) is seen


def test_segments_repeat_at_the_stiffness_of_their_middle():
    run = drifting_run(growth=0.2)
    parts = segments(run, force_states(run))
    assert len(parts) == 4 and len({part.run.name for part in parts}) == 4
    for part in parts:
        s = part.states
        column = np.column_stack([s.angle, s.rate, np.ones(s.n_samples)])
        stiffness = np.linalg.lstsq(column, s.moment, rcond=None)[0][0]
        # 2000 samples of 1 % noise: 0.03 % each; the trend within a segment is ±2.5 %.
        expected = 6000 * (1 + 0.2 * (np.mean(s.time) / DURATION - 0.5))
        assert stiffness == pytest.approx(expected, rel=2e-3)
        # What is left is the 1 % of noise, not the trend.
        assert s.noise.moment == pytest.approx(0.01 * np.std(run.moment), rel=0.15)


def driven_run(stiffness, swing, seed=0):
    """A linear joint whose stiffness (N·m/rad) and swing (1) are functions of time, under a sinusoidal moment."""
    rng = np.random.default_rng(seed)
    time = np.arange(0, DURATION, 1 / RATE)
    moment = 6 * swing(time) * np.sin(2 * np.pi * FREQUENCY * time)
    angle = moment / stiffness(time)
    noisy = [x + 0.01 * np.std(x) * rng.standard_normal(x.size) for x in (moment, angle)]
    return Run("driven", *noisy, RATE, frequency=FREQUENCY)


@pytest.mark.parametrize("seed", range(3))
def test_a_jump_within_a_run_is_no_start_up(seed):
    """A moment moves a joint further once it is softer; only what comes after the jump looks steady."""
    run = driven_run(lambda t: np.where(t < 3.6, 6000.0, 5500.0), np.ones_like, seed)
    states = force_states(run)
    assert states.dropped >= 3.5
    early = steady_before(run, states)
    assert early is not None and early.time[-1] < 3.6
    assert changes([run], [states])
    parts = segments(run, states)
    found = [np.std(p.states.moment) / np.std(p.states.angle) for p in parts]
    assert len(parts) == 4 and len({p.run.name for p in parts}) == 4
    assert found == pytest.approx([6000, 6000, 5500, 5500], rel=5e-3)


def test_a_long_start_up_is_no_jump():
    """A swing that dies down for half the run, at one and the same stiffness."""
    run = driven_run(lambda t: 6000.0 + 0 * t, lambda t: 1 + 0.5 * np.exp(-t / 1.5))
    states = force_states(run)
    assert states.dropped >= 2.5
    assert steady_before(run, states) is None and not changes([run], [states])


def test_a_short_run_stays_whole():
    run = drifting_run(growth=0.2)
    short = replace(run, moment=run.moment[:2000], angle=run.angle[:2000])
    assert len(segments(short, force_states(short))) == 1


@pytest.mark.parametrize("variant, began", [(0, 0.0), (1, 24.0)])
def test_the_law_of_a_drift_knows_the_time(variant, began):
    """At rest M = k_t·t·θ; where time runs, the clock adds to the instant at which the simulation began."""
    effect = select_effects(load_effects(), ["stiffness_drift"])[0]
    fitted = FittedEffect(effect, effect.variants[variant], np.empty(0), np.array([50.0]), 0.0)
    still = effect_law([fitted], 4.0, Instant(3.0, began))
    assert still.moment([1e-3], [0.0], [1.0])[0] == pytest.approx(50.0 * (3.0 + began) * 1e-3)
    running = effect_law([fitted], 4.0, Instant(3.0, began, True))
    state = np.array([[2.0]])
    assert running.moment([1e-3], [0.0], [1.0], state)[0] == pytest.approx(50.0 * (5.0 + began) * 1e-3)
    assert running.state_rate([1e-3], [0.0], [1.0], state)[0, 0] == 1.0


@pytest.mark.slow
@pytest.mark.parametrize("name, seed", [("stiffness_drift", 1), ("stiffness_drift_on", 0)])
def test_a_drift_of_the_stiffness_is_named_and_explains_the_gap(name, seed):
    hidden = hide(name, seed)
    result = diagnose(hidden.campaign, advise=False)
    assert result.verdict == "named"
    step = result.steps[0]
    assert step.effect == "stiffness_drift" and step.members == ("stiffness_drift",)
    # The size that was hidden, N·m/(rad·s); a few per cent are the linear terms beside it.
    (value,) = step.parameters.values()
    assert value == pytest.approx(hidden.parameters[0], rel=0.05)
    # The stiffness at the start of a run, or of the first run; the quadratic term is a few per cent of the moment.
    law, plan = hidden.plan.law, hidden.plan
    total = plan.duration * (len(plan.frequencies) * len(plan.levels) if name.endswith("_on") else 1)
    truth = dict(linear_stiffness=law.k1 - value * total / 2, cubic_stiffness=law.k3, linear_damping=law.c1)
    for term, expected in truth.items():
        assert result.model[term].coefficient == pytest.approx(expected, rel=0.03)
    assert result.model["quadratic_stiffness"].coefficient == pytest.approx(law.k2, rel=0.1)
    assert result.final.moment <= 1.2 * result.noise_floor.moment
    assert result.final.response <= 1.2 * result.noise_floor.response < 0.7 * result.initial.response


@pytest.mark.slow
@pytest.mark.parametrize("seed", [402, 403])
def test_a_jump_of_the_stiffness_is_unknown_by_moment_and_by_motion(seed):
    """It is no drift, which would be in proportion to time, and nothing else of the catalogue."""
    result = diagnose(hide("stiffness_jump", seed).campaign, max_effects=2, advise=False)
    assert result.verdict == "unknown" and all(step.probability <= 0.5 for step in result.steps)


@pytest.mark.slow
@pytest.mark.parametrize("name", ["moment_drift", "angle_drift"])
def test_a_drift_of_a_channel_is_still_named(name):
    result = diagnose(hide(name, 0).campaign, advise=False)
    assert result.steps[0].effect == name and result.verdict == "named"
