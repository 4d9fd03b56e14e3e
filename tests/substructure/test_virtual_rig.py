"""Virtual tests of a structure: written, and read again."""

from dataclasses import replace

import numpy as np
import pytest

from sindyjoint.mechanics import INTER_PANEL, load_rig_test
from tests.doors.asked import ask
from tests.made_models import paper_model

RIG = """
name = "short rig"
[[chain]]
beam = "lower"
length = "0.5 m"
bending_stiffness = "2333 N*m^2"
mass_per_length = "2.7 kg/m"
elements = 2
stiffness_uncertainty = 0.01
[[chain]]
joint = "hinge"
law = "inter-panel"
[[chain]]
beam = "upper"
length = "0.5 m"
bending_stiffness = "2333 N*m^2"
mass_per_length = "2.7 kg/m"
elements = 2
[[chain]]
mass = "tip mass"
value = "8 kg"
[drive]
quantity = "base acceleration"
unit = "m/s^2"
[[sensor]]
column = "a"
unit = "m/s^2"
point = { beam = "upper", at = "0.2 m" }
[[sensor]]
column = "b"
unit = "m/s^2"
point = "tip"
[[run]]
name = "shaken"
shape = "sine"
frequency = "3 Hz"
amplitude = "0.25 m/s^2"
[recorder]
sample_rate = "200 Hz"
duration = "2 s"
settling = "3 s"
noise = 0.0
"""


@pytest.fixture(scope="module")
def rig(tmp_path_factory):
    path = tmp_path_factory.mktemp("rig") / "short.toml"
    path.write_text(RIG, encoding="utf-8")
    return path


def written(text, folder):
    """Return the test that a rig's virtual test leaves in files."""
    folder.mkdir()
    (folder / "short.toml").write_text(text, encoding="utf-8")
    assert ask("simulate", folder / "short.toml", "--out", folder / "test", "-q").status == 0
    return load_rig_test(folder / "test" / "rig.toml")


def test_a_shaken_structure_is_written_and_read(tmp_path):
    read = written(RIG, tmp_path / "rig")
    assert read.simulated and read.kinds == ("inter-panel",)
    assert "inter-panel" not in read.structure.hinges[0].law.name
    (hinge,) = read.structure.hinges
    true = replace(read.structure, hinges=(replace(hinge, law=INTER_PANEL),))
    assert read.structure.loss_frequency == pytest.approx(true.frequencies(1)[0])
    assert [number.name for number in read.uncertain] == ["stiffness of lower"]
    (run,) = read.runs
    assert np.abs(run.drive).max() == pytest.approx(0.25, rel=1e-3)


def test_a_record_ends_as_one_that_goes_on(tmp_path):
    """The recorder's filter looks ahead; what it took for the future made the last samples wrong by per cents."""
    quick = RIG.replace('settling = "3 s"', 'settling = "0.5 s"')
    short, longer = (
        written(quick.replace('duration = "2 s"', f'duration = "{seconds} s"'), tmp_path / f"{seconds}").runs[
            0
        ]
        for seconds in (0.5, 0.8)
    )
    n = short.drive.size
    assert short.responses == pytest.approx(
        longer.responses[:, :n], abs=1e-6 * np.abs(longer.responses).max()
    )


def test_a_multisine_has_its_lines_and_its_peak(tmp_path):
    shape = 'shape = "multisine"\nfrequency = "0.5 Hz"\nband = ["1 Hz", "3 Hz"]'
    (run,) = written(RIG.replace('shape = "sine"\nfrequency = "3 Hz"', shape), tmp_path / "rig").runs
    lines = np.abs(np.fft.rfft(run.drive)) > 1e-3 * np.abs(run.drive).sum()
    assert np.flatnonzero(lines).tolist() == [2, 3, 4, 5, 6]
    assert np.abs(run.drive).max() == pytest.approx(0.25, rel=1e-2)


def test_a_sweep_is_written_without_frequency(tmp_path):
    sweep = RIG.replace('shape = "sine"\nfrequency = "3 Hz"', 'shape = "sweep"\nband = ["1 Hz", "6 Hz"]')
    (run,) = written(sweep, tmp_path / "rig").runs
    assert run.frequency is None and run.drive.size == 400


def test_a_model_stands_in_the_joints_of_a_virtual_test(rig, tmp_path, sindyjoint):
    model = paper_model(angle=5e-6)
    (tmp_path / "model.json").write_text(model.to_json())
    text = RIG.replace('"inter-panel"', '"model"').replace('duration = "2 s"', 'duration = "1 s"')
    (tmp_path / "rig.toml").write_text(
        text.replace('settling = "3 s"', 'settling = "0.5 s"'), encoding="utf-8"
    )
    command = ["simulate", str(tmp_path / "rig.toml"), "--out", str(tmp_path / "test"), "-q"]
    given = ["--model", str(tmp_path / "model.json")]
    assert sindyjoint(*command).status == 2
    answer = sindyjoint(*command, *given)
    assert answer.status == 0
    assert "shaken: hinge: beyond the tested range: angle up to" in answer.stderr
    written = load_rig_test(tmp_path / "test" / "rig.toml")
    assert written.kinds == ("hinge",) and len(written.runs) == 1
    # A model that would stand nowhere is refused, and nothing is written.
    refused = sindyjoint("simulate", rig, "--out", tmp_path / "other", *given)
    assert refused.status == 2 and "no joint is a place for it" in refused.stderr
    assert not (tmp_path / "other").exists()
