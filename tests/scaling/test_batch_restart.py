"""Many campaigns that are interrupted, killed or begun again: nothing is lost and nothing done twice."""

import csv
import json
import os
import shutil
import signal
import subprocess
import sys
from pathlib import Path

import pytest
from small_joints import content

from sindyjoint.files import hold_folder, name_temporary
from sindyjoint.workflows import read_record, verify_batch
from sindyjoint.workflows.batch import batch


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


@pytest.mark.slow
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
    name_temporary(out / "campaigns" / undone).mkdir()
    fresh = []
    # What was written does not know how it was run, nor does what is written next: here without other processes.
    result = batch(joints, out, "paper", on_record=lambda record: fresh.append(record.id))
    after = written(out)
    assert result.kept == len(before) and sorted(fresh) == sorted(after)
    assert {name: after[name] for name in before} == before
    assert content(out / "campaigns") == content(done[0] / "campaigns")
    assert result.to_dict() == done[1].to_dict()
    assert not list((out / "campaigns").glob(".*"))


def written(out: Path) -> dict[str, int]:
    return {p.parent.name: p.stat().st_mtime_ns for p in out.glob("campaigns/[!.]*/record.json")}


@pytest.mark.parametrize("way", WAYS[1:])
def test_every_way_of_running_writes_the_same_bytes_though_a_worker_dies(done, joints, tmp_path, way):
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
            killed.append(worker)

    result = batch(joints, tmp_path / "out", "paper", on_record=on_record, **way)
    (worker,) = killed
    # Its parent may not have fetched how it ended.
    assert not worker.is_running() or worker.status() == psutil.STATUS_ZOMBIE
    assert content(tmp_path / "out" / "campaigns") == content(done[0] / "campaigns")
    assert result.to_dict() == done[1].to_dict()


def test_an_interruption_loses_the_campaign_in_hand_at_most(heard, joints, tmp_path, sindyjoint, monkeypatch):
    from sindyjoint.workflows import batch as workflow

    done = []

    def run_task(task):
        if len(done) == 3:
            signal.raise_signal(signal.SIGINT)
        done.append(workflow_task(task))
        return done[-1]

    workflow_task = workflow.run_task
    command = ("batch", joints, "--out", tmp_path / "out", "-l", "paper")
    with monkeypatch.context() as patch:
        patch.setattr(workflow, "run_task", run_task)
        answer = sindyjoint(*command)
    assert answer.status == 130
    assert answer.stderr == "sindyjoint: interrupted; the same command goes on where this one stopped\n"
    assert "3 of them done before" in sindyjoint(*command).stdout


INTERRUPTED = """
import os, signal
from tests.light_tasks import square_sum
from sindyjoint.parallel import executor
if __name__ == "__main__":
    try:
        with executor(jobs=2) as workers:
            for number, _ in workers(square_sum, [10, *7 * [10**12]]):
                os.killpg(0, signal.SIGINT)
    except KeyboardInterrupt:
        print(number, "interrupted")
"""


def test_processes_end_with_an_interruption_and_without_a_word(heard, tmp_path):
    # As a terminal does: to all processes of the group. What ends is what the other end of the pipes is closed by.
    (tmp_path / "script.py").write_text(INTERRUPTED)
    environment = {**os.environ, "PYTHONPATH": os.pathsep.join([str(Path(__file__).parents[2]), *sys.path])}
    command = [sys.executable, tmp_path / "script.py"]
    run = subprocess.run(command, env=environment, capture_output=True, text=True, start_new_session=True)
    assert (run.returncode, run.stdout, run.stderr) == (0, "0 interrupted\n", "")


def test_a_record_without_its_files_is_not_done(joints, tmp_path):
    out = tmp_path / "out"
    batch(joints / "joint-0", out, "paper")
    (folder,) = (out / "campaigns").iterdir()
    before = content(folder)
    for name in ("factors.npz", "model.json"):
        # As after a loss that the record does not know of: it lists only what was still there.
        record = read_record(folder)
        del record.outputs[name]
        (folder / "record.json").write_text(record.to_json(), encoding="utf-8")
        (folder / name).unlink()
        assert batch(joints / "joint-0", out, "paper").kept == 0
        assert content(folder) == before
        (folder / name).unlink()
        assert batch(joints / "joint-0", out, "paper").kept == 0
        assert content(folder) == before
    assert batch(joints / "joint-0", out, "paper").kept == 1


def test_a_record_that_was_tampered_with_is_not_done(joints, tmp_path):
    out = tmp_path / "out"
    batch(joints / "joint-0", out, "paper")
    (folder,) = (out / "campaigns").iterdir()
    before = content(folder)
    text = before["record.json"].decode()
    for changed in (
        text.replace('"found"', '"none"'),
        text.replace('"terms": [', '"terms": [null, ', 1),
        text.replace('"checksum"', '"checksums"'),
        text[: len(text) // 2],
        "[" * 100_000,
        "{}",
    ):
        (folder / "record.json").write_text(changed, encoding="utf-8")
        assert verify_batch(joints / "joint-0", out, "paper")[0][0] == folder.name
        assert batch(joints / "joint-0", out, "paper").kept == 0
        assert content(folder) == before


def test_a_finished_batch_is_verified(joints, tmp_path, sindyjoint):
    out = tmp_path / "out"
    for name in ("joint-0", "joint-1", "joint-2"):
        shutil.copytree(joints / name, tmp_path / "in" / name)
    command = ("batch", tmp_path / "in", "--out", out, "-l", "paper")
    assert sindyjoint(*command).status == 0
    before = content(out)
    answer = sindyjoint(*command, "--verify-only")
    assert (answer.status, answer.stderr) == (0, "") and "everything is as it was written" in answer.stdout
    assert content(out) == before
    (out / "campaigns" / "joint-0" / "factors.npz").write_bytes(b"x")
    (out / "campaigns" / "joint-1" / "model.json").unlink()
    with (tmp_path / "in" / "joint-2" / "low.csv").open("a") as file:
        file.write("0.1,0.0001\n")
    (out / "batch.csv").write_text("mine")
    answer = sindyjoint(*command, "--verify-only", "--json")
    assert answer.status == 1
    assert [tuple(fault.values()) for fault in json.loads(answer.stdout)["faults"]] == [
        ("joint-0", "factors.npz was changed"),
        ("joint-1", "model.json is missing"),
        ("joint-2", "was made from other files, options, catalogue or version"),
        ("", "batch.csv was changed"),
    ]
    assert "has no reports" in sindyjoint(*command, "--reports", "--verify-only").stdout
    assert "6 fault(s)" in sindyjoint(*command, "--verify-only", "--align").stdout
    shutil.copytree(joints / "joint-0", tmp_path / "in" / "joint-9")
    assert "joint-9: has no result there" in sindyjoint(*command, "--verify-only").stdout
    # A folder that no batch wrote is the input's fault, in one line.
    foreign = sindyjoint("batch", tmp_path / "in", "--out", tmp_path / "in", "--verify-only")
    assert (foreign.status, foreign.stdout) == (2, "")
    assert "holds no batch; expected the folder that batch wrote with --out" in foreign.stderr


def test_a_second_batch_into_the_same_folder_is_refused(joints, tmp_path, sindyjoint):
    pytest.importorskip("fcntl", reason="no locks on folders")
    (tmp_path / "out" / "campaigns").mkdir(parents=True)
    with hold_folder(tmp_path / "out" / "campaigns") as held:
        answer = sindyjoint("batch", joints / "joint-0", "--out", tmp_path / "out", "-l", "paper")
    assert held and answer.status == 2 and answer.stderr.count("\n") == 1
    assert "another batch is writing into" in answer.stderr
    assert not list((tmp_path / "out" / "campaigns").iterdir())


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
        earlier = json.loads(before["record.json"])
        assert earlier.pop("schema") == 2 and len(earlier.pop("checksum")) == 64
        assert record["earlier"] == earlier
        (row, _) = csv.DictReader((out / "batch.csv").read_text(encoding="utf-8").splitlines())
        assert row["status"] == "broken" and "earlier result" in row["reason"] and row["terms"] == ""
        # The page of an earlier result is not shown as one of this batch.
        page = (out / "report.html").read_text(encoding="utf-8")
        assert "campaigns/joint-1/report.html" in page and "campaigns/joint-0/report.html" not in page
    (tmp_path / "low.csv").rename(run)
    answer = sindyjoint(*command, "--reports")
    assert answer.status == 0 and "2 of them done before" in answer.stdout
    assert content(folder) == before


def test_reports_that_hold_outlive_a_batch_without_them(joints, tmp_path, sindyjoint, few_effects):
    few_effects("quadratic_damping", "dead_zone")
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
    assert set(content(folder)) == {"model.json", "factors.npz", "record.json", "SHA256SUMS"}
