"""Ctrl-C in commands: status 130, one line, and nothing half-written, whatever it comes upon."""

import pkgutil
import signal
import sys

import pytest
from made_models import paper_model

from sindyjoint import load_campaign
from sindyjoint.documents import changed_files

# Where it comes: before anything is written, while a file or folder aside is made or held, while files move in.
EARLY, ASIDE, MOVING = (f"files.atomic.{name}" for name in ("check_output", "settle", "sums_text"))
# The list of hashes of the folder aside, that of the unfinished folder, that of the finished one.
CALLS = {MOVING: 3}
MODEL = "equation.catalogue_file.read_json"
FOLDER, FILE = "out", "out.txt"
BENCH = (5000.0, 0.0, 0.0, 28.4, 1.5)  # of the joint in the campaign
COMMANDS = {
    "verify": (("verify", "model.json", "campaign", "--draws", "0", "--out", FOLDER), (EARLY, MOVING)),
    "rig": (("rig", "pulse-rig", "--out", FOLDER), (EARLY, MOVING)),
    "export": (("export", "model.json", "--to", "c", "--out", FILE), (MODEL, ASIDE)),
    "check": (("check", "campaign", "--out", FOLDER), (EARLY, ASIDE, MOVING)),
    "simulate": (("simulate", "--model", "model.json", "--out", FOLDER), (MODEL, MOVING)),
    "init": (("init", "campaign", "--force", "--yes"), ("files.drafting.init.survey_folder", ASIDE)),
    "copy": (("libraries", "copy", "paper", FILE), (ASIDE,)),
    "schema": (("schema",), ("reporting.registry.record_schema",)),
}


pytestmark = pytest.mark.usefixtures("heard")


def interrupted(sindyjoint, monkeypatch, command, at):
    """Run a command and send what Ctrl-C sends when that function is called."""
    came = []
    function = pkgutil.resolve_name(f"sindyjoint.{at}")

    def called(*arguments, **options):
        came.append(at)
        if len(came) == CALLS.get(at, 1):
            signal.raise_signal(signal.SIGINT)
        return function(*arguments, **options)

    with monkeypatch.context() as patch:
        patch.setattr(f"sindyjoint.{at}", called)
        answer = sindyjoint(*command)
    assert len(came) >= CALLS.get(at, 1), f"{command} does not call {at}"
    return answer


def held_against_what_ctrl_c_promises(answer, home, before):
    assert answer.status == 130 and answer.stderr.splitlines()[-1] == "sindyjoint: interrupted"
    assert "Traceback" not in answer.stderr and answer.stderr.count("sindyjoint:") == 1
    assert not list(home.rglob(".*"))
    after = {path: path.read_bytes() for path in home.rglob("*") if path.is_file()}
    if list((home / FOLDER).iterdir()):
        assert changed_files(home / FOLDER) == []
    else:
        assert after == before


@pytest.mark.parametrize(
    ("name", "at"), [(name, at) for name, (_, stops) in COMMANDS.items() for at in stops]
)
def test_ctrl_c_is_one_line_and_leaves_nothing_half_written(folder, sindyjoint, monkeypatch, name, at):
    home = folder.path.parent
    monkeypatch.chdir(home)
    (home / "model.json").write_text(paper_model(values=BENCH).to_json())
    (home / FOLDER).mkdir()
    before = {path: path.read_bytes() for path in home.rglob("*") if path.is_file()}
    held_against_what_ctrl_c_promises(
        interrupted(sindyjoint, monkeypatch, COMMANDS[name][0], at), home, before
    )


def test_ctrl_c_while_a_figure_is_drawn_anew(folder, sindyjoint, monkeypatch):
    home = folder.path.parent
    monkeypatch.chdir(home)
    assert sindyjoint("check", "campaign", "--out", FOLDER).status == 0
    kind = sindyjoint("plot", FOLDER).stdout.split()[0]
    before = {path: path.read_bytes() for path in home.rglob("*") if path.is_file()}
    for at in ("reporting.registry.read_json", ASIDE):
        answer = interrupted(sindyjoint, monkeypatch, ("plot", FOLDER, kind, "--out", "figure.svg"), at)
        held_against_what_ctrl_c_promises(answer, home, before)
        assert not (home / "figure.svg").exists()


def test_files_that_move_in_arrive_together(folder, sindyjoint, monkeypatch):
    # The control: without the pause of Ctrl-C old and new files would be mixed, and the folder refused.
    from contextlib import nullcontext

    home = folder.path.parent
    monkeypatch.chdir(home)
    (home / FOLDER).mkdir()
    monkeypatch.setattr("sindyjoint.files.atomic._uninterrupted", nullcontext)
    assert interrupted(sindyjoint, monkeypatch, COMMANDS["check"][0], MOVING).status == 130
    assert changed_files(home / FOLDER) == ["its writing was interrupted"]


def test_ctrl_c_that_comes_while_an_object_is_cleared_is_not_lost(folder, sindyjoint, monkeypatch):
    class Cleared:
        def __del__(self):
            signal.raise_signal(signal.SIGINT)

    def read(*arguments):
        Cleared()
        return load(*arguments)

    load, lost = load_campaign, []
    monkeypatch.setattr(sys, "unraisablehook", lost.append)
    monkeypatch.setattr("sindyjoint.workflows.check.load_campaign", read)
    answer = sindyjoint("check", folder.path)
    assert [raised.exc_type for raised in lost] == [KeyboardInterrupt]
    assert answer.status == 130 and answer.stderr.splitlines()[-1] == "sindyjoint: interrupted"
    assert not answer.stdout


def test_ctrl_c_that_comes_while_a_class_is_made_is_no_error_of_the_command(folder, sindyjoint, monkeypatch):
    class Named:
        def __set_name__(self, owner, name):
            signal.raise_signal(signal.SIGINT)

    monkeypatch.setattr(
        "sindyjoint.workflows.check.load_campaign", lambda *_: type("Made", (), {"x": Named()})
    )
    answer = sindyjoint("check", folder.path)
    assert answer.status == 130 and answer.stderr.splitlines() == ["sindyjoint: interrupted"]
