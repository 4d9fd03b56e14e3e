"""Whole or not at all."""

import os
import subprocess
import sys

import pytest

from sindyjoint.errors import OutputError
from sindyjoint.files import (
    OLD,
    check_output,
    name_temporary,
    output_folder,
    prepare_output,
    settle,
    whole_folder,
    write_bytes,
    write_text,
)


def everything(folder) -> set[str]:
    return {str(path.relative_to(folder)) for path in folder.rglob("*")}


def test_text_is_written_and_replaced(tmp_path):
    target = tmp_path / "model.json"
    write_text(target, "k1 = 6066 N·m/rad\n")
    write_text(target, "c1\n")
    assert target.read_bytes() == b"c1\n"
    assert everything(tmp_path) == {"model.json"}


def test_a_failure_leaves_the_old_file(tmp_path, monkeypatch):
    target = tmp_path / "model.json"
    write_bytes(target, b"old")

    def refuse(*_):
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(os, "replace", refuse)
    with pytest.raises(
        OutputError, match=r"cannot write '.*model.json': No space left on device; choose another"
    ):
        write_bytes(target, b"new")
    assert target.read_bytes() == b"old"
    assert everything(tmp_path) == {"model.json"}


def test_a_folder_is_no_file(tmp_path):
    with pytest.raises(OutputError, match="it is a folder; give the name of a file"):
        write_text(tmp_path, "x")


@pytest.mark.skipif(not hasattr(os, "mkfifo"), reason="no pipes")
def test_a_pipe_or_a_device_is_not_replaced_by_a_file(tmp_path):
    os.mkfifo(tmp_path / "pipe")
    (tmp_path / "link").symlink_to("pipe")
    for name in ("pipe", "link"):
        with pytest.raises(OutputError, match="it is a device or a pipe"):
            write_text(tmp_path / name, "x")
    assert (tmp_path / "pipe").is_fifo() and everything(tmp_path) == {"pipe", "link"}


def test_the_folder_of_a_file_must_exist(tmp_path):
    with pytest.raises(OutputError, match=r"cannot write '.*x.json': No such file or directory"):
        write_text(tmp_path / "no" / "x.json", "x")


def test_a_file_is_no_output_folder(tmp_path):
    (tmp_path / "taken").write_text("x")
    for make in (check_output, prepare_output):
        with pytest.raises(
            OutputError, match=r"cannot write into '.*taken': it is a file; expected the name of a folder"
        ):
            make(tmp_path / "taken")
        with pytest.raises(OutputError, match=r"cannot write into '.*deep': '.*taken' is a file"):
            make(tmp_path / "taken" / "deep")


def test_checking_leaves_nothing_behind(tmp_path):
    assert check_output(tmp_path / "a" / "b") == tmp_path / "a" / "b"
    assert everything(tmp_path) == set()


def test_preparing_makes_the_folder(tmp_path):
    assert prepare_output(tmp_path / "a" / "b").is_dir()
    assert prepare_output(tmp_path / "a" / "b").is_dir()
    assert everything(tmp_path) == {"a", os.path.join("a", "b")}


def test_a_system_that_refuses_is_one_line(tmp_path, monkeypatch):
    # Permission bits mean nothing to root, who may run this: let the system call itself refuse.
    from pathlib import Path

    def refuse(self, *args, **kwargs):
        raise OSError(30, "Read-only file system")

    monkeypatch.setattr(Path, "touch", refuse)
    with pytest.raises(
        OutputError, match=r"cannot write '.*out': Read-only file system; choose another path"
    ):
        check_output(tmp_path / "out")


@pytest.mark.skipif(os.name != "posix", reason="permissions of POSIX")
def test_a_read_only_folder(bound_by_permissions):
    folder, bound = bound_by_permissions
    folder.chmod(0o500)
    with bound(), pytest.raises(OutputError, match="Permission denied"):
        check_output(folder / "out")
    folder.chmod(0o700)
    with bound():
        check_output(folder / "out")


def test_output_appears_at_the_end(tmp_path):
    target = tmp_path / "new" / "out"
    with output_folder(target) as stage:
        (stage / "figures").mkdir()
        (stage / "figures" / "a.svg").write_text("svg")
        (stage / "model.json").write_text("{}")
        assert not target.exists() and stage.parent.parent == target.parent
    assert everything(target) == {"SHA256SUMS", "model.json", "figures", os.path.join("figures", "a.svg")}


def test_after_an_exception_nothing_is_there(tmp_path):
    with pytest.raises(ZeroDivisionError), output_folder(tmp_path / "new" / "out") as stage:
        (stage / "model.json").write_text("{}")
        raise ZeroDivisionError
    assert everything(tmp_path) == set()


def test_after_an_exception_the_old_results_stay(tmp_path):
    (tmp_path / "model.json").write_text("old")
    with pytest.raises(ZeroDivisionError), output_folder(tmp_path) as stage:
        (stage / "model.json").write_text("new")
        raise ZeroDivisionError
    assert (tmp_path / "model.json").read_text() == "old"
    assert everything(tmp_path) == {"model.json"}


def test_a_folder_in_the_way_of_a_result(tmp_path):
    (tmp_path / "model.json").mkdir()
    with (
        pytest.raises(OutputError, match=r"model.json': it is a folder; remove it"),
        output_folder(tmp_path) as stage,
    ):
        (stage / "a.txt").write_text("x")
        (stage / "model.json").write_text("{}")
    assert everything(tmp_path) == {"model.json"}


def test_a_full_disk_while_filling(tmp_path):
    with pytest.raises(OutputError, match="No space left"), output_folder(tmp_path / "out") as stage:
        raise OSError(28, "No space left on device", str(stage / "model.json"))
    assert everything(tmp_path) == set()


def test_another_missing_file_is_not_blamed_on_the_output(tmp_path):
    with pytest.raises(FileNotFoundError, match="nowhere"), output_folder(tmp_path / "out"):
        open("/nowhere/at/all")
    assert everything(tmp_path) == set()


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
from sindyjoint.files import whole_folder
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
        if len(calls) == 2:  # after the rename of the old folder: the move in
            raise OSError(28, "No space left on device", str(source))
        true(source, place)

    monkeypatch.setattr(os, "replace", refuse)
    with pytest.raises(OutputError, match="No space left"), whole_folder(target):
        pass
    monkeypatch.undo()
    assert len(calls) == 3 and [p.name for p in tmp_path.rglob("*")] == ["results", "one"]
    # A process that was killed between the two has no such chance: the next one sees to it.
    target.rename(name_temporary(target, OLD))
    settle(target)
    assert [p.name for p in tmp_path.rglob("*")] == ["results", "one"]


def test_what_is_being_written_under_a_name_that_begins_alike_is_left(tmp_path):
    with whole_folder(tmp_path / "j.1") as stage:
        (stage / "factors").write_text("1")
        with whole_folder(tmp_path / "j") as other:
            (other / "model").write_text("2")
        settle(tmp_path / "j")
        assert (stage / "factors").exists()
    assert {p.relative_to(tmp_path).as_posix() for p in tmp_path.rglob("*")} == {
        "j", "j/model", "j.1", "j.1/factors",
    }  # fmt: skip
