"""What a newcomer does: a fresh clone, an empty environment, the guide's first page, runs of one's own. Needs the net.

``.ci/run`` runs it; the tests run the same commands but the installation.
"""

from __future__ import annotations

import re
import shutil
import subprocess
import sys
import tempfile
import time
import tomllib
from pathlib import Path

import numpy as np

ROOT = Path(__file__).resolve().parents[2]
GUIDE = "docs/guide/start.md"


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
    phase = 2 * np.pi * frequency * stamps
    angle, rate = level * np.sin(phase), level * 2 * np.pi * frequency * np.cos(phase)
    moment = 0.02 * -level * (2 * np.pi * frequency) ** 2 * np.sin(phase)
    moment += 6000 * angle + 50 * rate + 1.9 * np.sign(rate)
    moment += 0.01 * np.std(moment) * rng.normal(size=stamps.size)
    angle += 0.01 * np.std(angle) * rng.normal(size=stamps.size)
    rows = [f"{t:.4f},{m:.6f},{1e3 * a:.7f}" for t, m, a in zip(stamps, moment, angle, strict=True)]
    path.write_text("time,moment,angle\n" + "\n".join(rows) + "\n")


def write_own_data(page, folder):
    """Write the guide's manifest and the runs that it names."""
    (manifest,) = blocks(page, "toml")
    folder.mkdir()
    (folder / "campaign.toml").write_text(manifest, encoding="utf-8")
    levels = {"low": 4e-4, "middle": 5.5e-4, "high": 7e-4}
    for seed, run in enumerate(tomllib.loads(manifest)["run"]):
        logged(folder / run["file"], run["frequency"], levels[run["level"]], seed)


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
        assert len(commands) <= 3, commands
        write_own_data(page, clone / "hinge")
        for command in commands:
            start = time.perf_counter()
            done = subprocess.run(["bash", "-c", command], cwd=clone, capture_output=True, text=True)
            print(f"{time.perf_counter() - start:5.0f} s  {command}")
            if done.returncode:
                sys.exit(f"{command}: status {done.returncode}\n{done.stderr}")
        assert "linear stiffness" in done.stdout and "Coulomb friction" in done.stdout, done.stdout
        assert (clone / "results" / "report.html").stat().st_size > 100_000
        print(done.stdout)


if __name__ == "__main__":
    main()
