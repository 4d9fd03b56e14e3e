"""How often the paper's five terms, and nothing else, come back from virtual tests of its two joints.

    python benchmarks/bench_recovery_paper.py --seeds 50 --noise 0.001 0.01 0.05 --jobs 2

Every campaign is the built-in one: moment-driven with exact sticking, 3, 4, 5, 6 Hz at three levels below the
softening limit, noise as a share of each channel's RMS. The candidates are those of the ``extended`` library.
"""

from __future__ import annotations

import argparse
import json
from pathlib import Path
from typing import Any

import numpy as np

from sindyjoint.paper import TERMS


def one(joint: str, noise: float, seed: int) -> dict[str, Any]:
    """Simulate a campaign, discover, compare with the truth."""
    from sindyjoint.mechanics.virtual import named_joint, virtual_campaign
    from sindyjoint.workflows.discover import discover

    law: Any = named_joint(joint)
    found = discover(virtual_campaign(joint, noise=noise, random_state=seed))
    record = {"joint": joint, "noise": noise, "seed": seed, "ids": found.model.ids}
    record["candidates"] = len(found.regressor.terms_)
    record["verdict"] = found.verdict.verdict
    record["exact"] = set(found.model.ids) == set(TERMS)
    if record["exact"]:
        terms = [found.model[term] for term in TERMS]
        truth = np.array([law.k1, law.k2, law.k3, law.c1, law.M_F])
        record["error"] = 100 * (np.array([t.coefficient for t in terms]) / truth - 1)
        record["inside"] = [
            t.interval95[0] <= v <= t.interval95[1] for t, v in zip(terms, truth, strict=True)
        ]
    return record


def summary(records: list[dict[str, Any]]) -> list[dict[str, Any]]:
    """Return for each joint and noise how often the set was exact, the largest errors and the intervals that hold."""
    found = []
    for joint, noise in dict.fromkeys((r["joint"], r["noise"]) for r in records):
        rows = [r for r in records if (r["joint"], r["noise"]) == (joint, noise)]
        exact = [r for r in rows if r["exact"]]
        worst = np.max(np.abs([r["error"] for r in exact]), axis=0) if exact else np.full(5, np.nan)
        found.append(
            {
                "joint": joint,
                "noise": noise,
                "campaigns": len(rows),
                "exact": len(exact),
                "confirmed": sum(r["verdict"] == "confirmed" for r in rows),
                "worst": [f"{error:.2g}" for error in worst],
                "inside": int(np.sum([r["inside"] for r in exact])),
                "intervals": 5 * len(exact),
            }
        )
    return found


def report(records: list[dict[str, Any]]) -> None:
    """Print one line per joint and noise, then every miss."""
    print(f"{records[0]['candidates']} candidates; largest error of a coefficient over the exact ones, %")
    for row in summary(records):
        print(
            "{joint:<12} {noise:>6.1%}: exact {exact} of {campaigns}, confirmed {confirmed}, "
            "k1, k2, k3, c1, M_F {worst}, 95 % intervals hold {inside} of {intervals}".format_map(row)
        )
    for record in records:
        if not record["exact"]:
            where = f"{record['joint']}, noise {record['noise']:.1%}, seed {record['seed']}"
            print(f"  miss: {where}: {', '.join(record['ids'])}")


def main() -> None:
    """Run the campaigns."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--joints", nargs="+", default=["inter-panel", "panel-root"])
    parser.add_argument("--noise", type=float, nargs="+", default=[0.001, 0.01, 0.05])
    parser.add_argument("--seeds", type=int, default=50)
    parser.add_argument("--jobs", type=int, default=2)
    parser.add_argument("--json", type=Path, help="file for the figures")
    given = parser.parse_args()
    from joblib import Parallel, delayed

    records = Parallel(n_jobs=given.jobs)(
        delayed(one)(joint, noise, seed)
        for joint in given.joints
        for noise in given.noise
        for seed in range(given.seeds)
    )
    report(records)
    if given.json:
        given.json.write_text(json.dumps(summary(records), indent=1) + "\n")


if __name__ == "__main__":
    main()
