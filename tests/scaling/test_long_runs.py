"""Runs longer than memory: discovered segment by segment, they give the result of the whole."""

import json
from pathlib import Path

import numpy as np
import pytest

from sindyjoint import discover
from sindyjoint.discovery.long_runs import Task, work
from sindyjoint.errors import InputError
from sindyjoint.files import load_campaign, load_segment
from sindyjoint.parallel import executor
from sindyjoint.states import force_states
from sindyjoint.workflows import discover as workflow

RATE, SAMPLES = 500.0, 40_000
MANIFEST = """
[joint]
inertia = "0.02 kg*m^2"
[channels]
rate = "500 Hz"
moment = {{ column = {0}, unit = "N*m" }}
angle = {{ column = {1}, unit = "mrad" }}
[[run]]
file = "sine.{2}"
frequency = 3.0
[[run]]
file = "tones.{2}"
[[run]]
file = "short.{2}"
frequency = 5.0
"""


def record(path: Path, angle, rate, acceleration, seed):
    """Write the moment and angle of a joint of five terms, with 1 % noise."""
    rng = np.random.default_rng(seed)
    moment = 0.02 * acceleration + 6066 * angle - 2e5 * angle**2 - 2.684e9 * angle**3 + 48 * rate
    moment = moment + 1.867 * np.sign(rate)
    moment = moment + 0.01 * moment.std() * rng.normal(size=moment.size)
    angle = 1e3 * (angle + 0.01 * angle.std() * rng.normal(size=angle.size))
    if path.suffix == ".npy":
        np.save(path, np.column_stack([moment, angle]))
    else:
        np.savetxt(path, np.column_stack([moment, angle]), delimiter=",", header="m,a", comments="")


@pytest.fixture(scope="module", params=["npy", "csv"])
def long_campaign(request, tmp_path_factory):
    folder = tmp_path_factory.mktemp("long")
    ending = request.param
    columns = (1, 2) if ending == "npy" else ('"m"', '"a"')
    (folder / "campaign.toml").write_text(MANIFEST.format(*columns, ending))
    for name, frequency, level, n in (("sine", 3.0, 8e-4, SAMPLES), ("short", 5.0, 5e-4, 5_000)):
        turn, t = 2 * np.pi * frequency, np.arange(n) / RATE
        s, c = np.sin(turn * t), np.cos(turn * t)
        record(folder / f"{name}.{ending}", level * s, level * turn * c, -level * turn**2 * s, 1)
    turns = 2 * np.pi * np.linspace(0.5, 6, 30)
    phase = turns * (np.arange(SAMPLES) / RATE)[:, None] + np.random.default_rng(5).uniform(0, 6.28, 30)
    motion = [x.sum(axis=1) for x in (np.sin(phase), turns * np.cos(phase), -(turns**2) * np.sin(phase))]
    scale = 8e-4 / np.abs(motion[0]).max()
    record(folder / f"tones.{ending}", *(scale * x for x in motion), 2)
    return folder


def test_in_stretches_the_model_is_that_of_the_whole(long_campaign, monkeypatch):
    # Under one cut-off: another would be another question.
    whole = discover(long_campaign, bandwidth=25.0, correct=False)
    monkeypatch.setattr(workflow, "LONGEST", 20_000)
    parts = discover(long_campaign, bandwidth=25.0, correct=False)
    assert [len(run.blocks) for run in parts.regressor.evidence_.runs] == [16, 16, 8]
    assert [run.whole is not None for run in parts.campaign.runs] == [True, True, False]
    assert parts.campaign.runs[0].n_samples == SAMPLES // 16
    assert parts.model.ids == whole.model.ids and len(whole.model.ids) == 5
    # Other segments are other estimates of the same noise: within three of the larger standard error.
    error = np.maximum(parts.model.standard_errors, whole.model.standard_errors)
    assert np.all(np.abs(parts.model.coefficients - whole.model.coefficients) < 3 * error)
    assert np.all(parts.model.standard_errors < 2.5 * whole.model.standard_errors)
    fit, other = parts.model.fitted, whole.model.fitted
    assert fit.samples == pytest.approx(other.samples, rel=0.05)
    assert fit.moving_fraction == pytest.approx(other.moving_fraction, abs=0.03)
    assert fit.residual_rms == pytest.approx(other.residual_rms, rel=0.03)


def test_stretches_of_a_broadband_run_meet_without_a_seam(long_campaign):
    run = load_campaign(long_campaign).runs[1]
    states = force_states(run, "broadband")
    long_run = load_campaign(long_campaign, 20_000).runs[1].whole
    margin = round(states.dropped * RATE)
    pieces = []
    for number in range(long_run.n_stretches):
        segment = load_segment(long_run, number, margin)
        pieces.append(force_states(segment, "broadband", states.bandwidth).rate)
    np.testing.assert_allclose(np.concatenate(pieces), states.rate, atol=1e-9 * np.abs(states.rate).max())


@pytest.mark.parametrize("growth, passes", [(0.0, 1), (0.6, 2)])
def test_a_motion_that_grows_is_worked_through_twice(growth, passes, tmp_path, monkeypatch):
    monkeypatch.setattr(workflow, "LONGEST", 20_000)
    turns = 2 * np.pi * np.linspace(0.5, 6, 30)
    t = np.arange(SAMPLES) / RATE
    phase = turns * t[:, None] + np.random.default_rng(5).uniform(0, 6.28, 30)
    x, v, a = (
        (f(phase) * turns**k).sum(axis=1) for k, f in enumerate((np.sin, np.cos, lambda p: -np.sin(p)))
    )
    # The largest amplitude of the first segment comes again at the end.
    slope = growth / t[-1]
    level = 5e-4 / np.abs(x).max()
    size = level * (1 + slope * t)
    record(
        tmp_path / "tones.npy", size * x, size * v + level * slope * x, size * a + 2 * level * slope * v, 2
    )
    (tmp_path / "campaign.toml").write_text(
        MANIFEST.format(1, 2, "npy").split("[[run]]")[0] + '[[run]]\nfile = "tones.npy"\n'
    )
    stages = []
    found = discover(tmp_path, bandwidth=25.0, correct=False, progress=stages.append)
    assert 1 + any("once more" in stage for stage in stages) == passes
    assert len(found.model.ids) >= 4
    if passes == 2:
        stop = next(term for term in found.regressor.terms_ if term.values)
        scale = getattr(found.regressor.reference_, stop.term.parameters[0].relative_to)
        assert stop.values[0][1] == pytest.approx(stop.term.parameters[0].value * scale)


@pytest.mark.slow
def test_processes_change_no_bit(long_campaign, monkeypatch):
    monkeypatch.setattr(workflow, "LONGEST", 20_000)
    one = discover(long_campaign, "paper", correct=False)
    two = discover(long_campaign, "paper", correct=False, jobs=2)
    assert one.model.to_json() == two.model.to_json()
    assert json.dumps(one.to_dict()) == json.dumps(two.to_dict())


def test_a_stretch_at_rest_is_left_out_and_a_run_at_rest_refused(long_campaign, monkeypatch, tmp_path):
    whole = load_campaign(long_campaign, 20_000).runs[0].whole
    task = Task(whole, 3, "periodic", None, 0, 0.0, 0.02)
    assert work(task).failure == "" and work(task).moving > 1000
    if not (long_campaign / "sine.npy").exists():
        return
    monkeypatch.setattr(workflow, "LONGEST", 20_000)
    table = np.load(long_campaign / "sine.npy")
    for name in ("campaign.toml", "tones.npy", "short.npy"):
        (tmp_path / name).write_bytes((long_campaign / name).read_bytes())
    noise = np.random.default_rng(0).normal(scale=1e-4, size=table.shape)
    for share, outcome in ((4, "left out"), (12, "refused")):
        resting = table.copy()
        resting[-share * SAMPLES // 16 :] = noise[-share * SAMPLES // 16 :]
        np.save(tmp_path / "sine.npy", resting)
        if outcome == "left out":
            assert len(discover(tmp_path, correct=False).regressor.evidence_.runs[0].blocks) == 12
        else:
            with pytest.raises(InputError, match="12 of 16 segments of this long run cannot be used"):
                discover(tmp_path, correct=False)


def test_executors_are_checked(long_campaign):
    with pytest.raises(InputError, match="jobs is 0"), executor(jobs=0):
        pass
