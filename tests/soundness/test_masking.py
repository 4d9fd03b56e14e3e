"""What is left out of a fit: marked, bridged, and of no influence on the coefficients."""

from dataclasses import replace

import numpy as np
import pytest

from sindyjoint.errors import InputError
from sindyjoint.inputs import LongRecord
from sindyjoint.mechanics.virtual import virtual_campaign
from sindyjoint.record import Campaign, Joint, Run
from sindyjoint.soundness.finding import Finding
from sindyjoint.soundness.masking import bridge, mask_campaign, mask_run
from sindyjoint.states import force_states
from sindyjoint.workflows.discover import discover

PAPER = ("linear_stiffness", "cubic_stiffness", "linear_damping", "coulomb_friction")


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


@pytest.fixture(scope="module")
def clean():
    """Six runs of the virtual test."""
    return virtual_campaign(
        frequencies=[3, 4.5], levels=[0.9, 0.6, 0.4], duration=6, noise=0.01, random_state=3
    )


@pytest.fixture(scope="module")
def reference(clean):
    return discover(clean)


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
    assert mask_campaign(campaign, [finding(masked=False), finding(run="b")]) == (campaign, ())


def test_what_is_left_out_is_said_once_for_each_fault():
    runs = tuple(replace(sine(), name=name) for name in "abcde")
    campaign = Campaign(Joint(), runs)
    spikes = [finding(run=name, spans=[(5, 6), (9, 11)]) for name in "abcde"]
    tail = finding(run="b", channel=None, spans=[(1900, 2000)], id="dead_tail")
    masked, words = mask_campaign(campaign, [*spikes, tail])
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


def spiked(campaign):
    rng = np.random.default_rng(1)
    runs = []
    for run in campaign.runs:
        channels = {}
        for name in ("moment", "angle"):
            signal = getattr(run, name).copy()
            at = rng.choice(run.n_samples, 5, replace=False)
            signal[at] += 50 * np.std(signal) * rng.choice([-1, 1], 5)
            channels[name] = signal
        runs.append(replace(run, **channels))
    return campaign.with_runs(tuple(runs))


def clipped(campaign):
    limits = [np.quantile(np.abs(run.moment), 0.97) for run in campaign.runs]
    return campaign.with_runs(
        tuple(replace(r, moment=np.clip(r.moment, -c, c)) for r, c in zip(campaign.runs, limits, strict=True))
    )


@pytest.mark.parametrize(("fault", "id"), [(spiked, "spikes"), (clipped, "saturation")])
def test_coefficients_keep_within_their_intervals(clean, reference, fault, id):
    """5 spikes of 50 RMS in each channel of each run, or 3 % of each run's moment at its limit."""
    found = discover(fault(clean))
    assert found.found and found.soundness.verdict != "unsound"
    assert {f.id for f in found.soundness.findings} == {id}
    assert found.warnings[0].endswith(f"left out: {id}")
    for term in PAPER:
        before, after = reference.model[term], found.model[term]
        low, high = before.interval95
        assert low < after.coefficient < high, term
        assert after.standard_error < 2 * before.standard_error, term


def test_without_the_mask_the_same_spikes_ruin_the_model(clean, reference, monkeypatch):
    """The negative control: it is the mask that saves the coefficients."""
    monkeypatch.setattr("sindyjoint.soundness.check.find_faults", lambda campaign: ())
    try:
        found = discover(spiked(clean))
    except InputError as error:
        assert "moving samples" in str(error)
        return
    low, high = reference.model["coulomb_friction"].interval95
    assert (
        "coulomb_friction" not in found.model or not low < found.model["coulomb_friction"].coefficient < high
    )
