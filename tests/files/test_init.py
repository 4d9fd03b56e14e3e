"""``sindyjoint init``: odd folders end in a manifest that is accepted, with units right or asked for."""

import json
import shutil
from contextlib import suppress

import numpy as np
import pytest
from lab_folders import LAB, free_swings
from odd_folders import ODD, campaign
from own_folders import OWN

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


@pytest.mark.parametrize("writer", [*ODD, *LAB, *OWN], ids=lambda writer: writer.__name__)
def test_a_folder_ends_in_its_campaign_with_what_it_lacks_asked(writer, truth, tmp_path):
    answers = made(writer, tmp_path, truth)
    asked = []

    def ask(question):
        asked.append(question.key)
        return answers[question.key]

    result = init(tmp_path, ask=ask)
    # Nothing is asked that the files tell, and nothing is guessed that they do not.
    assert set(asked) == set(answers)
    assert "# guessed" not in result.manifest.read_text()
    # What discover takes, as its check accepts it.
    checked = sindyjoint.check(tmp_path)
    assert not checked.stopping
    assert "other_sensor" not in checked.soundness.ids
    read = checked.measured
    assert [run.frequency for run in read.runs] == [run.frequency for run in truth.runs]
    assert len({run.level for run in read.runs}) == 3
    for run, true in zip(read.runs, truth.runs, strict=True):
        assert run.sample_rate == pytest.approx(true.sample_rate, rel=1e-6)
        np.testing.assert_allclose(run.moment, true.moment, rtol=1e-9, atol=1e-12)
        np.testing.assert_allclose(run.angle, true.angle, rtol=1e-9, atol=1e-15)
    # By itself it marks what it guesses, and refuses to invent the volts of a sensor.
    result.manifest.unlink()
    if any(key.endswith(".gain") for key in answers):
        with pytest.raises(
            InputError, match="what is one (volt|count) of the .*answer with --set .answers in"
        ):
            init(tmp_path)
        return
    guessed = init(tmp_path)
    assert {question.key for question in guessed.draft.questions} == set(answers)
    assert ("# guessed" in guessed.manifest.read_text()) == bool(answers.keys() - {"runs"})
    load_campaign(tmp_path)


def test_free_swings_are_told_from_driven_runs(tmp_path, truth):
    answers = free_swings(tmp_path, truth)
    assert {q.key for q in init(tmp_path).draft.questions} == set(answers)
    drafted = init(tmp_path, answers, force=True).draft
    assert {run.course for run in drafted.runs} == {"free decay"} and {run.rate for run in drafted.runs} == {
        1000.0
    }
    assert load_campaign(tmp_path).runs[0].angle.max() == pytest.approx(np.radians(4), rel=0.05)


def test_nameless_columns_are_the_same_channels_in_every_file(tmp_path):
    rng, time = np.random.default_rng(7), np.arange(2000) / 500.0
    for number, size in enumerate((2.0, 4.0, 6.0, 6.0)):
        # Equal noise in both: by its roughness each file would be a toss of a coin.
        load, motion = size * np.sin(15 * time), size * np.sin(15 * time - 0.3)
        noisy = [x + 0.005 * size * rng.standard_normal(time.size) for x in (motion, load)]
        np.savetxt(tmp_path / f"run{number}.dat", np.column_stack([time, *noisy]))
    channels = {
        (column.quantity, column.column)
        for column in init(tmp_path).draft.columns
        if column.quantity != "time"
    }
    assert channels == {("angle", "2"), ("moment", "3")}


@pytest.mark.parametrize("unit", ["lbf-furlongs/s", "V/A"])
def test_a_unit_that_is_stated_and_not_known_is_never_guessed(unit, tmp_path):
    time = np.arange(2000) / 500.0
    table = np.column_stack([time, np.sin(15 * time), np.sin(15 * time - 0.3)])
    np.savetxt(
        tmp_path / "a.csv", table, delimiter=",", header=f"time_s,torque ({unit}),angle_mrad", comments=""
    )
    with pytest.raises(InputError, match=f"The file states {unit!r}"):
        init(tmp_path)


def test_runs_of_a_day_are_cut_at_pauses_and_each_keeps_its_rate(tmp_path):
    rng, parts = np.random.default_rng(3), []
    for number, (rate, lost) in enumerate(((500.0, 40), (50.0, 0), (50.0, 0), (1000.0, 0))):
        time = np.arange(0, 8, 1 / rate)
        load, motion = np.sin(15 * time), np.sin(15 * time - 0.3)
        made = np.column_stack([30.0 * number + time, load, motion]) + [0, 1e-3, 1e-3] * rng.standard_normal(
            (time.size, 3)
        )
        # What a recorder loses is no end of a run.
        parts.append(np.delete(made, slice(1000, 1000 + lost), axis=0))
    head = "time_s,torque_Nm,theta_mrad"
    np.savetxt(tmp_path / "day.csv", np.vstack(parts), delimiter=",", header=head, comments="", fmt="%.6f")
    drafted = init(tmp_path).draft
    assert [run.samples for run in drafted.runs] == [3960, 400, 400, 8000]
    runs = load_campaign(tmp_path).runs
    assert [run.sample_rate for run in runs] == pytest.approx([500, 50, 50, 1000], rel=1e-3)
    assert runs[0].valid is not None and np.count_nonzero(~runs[0].valid) == 40


def test_columns_of_several_joints_are_no_runs(tmp_path):
    time = np.arange(0, 4, 2e-3)
    table = np.column_stack([time, *(np.sin((3 + i) * time) for i in range(4))])
    np.savetxt(
        tmp_path / "arm.csv",
        table,
        delimiter=",",
        header="t_s,tau_Nm_1,q_deg_1,tau_Nm_2,q_deg_2",
        comments="",
    )
    assert [q.key for q in init(tmp_path).draft.questions] == ["runs"]
    told = init(tmp_path, {"runs": "no", "moment": "tau_Nm_2", "angle": "q_deg_2", "moment.unit": "N*m",
                           "angle.unit": "deg"}, force=True)  # fmt: skip
    assert len(told.draft.runs) == 1 and "tau_Nm_2" in told.draft.channels["moment"]


def test_runs_are_kept_for_validation_by_name(tmp_path, truth):
    dict((writer.__name__, writer) for writer in LAB)["wide_table"](tmp_path, truth)
    init(tmp_path, {"validate": "run 2, run 5"})
    uses = [run.use for run in load_campaign(tmp_path).runs]
    assert uses == ["identify", "validate", "identify", "identify", "validate", "identify"]
    with pytest.raises(InputError, match="validate = 'run 9' is no run; did you mean 'run"):
        init(tmp_path, {"validate": "run 9"}, force=True)


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
