"""What every set of public data is answered with: check, terms, diagnosis, gaps, floor and time, in one table.

python benchmarks/bench_public.py --data ../shared/data
python benchmarks/bench_public.py --data ../shared/data --only emps pendulum --advice

A verdict is read against its own figures: gap before and after are of data left out of the fit, the floor is measured.
"""

from __future__ import annotations

import argparse
import os
import sys
import time
from pathlib import Path

for variable in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"):
    os.environ.setdefault(variable, "1")

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

COLUMNS = (
    "set", "data", "paper set", "residual", "diagnosis", "names", "moment gap", "response gap", "floor", "seconds",
)  # fmt: skip


def row(folder: Path, advice: bool) -> list[str]:
    """Return what one set is answered with; an error in the place of what could not be made."""
    from sindyjoint import discover
    from sindyjoint.errors import SindyJointError
    from sindyjoint.files import load_campaign
    from sindyjoint.text import percent, spelled
    from sindyjoint.workflows.diagnose import diagnose

    start = time.perf_counter()
    try:
        campaign = load_campaign(folder)
        found = discover(campaign)
        fitted = found.model.fitted
        result = diagnose(campaign, advise=advice)
    except SindyJointError as error:
        return [
            folder.name,
            str(error)[:60],
            *[""] * (len(COLUMNS) - 3),
            f"{time.perf_counter() - start:.0f}",
        ]
    names = ", then ".join(f"{spelled(s.effect)} {s.probability:.2f}" for s in result.steps) or "none"
    return [
        folder.name,
        found.soundness.verdict if found.soundness else "",
        found.verdict.verdict,
        percent(fitted.residual_rms / fitted.moment_rms) if found.found else "no model",
        result.verdict.replace("_", " "),
        names,
        f"{percent(result.initial.moment)} to {percent(result.final.moment)}",
        f"{percent(result.initial.response)} to {percent(result.final.response)}",
        percent(result.noise_floor.moment),
        f"{time.perf_counter() - start:.0f}",
    ]


def main() -> None:
    """Print the table, a line as soon as its set is done."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--data", type=Path, required=True, help="folder that holds the sets")
    parser.add_argument("--only", nargs="*", help="names of sets")
    parser.add_argument("--advice", action="store_true", help="seek runs that would tell rivals apart, too")
    arguments = parser.parse_args()
    folders = sorted(path.parent for path in arguments.data.glob("*/campaign.toml"))
    if not folders:
        parser.error(f"{arguments.data} holds no folder with a campaign.toml")
    print("| " + " | ".join(COLUMNS) + " |\n|" + "---|" * len(COLUMNS))
    for folder in folders:
        if not arguments.only or folder.name in arguments.only:
            print("| " + " | ".join(row(folder, arguments.advice)) + " |", flush=True)


if __name__ == "__main__":
    main()
