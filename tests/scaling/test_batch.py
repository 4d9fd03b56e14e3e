"""Many campaigns: the joint that differs is named, the trend is found, nothing is lost and nothing done twice."""

import csv
import json
import os
import shutil
import signal
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import pytest
from small_joints import write_joint

from sindyjoint.discovery.evidence import fit_columns
from sindyjoint.discovery.evidence_file import evidence_bytes, read_evidence
from sindyjoint.errors import InputError, MissingInputError, OutputError, UnknownNameError
from sindyjoint.files.atomic import OLD, _name_temporary, settle, whole_folder
from sindyjoint.workflows.batch import batch, find_tasks


@pytest.fixture(scope="module")
def done(joints, tmp_path_factory):
    out = tmp_path_factory.mktemp("done") / "out"
    return out, batch(joints, out, "paper")


def content(folder: Path) -> dict[str, bytes]:
    return {str(p.relative_to(folder)): p.read_bytes() for p in sorted(folder.rglob("*")) if p.is_file()}


def test_the_joint_that_differs_and_the_trend_are_found(done):
    _, result = done
    assert result.complete and result.kept == 0
    assert result.common == ("linear_stiffness", "linear_damping", "coulomb_friction")
    assert [(d.id, d.kind) for d in result.differences] == [("joint-4", "outlier")]
    assert "viscous damping of 7" in result.differences[0].text
    assert "standard deviations above" in result.differences[0].text
    (trend,) = [t for t in result.population.trends if t.significant]
    assert (trend.coefficient, trend.covariate) == ("linear_stiffness", "temperature")
    # 0.2 % per K over 110 K; single joints scatter by 0.2 %.
    assert trend.slope == pytest.approx(-12.0, rel=0.05)


def test_a_campaign_alone_gives_the_same_digits(done, joints):
    from sindyjoint.workflows.discover import discover

    out, _ = done
    single = discover(joints / "joint-2", "paper")
    record = json.loads((out / "campaigns" / "joint-2" / "record.json").read_text())
    assert record["result"] == json.loads(json.dumps(single.to_dict()))
    assert (out / "campaigns" / "joint-2" / "model.json").read_text() == single.model.to_json() + "\n"


def test_coefficients_are_compared_on_one_set_of_terms(joints, tmp_path):
    # One joint softens: its model has a cubic term, and a linear stiffness that means something else.
    shutil.copytree(joints, tmp_path / "in")
    shutil.rmtree(tmp_path / "in" / "joint-1")
    write_joint(tmp_path / "in" / "joint-1", 1, temperature=-40, k3=-2e9)
    out = tmp_path / "out"
    result = batch(tmp_path / "in", out, "paper")
    assert result.common == ("linear_stiffness", "linear_damping", "coulomb_friction")
    terms = result.records[1].terms
    assert set(terms) == {*result.common, "cubic_stiffness"}
    assert ("joint-1", "terms with cubic stiffness") in [(d.id, d.text) for d in result.differences]
    # k1 + ¾ k3 A², over both runs; k1 of the model is the 6000 that the joint was given.
    evidence = read_evidence(out / "campaigns" / "joint-1" / "factors.npz")
    fit = fit_columns(evidence, [evidence.ids.index(term) for term in result.common])
    assert terms["linear_stiffness"]["coefficient"] == pytest.approx(6000, rel=0.01)
    assert result.values["linear_stiffness"][1] == pytest.approx(fit.coefficients[0], rel=2e-3)
    assert result.values["linear_stiffness"][1] < 5700


@pytest.mark.parametrize("way", [{"jobs": 2}, {"workers": 2}])
def test_every_way_of_running_writes_the_same_bytes(done, joints, tmp_path, way):
    if "workers" in way:
        pytest.importorskip("distributed", reason="dask[distributed] is not installed")
    out, result = done
    other = batch(joints, tmp_path / "out", "paper", **way)
    assert content(tmp_path / "out" / "campaigns") == content(out / "campaigns")
    assert other.to_dict() == result.to_dict()


def test_restart_keeps_what_holds_and_redoes_what_does_not(joints, tmp_path):
    shutil.copytree(joints, tmp_path / "in")
    out = tmp_path / "out"
    batch(tmp_path / "in", out, "paper")
    times = {p: p.stat().st_mtime_ns for p in out.rglob("record.json")}
    # Inputs of 0, the outputs of 1, a file of 2 that is no longer there; 3 to 6 as they were.
    with (tmp_path / "in" / "joint-0" / "low.csv").open("a") as file:
        file.write("0.1,0.0001\n")
    (out / "campaigns" / "joint-1" / "model.json").write_text("{}")
    (tmp_path / "in" / "joint-2" / "low.csv").unlink()
    reported = []
    result = batch(tmp_path / "in", out, "paper", on_record=lambda record: reported.append(record.id))
    assert result.kept == 4 and len(reported) == 7
    redone = {p.parent.name for p, when in times.items() if p.stat().st_mtime_ns != when}
    assert redone == {"joint-0", "joint-1", "joint-2"}
    assert result.records[2].status == "broken" and "there is no such file" in result.records[2].reason
    # Other options: another question, nothing is kept.
    assert batch(tmp_path / "in", out, "paper", align=True).kept == 0


KILLED = """
import ast, os, signal, sys
from sindyjoint.workflows.batch import batch
done = []
def on_record(record):
    done.append(record.id)
    if len(done) == 3:
        os.killpg(0, signal.SIGKILL)
if __name__ == "__main__":
    batch(sys.argv[1], sys.argv[2], "paper", on_record=on_record, **ast.literal_eval(sys.argv[3]))
"""
WAYS = [{}, {"jobs": 2}, {"workers": 2}]


@pytest.mark.parametrize("way", WAYS)
def test_killed_at_half_and_restarted_it_finishes_with_the_same_bytes(done, joints, tmp_path, way):
    if "workers" in way:
        pytest.importorskip("distributed", reason="dask[distributed] is not installed")
    out, script = tmp_path / "out", tmp_path / "script.py"
    script.write_text(KILLED)
    command = [sys.executable, script, joints, out, repr(way)]
    killed = subprocess.run(command, capture_output=True, start_new_session=True)
    assert killed.returncode == -signal.SIGKILL
    before = written(out)
    assert 3 <= len(before) < 7
    # What a campaign in hand may leave behind.
    undone = next(f"joint-{number}" for number in range(7) if f"joint-{number}" not in before)
    _name_temporary(out / "campaigns" / undone).mkdir()
    fresh = []
    result = batch(joints, out, "paper", on_record=lambda record: fresh.append(record.id), **way)
    after = written(out)
    assert result.kept == len(before) and sorted(fresh) == sorted(after)
    assert {name: after[name] for name in before} == before
    assert content(out / "campaigns") == content(done[0] / "campaigns")
    assert result.to_dict() == done[1].to_dict()
    assert not list((out / "campaigns").glob(".*"))


def written(out: Path) -> dict[str, int]:
    return {p.parent.name: p.stat().st_mtime_ns for p in out.glob("campaigns/[!.]*/record.json")}


@pytest.mark.parametrize("way", WAYS[1:])
def test_a_killed_worker_changes_no_byte(done, joints, tmp_path, way):
    psutil = pytest.importorskip("psutil", reason="psutil is not installed")
    if "workers" in way:
        pytest.importorskip("distributed", reason="dask[distributed] is not installed")
    killed = []

    def on_record(record):
        if not killed:
            children = psutil.Process().children(recursive=True)
            # The one that has worked most: not a process that only watches the others.
            worker = max(children, key=lambda process: process.cpu_times().user)
            worker.kill()
            killed.append(worker.pid)

    result = batch(joints, tmp_path / "out", "paper", on_record=on_record, **way)
    assert len(killed) == 1 and not psutil.pid_exists(killed[0])
    assert content(tmp_path / "out" / "campaigns") == content(done[0] / "campaigns")
    assert result.to_dict() == done[1].to_dict()


def test_an_interruption_loses_the_campaign_in_hand_at_most(joints, tmp_path):
    out = tmp_path / "out"
    command = [
        sys.executable,
        "-m",
        "sindyjoint",
        "batch",
        joints,
        "--out",
        out,
        "-l",
        "paper",
        "--jobs",
        "2",
    ]
    run = subprocess.Popen(command, stderr=subprocess.PIPE, text=True, start_new_session=True)
    deadline = time.monotonic() + 60
    while not list(out.glob("campaigns/*/record.json")) and time.monotonic() < deadline:
        time.sleep(0.01)
    # As a terminal does: to all processes of the group.
    os.killpg(run.pid, signal.SIGINT)
    _, stderr = run.communicate(timeout=60)
    before = len(list(out.glob("campaigns/*/record.json")))
    assert "Traceback" not in stderr
    if run.returncode != 0:  # on a quick machine all may have been done
        assert run.returncode == 130 and "interrupted" in stderr
    assert batch(joints, out, "paper", selection="evidence").kept <= before


def test_the_command_reports_a_broken_campaign_and_goes_on(joints, tmp_path, sindyjoint):
    shutil.copytree(joints, tmp_path / "in")
    (tmp_path / "in" / "joint-5" / "campaign.toml").write_text("joint = [")
    out = tmp_path / "out"
    answer = sindyjoint("batch", tmp_path / "in", "--out", out, "--library", "paper")
    assert answer.status == 1
    (line,) = answer.stderr.splitlines()
    assert line.startswith("sindyjoint: joint-5: ") and "is not valid TOML" in line
    assert "7 campaigns: 6 with a model, 1 broken" in answer.stdout
    rows = list(csv.DictReader((out / "batch.csv").read_text(encoding="utf-8").splitlines()))
    assert [row["status"] for row in rows].count("broken") == 1
    assert "is not valid TOML" in rows[5]["stands_out"]
    assert (
        float(rows[4]["linear_damping"]) == pytest.approx(75, rel=0.05) and "above" in rows[4]["stands_out"]
    )
    record = json.loads(
        sindyjoint("batch", tmp_path / "in", "--out", out, "-l", "paper", "--json", "-q").stdout
    )
    assert (record["found"], record["broken"]) == (6, 1)
    page = (out / "report.html").read_text(encoding="utf-8")
    assert "joint-4" in page and "Which joints differ" in page and page.count("<svg") >= 1
    listed = sindyjoint("plot", out)
    assert listed.stdout.startswith("joints")


def test_reports_are_written_and_linked(joints, tmp_path, sindyjoint):
    for number in (0, 1):
        shutil.copytree(joints / f"joint-{number}", tmp_path / "in" / f"joint <{number}>")
    out = tmp_path / "out"
    answer = sindyjoint(
        "batch", tmp_path / "in" / "*", "--out", out, "-l", "paper", "--reports", "--jobs", "2"
    )
    assert answer.status == 0
    page = (out / "report.html").read_text(encoding="utf-8")
    for number in (0, 1):
        (folder,) = out.glob(f"campaigns/joint-{number}*")
        assert (folder / "report.html").stat().st_size > 100_000
        assert f'href="campaigns/{folder.name}/report.html"' in page


def test_diagnoses_are_made_where_the_campaigns_are(joints, tmp_path, sindyjoint):
    out = tmp_path / "out"
    options = ("--out", out, "-l", "paper", "--diagnose", "--jobs", "2")
    assert sindyjoint("batch", joints / "joint-0", *options).status == 0
    (found,) = out.glob("campaigns/*/diagnosis/diagnosis.json")
    assert json.loads(found.read_text())["verdict"]
    # Without it nothing requested is missing; with it, after a batch without, it has to be made.
    assert "1 of them done before" in sindyjoint("batch", joints / "joint-0", *options).stdout


def test_names_of_folders_are_harmless_and_unique(tmp_path):
    for name in ("a/b", "a-b", "A-B", "ü b", "..x"):
        (tmp_path / "in" / name).mkdir(parents=True)
        (tmp_path / "in" / name / "campaign.toml").write_text("")
    tasks = find_tasks(tmp_path / "in", tmp_path / "in" / "out", "paper", {})
    ids = [task.id for task in tasks]
    assert len({id.lower() for id in ids}) == 5
    assert all("/" not in id and not id.startswith(".") for id in ids)
    (tmp_path / "in" / "other").mkdir()
    (tmp_path / "in" / "other" / "campaign.toml").write_text("")
    # A campaign that joins changes no name.
    assert set(ids) < {task.id for task in find_tasks(tmp_path / "in", tmp_path / "in" / "out", "paper", {})}


def test_names_that_are_cut_are_told_apart_and_stay(tmp_path):
    long = "x" * 100
    for name in ("j", "j.1", f"{long}-1", f"{long}-2", "ü" * 60):
        (tmp_path / "in" / name).mkdir(parents=True)
        (tmp_path / "in" / name / "campaign.toml").write_text("")
    ids = [task.id for task in find_tasks(tmp_path / "in", tmp_path / "out", "paper", {})]
    assert {"j", "j.1"} < set(ids) and len(set(ids)) == 5
    assert all(len(id.encode()) <= 80 for id in ids)
    # Without the other, whose name was cut to the same, it is called the same.
    (tmp_path / "in" / f"{long}-2" / "campaign.toml").unlink()
    assert set(ids) > {task.id for task in find_tasks(tmp_path / "in", tmp_path / "out", "paper", {})}


def test_campaigns_of_which_one_is_called_as_another_begins(joints, tmp_path, sindyjoint):
    for number, name in enumerate(("j", "j.1", "j.1.2")):
        shutil.copytree(joints / f"joint-{number}", tmp_path / "in" / name)
    out = tmp_path / "out"
    answer = sindyjoint(
        "batch", tmp_path / "in", "--out", out, "-l", "paper", "--reports", "--jobs", "2", "-q"
    )
    assert answer.status == 0
    files = {"factors.npz", "model.json", "record.json", "report.html", "terms.csv"}
    for name in ("j", "j.1", "j.1.2"):
        assert files <= {path.name for path in (out / "campaigns" / name).iterdir()}


def test_a_record_without_its_files_is_not_done(joints, tmp_path):
    out = tmp_path / "out"
    batch(joints / "joint-0", out, "paper")
    (folder,) = (out / "campaigns").iterdir()
    before = content(folder)
    for name in ("factors.npz", "model.json"):
        # As after a loss that the record does not know of: it lists only what was still there.
        record = json.loads(before["record.json"])
        del record["outputs"][name]
        (folder / "record.json").write_text(json.dumps(record), encoding="utf-8")
        (folder / name).unlink()
        assert batch(joints / "joint-0", out, "paper").kept == 0
        assert content(folder) == before
        (folder / name).unlink()
        assert batch(joints / "joint-0", out, "paper").kept == 0
        assert content(folder) == before
    assert batch(joints / "joint-0", out, "paper").kept == 1


def test_a_failed_attempt_keeps_the_earlier_result(joints, tmp_path, sindyjoint):
    shutil.copytree(joints / "joint-0", tmp_path / "in" / "joint-0")
    shutil.copytree(joints / "joint-1", tmp_path / "in" / "joint-1")
    out = tmp_path / "out"
    command = ("batch", tmp_path / "in", "--out", out, "-l", "paper")
    assert sindyjoint(*command, "--reports").status == 0
    folder = out / "campaigns" / "joint-0"
    before = content(folder)
    run = tmp_path / "in" / "joint-0" / "low.csv"
    run.rename(tmp_path / "low.csv")
    for _ in range(2):
        answer = sindyjoint(*command, "--reports")
        assert answer.status == 1 and "1 with a model, 1 broken" in answer.stdout
        assert "low.csv" in answer.stderr and "files of its earlier result are kept" in answer.stderr
        after = content(folder)
        record = json.loads(after.pop("record.json"))
        assert after == {name: data for name, data in before.items() if name != "record.json"}
        assert record["status"] == "broken" and "low.csv" in record["reason"]
        assert {"schema": 1, **record["earlier"]} == json.loads(before["record.json"])
        (row, _) = csv.DictReader((out / "batch.csv").read_text(encoding="utf-8").splitlines())
        assert row["status"] == "broken" and "earlier result" in row["reason"] and row["terms"] == ""
        # The page of an earlier result is not shown as one of this batch.
        page = (out / "report.html").read_text(encoding="utf-8")
        assert "campaigns/joint-1/report.html" in page and "campaigns/joint-0/report.html" not in page
    (tmp_path / "low.csv").rename(run)
    answer = sindyjoint(*command, "--reports")
    assert answer.status == 0 and "2 of them done before" in answer.stdout
    assert content(folder) == before


def test_reports_that_hold_outlive_a_batch_without_them(joints, tmp_path, sindyjoint):
    shutil.copytree(joints / "joint-0", tmp_path / "in" / "joint-0")
    out, folder = tmp_path / "out", tmp_path / "out" / "campaigns" / "joint-0"
    command = ("batch", tmp_path / "in", "--out", out, "-l", "paper")
    assert sindyjoint(*command).status == 0
    assert not (folder / "report.html").exists()
    assert "done before" not in sindyjoint(*command, "--reports").stdout
    before = content(folder)
    assert "report.html" in before
    assert "1 of them done before" in sindyjoint(*command).stdout
    assert content(folder) == before
    # Something more is requested: the campaign is done again, and what holds of the last time stays next to it.
    assert "done before" not in sindyjoint(*command, "--diagnose").stdout
    assert {"report.html", "diagnosis/report.html"} <= set(content(folder))
    assert "1 of them done before" in sindyjoint(*command, "--diagnose", "--reports").stdout
    # Of another run the report says nothing.
    with (tmp_path / "in" / "joint-0" / "low.csv").open("a") as file:
        file.write("0.1,0.0001\n")
    assert sindyjoint(*command).status == 0
    assert set(content(folder)) == {"model.json", "factors.npz", "record.json"}


def test_bad_input_is_refused_before_anything_is_done(joints, tmp_path):
    with pytest.raises(MissingInputError, match=r"no campaign\.toml in .*nothing"):
        batch(tmp_path / "nothing", tmp_path / "out")
    with pytest.raises(UnknownNameError, match="library 'papr' is unknown"):
        batch(joints, tmp_path / "out", "papr")
    with pytest.raises(UnknownNameError, match="has no term 'k9'"):
        batch(joints, tmp_path / "out", "paper", forced=("k9",))
    with pytest.raises(InputError, match="random_state: expected a whole number"):
        batch(joints, tmp_path / "out", "paper", random_state=np.random.default_rng(0))
    (tmp_path / "file").write_text("")
    with pytest.raises(OutputError, match="is a file"):
        batch(joints, tmp_path / "file", "paper")
    assert not (tmp_path / "out").exists()


def test_a_whole_folder_replaces_the_old_one_or_leaves_it(tmp_path):
    target = tmp_path / "results"
    with whole_folder(target) as stage:
        (stage / "one").write_text("1")
    with pytest.raises(RuntimeError), whole_folder(target) as stage:
        (stage / "two").write_text("2")
        raise RuntimeError
    assert [p.name for p in target.iterdir()] == ["one"]
    with whole_folder(target) as stage:
        (stage / "two").write_text("2")
    assert [p.name for p in target.iterdir()] == ["two"]
    assert [p.name for p in tmp_path.iterdir()] == ["results"]


LIVES = """
import sys
from sindyjoint.files.atomic import whole_folder
with whole_folder(sys.argv[1]) as stage:
    (stage / "file").write_text("x")
    print("ready", flush=True)
    sys.stdin.read()
"""


def test_only_what_a_dead_process_left_of_the_same_folder_is_removed(tmp_path):
    pytest.importorskip("fcntl", reason="no locks on folders: what is left stays")
    # Names of which one begins as the other, or that are alike in their first eighty characters.
    long = "x" * 90
    for name in ("j", "j.1", long, f"{long}-2", "[j]*"):
        target = tmp_path / name
        command = [sys.executable, "-c", LIVES, str(target)]
        with subprocess.Popen(command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True) as other:
            assert other.stdout.readline() == "ready\n"
            with whole_folder(tmp_path / "j") as stage:
                (stage / "mine").write_text("1")
            other.communicate("")
        assert other.returncode == 0 and (target / "file").read_text() == "x"
    with subprocess.Popen(command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True) as other:
        assert other.stdout.readline() == "ready\n"
        other.kill()
    assert list(tmp_path.glob(".*"))
    settle(tmp_path / "j")
    assert list(tmp_path.glob(".*"))
    settle(target)
    assert not list(tmp_path.glob(".*"))


def test_old_contents_that_nothing_replaced_go_back(tmp_path, monkeypatch):
    target = tmp_path / "results"
    target.mkdir()
    (target / "one").write_text("1")
    true, calls = os.replace, []

    def refuse(source, place):
        calls.append(source)
        if len(calls) == 3:  # after the rename of the new folder and of the old one: the move in
            raise OSError(28, "No space left on device", str(source))
        true(source, place)

    monkeypatch.setattr(os, "replace", refuse)
    with pytest.raises(OutputError, match="No space left"), whole_folder(target):
        pass
    monkeypatch.undo()
    assert len(calls) == 4 and [p.name for p in tmp_path.rglob("*")] == ["results", "one"]
    # A process that was killed between the two has no such chance: the next one sees to it.
    target.rename(_name_temporary(target, OLD))
    settle(target)
    assert [p.name for p in tmp_path.rglob("*")] == ["results", "one"]


def test_factors_survive_the_file(tmp_path, done):
    evidence = read_evidence(done[0] / "campaigns" / "joint-0" / "factors.npz")
    (tmp_path / "again.npz").write_bytes(evidence_bytes(evidence))
    again = read_evidence(tmp_path / "again.npz")
    assert again.ids == evidence.ids and again.groups == evidence.groups
    np.testing.assert_array_equal(again.pooled.triangle, evidence.pooled.triangle)
    (tmp_path / "bad.npz").write_text("no archive")
    with pytest.raises(InputError, match="holds no factors"):
        read_evidence(tmp_path / "bad.npz")
