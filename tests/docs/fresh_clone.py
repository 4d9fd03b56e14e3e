"""What a newcomer does: a fresh clone, an empty environment, the guide's first page, runs of one's own. Needs the net.

``.ci/run`` runs it; the tests run the same commands but the installation.
"""

from __future__ import annotations

import json
import re
import shutil
import subprocess
import sys
import tempfile
import time
from itertools import product
from pathlib import Path

import numpy as np

ROOT = Path(__file__).resolve().parents[2]
GUIDE = "docs/guide/start.md"
# The commands of the page: the third has the equation.
VERBS = ("install", "init", "discover", "verify", "diagnose", "export")


def blocks(text, language):
    """Return the code blocks of a page in one language."""
    return re.findall(rf"```{language}\n(.*?)```", text, re.S)


def commands_of(text):
    """Return the commands of a page, one a line."""
    return [line for block in blocks(text, "sh") for line in block.strip().splitlines()]


def logged(path, frequency, level, seed):
    """Write a run the way a logger would: a joint of k1, c1 and friction, moved by a sine, with 1 % noise."""
    rng = np.random.default_rng(seed)
    stamps = np.arange(0, 4, 1e-3)
    # No sample falls on a reversal, where the friction of this formula would be what rounding makes it.
    phase = 2 * np.pi * frequency * stamps + 0.3
    angle, rate = level * np.sin(phase), level * 2 * np.pi * frequency * np.cos(phase)
    moment = 0.02 * -level * (2 * np.pi * frequency) ** 2 * np.sin(phase)
    moment += 6000 * angle + 50 * rate + 1.9 * np.sign(rate)
    moment += 0.01 * np.std(moment) * rng.normal(size=stamps.size)
    angle += 0.01 * np.std(angle) * rng.normal(size=stamps.size)
    rows = [f"{t:.4f},{m:.6f},{1e3 * a:.7f}" for t, m, a in zip(stamps, moment, angle, strict=True)]
    path.write_text("time_s,moment_Nm,angle_mrad\n" + "\n".join(rows) + "\n")


def write_own_data(folder):
    """Write nine runs, without a manifest: three levels at three frequencies."""
    folder.mkdir()
    levels = {"low": 4e-4, "middle": 5.5e-4, "high": 7e-4}
    for seed, (frequency, level) in enumerate(product((3.0, 4.0, 5.0), levels)):
        logged(folder / f"{frequency:g}Hz-{level}.csv", frequency, levels[level], seed)


def main_path_holds(said, results):
    """Hold what the commands said against the law that moved the joint: k1 6000, c1 50, friction 1.9."""
    assert "the data are sound" in said["init"] and "guessed" not in said["init"], said["init"]
    for term in ("linear stiffness", "viscous damping", "Coulomb friction"):
        assert term in said["discover"], said["discover"]
    assert "bench hinge: passed" in said["verify"] and "not seen" in said["verify"], said["verify"]
    assert said["diagnose"].startswith("bench hinge: nothing missing"), said["diagnose"]
    found = json.loads((results / "model.json").read_text(encoding="utf-8"))["terms"]
    for term, truth in {"k1": 6000, "c1": 50, "M_F": 1.9}.items():
        (value,) = (each["coefficient"] for each in found if each["symbol"] == term)
        assert abs(value - truth) < 0.005 * truth, (term, value)
    # What the page shows of both is what they say; after a change: copy it.
    for verb, sample in zip(
        ("init", "discover"), blocks((ROOT / GUIDE).read_text("utf-8"), "text"), strict=True
    ):
        for line in filter(None, sample.splitlines()):
            assert " ".join(line.split()) in " ".join(said[verb].split()), line
    assert (results.parent / "joint.inp").is_file()
    for report in (results / "report.html", results / "diagnosis" / "report.html"):
        assert report.stat().st_size > 100_000


def main():
    """Clone, write the runs, type the guide's commands; leave with status 1 where one fails."""
    with tempfile.TemporaryDirectory() as place:
        clone = Path(place) / "clone"
        if (ROOT / ".git").exists():
            subprocess.run(["git", "clone", "-q", "--depth", "1", ROOT.as_uri(), clone], check=True)
        else:
            shutil.copytree(ROOT, clone, ignore=shutil.ignore_patterns(".*", "__pycache__"))
        page = (clone / GUIDE).read_text(encoding="utf-8")
        commands = commands_of(page)
        assert len(commands) == len(VERBS), commands
        write_own_data(clone / "hinge")
        said = {}
        for verb, command in zip(VERBS, commands, strict=True):
            start = time.perf_counter()
            done = subprocess.run(["bash", "-c", command], cwd=clone, capture_output=True, text=True)
            print(f"{time.perf_counter() - start:5.0f} s  {command}")
            if done.returncode:
                sys.exit(f"{command}: status {done.returncode}\n{done.stderr}")
            said[verb] = done.stdout
        main_path_holds(said, clone / "results")
        print(*said.values())


if __name__ == "__main__":
    main()
