"""Internal states begin with the record, and what the processing did counts only where the measurement shows it."""

from dataclasses import replace

import numpy as np
import pytest

from sindyjoint.diagnosis import FittedEffect, MeasuredMotion, effect_law, load_effects, select_effects
from sindyjoint.diagnosis.campaign.change import is_seen
from sindyjoint.diagnosis.campaign.gap import gap_of, noise_floor
from sindyjoint.diagnosis.campaign.gap_rows import gap_runs
from sindyjoint.diagnosis.campaign.repair import held_out_gap, modelled, refit, rest_angle
from sindyjoint.diagnosis.campaign.start import Work, first_model
from sindyjoint.equation import Reference
from sindyjoint.mechanics import PaperLaw, SumLaw, sampled, simulate
from sindyjoint.record import Campaign, Joint, Run
from sindyjoint.response import simulate_run
from sindyjoint.states import campaign_states, force_states

STEP = 0.002


def motion_of(angle, rate, first, lead, follow=1):
    part = slice(first, None)
    n = angle[part].size
    zero = np.zeros(n)
    return MeasuredMotion(
        angle[part], rate[part], zero, STEP, STEP * np.arange(n), 0.0, zero, zero, np.arange(n), False,
        follow=follow, lead=(angle[:first], rate[:first]) if lead else None,
    )  # fmt: skip


def slow_swing():
    time = STEP * np.arange(2000)
    return np.sin(3 * time), 3 * np.cos(3 * time)


@pytest.mark.parametrize("name", ["dahl_friction", "jenkins_element", "maxwell_branch"])
def test_a_state_begins_with_the_start_of_the_record(name):
    (effect,) = select_effects(load_effects(), [name])
    variant, angle, rate = effect.variants[0], *slow_swing()
    values = np.array([0.3])
    whole = variant.along(motion_of(angle, rate, 0, False), values)[200:, 0]
    with_lead = variant.along(motion_of(angle, rate, 200, True), values)[:, 0]
    without = variant.along(motion_of(angle, rate, 200, False), values)[:, 0]
    np.testing.assert_allclose(with_lead, whole, atol=1e-12)
    assert np.abs(without - whole).max() > 0.1 * np.abs(whole).max()


def test_a_slider_begins_in_its_middle_where_the_joint_rests():
    """A sensor's zero moves the angles and the joint's rest alike: the slider does not notice."""
    (effect,) = select_effects(load_effects(), ["jenkins_element"])
    variant, (angle, rate), values = effect.variants[0], slow_swing(), np.array([0.3])
    true = variant.along(motion_of(angle, rate, 0, False), values)
    moved = motion_of(angle + 0.2, rate, 0, False)
    np.testing.assert_allclose(variant.along(replace(moved, centre=0.2), values), true, atol=1e-12)
    assert np.abs(variant.along(moved, values) - true).max() > 0.1


def test_the_rest_of_a_joint_is_found_beside_its_zero_error():
    run, _, _ = driven_run(np.random.default_rng(3))
    moved = replace(run, angle=run.angle + 0.004)
    campaign = Campaign(Joint(inertia=0.0), (moved,))
    states = campaign_states(campaign, "broadband")
    model = first_model(campaign, states, None, "paper").model
    assert rest_angle(gap_runs(states, model, ["tones"]), model) == pytest.approx(0.004, rel=0.05)


def test_longer_steps_keep_to_the_samples_of_the_lead():
    (effect,) = select_effects(load_effects(), ["dahl_friction"])
    angle, rate = slow_swing()
    values = np.array([0.3])
    fine = effect.variants[0].along(motion_of(angle, rate, 203, True), values)[:, 0]
    rough = effect.variants[0].along(motion_of(angle, rate, 203, True, follow=10), values)[:, 0]
    # Beyond the last followed sample nothing is known.
    np.testing.assert_allclose(rough[:-10], fine[:-10], atol=0.02 * np.abs(fine).max())
    # A lead shorter than one step is left out.
    short = effect.variants[0].along(motion_of(angle, rate, 4, True, follow=10), values)[:, 0]
    assert np.isfinite(short).all()


def driven_run(rng):
    """Return a run of a spring and damper under two tones, from rest at the start."""
    time = np.arange(3000) / 500.0
    angle = 0.01 * np.sin(2 * np.pi * 1.3 * time) + 0.006 * np.sin(2 * np.pi * 3.1 * time)
    rate = np.gradient(angle, time)
    moment = 900.0 * angle + 3.0 * rate
    noisy = [x + 0.01 * np.std(x) * rng.standard_normal(x.size) for x in (moment, angle)]
    return Run("tones", *noisy, 500.0), angle, rate


def test_the_lead_of_a_run_is_its_motion_before_the_first_state():
    run, angle, rate = driven_run(np.random.default_rng(1))
    states = force_states(run, "broadband")
    known, speed = states.lead
    first = round(states.dropped * run.sample_rate)
    assert known.size == first > 0
    np.testing.assert_allclose(known, angle[:first], atol=0.03 * np.abs(angle).max())
    np.testing.assert_allclose(speed, rate[:first], atol=0.2 * np.abs(rate).max())


def test_an_error_of_the_processing_counts_where_it_is_seen():
    rng = np.random.default_rng(2)
    run, _, _ = driven_run(rng)
    campaign = Campaign(Joint(inertia=0.0), (run,))
    states = campaign_states(campaign, "broadband")
    model = first_model(campaign, states, None, "paper").model
    (row,) = gap_runs(states, model, ["tones"])
    error = 0.05 * model.fitted.moment_rms * np.sin(np.arange(row.target.size) / 9)
    there = replace(row, target=modelled(row, model, ()) + error)
    assert is_seen(error, there, model, ())
    assert not is_seen(error, replace(there, target=there.target - error), model, ())
    assert not is_seen(-error, there, model, ())


@pytest.mark.parametrize("seed", [0, 1])
def test_noise_of_the_motion_enters_the_moment_by_a_steep_damping(seed):
    """Of the true law a gap of more than two channel floors is left, and no more than noise of the rate explains."""
    rng, time = np.random.default_rng(seed), np.arange(3000) / 500.0
    runs = []
    for name, tones in (("one", (1.3, 3.1)), ("two", (0.9, 2.3))):
        pulse = 2 * np.pi * np.array(tones)[:, None]
        angle = np.array([0.01, 0.006]) @ np.sin(pulse * time)
        moment = 900.0 * angle + 60.0 * (np.array([0.01, 0.006]) @ (pulse * np.cos(pulse * time)))
        signals = ((moment, 0.002), (angle, 0.01))
        runs.append(Run(name, *(x + n * np.std(x) * rng.standard_normal(x.size) for x, n in signals), 500.0))
    campaign = Campaign(Joint(inertia=0.0), tuple(runs))
    states = campaign_states(campaign, "broadband")
    model = first_model(campaign, states, None, "paper").model
    work = Work.build(campaign, runs, states, ["one", "two"], model)
    gap, floor = gap_of(work, model, ()).moment, noise_floor(work).moment
    channel = states[0].noise.moment / np.sqrt(np.mean(states[0].moment ** 2))
    assert gap > 2 * channel
    assert gap == pytest.approx(floor, rel=0.2)


def test_friction_that_would_push_beside_an_effect_is_needless():
    run, _, _ = driven_run(np.random.default_rng(5))
    pushed = replace(run, moment=run.moment - 0.05 * np.sign(np.gradient(run.angle)))
    campaign = Campaign(Joint(inertia=0.0), (pushed,))
    states = campaign_states(campaign, "broadband")
    model = first_model(campaign, states, None, "paper").model
    rows = gap_runs(states, model, ["tones"])
    (effect,) = select_effects(load_effects(), ["constant_moment"])
    constant = FittedEffect(effect, effect.variants[0], np.empty(0), np.ones(1), 1.0)
    assert model["coulomb_friction"].coefficient < 0
    assert "coulomb_friction" in refit(rows, model, [constant]).dropped


def test_a_simulation_begins_with_the_internal_states_of_the_record():
    """A slider has moved before the first state; from its middle the joint would go another way."""
    rate = 500.0
    (effect,) = select_effects(load_effects(), ["jenkins_element"])
    slider = FittedEffect(effect, effect.variants[0], np.array([0.004]), np.array([1500.0]), 1.0)
    whole = SumLaw(PaperLaw(k1=900.0, c1=3.0, M_F=0.5, inertia=0.05), effect_law([slider], 0.0))
    time = np.arange(3000) / rate
    moment = 12.0 * np.sin(2 * np.pi * 1.3 * time) + 5.0 * np.sin(2 * np.pi * 3.1 * time)
    made = simulate(whole, sampled(moment, rate), time.size / rate, rate)
    run = Run("tones", moment, made.angle, rate)
    states = force_states(run, "broadband", bandwidth=15.0)
    assert states.lead[0].size > 60
    assert simulate_run(whole, run, states, drive="moment").response_nrmse < 0.01
    assert simulate_run(whole, run, states, drive="moment", initial_state=0.0).response_nrmse > 0.03


def test_runs_that_go_less_far_do_not_narrow_the_range_of_a_number():
    """A stop at 0.75 of the swing of the others: without the widest run it may still be where it is."""
    time, stop = np.arange(3000) / 500.0, 0.0075
    runs = []
    for name, swing in (("wide", 0.013), ("less", 0.01), ("least", 0.0095)):
        w = 2 * np.pi * np.array([1.3, 2.1])
        angle = swing * (0.6 * np.sin(w[0] * time) + 0.4 * np.sin(w[1] * time + 1))
        beyond = np.sign(angle) * np.maximum(np.abs(angle) - stop, 0)
        moment = 900.0 * angle + 3.0 * np.gradient(angle, time) + 500.0 * beyond
        runs.append(Run(name, moment, angle, 500.0))
    campaign = Campaign(Joint(inertia=0.0), tuple(runs))
    states = campaign_states(campaign, "broadband")
    (effect,) = select_effects(load_effects(), ["dead_zone"])
    fitted = FittedEffect(effect, effect.variants[0], np.array([stop]), np.array([500.0]), 1e6)
    model = first_model(campaign, states, None, "paper").model
    rows = gap_runs(states, model, [run.name for run in runs])
    less = max(float(np.abs(row.angle).max()) for row in rows[1:])
    assert fitted.variant.bounds(Reference(less, 1.0))[0, 1] < stop  # the range of the others alone
    assert held_out_gap(rows, model, [fitted], {run.name: 0.0 for run in runs}) < 0.002
