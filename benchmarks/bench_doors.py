"""The same rows through three doors: plain pysindy with this package's library and optimizer, the estimator, discover.

python benchmarks/bench_doors.py --joints 50 --data ../shared/data

Seeds 0, 1, 2, ... of the random joints of ``tests/recovery``; short records at 1 % noise.
"""

from __future__ import annotations

import argparse
import json
import sys
from pathlib import Path
from typing import Any

HERE = Path(__file__).resolve().parent
sys.path[:0] = [str(HERE.parent / "tests" / part) for part in ("discovery", "recovery")]
NOISE, DURATION, SAMPLE_RATE = 0.01, 4.0, 500.0


def apart(campaign: Any) -> tuple[float, int]:
    """Return the largest relative difference of a coefficient between the doors, and the number of terms."""
    from doors import DOORS, difference

    models = [door(campaign) for door in DOORS]
    return difference(models), len(models[0])


def of_joints(count: int) -> list[dict[str, Any]]:
    """Return the difference for each of some random joints."""
    from random_joints import random_plan

    found = []
    for seed in range(count):
        plan = random_plan(seed, duration=DURATION, sample_rate=SAMPLE_RATE)
        value, terms = apart(plan.campaign(NOISE))
        found.append({"name": f"joint {seed}", "difference": value, "terms": terms})
    return found


def of_data(folder: Path) -> list[dict[str, Any]]:
    """Return the difference for each campaign in a folder of folders; none where it is absent."""
    from sindyjoint.errors import SindyJointError
    from sindyjoint.files import load_campaign

    found = []
    for path in sorted(folder.glob("*/campaign.toml")):
        try:
            value, terms = apart(load_campaign(path))
        except SindyJointError as error:
            found.append({"name": path.parent.name, "refused": str(error)})
        else:
            found.append({"name": path.parent.name, "difference": value, "terms": terms})
    return found


def table(found: list[dict[str, Any]]) -> list[str]:
    """Return a line for each campaign, and one of the largest difference."""
    lines = [
        f"{each['name']:<22}{each['terms']:>3} terms  {each['difference']:.1e}"
        if "difference" in each
        else f"{each['name']:<22}refused: {each['refused']}"
        for each in found
    ]
    largest = max((each["difference"] for each in found if "difference" in each), default=float("nan"))
    return [*lines, f"{'largest':<31}  {largest:.1e}"]


def main() -> None:
    """Send every campaign through the doors and print the differences."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--joints", type=int, default=50)
    parser.add_argument("--data", type=Path, default=HERE.parent.parent / "shared" / "data")
    parser.add_argument("--json", action="store_true", help="one line for ``python -m benchmarks``")
    given = parser.parse_args()
    found = [*of_joints(given.joints), *of_data(given.data)]
    if given.json:
        print(json.dumps(found))
        return
    print("largest relative difference of a coefficient between the doors; inf: other terms")
    print("\n".join(table(found)))


if __name__ == "__main__":
    main()
