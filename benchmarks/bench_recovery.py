"""Exact recovery of the five terms over random joints, noises and drives, and coverage of the intervals.

python benchmarks/bench_recovery.py --joints 200 --noise 0.01 0.05 --jobs 2
"""

from __future__ import annotations

import argparse
import json
import sys
import time
from collections import defaultdict
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).resolve().parents[1] / "tests" / "recovery"))
from random_joints import TRUE_IDS, random_plan  # noqa: E402


def one(seed: int, noise: float, states: str, fixed: dict) -> dict:
    from sindyjoint.discovery.methods import column_path
    from sindyjoint.errors import SindyJointError
    from sindyjoint.workflows.discover import discover

    plan = random_plan(seed, **fixed)
    record = dict(seed=seed, noise=noise, states=states, drive=plan.drive, plan=str(plan))
    try:
        campaign = plan.campaign(noise)
        start = time.perf_counter()
        found = discover(campaign, states=states)
        record["seconds"] = time.perf_counter() - start
    except SindyJointError as error:
        return {**record, "error": str(error)}
    model, evidence = found.model, found.regressor.evidence_
    true = tuple(evidence.ids.index(term) for term in TRUE_IDS)
    sets = column_path("best_subset" if "best_subset" in _methods() else "stlsq", evidence)
    record.update(
        ids=model.ids,
        exact=set(model.ids) == set(TRUE_IDS),
        verdict=found.verdict.verdict,
        best_five=any(set(columns) == set(true) for columns in sets),
        least_share=min((t.unique_share for t in model.terms), default=None),
        misfit=model.fitted.misfit,
    )
    if record["exact"]:
        coefficients = {t.id: t for t in model.terms}
        terms = [coefficients[term] for term in TRUE_IDS]
        record["error_percent"] = [
            100 * (t.coefficient / v - 1) for t, v in zip(terms, plan.truth, strict=True)
        ]
        record["z"] = [(t.coefficient - v) / t.standard_error for t, v in zip(terms, plan.truth, strict=True)]
        record["inside"] = [
            bool(t.interval95[0] <= v <= t.interval95[1]) for t, v in zip(terms, plan.truth, strict=True)
        ]
    return record


def _methods() -> dict:
    from sindyjoint.discovery.methods import METHODS

    return METHODS


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--joints", type=int, default=200)
    parser.add_argument("--first", type=int, default=0)
    parser.add_argument("--noise", type=float, nargs="+", default=[0.01, 0.05])
    parser.add_argument("--states", default="auto", choices=["auto", "periodic", "broadband"])
    parser.add_argument("--drive", choices=["moment", "rig", "displacement"])
    parser.add_argument("--poor", action="store_true", help="three frequencies and two levels only")
    parser.add_argument("--jobs", type=int, default=2)
    parser.add_argument("--out", type=Path, help="write every record as one line of JSON")
    given = parser.parse_args()
    from joblib import Parallel, delayed

    fixed = {"drive": given.drive} if given.drive else {}
    if given.poor:
        fixed |= {"frequencies": (3.0, 4.0, 5.0), "levels": (0.9, 0.5)}
    seeds = range(given.first, given.first + given.joints)
    records = Parallel(n_jobs=given.jobs)(
        delayed(one)(seed, noise, given.states, fixed) for noise in given.noise for seed in seeds
    )
    if given.out:
        given.out.write_text("".join(json.dumps(r) + "\n" for r in records))
    report(records)


def report(records: list[dict]) -> None:
    groups = defaultdict(list)
    for record in records:
        groups[record["noise"], "all"].append(record)
        groups[record["noise"], record["drive"]].append(record)
    print(
        "noise  drive          n  exact  best five  wrong 'confirmed'  undecided  median s | RMS error % | "
        "coverage of 95 % intervals (k1 k2 k3 c1 M_F)"
    )
    for (noise, drive), rows in sorted(groups.items()):
        done = [r for r in rows if "error" not in r]
        exact = [r for r in done if r["exact"]]
        wrong = sum(r["verdict"] == "confirmed" and not r["exact"] for r in done)
        undecided = sum(r["verdict"] == "undecided" for r in done)
        errors = np.sqrt(np.mean([np.square(r["error_percent"]) for r in exact], axis=0)) if exact else []
        inside = np.mean([r["inside"] for r in exact], axis=0) if exact else []
        print(
            f"{noise:<6g} {drive:<12} {len(rows):>4} {len(exact) / len(rows):>6.1%} "
            f"{sum(r['best_five'] for r in done) / len(rows):>8.1%}"
            f" {wrong:>12} {undecided:>15} {np.median([r['seconds'] for r in done]):>12.2f} | "
            + " ".join(f"{e:.2f}" for e in errors)
            + " | "
            + " ".join(f"{i:.0%}" for i in inside)
        )
    for record in records:
        if not record.get("exact"):
            found = record.get("error") or f"{record['verdict']}: {', '.join(record['ids'])}"
            print(f"  miss at {record['noise']:g}, {record['plan']}: {found}")


if __name__ == "__main__":
    main()
