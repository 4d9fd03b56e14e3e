"""A console that cannot show a sign gets another one for it, in order, and the status that it would have had."""

import io
import os
import shutil
import subprocess
import sys
from functools import cache
from pathlib import Path

import pytest

from sindyjoint import cli
from tests.doors.asked import without_stages

# A name with letters of several scripts, in a campaign whose units and symbols are not ASCII anyway.
NAME = "Gelenk θ₁ ü 漢"


def answer(console, status, stdout, stderr):
    """Return what a command left behind; strict: what is written is of this encoding and of no other."""
    stdout, stderr = (part.decode(console.partition(":")[0]) for part in (stdout, stderr))
    assert "Traceback" not in stderr
    return status, stdout, stderr


def in_new_process(console, *arguments):
    environment = {**os.environ, "PYTHONIOENCODING": console}
    command = [sys.executable, "-m", "sindyjoint", *map(str, arguments)]
    done = subprocess.run(command, env=environment, capture_output=True)
    return answer(console, done.returncode, done.stdout, done.stderr)


@pytest.fixture
def run(monkeypatch):
    """Run the command line in this process, on streams as Python opens them under PYTHONIOENCODING."""

    def run(console, *arguments):
        name, _, errors = console.partition(":")
        streams = [
            io.TextIOWrapper(io.BytesIO(), encoding=name, errors=each, write_through=True)
            for each in (errors or "strict", "backslashreplace")
        ]
        with monkeypatch.context() as patch, pytest.raises(SystemExit) as leave:
            patch.setattr(sys, "stdout", streams[0])
            patch.setattr(sys, "stderr", streams[1])
            cli.main([str(argument) for argument in arguments])
        written = (stream.buffer.getvalue() for stream in streams)
        status, stdout, stderr = answer(console, int(leave.value.code or 0), *written)
        return status, stdout, without_stages(stderr, arguments)

    return run


@pytest.fixture
def named(folder):
    folder.replace("bench joint", NAME)
    return folder.path


CONSOLES = ["ascii", "cp1252", "ascii:surrogateescape"]


@pytest.mark.parametrize("console", CONSOLES)
def test_a_new_process_writes_what_this_one_does(run, named, console):
    # A result, and an error; that of all commands is seen below.
    for arguments in (("libraries", "show", "paper"), ("check", named / "campaign θ.toml", "--quiet")):
        fresh = in_new_process(console, *arguments)
        assert fresh == run(console, *arguments) and "theta" in fresh[1] + fresh[2]


@pytest.mark.parametrize("console", CONSOLES)
def test_a_result_is_spelled(run, named, console):
    status, stdout, stderr = run(console, "discover", named, "--library", "paper", "--verbose")
    assert status == 0 and "done" in stderr
    assert stdout.startswith(r"Gelenk theta1 ")
    assert r"\u6f22" in stdout
    if console == "cp1252":
        assert "k1·theta" in stdout and "N·m/rad " in stdout and " ± " in stdout and "ü" in stdout
    else:
        assert "k1*theta" in stdout and "N*m/rad " in stdout and " +/- " in stdout and r"\xfc" in stdout


@pytest.mark.parametrize("console", ["ascii", "cp1252"])
def test_other_commands_end_as_they_would(run, named, tmp_path, console):
    quick = ("--method", "stlsq", "--replicates", "10", "-l", "paper")
    assert run(console, "compare", named, *quick, "--out", tmp_path / "θ")[0] == 0
    (tmp_path / "in" / "ψ").mkdir(parents=True)
    (tmp_path / "in" / "ψ" / "campaign.toml").write_text("joint = [", encoding="utf-8")
    named.rename(tmp_path / "in" / "joint θ")
    status, stdout, stderr = run(console, "batch", tmp_path / "in", "--out", tmp_path / "out", "-l", "paper")
    assert status == 1 and "psi" in stdout and stderr.startswith("sindyjoint: psi: ")
    # Prints and echoes come in the order in which they were made.
    assert stdout.index("2 campaigns: 1 with a model, 1 broken") < stdout.index("report: ")
    status, stdout, _ = run(console, "libraries", "show", "paper")
    assert status == 0 and "theta" in stdout
    status, stdout, stderr = run(console, "discover", tmp_path / "no θ here")
    assert status == 2 and stdout == "" and "no theta here" in stderr and stderr.count("\n") == 1
    assert run(console, "diagnose", "--help")[0] == 0


OTHERS = (
    (0, "init", "{copy}", "--yes"),
    (0, "check", "{folder}", "--out", "{out}/check"),
    (0, "verify", "{model}", "{folder}", "--out", "{out}/verify"),
    (0, "diagnose", "{folder}", "--model", "{model}", "--out", "{out}/why"),
    (0, "plot", "{out}/why", "gap", "-o", "{out}/gap.svg"),
    (0, "rig", "pulse-rig", "--out", "{out}/rig"),
    (0, "changed", "{model}", "{model}", "--out", "{out}/changed"),
    (0, "reproduce", "--out", "{out}/paper"),
    (0, "export", "{model}", "--to", "latex"),
    (0, "simulate", "--frequencies", "4", "--levels", "0.8", "--duration", "1", "--out", "{out}/made"),
    (0, "libraries", "effects"),
    (0, "schema"),
)


@pytest.fixture(scope="module")
def paper():
    """Return the reproduction of the paper, made once."""
    from sindyjoint.workflows.reproduce import reproduce

    return cache(reproduce)


@pytest.mark.parametrize("console", ["ascii", "cp1252"])
def test_every_other_command_on_a_poor_terminal(run, named, tmp_path, monkeypatch, console, paper):
    # 80 columns, no colour, no terminal, the C locale. What takes long is made by hand: what it prints counts here.
    monkeypatch.syspath_prepend(Path(__file__).resolve().parents[1] / "reporting")
    from handmade_results import diagnosis, verification

    monkeypatch.setattr("sindyjoint.workflows.verify.verify", lambda *given, **options: verification(NAME))
    monkeypatch.setattr("sindyjoint.workflows.diagnose.diagnose", lambda *given, **options: diagnosis(NAME))
    monkeypatch.setattr("sindyjoint.workflows.reproduce.reproduce", lambda *given, **options: paper())
    for name, value in (("COLUMNS", "80"), ("NO_COLOR", "1"), ("LC_ALL", "C"), ("TERM", "dumb")):
        monkeypatch.setenv(name, value)
    shutil.copytree(named, tmp_path / "copy")
    (tmp_path / "copy" / "campaign.toml").unlink()
    (tmp_path / "model.json").write_text(verification(NAME).model.to_json(), encoding="utf-8")
    places = {
        "folder": named,
        "out": tmp_path / "ψ",
        "copy": tmp_path / "copy",
        "model": tmp_path / "model.json",
    }
    for status, *arguments in OTHERS:
        ended, stdout, stderr = run(console, *(part.format(**places) for part in arguments))
        assert ended == status, (arguments, stderr)
        assert "\x1b" not in stdout
    pages = {path.parent.name for path in (tmp_path / "ψ").rglob("report.html")}
    assert (
        pages == {"check", "verify", "why", "rig", "changed", "paper"}
        and (tmp_path / "ψ" / "gap.svg").is_file()
    )
    assert (tmp_path / "copy" / "campaign.toml").is_file() and (
        tmp_path / "ψ" / "made" / "campaign.toml"
    ).is_file()


def spelled(text: str, name: str) -> str:
    stream = io.TextIOWrapper(io.BytesIO(), encoding=name)
    cli._spell_stream(stream)
    stream.write(text)
    stream.flush()
    return stream.buffer.getvalue().decode("ascii" if name == "ascii" else name)


def test_spellings(monkeypatch):
    monkeypatch.setattr(sys, "stdout", None)  # as under pythonw: nothing to do, and no error
    cli.spell_output()
    assert spelled("−2.7·10⁻⁹ N·m/rad², θ̇ Φ λ", "ascii") == "-2.7*10^-9 N*m/rad^2, theta' Phi lambda"
    assert spelled("−2.7·10⁻⁹", "cp1252") == "-2.7·10^-9"
    assert spelled("θ – 漢", "utf-8") == "θ – 漢"
    # A file's name that is no text: its code, on every console.
    assert spelled("a\udcffb", "utf-8") == spelled("a\udcffb", "ascii") == r"a\udcffb"
    # Whoever asked for question marks gets them.
    stream = io.TextIOWrapper(io.BytesIO(), encoding="ascii", errors="replace")
    cli._spell_stream(stream)
    assert stream.errors == "replace" and stream.encoding == "ascii"
