"""What a command says while it works: on a terminal how long a stage will take, elsewhere nothing unless asked."""

import sys
import threading
import time

import pytest

from sindyjoint import simulate
from sindyjoint.cli import Progress, answer, main


class Spinner:
    said = ""

    def update(self, text):
        self.said = text


@pytest.fixture
def clock(monkeypatch):
    now = [0.0]
    monkeypatch.setattr(answer.time, "perf_counter", lambda: now[0])
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


def test_an_error_is_the_last_line(monkeypatch, capsys, tmp_path):
    """Also where the line of a stage is about to be printed as the command fails."""
    print_stage, speaking = Progress._speak, set()

    def speak(shown):
        speaking.add(threading.current_thread())
        time.sleep(2.0)
        print_stage(shown)

    monkeypatch.setattr(answer, "PATIENCE", 0.0)
    monkeypatch.setattr(Progress, "_speak", speak)
    simulate(frequencies=[3, 5], levels=[0.9], duration=20.0, out=tmp_path)
    with (tmp_path / "5Hz-0.9.csv").open("a") as file:
        file.write("nowhere")
    with pytest.raises(SystemExit):
        main(["discover", str(tmp_path)])
    for each in speaking - {threading.main_thread()}:
        each.join()
    *stages, error = capsys.readouterr().err.splitlines()
    assert error.startswith("sindyjoint: ") and "5Hz-0.9.csv: line" in error
    assert stages and not any(each.startswith("sindyjoint: ") for each in stages)
