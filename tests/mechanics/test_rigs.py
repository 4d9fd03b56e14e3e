"""Rig files: those that ship, and the errors of bad ones."""

import numpy as np
import pytest

from sindyjoint.errors import SindyJointError
from sindyjoint.mechanics import INTER_PANEL, PaperLaw, load_rig
from tests.conftest import RIGS


@pytest.mark.parametrize("name", sorted(path.stem for path in RIGS.glob("*.toml")))
def test_shipped_rigs_stay_below_their_softening_limit(name):
    rig = load_rig(name)
    response = rig.respond()
    assert response.time[-1] == pytest.approx(20.0)
    for row, item in zip(response.angle, rig.structure().hinges, strict=True):
        low, high = item.law.softening_limit
        assert 0.95 * low < row.min() and row.max() < 0.95 * high
    assert response.joint_dissipation[0] > 10 * response.joint_dissipation[-1] or name == "pulse-rig"
    assert set(response.displacement) == set(rig.points)


def test_pulse_rig_is_the_papers_test():
    rig = load_rig("pulse-rig")
    structure = rig.structure()
    assert 3 < structure.frequencies(1)[0] < structure.frequencies(1, locked=True)[0] < 6
    assert rig.excitation(np.array([0.0, 0.0049, 0.0051])).tolist() == [65.0, 65.0, 0.0]
    # locked after a few cycles, as the five-term law with this friction must
    response = rig.respond(duration=5.0)
    assert response.stuck[0][-1000:].all()


def test_model_replaces_the_joint(tmp_path):
    text = (RIGS / "pulse-rig.toml").read_text(encoding="utf-8").replace('"inter-panel"', '"model"')
    (tmp_path / "rig.toml").write_text(text, encoding="utf-8")
    law = PaperLaw(k1=5000.0)
    rig = load_rig(tmp_path / "rig.toml", {"model": law})
    assert rig.structure().hinges[0].law is law
    same = load_rig(tmp_path / "rig.toml", {"model": INTER_PANEL}).respond(duration=1.0)
    np.testing.assert_array_equal(
        same.displacement["tip"], load_rig("pulse-rig").respond(duration=1.0).displacement["tip"]
    )


def test_soft_clamp_lowers_the_frequency(tmp_path):
    text = (RIGS / "pulse-rig.toml").read_text(encoding="utf-8")
    (tmp_path / "rig.toml").write_text(text + '\n[base]\nclamp_stiffness = "1e5 N*m/rad"\n', encoding="utf-8")
    soft = load_rig(tmp_path / "rig.toml").structure().frequencies(1)[0]
    assert 0.8 < soft / load_rig("pulse-rig").structure().frequencies(1)[0] < 0.99


MEASURED = 'point = "tip"\nfile = "hammer.csv"\n' + (
    'time = { column = "t", unit = "ms" }\nforce = { column = "F", unit = "kN" }'
)


def with_pulse_file(text, measured=MEASURED):
    start, end = text.index("point = "), text.index("[output]")
    return text[:start] + measured + "\n\n" + text[end:]


def test_measured_pulse(tmp_path):
    text = (RIGS / "pulse-rig.toml").read_text(encoding="utf-8")
    (tmp_path / "rig.toml").write_text(with_pulse_file(text), encoding="utf-8")
    rows = [f"{t},{0.065 if 0 < t <= 4.5 else 0}" for t in np.arange(0, 6, 0.5)]
    (tmp_path / "hammer.csv").write_text("t,F\n" + "\n".join(rows) + "\n", encoding="utf-8")
    rig = load_rig(tmp_path / "rig.toml")
    assert rig.excitation.mean(0.0, 0.01) * 0.01 == pytest.approx(65.0 * 4.5e-3)
    response = rig.respond(duration=1.0)
    assert np.abs(response.displacement["tip"]).max() > 1e-3


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ('length = "0.5 m"', 'length = "0 m"', "rig.toml: beam 'lower beam': length is 0.0"),
        ('length = "0.5 m"', 'length = "0.5 kg"', r"\[\[chain\]\] 1 length: .*expected a length"),
        ('youngs_modulus = "70 GPa"', 'youngs_modulus = "-70 GPa"', "section.youngs_modulus is -7e"),
        (
            'law = "inter-panel"',
            'law = "elbow"',
            "joint 'elbow' is not known; expected one of inter-panel, panel-root",
        ),
        ('joint = "joint"', 'hinge = "joint"', "unknown key 'hinge'"),
        ('value = "8 kg"', 'inertia = "1 kg*m^2"', "a mass wants value"),
        ('force = "65 N"', 'force = "65 kg"', r"\[pulse\] force: .*expected a force"),
        ('duration = "5 ms"\n', "", "a shape wants force"),
        ('point = "tip"', 'point = "top"', "point 'top' is not in the chain"),
        ("elements = 8", "elements = 0", "elements: expected 1 or more"),
        ("[pulse]", "[pulse", "is not valid TOML"),
        ('name = "pulse rig"', "", "key 'name' is missing"),
    ],
)
def test_bad_rigs_are_told_in_one_line(tmp_path, old, new, message):
    text = (RIGS / "pulse-rig.toml").read_text(encoding="utf-8")
    assert old in text
    (tmp_path / "rig.toml").write_text(text.replace(old, new, 1), encoding="utf-8")
    with pytest.raises(SindyJointError, match=message) as caught:
        load_rig(tmp_path / "rig.toml")
    assert "\n" not in str(caught.value)
    assert "rig.toml" in str(caught.value)


@pytest.mark.parametrize(
    ("content", "unit", "message"),
    [
        ("t,F\n0,0\n1,1\n2,0\n3,0\n", "N*m", "force: unit 'N\\*m' is not a force"),
        ("t,F\n0,0\n1,1\n5,0\n6,0\n", "N", "time does not rise in equal steps"),
        ("t,G\n0,0\n1,1\n2,0\n3,0\n", "N", "'F'"),
    ],
)
def test_bad_pulse_files_are_named(tmp_path, content, unit, message):
    text = (RIGS / "pulse-rig.toml").read_text(encoding="utf-8")
    (tmp_path / "rig.toml").write_text(with_pulse_file(text, MEASURED.replace("kN", unit)), encoding="utf-8")
    (tmp_path / "hammer.csv").write_text(content, encoding="utf-8")
    with pytest.raises(SindyJointError, match=message) as caught:
        load_rig(tmp_path / "rig.toml")
    assert "hammer.csv" in str(caught.value)


def test_unknown_rig_names_those_that_ship():
    with pytest.raises(SindyJointError, match="'pulse' is no rig; .* four-panel-wing, pulse-rig"):
        load_rig("pulse")
