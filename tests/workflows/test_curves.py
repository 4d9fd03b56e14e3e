"""The curves of a model and of a rig: their doors, records, pages, and what they refuse."""

import json

import jsonschema
import numpy as np
import pytest
from typer.testing import CliRunner

import sindyjoint
from sindyjoint.cli import make_app
from sindyjoint.errors import InputError
from sindyjoint.reporting import load_results, record_schema
from tests.made_models import paper_model


@pytest.fixture(scope="module")
def of_rig():
    return sindyjoint.curves("pulse-rig", model=paper_model(0.02), levels=[0.8], modes=1, harmonics=7)


@pytest.fixture(scope="module")
def folder(of_rig, tmp_path_factory):
    return of_rig.report(tmp_path_factory.mktemp("curves") / "rig")


def test_record_holds_what_the_schema_says(of_rig):
    record = json.loads(json.dumps(of_rig.to_dict(), allow_nan=False))
    jsonschema.validate(record, record_schema("structure-curves"))
    joint = sindyjoint.curves(paper_model(0.02))
    jsonschema.validate(
        json.loads(json.dumps(joint.to_dict(), allow_nan=False)), record_schema("joint-curves")
    )
    assert [curve.frequency for curve in joint.curves] == [1.0]


@pytest.mark.slow
def test_bands_of_a_structure_are_those_of_drawn_models(of_rig):
    level, mode = of_rig.levels[0], of_rig.modes[0]
    frequencies, dampings, peaks = [], [], []
    from sindyjoint.response import draw_models

    at = 1e-3
    for model in draw_models(paper_model(0.02), 12, np.random.default_rng(3)):
        one = sindyjoint.curves("pulse-rig", model=model, levels=[0.8], modes=1, harmonics=7)
        frequencies.append(np.interp(at, one.modes[0].amplitude, one.modes[0].frequency))
        dampings.append(np.interp(at, one.modes[0].amplitude, one.modes[0].damping))
        peaks.append(np.log(one.levels[0].peak[1]))
    # Twelve draws know a spread to 21 %.
    assert np.interp(at, mode.amplitude, mode.frequency_error) == pytest.approx(np.std(frequencies), rel=0.5)
    assert np.interp(at, mode.amplitude, mode.damping_error) == pytest.approx(np.std(dampings), rel=0.5)
    assert level.peak_error == pytest.approx(np.std(peaks), rel=0.5)


def test_a_report_is_drawn_again_from_what_was_saved(of_rig, folder):
    names = {path.name for path in folder.iterdir()}
    assert {"report.html", "curves.json", "response.csv", "modes.csv"} <= names
    again = load_results(folder)
    assert again.figures == of_rig.figures == ("response", "receptance", "backbone", "damping")
    assert again.levels[0].amplitude == pytest.approx(of_rig.levels[0].amplitude, rel=1e-5)
    assert "simulated, not measured" in (folder / "report.html").read_text(encoding="utf-8")


def test_command_of_a_model_writes_its_curves(tmp_path):
    model = tmp_path / "model.json"
    model.write_text(paper_model(0.02).to_json(), encoding="utf-8")
    options = ["curves", str(model), "--frequency", "4 Hz", "--amplitudes", "10..500 urad", "--json", "-q"]
    done = CliRunner().invoke(make_app(), [*options, "--out", str(tmp_path / "out")])
    assert done.exit_code == 0, done.output
    record = json.loads(done.stdout)
    assert record["curves"][0]["amplitude"][-1] == pytest.approx(5e-4)
    rows = (tmp_path / "out" / "curves.csv").read_text(encoding="utf-8").splitlines()
    assert rows[0].startswith("frequency_Hz,amplitude_rad,secant_Nm/rad") and len(rows) == 41


@pytest.mark.parametrize(
    ("subject", "options", "message"),
    [
        ("pulse-rig", {"frequencies": [3.0]}, "frequencies was given, which belongs to the curves of a model"),
        ("model", {"levels": [3.0]}, "levels was given, which belongs to the curves of a rig"),
        ("model", {"amplitudes": (2e-4, 1e-4)}, "expected two positive numbers, the smaller one first"),
        ("pulse-rig", {"levels": [-1.0]}, "expected positive forces"),
        ("pulse-rig", {"band": (5.0, 4.0)}, "expected two positive frequencies"),
        ("pulse-rig", {"modes": 0}, "expected at least one of each"),
        ("pulse-rig", {"model": ["model", "model"]}, "two models stand for 'joint' of 'pulse rig'"),
    ],
)  # fmt: skip
def test_what_cannot_be_used_is_refused(subject, options, message):
    model = paper_model(0.02)
    if "model" in options:
        options = {"model": [paper_model(0.02), paper_model(0.03)]}
    with pytest.raises(InputError, match=message):
        sindyjoint.curves(model if subject == "model" else subject, **options)
