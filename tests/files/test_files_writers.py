"""What is written is read back: the same joint, the same runs, to the last bit."""

import re
import tomllib
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from sindyjoint.errors import InputError, OutputError
from sindyjoint.files import load_campaign, write_campaign, writers
from sindyjoint.record import Campaign, Joint, Run
from sindyjoint.rig import SensorNoise, SensorRig
from sindyjoint.text import control_character

RIG = SensorRig(2333.0, 0.02, 0.06, 1.02)
T = np.arange(400) / 200


def run(name="a", seed=0, moment=None, **options) -> Run:
    rng = np.random.default_rng(seed)
    noise = rng.normal(scale=0.01, size=(2, T.size))
    angle = 1e-3 * (np.cos(2 * np.pi * 4 * T) + noise[0])
    moment = 5 * np.sin(2 * np.pi * 4 * T) + noise[1] if moment is None else moment
    return Run(name, moment, angle, options.pop("sample_rate", 200.0), frequency=4.0, **options)


def assert_same(one: Campaign, other: Campaign, tolerance: float = 0.0) -> None:
    assert one.joint == other.joint
    assert (one.simulated, one.skew, one.notes) == (other.simulated, other.skew, other.notes)
    assert len(one.runs) == len(other.runs)
    for mine, theirs in zip(one.runs, other.runs, strict=True):
        for name in ("name", "sample_rate", "frequency", "level", "use"):
            assert getattr(mine, name) == getattr(theirs, name)
        np.testing.assert_allclose(theirs.moment, mine.moment, rtol=tolerance, atol=tolerance)
        np.testing.assert_allclose(theirs.angle, mine.angle, rtol=tolerance, atol=tolerance)
        assert theirs.noise == mine.noise
        assert (mine.rate is None) == (theirs.rate is None)
        if mine.rate is not None:
            np.testing.assert_array_equal(theirs.rate, mine.rate)


CAMPAIGN = Campaign(
    Joint('a "quoted" µ\\\n joint', "rotation", 0.02, 296.15, "A'7", {"α β": 'x"y', "b.c": ""}),
    (
        run("4 Hz/low", level='l"o'),
        run("4 Hz-low", 1, use="validate", rate=np.sin(T)),
        run("../../etc", 2, sample_rate=612.3456789),
        run("", 3, noise=SensorNoise(moment=0.02, angle=1 / 3e6)),
        run("🙂é" * 200, 4),
        run("free", moment=np.zeros(T.size)),
    ),
    simulated=True,
    skew=3e-4,
    notes=("first 'note'", "second\tnote"),
)


@pytest.mark.parametrize("format", ["csv", "tsv", "npz", "parquet", "h5", "mat"])
def test_every_format_returns_every_bit(format, tmp_path):
    if library := {"parquet": "pyarrow", "h5": "h5py"}.get(format):
        pytest.importorskip(library)
    manifest = write_campaign(CAMPAIGN, tmp_path / "out", format)
    assert manifest == tmp_path / "out" / "campaign.toml"
    assert_same(CAMPAIGN, load_campaign(tmp_path / "out"))
    files = sorted(path.name for path in (tmp_path / "out").iterdir())
    assert len(files) == 8
    assert all(name in ("SHA256SUMS", "campaign.toml") or name.endswith(f".{format}") for name in files)


def test_writing_twice_gives_the_same_bytes(tmp_path):
    for folder in ("a", "b"):
        write_campaign(CAMPAIGN, tmp_path / folder)
    for path in (tmp_path / "a").iterdir():
        assert path.read_bytes() == (tmp_path / "b" / path.name).read_bytes()


def test_raw_gauges_come_back_through_the_rig(tmp_path):
    campaign = CAMPAIGN.with_runs(CAMPAIGN.runs[:3])
    write_campaign(campaign, tmp_path, rig=RIG)
    assert set(tomllib.loads((tmp_path / "campaign.toml").read_text(encoding="utf-8"))["rig"]["strain"]) == {
        "e1",
        "e2",
        "e3",
        "e4",
    }
    # Eqs. 1–3 there and back: a few roundings.
    assert_same(campaign, load_campaign(tmp_path), tolerance=1e-14)


def test_measured_raw_channels_are_written_as_they_are(tmp_path):
    rng = np.random.default_rng(7)
    test = run()
    strains = RIG.strains(test.moment) + 1e-7 * rng.normal(size=(4, T.size))
    spots = RIG.displacements(test.angle) + 1e-7 * rng.normal(size=(3, T.size))
    raw = {f"e{place + 1}": row for place, row in enumerate(strains)}
    raw |= {f"d{place + 1}": row for place, row in enumerate(spots)}
    write_campaign(Campaign(Joint(), (test,)), tmp_path, rig=RIG, raw=[raw])
    back = load_campaign(tmp_path).runs[0]
    np.testing.assert_allclose(back.moment, RIG.moment(strains), rtol=1e-14)
    np.testing.assert_allclose(back.angle, RIG.angle(spots), rtol=1e-14)


def test_translation(tmp_path):
    campaign = Campaign(Joint("slide", "translation", 2.5), (run(rate=np.sin(T)), run("b", rate=np.cos(T))))
    write_campaign(campaign, tmp_path)
    text = (tmp_path / "campaign.toml").read_text()
    assert 'mass = "2.5 kg"' in text
    assert 'force = { column = "force", unit = "N" }' in text
    assert_same(campaign, load_campaign(tmp_path))


def test_other_files_in_the_folder_stay(tmp_path):
    (tmp_path / "notes.md").write_text("mine")
    write_campaign(CAMPAIGN, tmp_path)
    assert (tmp_path / "notes.md").read_text() == "mine"


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"format": "xls"}, "format is 'xls'; expected one of csv, tsv, npz"),
        ({"rig": RIG}, "a run has a constant moment, which no strain gauge shows; leave it out"),
        ({"raw": [{}]}, "raw channels of 1 run\\(s\\) were given; expected a rig and one set per run"),
    ],
)
def test_refusals(options, message, tmp_path):
    with pytest.raises(InputError, match=message):
        write_campaign(CAMPAIGN, tmp_path / "out", **options)
    assert not (tmp_path / "out").exists()


def test_a_rig_and_translation(tmp_path):
    with pytest.raises(InputError, match="for a translational joint; leave it out"):
        write_campaign(Campaign(Joint(motion="translation"), (run(),)), tmp_path, rig=RIG)


def test_output_that_is_a_file(tmp_path):
    (tmp_path / "out").write_text("x")
    with pytest.raises(OutputError, match="it is a file; expected the name of a folder"):
        write_campaign(CAMPAIGN, tmp_path / "out")


def test_failure_midway_leaves_nothing(tmp_path, monkeypatch):
    calls = []

    def fail(columns, remark):
        calls.append(1)
        if len(calls) == 3:
            raise OSError(28, "No space left on device")
        return b"t,m\n"

    monkeypatch.setitem(writers.ENCODERS, "csv", fail)
    with pytest.raises(OutputError, match="No space left on device"):
        write_campaign(CAMPAIGN, tmp_path / "out")
    assert list(tmp_path.iterdir()) == []


# A record refuses what a terminal would obey.
names = st.text(st.characters(codec="utf-8"), max_size=20).filter(
    lambda text: control_character(text) is None
)
numbers = st.floats(allow_nan=False, allow_infinity=False, width=64)


@settings(suppress_health_check=[HealthCheck.function_scoped_fixture], max_examples=60, deadline=None)
@given(
    joint=names,
    serial=st.none() | names,
    labels=st.dictionaries(names, names, max_size=3),
    run_names=st.lists(names.filter(bool), min_size=1, max_size=3, unique=True),
    level=st.none() | names,
    notes=st.lists(names, max_size=2, unique=True),
    scale=st.floats(1e-12, 1e12),
    skew=st.none() | st.floats(-1, 1),
)
def test_any_text_and_any_number_survive(
    joint, serial, labels, run_names, level, notes, scale, skew, tmp_path
):
    base = run()
    runs = tuple(
        Run(name, base.moment * scale, base.angle, 200.0, frequency=4.0, level=level) for name in run_names
    )
    campaign = Campaign(
        Joint(joint, serial=serial, labels=labels), runs, simulated=True, skew=skew, notes=tuple(notes)
    )
    write_campaign(campaign, tmp_path)
    assert_same(campaign, load_campaign(tmp_path))


def test_declared_noise_comes_back_through_a_rig(tmp_path):
    """Of a quantity that the gauges give, the manifest declares the noise alone."""
    noises = (SensorNoise(moment=0.02, angle=1e-6), SensorNoise(moment=0.02, angle=3e-6))
    runs = [replace(r, noise=n) for r, n in zip(CAMPAIGN.runs[:2], noises, strict=True)]
    write_campaign(CAMPAIGN.with_runs(tuple(runs)), tmp_path, rig=RIG)
    assert tuple(r.noise for r in load_campaign(tmp_path).runs) == noises
    manifest = tomllib.loads((tmp_path / "campaign.toml").read_text(encoding="utf-8"))
    assert manifest["channels"]["moment"] == {"noise": "0.02 N*m"}
    # Without the gauges such an entry is no channel.
    text = (tmp_path / "campaign.toml").read_text(encoding="utf-8")
    (tmp_path / "campaign.toml").write_text(re.sub(r"(?s)\[rig\].*?\n\n", "", text), encoding="utf-8")
    with pytest.raises(InputError, match="key 'moment' is missing"):
        load_campaign(tmp_path)
