"""What a command says while it works: on a terminal how long a stage will take, elsewhere nothing unless asked."""

import sys

import pytest

from sindyjoint.cli import Progress, progress


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
    for seconds, stage, shown in (  # a bar of twelve signs
        (0.0, "force states", "force states"),
        (1.0, "simulating runs: 1 of 12", r"\[#...........] simulating runs: 1 of 12"),
        (3.0, "simulating runs: 2 of 12", r"\[##..........] simulating runs: 2 of 12, about 20 s more"),
        (7.0, "simulating runs: 4 of 12", r"\[####........] simulating runs: 4 of 12, about 16 s more"),
        (8.0, "segments: 1 of 3", r"\[####........] segments: 1 of 3"),
    ):
        clock[0] = seconds
        told.say(stage)
        assert spinner.said == shown


@pytest.mark.parametrize(
    ("options", "expected"),
    [({}, ""), ({"quiet": True}, ""), ({"verbose": True}, "   4.00 s  simulating runs: 1 of 2\n")],
    ids=["usual", "quiet", "verbose"],
)
def test_off_a_terminal_only_verbose_has_a_line_for_each_stage(clock, capsys, options, expected):
    shown = Progress(**options)
    for seconds, stage in ((4.0, "simulating runs: 1 of 2"), (5.0, "simulating runs: 2 of 2")):
        clock[0] = seconds
        shown.say(stage)
    assert capsys.readouterr().err == expected
