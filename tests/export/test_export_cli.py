"""``sindyjoint export``: what it prints, what it writes, and one line for every mistake."""

import json

import pytest

from sindyjoint.cli import main
from sindyjoint.errors import OutputError
from sindyjoint.export import export_model, write_export


@pytest.fixture
def run(capsys):
    """Run the command line; return exit status, stdout, stderr."""

    def call(*arguments):
        with pytest.raises(SystemExit) as done:
            main([str(argument) for argument in arguments])
        captured = capsys.readouterr()
        return done.value.code, captured.out, captured.err

    return call


@pytest.fixture
def model_file(paper_model, tmp_path):
    """The paper's model as discover would have left it."""
    folder = tmp_path / "results"
    folder.mkdir()
    (folder / "model.json").write_text(paper_model.to_json(), encoding="utf-8")
    return folder / "model.json"


def test_text_goes_to_stdout_and_the_table_to_stderr(run, model_file, paper_model):
    status, out, err = run("export", model_file, "--to", "c")
    assert status == 0
    assert out == export_model(paper_model, "c").files["joint.h"]
    assert err.startswith("Fidelity over the moving states") and "cubic_stiffness" in err


def test_a_folder_of_results_is_a_model_too(run, model_file, tmp_path):
    status, out, err = run("export", model_file.parent, "--to", "latex", "--out", tmp_path / "joint.tex")
    assert (status, out) == (0, "")
    assert r"\begin{equation}" in (tmp_path / "joint.tex").read_text(encoding="utf-8")
    assert f"wrote {tmp_path / 'joint.tex'}" in err


def test_ansys_writes_a_folder_and_a_json_record(run, model_file, tmp_path):
    status, out, _ = run(
        "export", model_file, "--to", "ansys", "--rig", "four-panel-wing", "--out", tmp_path / "a", "--json"
    )
    record = json.loads(out)
    assert status == 0
    assert record["files"] == [str(tmp_path / "a" / name) for name in ("joint.inp", "four-panel-wing.inp")]
    assert all((tmp_path / "a" / name).is_file() for name in ("joint.inp", "four-panel-wing.inp"))
    assert record["schema"] == 1 and record["target"] == "ansys" and record["not_carried"] == []
    assert {"term", "symbol", "representation", "carried", "error", "largest_error"} == set(
        record["fidelity"][0]
    )


@pytest.mark.parametrize(
    ("motion", "words"),
    [
        ("rotation", ("moment of angle and rate", "of the RMS moment")),
        ("translation", ("force of displacement and velocity", "of the RMS force")),
    ],
)
def test_what_is_left_out_is_reported(run, make_model, tmp_path, motion, words):
    model = make_model({"linear_stiffness": 6066.0, "asymmetric_damping": 1e4}, motion=motion)
    (tmp_path / "model.json").write_text(model.to_json(), encoding="utf-8")
    status, _, err = run("export", tmp_path, "--to", "simscape")
    assert status == 0
    assert f"not carried: asymmetric_damping (c_m): these blocks have no {words[0]}" in err
    assert words[1] in err


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["--to", "ansis"], "target 'ansis' is not known; did you mean 'ansys'?"),
        (["--to", "ansys"], "ansys is 2 files (joint.inp, pulse-rig.inp); say with --out where it goes"),
        (["--to", "fmu"], "fmu is a binary file (joint.fmu); say with --out where it goes"),
        (["--to", "c", "--json"], "--json is given without --out"),
        (["--to", "c", "--rig", "pulse-rig"], "--rig is given with --to c; only ansys writes a rig"),
        (["--to", "ansys", "--rig", "nothing", "--out", "x"], "'nothing' is no rig"),
        (
            ["--to", "c", "--out", "/nowhere/at/all.h"],
            "cannot write '/nowhere/at/all.h': No such file or directory",
        ),
        ([], "Missing option '--to'"),
    ],
)
def test_a_mistake_is_one_line_and_status_2(run, model_file, arguments, message, monkeypatch, tmp_path):
    monkeypatch.chdir(tmp_path)
    before = sorted(tmp_path.rglob("*"))
    status, out, err = run("export", model_file, *arguments)
    assert (status, out) == (2, "")
    assert err.startswith("sindyjoint: ") and err.count("\n") == 1 and message in err
    assert sorted(tmp_path.rglob("*")) == before


@pytest.mark.parametrize(
    ("content", "message"),
    [
        (b"{", "is not JSON"),
        (b"[1]", "not a joint model: expected 'schema': 2 (or 1) and 'terms'"),
        (b"\xff\xfe\x00", "is not UTF-8 text"),
        (b"[" * 100_000, "is nested too deeply"),
        (b'{"schema": 1, "terms": [{"id": 3}]}', "not a joint model: key 'joint' is missing"),
        (b'{"schema": 1, "terms": []}', "not a joint model: key 'joint' is missing"),
    ],
)
def test_a_model_that_is_none_is_named(run, tmp_path, content, message):
    path = tmp_path / "model.json"
    path.write_bytes(content)
    status, out, err = run("export", path, "--to", "python", "--out", tmp_path / "joint.py")
    assert (status, out) == (2, "")
    assert err.startswith(f"sindyjoint: {path}: {message}") and err.count("\n") == 1
    assert not (tmp_path / "joint.py").exists()


@pytest.mark.parametrize(
    ("field", "value", "message"),
    [
        ("coefficient", "large", "terms.1.coefficient: expected a number"),
        ("coefficient", float("nan"), "terms.1.coefficient: expected a finite"),
        ("symbol", None, "terms.1.symbol: expected text"),
        ("formula", "__import__('os')", "is not allowed"),
        ("formula", 7, "terms.1.formula: expected text"),
        ("coefficient", 10**400, "holds an integer of"),
    ],
)
def test_a_damaged_field_is_named(run, model_file, field, value, message):
    data = json.loads(model_file.read_text(encoding="utf-8"))
    data["terms"][0][field] = value
    model_file.write_text(json.dumps(data), encoding="utf-8")
    status, _, err = run("export", model_file, "--to", "c")
    assert status == 2 and message in err and err.count("\n") == 1


def test_a_missing_model_is_named(run, tmp_path):
    status, _, err = run("export", tmp_path, "--to", "c")
    assert status == 2 and "no model is here" in err and "discover --out" in err


def test_a_failed_write_leaves_the_old_files(paper_model, tmp_path):
    # The second file of the export is in the way as a folder: nothing may have changed, not even the first.
    (tmp_path / "joint.inp").write_text("old")
    (tmp_path / "pulse-rig.inp").mkdir()
    with pytest.raises(OutputError, match="it is a folder; remove it or choose another path"):
        write_export(export_model(paper_model, "ansys"), tmp_path)
    assert (tmp_path / "joint.inp").read_text() == "old"
    assert sorted(p.name for p in tmp_path.iterdir()) == ["joint.inp", "pulse-rig.inp"]
