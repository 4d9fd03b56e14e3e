"""What a result advises next is a command that runs as it is printed, or something to do on the bench."""

import re
import shlex
from dataclasses import replace

import pytest

from sindyjoint import simulate
from sindyjoint.files import write_campaign
from tests.doors.asked import ask
from tests.made_models import paper_model

FIRST = [
    ("check", "{}"),
    ("discover", "{}"),
    ("compare", "{}", "--method", "stlsq", "--replicates", "10"),
    ("diagnose", "{}", "--no-advice"),
    ("plan", "--campaign", "{}", "--time", "12 s"),
]


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """Folder of a campaign whose name a shell would take apart; one run is kept for validation."""
    made = simulate("inter-panel", frequencies=[3, 6], levels=[0.9, 0.5], duration=3, random_state=2)
    made = made.with_runs((*made.runs[:-1], replace(made.runs[-1], use="validate")))
    return write_campaign(made, tmp_path_factory.mktemp("it's a lab") / "my hinge").parent


def advised(text):
    """Return the commands that stand in what was printed, as a shell would pass them on."""
    lines = [line.strip().removeprefix("next: ") for line in text.splitlines()]
    return [
        shlex.split(re.split(r" {2}to ", line)[0])[1:] for line in lines if line.startswith("sindyjoint ")
    ]


def test_each_command_that_is_advised_runs(folder, monkeypatch, tmp_path):
    monkeypatch.chdir(tmp_path)
    waiting = [[word.format(folder) for word in command] for command in FIRST]
    done = {}
    while waiting:
        command = waiting.pop(0)
        if tuple(command) not in done:
            answer = ask(*command)
            assert answer.status in (0, 1), (command, answer.stderr)
            assert not re.search(r"\b(CAMPAIGN|RESULTS|MODEL|RIG|FORMAT)\b", answer.stdout), answer.stdout
            done[tuple(command)] = answer.stdout
            waiting += advised(answer.stdout)
    verbs = {command[0] for command in done}
    assert {"verify", "export", "simulate"} <= verbs and len(done) > len(FIRST) + 4
    assert (tmp_path / "joint.py").is_file()


def test_without_a_folder_the_first_step_keeps_what_was_found(folder, monkeypatch, tmp_path):
    monkeypatch.chdir(tmp_path)
    first, *others = advised(ask("diagnose", folder, "--no-advice", "--align").stdout)
    assert first == ["diagnose", str(folder), "--no-advice", "--align", "--out", "results"]
    assert ["verify", "results", str(folder)] in others
    assert advised(ask(*first).stdout) == others
    page = (tmp_path / "results" / "report.html").read_text(encoding="utf-8")
    assert "<code>sindyjoint verify results " in page and "keep what was found" not in page


def test_effects_of_ones_own_begin_with_a_copy(monkeypatch, tmp_path):
    monkeypatch.chdir(tmp_path)
    assert ask("libraries", "copy", "effects/friction", "effects.toml").status == 0
    assert ask("libraries", "check", "effects.toml").status == 0
    assert ask("libraries", "copy", "effects/nothing", "other.toml").status == 2


@pytest.mark.parametrize(
    ("target", "file"), [("abaqus", "joint.inp"), ("c", "joint.h"), ("latex", "joint.tex")]
)
def test_a_file_without_a_suffix_gets_that_of_its_target(monkeypatch, tmp_path, target, file):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "model.json").write_text(paper_model().to_json(), encoding="utf-8")
    assert ask("export", "model.json", "--to", target, "--out", "joint").status == 0
    assert (tmp_path / file).is_file()
