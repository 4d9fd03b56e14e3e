"""``sindyjoint init``: odd folders end in a manifest that is accepted, with units right or asked for."""

import json
import shutil
from contextlib import suppress

import numpy as np
import pytest
from odd_folders import ODD, campaign

import sindyjoint
from sindyjoint import init
from sindyjoint.errors import InputError, MissingInputError, OutputError, UnknownNameError
from sindyjoint.files import load_campaign
from tests.doors.asked import ask


@pytest.fixture(scope="module")
def truth():
    return campaign()


def made(writer, folder, truth) -> dict[str, str]:
    if writer.__name__ == "workbook":
        pytest.importorskip("openpyxl")
    return writer(folder, truth)


@pytest.mark.parametrize("writer", ODD, ids=lambda writer: writer.__name__)
def test_odd_folder(writer, truth, tmp_path):
    answers = made(writer, tmp_path, truth)
    asked = []

    def ask(question):
        asked.append(question.key)
        return answers[question.key]

    result = init(tmp_path, ask=ask)
    # Nothing is asked that the files tell, and nothing is guessed that they do not.
    assert set(asked) == set(answers)
    assert "# guessed" not in result.manifest.read_text()
    read = load_campaign(tmp_path)
    assert [run.frequency for run in read.runs] == [run.frequency for run in truth.runs]
    assert len({run.level for run in read.runs}) == 3
    for run, true in zip(read.runs, truth.runs, strict=True):
        assert run.sample_rate == pytest.approx(true.sample_rate, rel=1e-6)
        np.testing.assert_allclose(run.moment, true.moment, rtol=1e-9, atol=1e-12)
        np.testing.assert_allclose(run.angle, true.angle, rtol=1e-9, atol=1e-15)


@pytest.mark.parametrize("writer", ODD, ids=lambda writer: writer.__name__)
def test_the_check_of_discover_accepts_it(writer, truth, tmp_path):
    answers = made(writer, tmp_path, truth)
    init(tmp_path, answers)
    assert not sindyjoint.check(tmp_path).stopping


@pytest.mark.parametrize("writer", ODD, ids=lambda writer: writer.__name__)
def test_guesses_are_marked(writer, truth, tmp_path):
    answers = made(writer, tmp_path, truth)
    if any(key.endswith(".gain") for key in answers):
        with pytest.raises(InputError, match="what is one volt of the moment.*answer with --set KEY=VALUE"):
            init(tmp_path)
        return
    result = init(tmp_path)
    assert {question.key for question in result.draft.questions} == set(answers)
    assert ("# guessed" in result.manifest.read_text()) == bool(answers)
    load_campaign(tmp_path)


def test_discover_takes_what_init_wrote(truth, tmp_path):
    # Two nested halves of the same hour: files to equation in two commands, no line edited.
    ODD[0](tmp_path, truth)
    assert ask("init", str(tmp_path)).status == 0
    result = ask("discover", str(tmp_path), "--json")
    assert result.status == 0
    found = {term["id"]: term["coefficient"] for term in json.loads(result.stdout)["terms"]}
    assert found["linear_stiffness"] == pytest.approx(6061, rel=0.05)
    assert "coulomb_friction" in found


def test_a_manifest_that_is_there_stays(truth, tmp_path):
    ODD[0](tmp_path, truth)
    (tmp_path / "campaign.toml").write_text("mine")
    with pytest.raises(OutputError, match="is there already; give --force"):
        init(tmp_path)
    assert (tmp_path / "campaign.toml").read_text() == "mine"
    init(tmp_path, force=True)
    assert len(load_campaign(tmp_path).runs) == 6


def test_off_a_terminal_open_questions_are_listed(truth, tmp_path):
    ODD[1](tmp_path, truth)
    result = ask("init", str(tmp_path))
    assert result.status == 2
    assert "the files do not tell" in result.stderr and "take the guesses with --yes" in result.stderr
    assert not (tmp_path / "campaign.toml").exists()
    assert ask("init", str(tmp_path), "--yes").status == 0


def test_simulated_files_stay_simulated_without_their_manifest(truth, tmp_path):
    from sindyjoint.files import write_campaign

    write_campaign(truth, tmp_path, "npz").unlink()
    result = init(tmp_path)
    assert not result.draft.questions
    assert load_campaign(tmp_path).simulated
    assert "simulated" in str(result)


def test_left_out_files_are_named(truth, tmp_path):
    ODD[10](tmp_path, truth)
    with suppress(OSError):  # not every file system takes it
        (tmp_path / "red\x1b[31m\n.csv").write_text("t,m\n")
    result = init(tmp_path)
    left_out = {name for name, _ in result.draft.left_out}
    assert left_out - {"red\x1b[31m\n.csv"} == {"README.txt", "broken.csv"}
    assert "#   broken.csv: is not a text table" in result.manifest.read_text()
    assert load_campaign(tmp_path).runs


def test_bad_answers_are_refused(truth, tmp_path):
    ODD[0](tmp_path, truth)
    with pytest.raises(
        UnknownNameError, match="'angel.unit' is nothing that can be set; did you mean 'angle.unit'"
    ):
        init(tmp_path, {"angel.unit": "mrad"})
    with pytest.raises(
        InputError, match="moment = 'M' is no column; columns there: Zeit, Drehmoment, Winkel"
    ):
        init(tmp_path, {"moment": "M"})
    with pytest.raises(MissingInputError, match="is no folder"):
        init(tmp_path / "nowhere")
    empty = tmp_path / "empty"
    empty.mkdir()
    with pytest.raises(MissingInputError, match="holds no data file; expected files that end in csv"):
        init(empty)
    shutil.rmtree(empty)
