"""Virtual tests of a structure: written, read again, and recovered."""

from contextlib import suppress
from dataclasses import replace

import numpy as np
import pytest

from sindyjoint.cli import main
from sindyjoint.diagnosis.structure.start import model_of_law
from sindyjoint.mechanics.laws import INTER_PANEL
from sindyjoint.mechanics.rig_test_file import load_rig_plan, load_rig_test
from sindyjoint.mechanics.virtual_rig import Drive, virtual_rig_test
from sindyjoint.substructure.recovery import recover
from sindyjoint.substructure.states import joint_states

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


def test_a_shaken_structure_is_written_read_and_recovered(rig, tmp_path):
    plan = load_rig_plan(rig)
    made = virtual_rig_test(plan.test, plan.drives, plan.recorder, 0)
    with suppress(SystemExit):
        main(["simulate", str(rig), "--out", str(tmp_path / "test"), "-q"])
    read = load_rig_test(tmp_path / "test" / "rig.toml")
    (run,), (other,) = made.runs, read.runs
    assert run.responses == pytest.approx(other.responses) and run.drive == pytest.approx(other.drive)
    assert (
        read.simulated
        and read.kinds == ("inter-panel",)
        and "inter-panel" not in read.structure.hinges[0].law.name
    )
    assert read.structure.loss_frequency == pytest.approx(made.structure.loss_frequency)
    assert [number.name for number in read.uncertain] == ["stiffness of lower"]
    # Equilibrium of what is behind the joint: its moment is that of the masses' inertia.
    states = joint_states(recover(read, run), 0, "run")
    assert np.ptp(states.moment) > 1.0


def test_a_record_ends_as_one_that_goes_on(rig):
    """The recorder's filter looks ahead; what it took for the future made the last samples wrong by per cents."""
    plan = load_rig_plan(rig)
    short, longer = (
        virtual_rig_test(plan.test, plan.drives, replace(plan.recorder, settling=0.5, duration=seconds)).runs[
            0
        ]
        for seconds in (0.5, 0.8)
    )
    n = short.drive.size
    assert short.responses == pytest.approx(
        longer.responses[:, :n], abs=1e-6 * np.abs(longer.responses).max()
    )


def test_a_multisine_has_its_lines_and_its_peak():
    drive = Drive("m", "multisine", 2.0, 0.5, (1.0, 3.0))
    time = np.arange(0, 2, 1e-3)
    values = drive.values(time, np.random.default_rng(0))
    lines = np.abs(np.fft.rfft(values)) > 1e-6 * values.size
    assert np.flatnonzero(lines).tolist() == [2, 3, 4, 5, 6]
    assert np.abs(values).max() == pytest.approx(2.0, rel=1e-3)


def test_a_sweep_is_written_without_frequency_and_recovered_whole(tmp_path):
    sweep = RIG.replace('shape = "sine"\nfrequency = "3 Hz"', 'shape = "sweep"\nband = ["1 Hz", "6 Hz"]')
    (tmp_path / "rig.toml").write_text(sweep)
    with pytest.raises(SystemExit) as ended:
        main(["simulate", str(tmp_path / "rig.toml"), "--out", str(tmp_path / "test"), "-q"])
    assert ended.value.code == 0
    test = load_rig_test(tmp_path / "test" / "rig.toml")
    (run,) = test.runs
    assert run.frequency is None
    recovery = recover(test, run)
    assert not recovery.spectra.repeats and recovery.ends is not None
    states = joint_states(recovery, 0, "sweep")
    assert states.frequency is None and states.n_samples == run.drive.size - 1


def test_a_model_stands_in_the_joints_of_a_virtual_test(rig, tmp_path, sindyjoint):
    model = model_of_law(INTER_PANEL, 5e-6, 0.01, 0.005)
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
