"""Commands that are killed, run out of disk, meet a read-only folder or each other: what they leave is whole.

    python benchmarks/bench_kill.py --times 50 --seed 36 --json kill.json

``killed``: SIGKILL at a random time; the same command again then ends as if nothing had been. ``full``: a disk with
room for a random share of what the command writes. ``read-only``: a disk that takes nothing. ``together``: the same
command twice into one folder, the second after a random time. Disks are mounted (tmpfs), for which one must be root.
Prints a line for each, with what was found half-written, and what ended in anything but an answer or one line and
status 2.
"""

from __future__ import annotations

import argparse
import json
import os
import random
import shutil
import signal
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from sindyjoint import simulate

COMMANDS = {
    "init": (["init", "tests/a", "--yes", "--force"], "tests/a"),
    "discover": (["discover", "tests/a", "--library", "paper", "--out", "results", "--force"], "results"),
    "batch": (["batch", "tests", "--library", "paper", "--out", "results", "--force"], "results"),
}
REFUSED = 2


def broken_files(folder: Path) -> list[str]:
    """Return the files that are not whole: JSON that does not end, a page without its end, an empty file."""
    found = []
    for path in sorted(folder.rglob("*")):
        if path.is_file() and not path.name.startswith("."):
            text = path.read_bytes()
            whole = bool(text) and (path.suffix != ".html" or text.rstrip().endswith(b"</html>"))
            try:
                _ = json.loads(text) if path.suffix == ".json" else None
            except ValueError:
                whole = False
            found += [] if whole else [str(path.relative_to(folder))]
    return found


def answer_in(folder: Path) -> dict[str, object]:
    """Return what was found, file by file: terms, or a manifest."""
    return {
        str(path.relative_to(folder)): json.loads(text)["terms"] if path.suffix == ".json" else text
        for path in sorted([*folder.rglob("model.json"), *folder.rglob("campaign.toml")])
        for text in [path.read_text(encoding="utf-8")]
    }


@dataclass
class Trial:
    """A command, the data that it reads, and what it answers where it is left alone."""

    name: str
    kept: Path
    seconds: float = 0.0
    size: int = 0
    wanted: dict[str, object] = field(default_factory=dict)

    def start(self, root: Path) -> subprocess.Popen[str]:
        """Start the command in a folder."""
        command = [sys.executable, "-m", "sindyjoint", *COMMANDS[self.name][0], "--quiet"]
        return subprocess.Popen(
            command, cwd=root, stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, text=True
        )

    def out(self, root: Path) -> Path:
        """Return where the command writes in a folder."""
        return root / COMMANDS[self.name][1]

    def alone(self, root: Path) -> None:
        """Run the command once, and keep its time, its answer and the size of its files."""
        shutil.copytree(self.kept, root / "tests")
        begun = time.perf_counter()
        _, said = (started := self.start(root)).communicate()
        self.seconds, self.wanted = time.perf_counter() - begun, answer_in(self.out(root))
        self.size = sum(path.stat().st_size for path in self.out(root).rglob("*") if path.is_file())
        assert started.returncode == 0 and self.wanted, (
            f"{self.name} does not work where it is left alone: {said}"
        )

    def wrong(self, started: subprocess.Popen[str]) -> str:
        """Return what is wrong with how the command ended: not with its answer, nor with one line and status 2."""
        _, said = started.communicate()
        lines = said.strip().splitlines()
        refused = started.returncode == REFUSED and len(lines) == 1
        return (
            ""
            if refused or (started.returncode == 0 and not lines)
            else f"{started.returncode}: {said[-300:]}"
        )


@contextmanager
def disk(place: Path, size: int | None = None, writable: bool = True) -> Iterator[Path]:
    """Mount a disk of so many bytes, with the data on it."""
    place.mkdir()
    subprocess.run(["mount", "-t", "tmpfs", "-o", f"size={size or '50%'}", "tmpfs", place], check=True)
    try:
        yield place
    finally:
        subprocess.run(["umount", place], check=True)
        place.rmdir()


def killed(trial: Trial, root: Path, rng: random.Random) -> dict[str, Any]:
    """Kill the command at a random time, then run it again."""
    shutil.copytree(trial.kept, root / "tests")
    started = trial.start(root)
    try:
        started.wait(rng.uniform(0.3, 1.1) * trial.seconds)
    except subprocess.TimeoutExpired:
        started.send_signal(signal.SIGKILL)
    started.communicate()
    halves = broken_files(trial.out(root))
    wrong = trial.wrong(trial.start(root))
    return {"reached": started.returncode == -signal.SIGKILL, "halves": halves, "wrong": wrong}


def full(trial: Trial, root: Path, rng: random.Random) -> dict[str, Any]:
    """Run the command on a disk that may be too small for what it writes."""
    # Files take whole pages.
    pages = sum(-(-path.stat().st_size // 4096) + 1 for path in trial.kept.rglob("*"))
    with disk(root / "disk", 4096 * pages + round(rng.uniform(0.0, 1.0) * trial.size)) as place:
        shutil.copytree(trial.kept, place / "tests")
        started = trial.start(place)
        wrong = trial.wrong(started)
        halves = broken_files(trial.out(place))
    return {"reached": started.returncode != 0, "halves": halves, "wrong": wrong}


def read_only(trial: Trial, root: Path, rng: random.Random) -> dict[str, Any]:
    """Run the command on a disk that takes nothing."""
    with disk(root / "disk") as place:
        shutil.copytree(trial.kept, place / "tests")
        subprocess.run(["mount", "-o", "remount,ro", place], check=True)
        started = trial.start(place)
        wrong = trial.wrong(started)
    return {"reached": started.returncode == REFUSED, "halves": [], "wrong": wrong}


def together(trial: Trial, root: Path, rng: random.Random) -> dict[str, Any]:
    """Run the command twice into one folder."""
    shutil.copytree(trial.kept, root / "tests")
    first = trial.start(root)
    time.sleep(rng.uniform(0.0, 1.0) * trial.seconds)
    second = trial.start(root)
    wrong = trial.wrong(first) or trial.wrong(second)
    return {"reached": True, "halves": broken_files(trial.out(root)), "wrong": wrong}


WAYS = {"killed": killed, "full": full, "read-only": read_only, "together": together}


def count(name: str, way: str, times: int, seed: int) -> dict[str, Any]:
    """Return how often a command in one way left something half-written, another answer, or ended wrongly."""
    rng = random.Random(f"{seed} {name} {way}")
    with tempfile.TemporaryDirectory() as place:
        trial = Trial(name, Path(place) / "kept")
        for joint, folder in (("inter-panel", "a"), ("panel-root", "b")):
            simulate(
                joint, frequencies=[3, 5], levels=[0.9, 0.5], duration=3.0, out=trial.kept / folder, rng=0
            )
        (first := Path(place) / "first").mkdir()
        trial.alone(first)
        ends = []
        for number in range(times):
            (root := Path(place) / str(number)).mkdir()
            end = WAYS[way](trial, root, rng)
            # Where the last command of a trial gave its answer, it is that of the undisturbed one.
            if way in ("killed", "together") and answer_in(trial.out(root)) != trial.wanted:
                end["wrong"] = end["wrong"] or "another answer"
            ends.append(end)
            shutil.rmtree(root)
    return {
        "command": name,
        "way": way,
        "seed": seed,
        "times": times,
        "reached": sum(end["reached"] for end in ends),
        "half_written": sum(bool(end["halves"]) for end in ends),
        "wrong": sum(bool(end["wrong"]) for end in ends),
        "said": sorted(
            {end["wrong"] for end in ends if end["wrong"]} | {h for end in ends for h in end["halves"]}
        ),
    }


def main() -> None:
    """Disturb what is asked for."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--times", type=int, default=50)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--commands", nargs="*", choices=COMMANDS, default=[*COMMANDS])
    parser.add_argument("--ways", nargs="*", choices=WAYS, default=[*WAYS])
    parser.add_argument("--json", type=Path, help="file for all figures")
    given = parser.parse_args()
    made = []
    for way in given.ways:
        if way in ("full", "read-only") and os.geteuid():
            print(f"{way}: only root mounts disks; left out")
            continue
        for name in given.commands:
            made.append(count(name, way, 1 if way == "read-only" else given.times, given.seed))
            print(
                "{command:9} {way:9} {times} times, {reached} reached, {half_written} half-written, "
                "{wrong} wrong {said}".format_map(made[-1]),
                flush=True,
            )
            if given.json:
                given.json.write_text(json.dumps(made, indent=1) + "\n")


if __name__ == "__main__":
    main()
