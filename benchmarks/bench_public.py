"""What every set of public data is answered with: check, diagnosis, base, gaps, floors and time, in one table.

python -m benchmarks verdicts --data ../shared/data
python -m benchmarks verdicts --data ../shared/data --only emps pendulum --advice

A verdict is read against its own figures: gap before and after are of data left out of the fit, the floor is measured.
The simulated response is that of runs for validation where there are any. Seconds are of the processor.
"""

from __future__ import annotations

import argparse
import os
import sys
import time
from collections.abc import Sequence
from pathlib import Path

for variable in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"):
    os.environ.setdefault(variable, "1")

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

COLUMNS = (
    "set", "data", "verdict", "names", "base", "moment gap", "floor", "response gap", "floor", "seconds",
)  # fmt: skip


def row(folder: Path, advice: bool) -> list[str]:
    """Return what one set is answered with; an error in the place of what could not be made."""
    from sindyjoint.errors import SindyJointError
    from sindyjoint.text import percent, spelled
    from sindyjoint.workflows.diagnose import diagnose

    start = time.process_time()
    try:
        result = diagnose(folder, advise=advice)
    except SindyJointError as error:
        spent = f"{time.process_time() - start:.0f}"
        return [folder.name, "", "refused", str(error)[:80], *[""] * (len(COLUMNS) - 5), spent]
    names = ", then ".join(f"{spelled(s.effect)} {s.probability:.2f}" for s in result.steps) or "none"
    first, last, floor = result.initial, result.final, result.noise_floor
    return [
        folder.name,
        result.soundness.verdict if result.soundness else "",
        result.verdict.replace("_", " "),
        names,
        base_of(result.warnings),
        f"{percent(first.moment)} to {percent(last.moment)}",
        percent(floor.moment),
        f"{percent(first.response)} to {percent(last.response)}",
        percent(floor.response),
        f"{time.process_time() - start:.0f}",
    ]


def base_of(warnings: Sequence[str]) -> str:
    """Return from where a search began, as its warning says."""
    begun = "the search started from "
    told = [line[len(begun) :].split(", which")[0] for line in warnings if line.startswith(begun)]
    return next((each for each in told if "given" not in each), "the paper's five terms")


def main(given: Sequence[str] | None = None) -> None:
    """Print the table, a line as soon as its set is done."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--data", type=Path, required=True, help="folder that holds the sets")
    parser.add_argument("--only", nargs="*", help="names of sets")
    parser.add_argument("--advice", action="store_true", help="seek runs that would tell rivals apart, too")
    arguments = parser.parse_args(given)
    folders = sorted(path.parent for path in arguments.data.glob("*/campaign.toml"))
    if not folders:
        parser.error(f"{arguments.data} holds no folder with a campaign.toml")
    print("| " + " | ".join(COLUMNS) + " |\n|" + "---|" * len(COLUMNS))
    for folder in folders:
        if not arguments.only or folder.name in arguments.only:
            print("| " + " | ".join(row(folder, arguments.advice)) + " |", flush=True)


if __name__ == "__main__":
    main()
