"""Folders of results that were written half, or changed since: refused by readers, mended by the next run."""

import hashlib
import json
import os
import shutil
import subprocess
import sys
import threading
import time

import pytest
from made_models import paper_model

from sindyjoint.documents import SUMS, changed_files, read_checked, read_list, refuse_foreign_file
from sindyjoint.errors import InputError, OutputError
from sindyjoint.export import read_model
from sindyjoint.files import load_campaign, output_folder
from tests.seeds import slow


def write(folder, number=0, count=40, **options):
    with output_folder(folder, **options) as stage:
        (stage / "figures").mkdir()
        (stage / "figures" / "data.json").write_text(json.dumps({"number": number}))
        (stage / "model.json").write_text(paper_model().to_json() + "\n" * number)
        for i in range(count):
            (stage / f"{i:02d}.txt").write_text(str(number))


def test_the_list_is_that_of_sha256sum(tmp_path):
    write(tmp_path / "out", count=2)
    lines = (tmp_path / "out" / SUMS).read_text().splitlines()
    assert [line.split("  ")[1] for line in lines] == ["00.txt", "01.txt", "figures/data.json", "model.json"]
    assert lines[0].split("  ")[0] == hashlib.sha256(b"0").hexdigest()
    if shutil.which("sha256sum"):
        subprocess.run(
            ["sha256sum", "--check", "--strict", "--quiet", SUMS], cwd=tmp_path / "out", check=True
        )


def test_a_second_result_joins_the_list_and_other_files_stay(tmp_path):
    write(tmp_path, count=3)
    (tmp_path / "notes.md").write_text("mine")
    with output_folder(tmp_path) as stage:
        (stage / "00.txt").write_text("new")
        (stage / "more.txt").write_text("new")
    assert changed_files(tmp_path) == [] and (tmp_path / "notes.md").read_text() == "mine"
    assert len((tmp_path / SUMS).read_text().splitlines()) == 6
    (tmp_path / "01.txt").write_text("edited")
    (tmp_path / "02.txt").unlink()
    assert changed_files(tmp_path) == ["01.txt was changed", "02.txt is missing"]


def test_results_of_one_kind_are_replaced_whole_and_others_stay(tmp_path):
    (tmp_path / "notes.md").write_text("mine")
    with output_folder(tmp_path, "campaign") as stage:
        (stage / "campaign.toml").write_text("")
    write(tmp_path, count=3, kind="discovery")
    write(tmp_path, number=1, count=1, kind="discovery")
    names = {path.name for path in tmp_path.iterdir()}
    assert names == {"SHA256SUMS", "notes.md", "campaign.toml", "00.txt", "model.json", "figures"}
    assert changed_files(tmp_path) == [] and read_list(tmp_path).kinds["campaign.toml"] == "campaign"
    if shutil.which("sha256sum"):
        subprocess.run(["sha256sum", "--check", "--strict", "--quiet", SUMS], cwd=tmp_path, check=True)


def test_a_file_of_the_user_is_replaced_only_by_force(tmp_path):
    write(tmp_path, count=2, kind="discovery")
    (tmp_path / "01.txt").write_text("mine")
    before = {path: path.read_bytes() for path in tmp_path.rglob("*") if path.is_file()}
    with pytest.raises(
        OutputError, match=r"cannot write '.*01.txt': it was not written by this command, or was cha"
    ):
        write(tmp_path, number=1, count=2, kind="discovery")
    with pytest.raises(OutputError, match=r"00.txt' \(and 3 more\)"):
        write(tmp_path, number=1, count=2, kind="diagnosis")
    assert {path: path.read_bytes() for path in tmp_path.rglob("*") if path.is_file()} == before
    # What the user changed is not in the way of results without it, and stays.
    write(tmp_path, number=1, count=1, kind="discovery")
    assert (tmp_path / "01.txt").read_text() == "mine" and (tmp_path / "00.txt").read_text() == "1"
    write(tmp_path, number=2, count=2, kind="discovery", force=True)
    assert (tmp_path / "01.txt").read_text() == "2" and changed_files(tmp_path) == []


def test_a_changed_model_is_refused_and_a_copy_elsewhere_is_not(tmp_path, sindyjoint):
    write(tmp_path / "out", count=1)
    model = tmp_path / "out" / "model.json"
    text = model.read_text()
    model.write_text(text.replace("6066", "6067") + " ")
    for command in (
        ("export", model, "--to", "c"),
        ("verify", model, "pulse-rig"),
        ("plot", tmp_path / "out"),
    ):
        answer = sindyjoint(*command)
        assert answer.status == 2 and answer.stderr.count("\n") == 1, answer
    assert "is not the file that was written" in sindyjoint("export", model, "--to", "c").stderr
    (tmp_path / "mine").mkdir()
    shutil.copy(model, tmp_path / "mine")
    assert read_model(tmp_path / "mine").ids == paper_model().ids


def test_a_picture_file_is_held_against_the_list_of_the_folder_above(tmp_path):
    write(tmp_path, count=0)
    assert json.loads(read_checked(tmp_path / "figures" / "data.json")) == {"number": 0}
    (tmp_path / "figures" / "data.json").write_text('{"number": 1}')
    with pytest.raises(InputError, match="is not the file that was written"):
        read_checked(tmp_path / "figures" / "data.json")


def test_a_list_that_is_none_is_refused_until_the_next_run_by_force(tmp_path):
    write(tmp_path, count=0)
    for damage in (b"\xff\xfe", b"abc\n", b"0" * 64 + b"  \x1b[31m\n"):
        (tmp_path / SUMS).write_bytes(damage)
        with pytest.raises(InputError, match="is no list of hashes"):
            read_model(tmp_path)
    write(tmp_path, count=0, force=True)
    assert read_model(tmp_path).terms


def test_an_edited_simulated_campaign_is_read_and_half_of_one_is_not(bench, tmp_path):
    with output_folder(tmp_path) as stage:
        (stage / "run2.csv").write_text("t")
    bench.replace('name = "bench"', 'name = "mine"')
    assert load_campaign(tmp_path).joint.name == "mine"
    (tmp_path / SUMS).write_text(
        "# unfinished: results are being written, or their writing was interrupted\n"
    )
    with pytest.raises(InputError, match="writing these results was interrupted"):
        load_campaign(tmp_path)


KILLED = """
import os, signal, sys
from sindyjoint.files import atomic
true, count = os.replace, 0
def replace(source, target):
    global count
    count += 1
    if count == int(sys.argv[2]):
        os.kill(os.getpid(), signal.SIGKILL)
    true(source, target)
os.replace = atomic.os.replace = replace
from test_files_checksums import write
write(sys.argv[1], 1, kind="discovery")
"""


@pytest.mark.parametrize("at", [2, 3, 44, 45, *slow(20, 43)])
def test_old_and_new_files_are_never_taken_for_a_result(tmp_path, at):
    # Killed before the n-th file has its name: the list that says so, 42 files, the list of hashes.
    pytest.importorskip("fcntl", reason="no locks on folders: what is left stays")
    write(tmp_path / "out", 0, kind="discovery")
    run = subprocess.run(
        [sys.executable, "-c", KILLED, str(tmp_path / "out"), str(at)],
        env={**os.environ, "PYTHONPATH": os.pathsep.join([os.path.dirname(__file__), *sys.path])},
    )
    # The list within the stage is renamed as well, and before all others.
    assert run.returncode == -9
    numbers = {path.read_text() for path in (tmp_path / "out").glob("*.txt")}
    if at == 2:
        assert numbers == {"0"} and changed_files(tmp_path / "out") == []
    else:
        assert changed_files(tmp_path / "out") == ["its writing was interrupted"]
        with pytest.raises(
            InputError, match="was interrupted, old and new files are mixed; run the command again"
        ):
            read_model(tmp_path / "out")
    assert list((tmp_path / "out").glob(".*.part"))
    write(tmp_path / "out", 1, kind="discovery")
    assert changed_files(tmp_path / "out") == [] and not list((tmp_path / "out").glob(".*"))


def test_a_first_result_appears_in_one_step(tmp_path):
    seen, looked = [], threading.Event()

    def look():
        while not seen or seen[-1] != 43:
            seen.append(len(list((tmp_path / "out").rglob("*.*"))) if (tmp_path / "out").exists() else 0)
            looked.set()
            time.sleep(0)

    watcher = threading.Thread(target=look, daemon=True)
    watcher.start()
    assert looked.wait(timeout=20)  # a thread may start late: the empty folder is seen before the writing
    write(tmp_path / "out", count=41)
    watcher.join(timeout=20)
    assert set(seen) == {0, 43}


TOGETHER = """
import sys, threading
from test_files_checksums import write
def work(number):
    for step in range(3):
        write(sys.argv[1], 10 * int(sys.argv[2]) + number, 10)
        write(f"{sys.argv[1]}-{sys.argv[2]}-{number}", number, 3)
threads = [threading.Thread(target=work, args=(number,)) for number in range(8)]
[thread.start() for thread in threads]
[thread.join() for thread in threads]
"""


def test_four_processes_of_eight_threads_write_into_one_folder(tmp_path):
    pytest.importorskip("fcntl", reason="no locks on folders")
    environment = {**os.environ, "PYTHONPATH": os.pathsep.join([os.path.dirname(__file__), *sys.path])}
    command = [sys.executable, "-c", TOGETHER, str(tmp_path / "out")]
    runs = [
        subprocess.Popen([*command, str(number)], env=environment, stderr=subprocess.PIPE, text=True)
        for number in range(4)
    ]
    errors = [run.communicate()[1] for run in runs]
    assert errors == [""] * 4 and [run.returncode for run in runs] == [0] * 4
    folders = sorted(tmp_path.iterdir())
    assert len(folders) == 33  # the common one, one for each thread, and nothing left over
    for folder in folders:
        assert changed_files(folder) == [] and not list(folder.glob(".*"))
    # Of one writer all of it, not of several some.
    assert len({path.read_text() for path in (tmp_path / "out").glob("*.txt")}) == 1


@pytest.mark.parametrize("kind", ["svg", "png", "pdf"])
def test_a_figure_takes_the_place_of_a_figure_and_of_no_other_file(kind, tmp_path):
    from matplotlib.figure import Figure

    from sindyjoint.reporting import figure_bytes

    place = tmp_path / f"loops.{kind}"
    refuse_foreign_file(place, False)
    place.write_bytes(figure_bytes(Figure(), kind))
    refuse_foreign_file(place, False)
    place.write_bytes(b"my own drawing")
    with pytest.raises(
        OutputError, match="did not write is there; choose another name, or replace it with --force"
    ):
        refuse_foreign_file(place, False)
    refuse_foreign_file(place, True)
