"""Detectors and masks alone: steps of series, runs held against a law in closed form, gaps that are bridged."""

from dataclasses import replace

import numpy as np
import pytest

from sindyjoint.errors import InputError
from sindyjoint.inputs import LongRecord
from sindyjoint.record import Campaign, Joint, Run
from sindyjoint.soundness import (
    MOST_HARMONICS,
    POINTS,
    Finding,
    Held,
    bridge,
    cycles_of,
    find_odd_runs,
    find_other_scales,
    mask_faults,
    mask_run,
    step_of,
    words_of,
)
from sindyjoint.states import force_states


def finding(run="a", channel="moment", spans=((3, 5),), id="spikes", masked=True):
    return Finding(id, run, channel, "biases", "", "", "", tuple(spans), masked)


def sine(n=2000, rate=1000.0, frequency=5.0, **options):
    turn = 2 * np.pi * frequency * np.arange(n) / rate
    return Run(
        "a",
        2.0 * np.sin(turn) + 0.3 * np.cos(turn),
        1e-3 * np.sin(turn),
        rate,
        frequency=frequency,
        **options,
    )


def test_a_run_knows_which_of_its_samples_are_valid():
    valid = np.ones(2000, dtype=bool)
    valid[7] = False
    run = sine(valid=valid)
    assert run.valid is not valid and not run.valid[7] and not run.valid.flags.writeable
    with pytest.raises(
        InputError, match=r"shape \(3,\) and type bool; expected one truth value for each of the 2000"
    ):
        sine(valid=valid[:3])
    with pytest.raises(InputError, match="type float64"):
        sine(valid=valid.astype(float))
    with pytest.raises(InputError, match="31 of 2000 samples are valid; expected at least 32"):
        sine(valid=np.arange(2000) < 31)


def test_a_cubic_is_bridged_exactly():
    t = np.linspace(-1, 1, 60)
    signal = 1 - 2 * t + 3 * t**2 - 4 * t**3
    valid = np.ones(60, dtype=bool)
    valid[[10, 30, 31, 32, 33, 34]] = False
    broken = np.where(valid, signal, 99.0)
    np.testing.assert_allclose(bridge(broken, valid), signal, atol=1e-12)


def test_a_saturated_peak_is_bridged_by_its_flanks():
    run = sine()
    clipped = np.clip(run.moment, -1.97, 1.97)
    bridged = bridge(clipped, np.abs(clipped) < 1.97, 200.0)
    assert np.max(np.abs(clipped - run.moment)) > 0.05
    assert np.max(np.abs(bridged - run.moment)) < 0.005


def test_a_long_gap_is_filled_from_other_periods():
    run = sine()
    valid = np.ones(2000, dtype=bool)
    valid[700:1000] = False
    bridged = bridge(np.where(valid, run.moment, 0.0), valid, 200.0)
    np.testing.assert_allclose(bridged, run.moment, atol=1e-9)


def test_masking_marks_and_bridges_only_the_channel_at_fault():
    run = sine()
    masked = mask_run(
        replace(run, moment=run.moment + 1e3 * (np.arange(2000) == 50)), [finding(spans=[(50, 51)])]
    )
    assert np.flatnonzero(~masked.valid).tolist() == [50]
    assert masked.moment[50] == pytest.approx(run.moment[50], abs=1e-4)
    np.testing.assert_array_equal(masked.angle, run.angle)
    assert not force_states(masked).moving[50]


def test_a_dead_start_and_tail_are_cut_off():
    masked = mask_run(sine(), [finding(channel=None, spans=[(0, 120), (1700, 2000)], id="dead_tail")])
    assert masked.n_samples == 1580 and masked.valid is None
    np.testing.assert_array_equal(masked.angle, sine().angle[120:1700])


def test_what_cannot_be_left_out_stays():
    run = sine()
    assert mask_run(run, []) is run
    assert mask_run(run, [finding(spans=[(0, 1990)])]) is run
    long = replace(run, whole=LongRecord("campaign.toml", 0, (0, 2000, 4000)))
    assert mask_run(long, [finding()]) is long
    campaign = Campaign(Joint(), (run,))
    assert mask_faults(campaign, [finding(masked=False), finding(run="b")]) == (campaign, ())


def test_what_is_left_out_is_said_once_for_each_fault():
    runs = tuple(replace(sine(), name=name) for name in "abcde")
    campaign = Campaign(Joint(), runs)
    spikes = [finding(run=name, spans=[(5, 6), (9, 11)]) for name in "abcde"]
    tail = finding(run="b", channel=None, spans=[(1900, 2000)], id="dead_tail")
    masked, words = mask_faults(campaign, [*spikes, tail])
    assert words == (
        "15 samples of a, b, c and 2 more runs left out: spikes",
        "100 samples of b left out: dead tail",
    )
    assert [run.n_samples for run in masked.runs] == [2000, 1900, 2000, 2000, 2000]


def test_no_sample_near_a_limit_is_taken_for_its_noise():
    """Where noise outwards is cut off, what remains is biased: whole crests are left out, not clipped samples."""
    rng = np.random.default_rng(4)
    run = sine()
    noisy = run.moment + 0.02 * rng.normal(size=2000)
    limit = float(np.quantile(noisy, 0.97))
    at = np.flatnonzero(noisy >= limit)
    masked = mask_run(
        replace(run, moment=np.minimum(noisy, limit)),
        [finding(id="saturation", spans=[(int(i), int(i) + 1) for i in at])],
    )
    near = run.moment > limit - 0.01
    assert not masked.valid[near].any() and masked.valid[run.moment < limit - 0.15].all()


def test_broadband_states_leave_out_what_the_kernel_reaches():
    rng = np.random.default_rng(2)
    angle = np.convolve(rng.normal(size=6200), np.hanning(80), mode="same")[100:6100]
    run = Run("a", 5.0 * angle, angle, 1000.0)
    masked = mask_run(
        replace(run, moment=run.moment + 1e4 * (np.arange(6000) == 3000)), [finding(spans=[(3000, 3001)])]
    )
    states, before = force_states(masked, "broadband"), force_states(run, "broadband")
    first = round(states.time[0] * 1000)
    reach = int(np.ceil(500 / states.bandwidth))
    assert not states.moving[3000 - reach - first : 3001 + reach - first].any()
    np.testing.assert_array_equal(states.moving[: 2900 - first], before.moving[: 2900 - first])


@pytest.mark.parametrize(("periods", "most"), [(9, 3), (12, 3), (24, 0)])
def test_noise_has_no_steps(periods, most):
    """What the policy says of the rate: one in 5 000 series of few periods, none of more."""
    rng = np.random.default_rng(2)
    assert sum(step_of(rng.standard_normal(periods), 0.0) is not None for _ in range(5000)) <= most


@pytest.mark.parametrize("periods", [9, 24])
def test_a_step_is_found_where_it_is(periods):
    at = periods // 2
    series = np.where(np.arange(periods) < at, 0.0, np.where(np.arange(periods) == at, 0.04, 0.1))
    noisy = series + 1e-4 * np.random.default_rng(3).standard_normal(periods)
    step = step_of(noisy)
    assert step.period == at and step.size == pytest.approx(0.1, abs=1e-3)


def test_a_start_up_is_no_step():
    assert step_of(1 - np.exp(-np.arange(40) / 6)) is None


PHASE = 2 * np.pi * np.arange(POINTS) / POINTS
PLAN = [(f, level) for f in (3.0, 4.0, 6.0) for level in (1.0, 2.0, 3.0)]


def runs_of(extra, plan):
    """Return runs at frequencies and levels; ``extra`` adds to moments of 1 to 3 Nm."""
    moments, angles = [], []
    for frequency, level in plan:
        angle, rate = level * np.sin(PHASE), level * frequency * np.cos(PHASE)
        moment = angle - 0.02 * angle**3 + 0.03 * rate + 0.1 * np.sign(rate)
        moments.append(np.fft.rfft(moment + extra(frequency, level, angle, rate)) / POINTS)
        angles.append(np.fft.rfft(angle) / POINTS)
    names = tuple(f"{f:g} Hz {level:g}" for f, level in plan)
    harmonics = np.array([moments, angles])[:, :, : MOST_HARMONICS + 1]
    return cycles_of(names, np.array([f for f, _ in plan]), harmonics, np.zeros((len(plan), POINTS, 0)))


def told(extra, plan=PLAN):
    found, _ = find_odd_runs(runs_of(extra, plan), 0.0, words_of("rotation"))
    return [(f.id, f.run) for f in found]


def only(frequency, level, law):
    return lambda f, x, a, v: law(a, v) if (f, x) == (frequency, level) else 0.0


def cusp(a, v):
    return 0.3 * np.abs(a)


@pytest.mark.parametrize("run", [(4.0, 2.0), (3.0, 1.0)])
def test_a_run_that_departs_within_the_range_of_the_others_differs(run):
    assert told(only(*run, cusp)) == [("run_differs", f"{run[0]:g} Hz {run[1]:g}")]


def test_what_all_runs_of_a_frequency_show_is_the_joints():
    plan = [(f, level) for f, level in PLAN if level < 3]
    assert told(lambda f, x, a, v: 0.1 * x**1.6 * np.sin(3 * PHASE) if f == 4 else 0.0, plan) == []


@pytest.mark.parametrize(
    ("alike", "frequency", "level", "departs"),
    [
        (PLAN, 4.0, 2.0, True),
        ([(f, x) for f, x in PLAN if x < 3], 6.0, 3.0, False),  # beyond the range of the others
        (
            [(f, x) for f, x in PLAN if x > 1],
            3.0,
            1.0,
            False,
        ),  # smaller than any other: a memory depends on it
        ([(4.0, 3.0), (6.0, 1.0)], 4.0, 2.0, False),  # any of three may be the odd one
        ([(f, x) for f, x in PLAN if x < 3], 4.0, 60.0, True),  # another unit, not the edge of a range
    ],
)
def test_a_run_departs_where_the_others_can_say_what_is_expected(alike, frequency, level, departs):
    plan = [*(a for a in alike if a != (frequency, level)), (frequency, level)]
    runs = runs_of(only(frequency, level, cusp), plan)
    held = Held(runs, tuple(range(len(plan) - 1)), 0.0, 0.001)
    assert held.departs(len(plan) - 1) is departs


def test_the_lag_of_one_run_is_told_even_where_it_swings_furthest():
    late = 2 * np.pi * 6.0 * 6e-3

    def shifted(f, level, a, v):
        if (f, level) != (6.0, 3.0):
            return 0.0
        angle, rate = level * np.sin(PHASE - late), level * f * np.cos(PHASE - late)
        return angle - a - 0.02 * (angle**3 - a**3) + 0.03 * (rate - v) + 0.1 * (np.sign(rate) - np.sign(v))

    assert told(shifted) == [("channel_delay", "6 Hz 3")]


@pytest.mark.parametrize("odd", [(2,), (0, 4, 7), (1, 3, 5, 8)])
@pytest.mark.parametrize(
    ("factor", "mistake"), [(180 / np.pi, "rad and deg"), (1e-3, "a unit and its thousandth")]
)
def test_runs_in_another_unit_are_named_with_the_mistake(odd, factor, mistake):
    gains = np.where(np.isin(np.arange(len(PLAN)), odd), factor, 1.0)
    runs = runs_of(lambda f, x, a, v: 0.0, PLAN).scaled("angle", gains)
    found, rest = find_other_scales(runs, 0.0, words_of("rotation"))
    assert [(f.id, f.run, f.channel) for f in found] == [
        ("gain_differs", runs.names[i], "angle") for i in odd
    ]
    assert all(mistake in f.extent for f in found) and len(rest) == len(PLAN) - len(odd)
