"""What ``verify`` refuses, in one line: rigs that cannot be, models and runs that are not there."""

import pytest

from tests.conftest import RIGS

PULSE_FILE = 'file = "hammer.csv"\ntime = {{ column = "t", unit = "ms" }}\nforce = {{ column = "F", unit = "{force}" }}'


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (('length = "0.5 m"', 'length = "0 m"'), "length is 0.0; expected a finite number above zero"),
        (('height = "20 mm"', 'height = "-20 mm"'), "height is -0.02 in SI; expected a number above zero"),
        (('law = "inter-panel"', 'law = "elbow"'), "joint 'elbow' is not known; expected one of inter-panel"),
        (('step = "0.5 ms"', 'step = "50 ms"'), "too large for the first mode"),
        (('force = "65 N"', 'force = "65 kg"'), "[pulse] force: "),
        (
            ('youngs_modulus = "70 GPa"', 'youngs_modulus = "-70 GPa"'),
            "youngs_modulus is -7e+10 in SI; expected a number above zero",
        ),
        (
            ("[pulse]", '[base]\nclamp_stiffness = "-1e5 N*m/rad"\n\n[pulse]'),
            "clamp_stiffness is -100000.0; expected a number above zero, or inf",
        ),
        (
            ("[[chain]]\nmass", '[[chain]]\njoint = "end"\nlaw = "inter-panel"\n\n[[chain]]\nmass'),
            "the chain is disconnected: joint 'end' is followed by 'lumped mass'; expected a beam behind it",
        ),
        (
            ('shape = "rectangular"\nforce = "65 N"\nduration = "5 ms"', PULSE_FILE.format(force="mm")),
            "hammer.csv: force: unit 'mm' is not a force",
        ),
        (
            ('shape = "rectangular"\nforce = "65 N"\nduration = "5 ms"', PULSE_FILE.format(force="kN")),
            "left its angle range",
        ),
        (('point = "tip"', 'point = "tip top"'), "point 'tip top' is not in the chain; expected one of"),
    ],
)
def test_bad_rigs_end_in_one_line(sindyjoint, model_file, tmp_path, change, message):
    text = (RIGS / "pulse-rig.toml").read_text()
    assert change[0] in text
    path = tmp_path / "bad.toml"
    path.write_text(text.replace(*change))
    (tmp_path / "hammer.csv").write_text("t,F\n0,65\n1,65\n2,65\n3,65\n4,65\n5,0\n")
    answer = sindyjoint("verify", model_file, path, "--out", tmp_path / "out")
    # Good input that no simulation follows is status 1.
    assert answer.status == (1 if message == "left its angle range" else 2) and answer.stdout == ""
    assert answer.stderr.count("\n") == 1 and message in answer.stderr
    assert not (tmp_path / "out").exists()


@pytest.mark.parametrize(
    ("model", "against", "message"),
    [
        (
            "nothing.json",
            "pulse-rig",
            "'nothing.json': no model is here; expected a model.json, or a folder with one",
        ),
        ("text.json", "pulse-rig", "text.json: is not JSON"),
        (
            "model.json",
            "nothing",
            "no such file or folder; expected a campaign.toml, its folder, a rig's TOML file or one of",
        ),
        ("model.json", "text.json", "text.json"),
    ],
)
def test_bad_input_ends_in_one_line(sindyjoint, model_file, tmp_path, monkeypatch, model, against, message):
    (tmp_path / "text.json").write_text("not json at all")
    monkeypatch.chdir(tmp_path)
    answer = sindyjoint("verify", model, against)
    assert answer.status == 2 and answer.stderr.count("\n") == 1 and message in answer.stderr
