"""What a command says while it works: how long a stage that counts will take, and a line per stage off a terminal."""

import sys

import pytest

from sindyjoint.cli import progress
from sindyjoint.cli.progress import Progress


class Spinner:
    said = ""

    def update(self, text):
        self.said = text


@pytest.fixture
def clock(monkeypatch):
    now = [0.0]
    monkeypatch.setattr(progress.time, "perf_counter", lambda: now[0])
    return now


def test_a_terminal_shows_the_time_that_remains(clock, monkeypatch):
    monkeypatch.setattr(sys.stderr, "isatty", lambda: True, raising=False)
    told = Progress()
    told._status = spinner = Spinner()
    for seconds, stage, shown in (
        (0.0, "force states", "force states"),
        (1.0, "simulating runs: 1 of 12", "simulating runs: 1 of 12"),
        (3.0, "simulating runs: 2 of 12", "simulating runs: 2 of 12, about 20 s more"),
        (7.0, "simulating runs: 4 of 12", "simulating runs: 4 of 12, about 16 s more"),
        (8.0, "segments: 1 of 3", "segments: 1 of 3"),
    ):
        clock[0] = seconds
        told.say(stage)
        assert spinner.said == shown


def test_off_a_terminal_each_stage_has_one_line(clock, capsys, monkeypatch):
    monkeypatch.setattr(progress, "LONG", 3.0)
    told, quiet = Progress(), Progress(quiet=True)
    for seconds, stage in (
        (1.0, "force states"),
        (4.0, "simulating runs: 1 of 2"),
        (5.0, "simulating runs: 2 of 2"),
    ):
        clock[0] = seconds
        told.say(stage)
        quiet.say(stage)
    # What takes no three seconds says nothing: what fails at once fails in one line.
    assert capsys.readouterr().err == "   4.00 s  simulating runs: 1 of 2\n"
