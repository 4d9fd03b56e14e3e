"""Every command explains itself, with an example that begins with its name."""

import json
import os
import re
import subprocess
import sys

import pytest

from tests.doors.inventory import GOLDEN

EVERY = [tuple(name.split()) for name in json.loads(GOLDEN.read_text(encoding="utf-8"))["commands"] if name]


def test_there_are_the_commands_of_the_readme(request):
    readme = (request.config.rootpath / "README.md").read_text(encoding="utf-8")
    assert {("discover",), ("simulate",), ("schema",), ("libraries", "list")} <= set(EVERY)
    missing = sorted({path[0] for path in EVERY if f"sindyjoint {path[0]}" not in readme})
    assert not missing, "the README has no line about these commands"


@pytest.mark.parametrize("path", EVERY, ids=" ".join)
def test_help_with_an_example(path, sindyjoint):
    answer = sindyjoint(*path, "--help")
    assert (answer.status, answer.stderr) == (0, "")
    text = " ".join(answer.stdout.split())
    assert re.search(rf"Examples?: .*sindyjoint {' '.join(path)}", text), text
    # A sentence comes first, and every option has one.
    assert re.search(r"Usage: sindyjoint .*? [A-Z][a-z]+ .+?\. ", text)


@pytest.mark.parametrize("path", [(), ("libraries",)], ids=" ".join)
def test_groups_have_an_example_too(path, sindyjoint):
    text = " ".join(sindyjoint(*path, "--help").stdout.split())
    assert re.search(r"Example: sindyjoint \w+", text), text


def test_a_shell_completes_the_commands():
    run = subprocess.run(
        [sys.executable, "-m", "sindyjoint"],
        env={
            **os.environ,
            "_SINDYJOINT_COMPLETE": "complete_bash",
            "COMP_WORDS": "sindyjoint ver",
            "COMP_CWORD": "1",
        },
        capture_output=True,
        text=True,
    )
    assert run.stdout.split() == ["verify"], run.stderr
    script = subprocess.run(
        [sys.executable, "-m", "sindyjoint", "--show-completion", "bash"],
        # Which shell runs the tests is of no interest: the one that is named counts.
        env={**os.environ, "_TYPER_COMPLETE_TEST_DISABLE_SHELL_DETECTION": "1"},
        capture_output=True,
        text=True,
    )
    assert "_SINDYJOINT_COMPLETE" in script.stdout, script.stderr


@pytest.mark.parametrize("path", EVERY, ids=" ".join)
def test_every_option_is_explained(path, sindyjoint):
    _, _, text = sindyjoint(*path, "--help").stdout.partition("\nOptions:\n")
    # Each begins its line; words of explanation stand behind its type, or on the next line.
    options = re.split(r"\n  (?=-)", "\n" + text)[1:]
    assert options
    for option in options:
        assert re.search(r" {2,}\w.*\w{3}", option, re.S), option


def test_no_arguments_show_the_help(sindyjoint):
    answer = sindyjoint()
    assert "Usage: sindyjoint" in answer.stdout + answer.stderr
    assert "discover" in answer.stdout + answer.stderr


def test_version(sindyjoint):
    from sindyjoint import __version__

    assert sindyjoint("--version") == (0, f"sindyjoint {__version__}\n", "")


def test_schema_is_json(sindyjoint):
    import json

    record = json.loads(sindyjoint("schema").stdout)
    assert record["title"] == "Manifest" and "channels" in record["properties"]


@pytest.mark.parametrize(
    "arguments", [["discovr"], ["discover", "--jsn"], ["libraries", "shw"], ["simulate", "--seed", "1"]]
)
def test_usage_errors_are_one_line(sindyjoint, arguments):
    answer = sindyjoint(*arguments)
    assert answer.status == 2 and answer.stdout == ""
    assert answer.stderr.startswith("sindyjoint: ") and answer.stderr.count("\n") == 1
    assert "--help" in answer.stderr


@pytest.mark.parametrize(
    "path", [(), ("libraries",), ("simulate",), ("verify",), ("export",), ("init",)], ids=" ".join
)
def test_a_bare_command_shows_its_help_in_full(path, sindyjoint):
    answer = sindyjoint(*path)
    assert answer.status == 2 and answer.stderr == ""
    assert answer.stdout.startswith(f"Usage: sindyjoint {' '.join(path)}".rstrip())
    assert len(answer.stdout.splitlines()) > 8 and "\n\nOptions:\n" in answer.stdout
