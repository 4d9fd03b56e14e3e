"""What the check finds: faults put into campaigns of random joints, and nothing in sound ones."""

from dataclasses import replace
from functools import cache

import numpy as np
import pytest

from sindyjoint import check
from sindyjoint.errors import InputError
from sindyjoint.files import load_campaign
from sindyjoint.record import Campaign, Joint, Run
from tests.diagnosis.hidden_effects import hide
from tests.recovery.random_joints import random_plan
from tests.seeds import seeds
from tests.soundness.faults import FAULTS, findings_of, found, inject, sound_campaign
from tests.soundness.file_units import FILE_FAULTS, HONEST_FILES, write_files

SEEDS = (203, 205)  # moment-driven and displacement-driven or by a rig; not those that limits were set on


@cache
def campaign_of(seed):
    return sound_campaign(seed)


def doubts(findings):
    return [(f.id, f.run, f.extent) for f in findings if f.severity != "note"]


@pytest.mark.parametrize("seed", SEEDS)
def test_a_sound_campaign_has_no_fault(seed):
    assert doubts(findings_of(campaign_of(seed))) == []


@pytest.mark.parametrize("kind", FAULTS)
def test_a_fault_is_found_under_its_name_and_says_what_it_does_and_what_helps(kind):
    bad, run = inject(kind, campaign_of(SEEDS[len(kind) % 2]), SEEDS[0])
    findings = findings_of(bad)
    assert found(kind, findings, run), [(f.id, f.run, f.extent) for f in findings]
    names = {run.name for run in bad.runs} | {None}
    order = [("stops", "biases", "note").index(f.severity) for f in findings]
    assert order == sorted(order)
    for f in findings:
        assert f.run in names and f.channel in ("moment", "angle", "rate", "time", None)
        assert any(character.isdigit() for character in f.extent) or f.id == "coverage"
        assert f.effect and f.remedy and "\n" not in f.extent + f.effect + f.remedy
        size = max(run.n_samples for run in bad.runs)
        assert all(0 <= a < b <= size for a, b in f.spans)
        assert f.spans or not f.masked


@pytest.mark.parametrize("kind", FILE_FAULTS)
def test_a_unit_that_the_file_denies_stops(kind, tmp_path):
    names, row, declared, channel = FILE_FAULTS[kind]
    some = campaign_of(SEEDS[0])
    some = some.with_runs(some.runs[:2])
    loaded = load_campaign(write_files(some, tmp_path, names, row, declared))
    mismatches = [f for f in findings_of(loaded) if f.id == "unit_mismatch"]
    assert {(f.run, f.channel, f.severity) for f in mismatches} == {
        (run, channel, "stops") for run in ("0", "1")
    }


@pytest.mark.parametrize(("names", "row", "declared"), HONEST_FILES)
def test_an_honest_header_is_believed(names, row, declared, tmp_path):
    some = campaign_of(SEEDS[0])
    loaded = load_campaign(write_files(some.with_runs(some.runs[:2]), tmp_path, names, row, declared))
    assert not [f for f in findings_of(loaded) if f.id == "unit_mismatch"]


def test_words_follow_the_motion():
    sliding = replace(campaign_of(SEEDS[0]), joint=Joint(motion="translation", inertia=0.02))
    bad, _ = inject("moment_clipped", sliding, 0)
    text = " ".join(f.extent + f.effect + f.remedy for f in findings_of(bad))
    assert "force" in text and "moment" not in text and "N*m" not in text


def steady(frequency, level, stiffness=1.0, damping=1.0, friction=1.0):
    """A run of ten periods of the paper's law, its angle prescribed; 0.5 % noise."""
    time = np.arange(0, 10 / frequency, 1e-3)
    phase, rng = 2 * np.pi * frequency * time, np.random.default_rng([int(frequency), int(1e6 * level)])
    angle, rate = level * np.sin(phase), level * 2 * np.pi * frequency * np.cos(phase)
    moment = stiffness * (6066 * angle - 2.684e9 * angle**3) + damping * 48 * rate
    moment += friction * 0.4 * np.sign(rate)
    noisy = [x + 0.005 * np.std(x) * rng.standard_normal(x.size) for x in (moment, angle)]
    return Run(f"{frequency} Hz, {level}", *noisy, 1000.0, frequency=frequency)


@pytest.mark.parametrize("other", [{"friction": 1.6}, {"stiffness": 0.85, "damping": 0.6, "friction": 0.8}])
def test_another_friction_or_temperature_is_no_delay_and_no_gain(other):
    runs = [
        steady(f, level, **(other if (f, level) == (3, 4e-4) else {}))
        for f in (2, 3, 5)
        for level in (2.5e-4, 4e-4, 6e-4)
    ]
    (finding,) = findings_of(Campaign(Joint(inertia=0.0), tuple(runs)))
    assert (finding.id, finding.run) == ("run_differs", "3 Hz, 0.0004")


@pytest.mark.parametrize(
    ("fall", "step", "not_there"),
    [(0.5, 0.0, "clock_drift"), (0.0, -0.5, "channel_slip"), (0.0, 1.0, "channel_slip")],
)
def test_what_a_joint_does_to_the_phase_is_no_fault_of_a_clock(fall, step, not_there):
    # Friction that falls along the run, or another level from the middle on, turns the moment against the angle.
    time, rng = np.arange(12_000) / 1000.0, np.random.default_rng(7)
    turn = 6 * np.pi * time
    angle = 5e-4 * (1 + step * (time > 6.0)) * np.sin(turn)
    moment = 6000 * angle + (1 - fall * time / 12) * np.sign(np.cos(turn))
    noisy = [x + 0.005 * np.std(x) * rng.standard_normal(x.size) for x in (moment, angle)]
    ids = {
        f.id for f in findings_of(Campaign(Joint(inertia=0.0), (Run("a", *noisy, 1000.0, frequency=3.0),)))
    }
    assert not_there not in ids and (not step or "level_changes" in ids)


def run_of(moment, angle, name="a", **rest):
    return Run(name, moment, angle, 100.0, **rest)


ONES, RAMP = np.ones(400), np.arange(400.0)
NOISE = np.random.default_rng(0).standard_normal(400)
ODD = {
    "constant": [run_of(ONES, ONES, frequency=5.0)],
    "zeros": [run_of(0 * ONES, 0 * ONES), run_of(0 * ONES, RAMP, "b")],
    "ramp": [run_of(RAMP, RAMP, frequency=5.0)],
    "noise": [run_of(NOISE, NOISE[::-1], frequency=5.0)],
    "short": [run_of(NOISE[:32], RAMP[:32], frequency=1.0)],
    "two levels": [run_of(np.sign(NOISE), np.sign(np.sin(RAMP)), frequency=4.0)],
    "impulse": [run_of(np.eye(1, 400)[0], RAMP)],
    "huge": [run_of(1e49 * NOISE, 1e-200 * NOISE)],
    "mixed lengths": [run_of(NOISE, NOISE), run_of(NOISE[:50], RAMP[:50], "b", rate=RAMP[:50], frequency=2.0)],
}  # fmt: skip


@pytest.mark.parametrize("name", ODD)
def test_odd_data_raise_nothing(name, recwarn):
    findings_of(Campaign(Joint(inertia=0.1), tuple(ODD[name])))
    findings_of(Campaign(Joint(motion="translation"), tuple(ODD[name])))
    assert not recwarn.list


@seeds(952, 1006)
def test_a_bend_at_the_reversals_is_no_delay(seed):
    """Friction bends the motion of a rig; the series of a noisy angle rounds that, and turns 1 ms too late."""
    assert "channel_delay" not in [f.id for f in findings_of(sound_campaign(seed))]


@seeds(504, 507, 515)
def test_a_maxwell_branch_is_no_delay(seed):
    """Its lag does not grow with frequency for ever; three of the six of 30 campaigns that were called delayed."""
    rng = np.random.default_rng((5, seed))
    size, noise = float(rng.uniform(0.04, 0.15)), float(10 ** rng.uniform(-3, -1.3))
    campaign = hide("maxwell_branch", seed, size, noise).campaign
    assert "channel_delay" not in [f.id for f in findings_of(campaign)]


def test_a_joint_that_sticks_at_the_start_has_no_sign_that_flips_and_no_gain_that_changes():
    """Random joint 16: its rig swings up from rest, and friction holds it for the first .66 s."""
    checked = check(random_plan(16, duration=4.0, sample_rate=500.0).campaign(0.01))
    assert checked.soundness.verdict == "sound"


@pytest.mark.parametrize(("damping", "dead"), [(0.0, True), (0.004, False)])
def test_a_moment_of_zeros_is_that_of_a_free_motion_only_where_that_dies_away(damping, dead):
    """Ten cycles, 1 % noise: 0.4 % of the critical damping takes 8 % from the middle third to the last."""
    time = np.arange(2000) / 200
    runs = []
    for seed in range(3):
        swing = np.exp(-damping * 2 * np.pi * time) * np.cos(2 * np.pi * time)
        angle = 1e-3 * (swing + 0.01 * np.random.default_rng(seed).standard_normal(time.size))
        runs.append(Run(f"run {seed}", np.zeros(time.size), angle, 200.0))
    found = check(Campaign(Joint(inertia=0.02), tuple(runs))).soundness.findings
    assert ("frozen_channel" in {each.id for each in found}) is dead


def test_values_that_no_unit_makes_are_refused():
    with pytest.raises(
        InputError, match="holds 2 value.s. that are not finite or beyond 1e.50, the first at sample 0"
    ):
        Run("r", np.array([1e60, 0.0, -np.inf, *NOISE]), np.zeros(NOISE.size + 3), 100.0)
