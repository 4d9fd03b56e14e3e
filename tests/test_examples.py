"""Every example runs by itself, without a warning, and leaves its picture."""

import os
import runpy
import subprocess
import sys
from pathlib import Path

import pytest

EXAMPLES = sorted((Path(__file__).resolve().parents[1] / "examples").glob("[0-9][0-9]_*.py"))


def test_there_are_examples():
    assert len(EXAMPLES) >= 4


def leaves_its_picture(path, folder):
    picture = folder / f"{path.stem}.png"
    assert picture.read_bytes().startswith(b"\x89PNG") and picture.stat().st_size > 10_000
    assert path.read_text(encoding="utf-8").startswith('"""')


@pytest.mark.parametrize("path", EXAMPLES[1:], ids=lambda path: path.stem)
def test_example_leaves_its_picture(path, tmp_path, monkeypatch, capfd):
    # In this process, whose warnings are errors: a new one would load the same libraries ten times. The first: below.
    monkeypatch.setattr(sys, "argv", [str(path), str(tmp_path)])
    monkeypatch.chdir(tmp_path)
    runpy.run_path(str(path), run_name="__main__")
    assert capfd.readouterr().err == ""
    leaves_its_picture(path, tmp_path)


def test_an_example_needs_nothing_that_another_one_loaded(tmp_path):
    path = EXAMPLES[0]
    run = subprocess.run(
        [sys.executable, "-W", "error", str(path), str(tmp_path)],
        capture_output=True,
        text=True,
        cwd=tmp_path,
        env=os.environ | {"MPLBACKEND": "agg"},
    )
    assert (run.returncode, run.stderr) == (0, "")
    leaves_its_picture(path, tmp_path)
