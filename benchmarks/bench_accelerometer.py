"""Random joints whose motion an accelerometer measures, alone or beside a displacement sensor that drifts.

python benchmarks/bench_accelerometer.py run --out accelerometer.jsonl --seeds 0 50
python benchmarks/bench_accelerometer.py show accelerometer.jsonl

Each seed is a random joint about the paper's inter-panel joint, tested three times at 1 % noise of every channel: with
the angle's sensor, with an accelerometer instead, and with both, the former drifting by a fifth of the angle's RMS.
"""

from __future__ import annotations

import sys
from dataclasses import replace
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))
from benchmarks.bench_inputs import COEFFICIENTS  # noqa: E402
from benchmarks.resumed import append, done_in, main, records_in, seeds_of  # noqa: E402

CASES = {
    "angle": ("angle measured", {}),
    "accelerometer": ("accelerometer instead", {"accelerometer": "instead"}),
    "both": ("both, the angle drifting by 20 %", {"accelerometer": "beside", "angle_drift": 0.2}),
}


def one(seed: int, case: str) -> dict:
    """Return the relative errors of the coefficients of the joint of a seed, and whether their intervals hold."""
    from sindyjoint import discover
    from sindyjoint.mechanics import INTER_PANEL
    from sindyjoint.mechanics.virtual import virtual_campaign

    rng = np.random.default_rng(seed)
    joint = replace(
        INTER_PANEL,
        **{c: getattr(INTER_PANEL, c) * float(np.exp(rng.uniform(-0.3, 0.3))) for c in COEFFICIENTS},
    )
    found = discover(
        virtual_campaign(
            joint,
            frequencies=[3, 4.5, 6],
            levels=[0.85, 0.5],
            duration=4.0,
            random_state=rng,
            **CASES[case][1],
        )
    )
    record: dict = {"seed": seed, "case": case, "verdict": found.verdict.verdict}
    record["findings"] = [f.id for f in found.soundness.findings]
    for name, term in COEFFICIENTS.items():
        truth = getattr(joint, name)
        if term in found.model:
            estimate = found.model[term]
            low, high = estimate.interval95
            record[name] = {"error": estimate.coefficient / truth - 1, "holds": bool(low <= truth <= high)}
    return record


def run(arguments) -> None:
    """Append a line for each seed and case that the file lacks."""
    done = done_in(arguments.out, ("seed", "case"))
    for seed in range(*arguments.seeds):
        for case in CASES:
            if (seed, case) not in done:
                append(arguments.out, one(seed, case))


def show(arguments) -> list[dict]:
    """Print the figures and return them."""
    records = records_in(arguments.paths)
    rows = []
    for case, (title, _) in CASES.items():
        of_case = [r for r in records if r["case"] == case]
        if not of_case:
            continue
        found = sum(r["verdict"] == "confirmed" for r in of_case)
        print(f"{case}, {len(of_case)} joints: the paper's five terms confirmed in {found}")
        row = dict(
            motion=title,
            seeds=seeds_of(of_case),
            confirmed=found,
            joints=len(of_case),
            errors=[],
            held=0,
            of=0,
        )
        for name in COEFFICIENTS:
            known = [r[name] for r in of_case if name in r]
            errors = np.array([each["error"] for each in known])
            print(
                f"  {name}: found in {len(known)}, error {100 * np.sqrt(np.mean(errors**2)):.2f} % RMS (mean "
                f"{100 * errors.mean():+.2f}, largest {100 * np.abs(errors).max():.2f}), within its interval "
                f"{np.mean([each['holds'] for each in known]):.0%}"
            )
            row["errors"].append(f"{100 * np.sqrt(np.mean(errors**2)):.2f}")
            row["held"] += sum(each["holds"] for each in known)
            row["of"] += len(known)
        rows.append(row)
        faults = [name for r in of_case for name in r["findings"]]
        print(f"  findings: {', '.join(sorted(set(faults))) or 'none'} ({len(faults)})")
    return rows


if __name__ == "__main__":
    main(__doc__, run, show)
