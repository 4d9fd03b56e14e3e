"""Samples that a recorder lost, and others at fault: left out where that is safe, refused where not."""

import json
from dataclasses import replace

import numpy as np
import pytest

from sindyjoint import check, discover, load_campaign, simulate

PAPER = ("linear_stiffness", "cubic_stiffness", "linear_damping", "coulomb_friction")
LOST = ((700, 715), (2000, 2150))  # 15 samples, and more than a quarter of each period


@pytest.fixture(scope="module")
def whole():
    return simulate(frequencies=(3.0, 5.0), levels=(0.9, 0.5), duration=4.0, noise=0.01, random_state=3)


MANIFEST = """
[joint]
inertia = "{inertia} kg*m^2"
[channels]
time = {{ column = "t", unit = "s" }}
moment = {{ column = "m", unit = "N*m" }}
angle = {{ column = "a", unit = "rad" }}
"""


@pytest.fixture
def lost(whole, tmp_path):
    """The campaign in files with a time column, each without some of its lines."""
    entries = [MANIFEST.format(inertia=whole.joint.inertia)]
    for index, run in enumerate(whole.runs):
        rows = [f"{t:.4f},{m:.9e},{a:.9e}\n" for t, m, a in zip(run.time, run.moment, run.angle, strict=True)]
        for start, stop in reversed(LOST):
            del rows[start:stop]
        (tmp_path / f"{index}.csv").write_text("t,m,a\n" + "".join(rows))
        entries.append(f'[[run]]\nfile = "{index}.csv"\nfrequency = {run.frequency}\nlevel = "{run.level}"\n')
    (tmp_path / "campaign.toml").write_text("\n".join(entries))
    return tmp_path


def test_lost_samples_are_a_finding_and_left_out(lost, whole):
    checked = check(lost)
    found = [f for f in checked.soundness.findings if f.id == "lost_samples"]
    assert len(found) == len(whole.runs) and all(f.masked and f.severity == "biases" for f in found)
    assert all(f.spans == LOST for f in found) and "165 samples in 2 place(s)" in found[0].extent
    assert not checked.stopping
    assert any("left out: lost samples" in w for w in checked.warnings)
    run = checked.usable.runs[0]
    assert run.n_samples == whole.runs[0].n_samples and np.count_nonzero(~run.valid) == 165
    # Which of them were there is as it was.
    assert np.allclose(run.moment[run.valid], whole.runs[0].moment[run.valid], rtol=1e-6)


def test_a_gap_of_periods_is_no_other_fault(whole):
    valid = np.ones(whole.runs[0].n_samples, dtype=bool)
    valid[1400:2000] = False
    moment = np.interp(whole.runs[0].time, whole.runs[0].time[valid], whole.runs[0].moment[valid])
    gappy = replace(whole.runs[0], moment=moment, valid=valid)
    found = check(replace(whole, runs=(gappy, *whole.runs[1:]))).soundness.findings
    assert [f.id for f in found if f.severity != "note"] == ["lost_samples"]


def test_what_is_left_out_moves_no_coefficient_beyond_its_interval(lost, whole):
    before, after = discover(whole), discover(load_campaign(lost))
    assert after.model.ids == before.model.ids
    for term in after.model.terms:
        assert term.interval95[0] <= before.model[term.id].coefficient <= term.interval95[1], term.id


def test_a_long_gap_of_a_run_that_does_not_repeat_stops(lost, sindyjoint):
    manifest = lost / "campaign.toml"
    lines = [line for line in manifest.read_text().splitlines() if not line.startswith("frequency")]
    manifest.write_text("\n".join(lines) + "\n")
    answer = sindyjoint("check", lost, "--json")
    findings = [f for f in json.loads(answer.stdout)["findings"] if f["id"] == "lost_samples"]
    assert answer.status == 1 and all(f["severity"] == "stops" for f in findings)
    assert "make a run of each part" in findings[0]["remedy"]
    told = sindyjoint("discover", lost)
    assert told.status == 1 and "the data are unsound" in told.stdout
    assert "faults lost samples" in " ".join(told.stdout.split())


def test_what_was_left_out_before_is_shown_again(whole):
    """A campaign whose samples are marked already says so, whoever marked them."""
    valid = np.ones(whole.runs[0].n_samples, dtype=bool)
    valid[100:110] = False
    marked = whole.with_runs((replace(whole.runs[0], valid=valid), *whole.runs[1:]))
    (found,) = [f for f in check(marked).soundness.findings if f.id == "lost_samples"]
    assert found.run == whole.runs[0].name and found.spans == ((100, 110),)


def test_a_diagnosis_beside_a_batch_says_what_is_left_out(lost, tmp_path, sindyjoint):
    """It is of the campaign as it was read, not of the one without those samples, of which nothing is to be said."""
    out = tmp_path / "batch"
    assert sindyjoint("batch", lost, "--out", out, "--diagnose").status == 0
    (file,) = out.rglob("diagnosis.json")
    record = json.loads(file.read_text())
    assert "lost_samples" in record["soundness"]["ids"]
    assert any("left out: lost samples" in warning for warning in record["warnings"])


@pytest.fixture(scope="module")
def clean():
    """Six runs of the virtual test."""
    return simulate(frequencies=[3, 4.5], levels=[0.9, 0.6, 0.4], duration=6, noise=0.01, random_state=3)


@pytest.fixture(scope="module")
def reference(clean):
    return discover(clean)


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
