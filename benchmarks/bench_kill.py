"""Commands killed at random times: what they leave is whole, and the same command again ends as if nothing had been.

    python benchmarks/bench_kill.py --times 50 --seed 0

Prints a line per command: kills, those that came before the end, and what was found half-written, or different after
the second run.
"""

from __future__ import annotations

import argparse
import json
import random
import shutil
import signal
import subprocess
import sys
import tempfile
import time
from pathlib import Path

from sindyjoint import simulate

COMMANDS = {
    "init": (["init", "tests/a", "--yes", "--force"], "tests/a"),
    "discover": (["discover", "tests/a", "--library", "paper", "--out", "results", "--force"], "results"),
    "batch": (
        ["batch", "tests", "--library", "paper", "--out", "results", "--force"],
        "results",
    ),
}


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


def kill_at_random(name: str, times: int, rng: random.Random) -> str:
    """Return the line of a command that was killed so many times."""
    arguments, out = COMMANDS[name]
    command = [sys.executable, "-m", "sindyjoint", *arguments, "--quiet"]
    early, halves, others = 0, [], []
    with tempfile.TemporaryDirectory() as place:
        root = Path(place)
        for joint, folder in (("inter-panel", "a"), ("panel-root", "b")):
            simulate(
                joint, frequencies=[3, 5], levels=[0.9, 0.5], duration=3.0, out=root / "tests" / folder, rng=0
            )
        shutil.copytree(root / "tests", root / "kept")

        def run(killed_after: float | None = None) -> int:
            started = subprocess.Popen(
                command, cwd=root, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL
            )
            try:
                return started.wait(killed_after)
            except subprocess.TimeoutExpired:
                started.send_signal(signal.SIGKILL)
                return started.wait()

        begun = time.perf_counter()
        status = run()
        seconds, wanted = time.perf_counter() - begun, answer_in(root / out)
        assert status == 0 and wanted, f"{name} does not work even where it is left alone: status {status}"
        for number in range(times):
            for folder in ("results", "tests"):
                shutil.rmtree(root / folder, ignore_errors=True)
            shutil.copytree(root / "kept", root / "tests")
            early += run(rng.uniform(0.3, 1.1) * seconds) == -signal.SIGKILL
            halves += [f"{number}: {each}" for each in broken_files(root / out)]
            if run() != status or answer_in(root / out) != wanted or broken_files(root / out):
                others.append(number)
    found = f"half-written {halves or 0}, differ afterwards {others or 0}"
    return f"{name:9} {times} kills, {early} before the end: {found}"


def main() -> None:
    """Kill what is asked for."""
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("--times", type=int, default=50)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--commands", nargs="*", choices=COMMANDS, default=[*COMMANDS])
    given = parser.parse_args()
    for name in given.commands:
        print(kill_at_random(name, given.times, random.Random(f"{given.seed} {name}")), flush=True)


if __name__ == "__main__":
    main()
