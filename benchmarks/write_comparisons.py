"""Write the comparisons on the guide's page *Measured* by running the benchmarks.

    python benchmarks/write_comparisons.py            # all seeds: half an hour of one core
    python benchmarks/write_comparisons.py --size middle    # a fifth of that
    python benchmarks/write_comparisons.py --size quick     # a few seeds each

Every table between the two marks of ``docs/guide/measured.md`` is what a benchmark printed, under its command.
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
PAGE = HERE.parent / "docs" / "guide" / "measured.md"
BEGIN, END = "<!-- written by benchmarks/write_comparisons.py -->\n", "<!-- end -->\n"

HEAD = "`python benchmarks/write_comparisons.py` writes this section. Made with {versions}. {size}\n"
SIZES = {
    "full": "All seeds were run.",
    "middle": "Of the seeds a part was run; each command says how many, and the script without `--size` runs all.",
    "quick": "A few seeds were run; each command says how many, and the script without `--size` runs all.",
}

# Title, what to look for, script, arguments by size.
PARTS = (
    (
        "pysindy on the same campaigns",
        "Campaigns with exactly the paper's five terms, from the same candidates and runs. `plain`: pysindy with its "
        "defaults; `oracle`: the best of 31 thresholds, by the truth; `plugged`: pysindy with `TermLibrary` and "
        "`UniqueShareSTLSQ` on force states; `bare`: the same without labels of the rows.",
        "bench_pysindy.py",
        {
            "full": ["--seeds", "20", "--joints", "inter-panel", "panel-root", "random"],
            "middle": ["--seeds", "6", "--joints", "inter-panel", "panel-root", "random"],
            "quick": ["--seeds", "3", "--noise", "0.01", "--joints", "inter-panel"],
        },
    ),
    (
        "The paper's averaged map and surface fit",
        "Errors of the coefficients, compared with the paper's method: averaged cells of the map, a fitted surface.",
        "bench_map_fit.py",
        {
            "full": ["--seeds", "20", "--noise", "0.01"],
            "middle": ["--seeds", "6", "--noise", "0.01"],
            "quick": ["--seeds", "3", "--noise", "0.01"],
        },
    ),
    (
        "Recovery of the paper's joints",
        "Campaigns with exactly the five terms, and errors of the coefficients.",
        "bench_recovery_paper.py",
        {
            "full": ["--seeds", "50", "--noise", "0.001", "0.01", "0.05"],
            "middle": ["--seeds", "10", "--noise", "0.001", "0.01", "0.05"],
            "quick": ["--seeds", "5", "--noise", "0.01", "0.05"],
        },
    ),
    (
        "Simulation",
        "Time of the stick–slip joint and of the rig, compared with SciPy and OpenSees.",
        "bench_simulation.py",
        {"full": [], "middle": [], "quick": []},
    ),
)


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
    """Run every benchmark and write the page."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--size", choices=("full", "middle", "quick"), default="full", help="how many seeds")
    size = parser.parse_args().size
    names = ("pysindy", "scikit-learn", "numpy", "scipy")
    versions = ", ".join(
        [f"Python {platform.python_version()}", *(f"{name} {version(name)}" for name in names)]
    )
    text = [HEAD.format(versions=versions, size=SIZES[size])]
    for title, what, script, sizes in PARTS:
        arguments = sizes[size]
        print(script, *arguments, file=sys.stderr)
        command = " ".join(["python", f"benchmarks/{script}", *arguments])
        text.append(
            f"### {title}\n\n{what}\n\n```sh\n{command}\n```\n\n```text\n{run(script, arguments)}\n```\n"
        )
    before, _, rest = PAGE.read_text(encoding="utf-8").partition(BEGIN)
    after = rest.partition(END)[2]
    PAGE.write_text(f"{before}{BEGIN}\n{chr(10).join(text)}\n{END}{after}", encoding="utf-8")
    print(PAGE, file=sys.stderr)


if __name__ == "__main__":
    main()
