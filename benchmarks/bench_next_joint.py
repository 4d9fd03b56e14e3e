"""How often the predictive interval of a batch holds the coefficient of a joint that was not tested.

python benchmarks/bench_next_joint.py --batches 200

Each batch has 8 to 40 joints whose coefficients scatter by 1 to 10 %, estimated with errors of a tenth to a half of it.
"""

from __future__ import annotations

import argparse
import sys
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

from benchmarks.resumed import with_rows, write_rows  # noqa: E402


def holds(seed: int, coefficients: int = 5, further: int = 20) -> list[bool]:
    """Return of each coefficient of a random batch, and of some further joints, whether its interval holds."""
    from sindyjoint.workflows.joints.population import population

    rng = np.random.default_rng(seed)
    joints = int(rng.integers(8, 41))
    values, errors, truth = {}, {}, {}
    for index in range(coefficients):
        spread = rng.uniform(0.01, 0.1)
        error = spread * rng.uniform(0.1, 0.5)
        true = 1 + spread * rng.normal(size=joints + further)
        values[f"c{index}"] = true[:joints] + error * rng.normal(size=joints)
        errors[f"c{index}"] = np.full(joints, error)
        truth[f"c{index}"] = true[joints:]
    found = []
    for scatter in population(values, errors).scatters:
        low, high = scatter.next_joint95
        found += [bool(low <= value <= high) for value in truth[scatter.coefficient]]
    return found


if __name__ == "__main__":
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--batches", type=int, default=200)
    given = with_rows(parser).parse_args()
    count = given.batches
    every = [value for seed in range(count) for value in holds(seed)]
    print(
        f"{count} batches (seeds 0 to {count - 1}): {np.mean(every):.2%} of {len(every)} unseen coefficients are held"
    )
    question = f"95 % intervals of the next joint that hold, {count} batches"
    write_rows(given.json, [dict(task=question, value=f"{sum(every)}/{len(every)}", note="")])
