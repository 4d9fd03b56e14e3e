"""Run the comparisons with other programs and keep what they print for the guide's page *Measured*.

    python benchmarks/write_comparisons.py            # all seeds: half an hour of one core
    python benchmarks/write_comparisons.py --size middle    # a fifth of that
    python benchmarks/write_comparisons.py --size quick     # a few seeds each

Each file of ``docs/comparisons`` has versions, the command and what it printed.
"""

from __future__ import annotations

import argparse
import os
import platform
import subprocess
import sys
from importlib.metadata import version
from pathlib import Path

HERE = Path(__file__).resolve().parent
KEPT = HERE.parent / "docs" / "comparisons"

ALL_JOINTS = ["--joints", "inter-panel", "panel-root", "random"]
# Arguments of each benchmark by size.
PARTS = {
    "bench_pysindy": {
        "full": ["--seeds", "20", *ALL_JOINTS],
        "middle": ["--seeds", "6", *ALL_JOINTS],
        "quick": ["--seeds", "3", "--noise", "0.01", "--joints", "inter-panel"],
    },
    "bench_map_fit": {
        "full": ["--seeds", "20", "--noise", "0.01"],
        "middle": ["--seeds", "6", "--noise", "0.01"],
        "quick": ["--seeds", "3", "--noise", "0.01"],
    },
    "bench_simulation": {"full": [], "middle": [], "quick": []},
}


def run(script: str, arguments: list[str]) -> str:
    """Return what a benchmark prints; it stops the page where it fails."""
    environment = {**os.environ, "OMP_NUM_THREADS": "1"}
    done = subprocess.run(
        [sys.executable, str(HERE / script), *arguments], capture_output=True, text=True, env=environment
    )
    if done.returncode:
        raise SystemExit(f"{script} failed:\n{done.stderr}")
    return done.stdout.rstrip()


def main() -> None:
    """Run every benchmark and keep its output."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--size", choices=("full", "middle", "quick"), default="full", help="how many seeds")
    size = parser.parse_args().size
    names = ("pysindy", "scikit-learn", "numpy", "scipy")
    versions = ", ".join(
        [f"Python {platform.python_version()}", *(f"{name} {version(name)}" for name in names)]
    )
    for name, sizes in PARTS.items():
        command = " ".join(["python", f"benchmarks/{name}.py", *sizes[size]])
        print(command, file=sys.stderr)
        text = f"{versions}\n$ {command}\n{run(f'{name}.py', sizes[size])}\n"
        (KEPT / f"{name}.txt").write_text(text, encoding="utf-8")


if __name__ == "__main__":
    main()
