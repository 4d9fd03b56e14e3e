"""--verbose prints steps, times and the numbers behind a result on stderr; --quiet nothing; stdout never changes."""

import json
import re
import sys
from pathlib import Path

import pytest

from sindyjoint import simulate
from sindyjoint.files import write_campaign
from tests.doors.inventory import GOLDEN

sys.path.insert(0, str(Path(__file__).resolve().parents[1] / "reporting"))

COMMANDS = json.loads(GOLDEN.read_text(encoding="utf-8"))["commands"]
COMPUTE = ("batch", "compare", "diagnose", "discover", "reproduce", "simulate", "verify")


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    made = simulate("inter-panel", frequencies=[3, 6], levels=[0.9, 0.5], duration=3, random_state=2)
    return write_campaign(made, tmp_path_factory.mktemp("runs")).parent


@pytest.mark.parametrize("name", COMPUTE)
def test_every_command_that_computes_has_both(name):
    assert {"--quiet", "--verbose"} <= set(COMMANDS[name])


def test_verbose_changes_stderr_only(sindyjoint, folder):
    plain = sindyjoint("discover", folder, "--library", "paper")
    loud = sindyjoint("discover", folder, "--library", "paper", "--verbose")
    assert plain.status == loud.status == 0 and plain.stderr == "" and loud.stdout == plain.stdout
    lines = loud.stderr.splitlines()
    stages = [re.fullmatch(r" *(\d+\.\d\d) s  (.+)", line) for line in lines]
    times = [float(found[1]) for found in stages if found]
    assert times == sorted(times) and [found[2] for found in stages if found][0] == "loading"
    assert "selecting terms" in loud.stderr
    # The numbers behind it: the noise of each run, the models near the chosen one, the unique share of each term.
    assert re.search(
        r"3Hz-0.9 +\d+ +1000 Hz +periodic, completed +\S+ Hz +[\d.]+ % +[\d.e-]+ rad +[\d.e-]+ N·m",
        loud.stderr,
    )
    assert re.search(r"chosen +5 +0\.0\d+ +0\.0\d+", loud.stderr)
    assert re.search(r"coulomb_friction +\d+\.\d+ % +\d+\.\d+ %", loud.stderr)


def test_quiet_and_verbose_contradict_each_other(sindyjoint, tmp_path):
    answer = sindyjoint("simulate", "--out", tmp_path / "v", "--quiet", "--verbose")
    assert answer.status == 2 and answer.stdout == "" and answer.stderr.count("\n") == 1
    assert "--verbose: contradicts --quiet; choose one of them" in answer.stderr
    assert not (tmp_path / "v").exists()


def test_simulated_runs_are_told_one_by_one(sindyjoint, tmp_path):
    options = ("--frequencies", "4", "--levels", "0.8", "--duration", "2")
    loud = sindyjoint("simulate", "--out", tmp_path / "v", *options, "--verbose")
    assert loud.status == 0
    assert re.search(r"4Hz-0.8 +2000 +1000 Hz +4 Hz +7\.\d+e-04 rad +5\.\d+ N·m", loud.stderr)
    quiet = sindyjoint("simulate", "--out", tmp_path / "q", *options, "--quiet")
    assert quiet.stderr == "" and quiet.status == 0
