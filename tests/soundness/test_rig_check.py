"""The check of a structure's test: faults of single channels, and what only sensors held against each other show."""

import json
from dataclasses import replace

import numpy as np
import pytest

from sindyjoint import check, discover_rig
from sindyjoint.errors import UnknownNameError, UnsoundError
from sindyjoint.mechanics import Hinge, PaperLaw, RigRun, RigTest, Sensor, Structure
from tests.soundness.rig_faults import RIG_FAULTS, found, inject

RATE, PERIODS, FREQUENCY, LINES = 200.0, 24, 2.0, 6
MASSES, SPRINGS, DAMPER = np.array([3.0, 2.0, 1.5, 2.5]), (4000.0, 9000.0, 6000.0), 20.0


def matrices():
    """Four masses: the first on a spring to the ground, springs between 1 and 2, 3 and 4, the joint between 2 and 3."""
    stiffness = np.zeros((4, 4))
    stiffness[0, 0] += SPRINGS[0]
    for (i, j), k in (((0, 1), SPRINGS[1]), ((2, 3), SPRINGS[2])):
        stiffness[np.ix_([i, j], [i, j])] += k * np.array([[1, -1], [-1, 1]])
    damping = np.zeros((4, 4))
    damping[0, 0] = DAMPER
    return np.diag(MASSES), stiffness, damping


def structure():
    """The same in coordinates of which the first is the elongation of the joint."""
    back = np.array(
        [[0, 1, 0, 0], [0, 0, 1, 0], [1, 0, 1, 0], [0, 0, 0, 1.0]]
    )  # x of (elongation, x1, x2, x4)
    mass, stiffness, damping = (back.T @ matrix @ back for matrix in matrices())
    points = {f"x{i + 1}": row for i, row in enumerate(back)}
    hinge = (Hinge("joint", PaperLaw(k1=1.0)),)
    return Structure(mass, stiffness, np.zeros((4, 4)), hinge, points, viscous=damping)


def made(seed=3, noise=0.005, runs=4, factor=1.0):
    """Return a test whose drive and joint force are prescribed series, all motions solved here by NumPy."""
    rng = np.random.default_rng(seed)
    mass, stiffness, damping = matrices()
    time = np.arange(int(PERIODS * RATE / FREQUENCY)) / RATE
    recorded = []
    for number in range(runs):
        signals = np.zeros((5, time.size))
        for order in range(1, LINES + 1):
            w = 2 * np.pi * FREQUENCY * order
            size = (1 + number) / order**2
            drive, joint = size * (rng.normal(size=2) + 1j * rng.normal(size=2)) * (5.0, 2.0)
            load = np.array([0, joint, -joint, drive])
            x = np.linalg.solve(factor * stiffness - w**2 * mass + 1j * w * damping, load)
            lines = np.concatenate([[drive], -(w**2) * x])
            signals += (lines[:, None] * np.exp(1j * w * time)).real
        signals += noise * signals.std(axis=1, keepdims=True) * rng.normal(size=signals.shape)
        recorded.append(RigRun(f"run {number}", signals[0], signals[1:], RATE, FREQUENCY, f"{number}"))
    sensors = tuple(Sensor(f"a{i}", f"x{i}") for i in range(1, 5))
    return RigTest("masses", structure(), ("joint",), "x4", sensors, tuple(recorded), motion="translation")


@pytest.fixture(scope="module")
def sound():
    return made()


@pytest.mark.parametrize("factor", [1.0, 1.02])
def test_sound_data_have_no_finding_that_stops_or_biases(factor):
    found_here = check(made(7, factor=factor))
    assert [f for f in found_here.soundness.findings if f.severity != "note"] == []
    assert found_here.soundness.verdict == "sound" and not found_here.warnings


QUICK = (
    "sensor_frozen", "sensor_constant", "sensor_noise", "sensor_gain_step", "samples_lost", "run_scaled",
    "sensor_reversed", "drive_gain", "sensor_late", "sensors_swapped", "run_reversed",
)  # fmt: skip
# So short a record has few samples at a limit, and its drive many lines.
UNSEEN = ("sensor_saturated", "drive_saturated", "tail_dead", "frequency_wrong", "sensor_spikes")


def assert_found(sound, kind):
    put, run, channel = inject(kind, sound, 5)
    findings = check(put).soundness.findings
    assert found(kind, put, findings, run, channel), findings


@pytest.mark.parametrize("kind", QUICK)
def test_a_fault_is_found_with_its_run_and_its_channel(sound, kind):
    assert_found(sound, kind)


@pytest.mark.slow
@pytest.mark.parametrize("kind", sorted(set(RIG_FAULTS) - set(QUICK) - set(UNSEEN)))
def test_other_faults_are_found_too(sound, kind):
    assert_found(sound, kind)


def test_a_gain_is_reported_with_its_size_and_what_it_does(sound):
    """The effect is that on the recovered states: of a sensor 10 % off, its share of them."""
    runs = tuple(replace(r, responses=r.responses * np.array([[1], [1.1], [1], [1]])) for r in sound.runs)
    (finding,) = check(replace(sound, runs=runs)).soundness.findings
    assert (finding.id, finding.run, finding.channel) == ("gain_differs", None, "a2")
    assert "1.1 times" in finding.extent and "shifts the recovered angle by" in finding.effect


def test_what_friction_rings_in_all_sensors_and_a_run_again_are_no_copies_and_no_spikes(sound):
    """A mode at 0.46 of the sampling rate, rung at each reversal: third differences take it for noise."""
    first, rng = sound.runs[0], np.random.default_rng(2)
    n, time = first.drive.size, np.arange(40)
    ring = np.zeros(n)
    for at in range(20, n - time.size, round(RATE / FREQUENCY / 2)):
        ring[at : at + time.size] += np.exp(-time / 8) * np.cos(0.92 * np.pi * time)
    size = np.array([1.0, 0.9, 0.8, 0.7])[:, None] * 8 * first.responses.std()
    again = [
        replace(
            first,
            name=name,
            drive=first.drive * (1 + 1e-3 * rng.standard_normal(n)),
            responses=first.responses + size * ring + 1e-3 * size * rng.standard_normal((4, n)),
        )
        for name in ("once", "again")
    ]
    found_here = check(replace(sound, runs=(*again, *sound.runs[1:]))).soundness.findings
    assert {f.id for f in found_here} & {
        "duplicate_channel",
        "scaled_copy",
        "duplicate_run",
        "spikes",
    } == set()


def test_what_one_sensor_rings_of_and_others_bend_at_is_no_spike(sound):
    """A joint that slips rings the quiet sensor beside it for a sample or two, and bends what others show."""
    run, rng = sound.runs[0], np.random.default_rng(4)
    n = run.drive.size
    at = rng.choice(np.arange(20, n - 20), 9, replace=False)
    bent = np.zeros(n)
    for each in at:
        after = np.arange(n - each)
        bent[each:] += (1 - np.exp(-after / 5)) * np.exp(-after / 40) * rng.choice([-2, 2])
    responses = run.responses + np.array([0, 1, 0.8, 0.6])[:, None] * run.responses.std() * bent
    responses[0, at] += 12 * np.abs(responses[0]).max()
    bends = replace(run, responses=responses, frequency=None)
    found_here = check(replace(sound, runs=(bends, *sound.runs[1:]))).soundness.findings
    assert "spikes" not in {f.id for f in found_here}


def test_spikes_are_filled_in_from_the_other_periods(sound):
    runs = list(sound.runs)
    responses = runs[1].responses.copy()
    at = [300, 700, 1500]
    responses[2, at] += 30 * np.abs(responses[2]).max()
    runs[1] = replace(runs[1], responses=responses)
    result = check(replace(sound, runs=tuple(runs)))
    assert result.soundness.verdict == "doubtful" and not result.stopping
    assert result.warnings == ("3 samples of run 1 filled in: spikes",)
    exact = sound.runs[1].responses[2]
    assert np.abs(result.usable.runs[1].responses[2][at] - exact[at]).max() < 0.2 * exact.std()
    untouched = np.delete(result.usable.runs[1].responses[2], at)
    assert np.array_equal(untouched, np.delete(exact, at))


def test_unsound_data_have_no_law_unless_accepted(sound):
    runs = tuple(replace(r, responses=r.responses * np.array([[1], [1], [-1], [1]])) for r in sound.runs)
    reversed_one = replace(sound, runs=runs)
    with pytest.raises(UnsoundError, match="--accept reversed_sign") as caught:
        discover_rig(reversed_one)
    assert caught.value.check.soundness.findings[0].channel == "a3"
    result = check(reversed_one, accept=["reversed_sign"])
    assert not result.stopping and result.soundness.verdict == "unsound"
    assert result.warnings[0].startswith("accepted: reversed sign of the sensor 'a3'")
    with pytest.raises(UnknownNameError, match="swapped_channels"):
        check(sound, accept=["reversed"])


def test_as_many_sensors_as_joints_show_nothing_of_each_other(sound):
    runs = tuple(replace(r, responses=-r.responses[1:2]) for r in sound.runs)
    result = check(replace(sound, sensors=sound.sensors[1:2], runs=runs))
    assert [(f.id, f.severity) for f in result.soundness.findings] == [("coverage", "note")]


def test_the_record_has_the_fields_of_a_campaigns_check(sound, tmp_path):
    put, _, _ = inject("sensor_spikes", sound, 5)
    place = check(put).report(tmp_path / "out")
    record = json.loads((place / "check.json").read_text(encoding="utf-8"))
    assert set(record["findings"][0]) == {"id", "run", "channel", "severity", "extent", "effect", "remedy"}
    page = (place / "report.html").read_text(encoding="utf-8")
    assert "Are the data of this structure sound?" in page and "spikes" in page
    assert "m/s" in page
