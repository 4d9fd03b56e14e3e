"""A constant added to the displacement: whether names, verdict and gap stay, and coefficients follow the Taylor shift.

python benchmarks/bench_offsets.py run --out offsets.jsonl --seeds 4100 4101
python benchmarks/bench_offsets.py run --out discovered.jsonl --seeds 4100 4101 --discover
python benchmarks/bench_offsets.py show offsets.jsonl

Random joints with an effect hidden, driven by a moment (even seeds) or a motion (odd seeds), diagnosed as they are and
with a constant d added to the displacement: shares of the largest amplitude. ``run`` appends one line per diagnosis and
resumes. ``show`` compares each diagnosis with that of d = 0. Where a zero error θ_0 of the angle was found, the law is
counted from there and its Taylor shift is that of e = d − θ_0, less that of d = 0:

k1' = k1 − 2 k2 e + 3 k3 e², k2' = k2 − 3 k3 e, k3, c1 and M_F as they were, M_0' = M_0 − k1 e + k2 e² − k3 e³.

z is the difference of a coefficient over its standard errors, with that of θ_0; numbers of elements stay as they were.
A term that is absent is zero without an error.
"""

from __future__ import annotations

import argparse
import os
import sys
import time
from collections import defaultdict
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

for variable in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"):
    os.environ.setdefault(variable, "1")


import numpy as np  # noqa: E402

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

from benchmarks.resumed import append, done_in, main, records_in, seeds_of  # noqa: E402

if TYPE_CHECKING:
    from sindyjoint.diagnosis.result import Diagnosis
    from sindyjoint.judgement.discovery import Discovery

NAMES = (
    "nothing",
    "quadratic_damping",
    "stribeck_friction",
    "jenkins_element",
    "dahl_friction",
    "backlash_play",
    "dead_zone",
)
SHARES = (0.1, 0.2, -0.2, 0.4, 0.8, -0.8)
CONSTANT, OFFSET = "constant_moment", "angle_offset"
POWERS = (CONSTANT, "linear_stiffness", "quadratic_stiffness", "cubic_stiffness")
# By which share gaps may differ: that of the moment is estimated from some thousand rows of the same noise, that of
# the response is simulated with coefficients within their intervals.
SAME = dict(moment=0.02, response=0.05)
WITHIN = 1.96  # standard errors


def one(name: str, seed: int, share: float, duration: float, discovery: bool) -> dict:
    from sindyjoint.workflows.diagnose import diagnose
    from sindyjoint.workflows.discover import discover
    from tests.diagnosis.hidden_effects import hide

    record = dict(name=name, seed=seed, share=share, duration=duration, discovery=discovery)
    try:
        campaign = hide(name, seed, duration=duration).campaign
        shift = share * max(float(np.ptp(run.angle)) / 2 for run in campaign.runs)
        moved = campaign.with_runs(
            tuple(replace(r, angle=r.angle + shift, source=None) for r in campaign.runs)
        )
        start = time.process_time()
        found = _discovered(discover(moved)) if discovery else _diagnosed(diagnose(moved, advise=False))
    except Exception as error:  # a benchmark goes on, and says what failed
        return {**record, "error": f"{type(error).__name__}: {error}"}
    return {**record, "shift": shift, "cpu": time.process_time() - start, **found}


def _discovered(result: Discovery) -> dict:
    model = result.model
    numbers = {t.id: [t.coefficient, t.standard_error] for t in model.terms}
    return dict(
        numbers=numbers,
        verdict=result.verdict.verdict,
        steps=[name for name in numbers if name not in POWERS],
        offset=[0.0, 0.0],
        gaps=dict(moment=model.fitted.residual_rms, response=float("nan")),
    )


def _diagnosed(result: Diagnosis) -> dict:
    numbers = {t.id: [t.coefficient, t.standard_error] for t in result.whole.terms}
    for each in result.whole.elements:
        numbers |= {f"{each.effect}.{n.name}": [n.value, n.standard_error] for n in each.numbers}
    return dict(
        numbers=numbers,
        verdict=result.verdict,
        steps=[step.effect for step in result.steps],
        parameters=[dict(step.parameters) for step in result.steps],
        offset=[
            result.test.total("angle zero"),
            float(
                np.hypot.reduce(
                    [n.number.standard_error for n in result.test.nuisances if n.enters == "angle zero"],
                    initial=0.0,
                )
            ),
        ],
        gaps=dict(moment=result.final.moment, response=result.final.response),
        floor=result.noise_floor.moment,
        reason=result.reason,
        notes=list(result.warnings),
    )


def taylor(before: dict, after: dict) -> dict[str, float]:
    """Return z of each number of a diagnosis against the Taylor shift of that without a constant added."""
    zeros, errors = zip(*(np.broadcast_to(each["offset"], 2) for each in (before, after)), strict=True)
    e, unsure = (after["shift"] - zeros[1]) - (before["shift"] - zeros[0]), np.hypot(*errors)
    numbers = before["numbers"]
    # The coefficients of powers of θ about another zero are linear in the old ones: Taylor.
    matrix = np.array([[1, -e, e**2, -(e**3)], [0, 1, -2 * e, 3 * e**2], [0, 0, 1, -3 * e], [0, 0, 0, 1]])
    slopes = np.array([[0, -1, 2 * e, -3 * e**2], [0, 0, -2, 6 * e], [0, 0, 0, -3], [0, 0, 0, 0]])
    values, errors = np.array([numbers.get(name, (0.0, 0.0)) for name in POWERS]).T
    expected = {name: tuple(number) for name, number in numbers.items()}
    errors = np.sqrt(matrix**2 @ errors**2 + (slopes @ values * unsure) ** 2)
    expected |= zip(POWERS, zip(matrix @ values, errors, strict=True), strict=True)
    if zeros[1] and not unsure and CONSTANT not in after["numbers"]:
        del expected[CONSTANT]  # θ_0 stands in its place, and has no error to compare with
    found = {}
    for name, (value, error) in expected.items():
        later, its = after["numbers"].get(name, (0.0, 0.0))
        both = float(np.hypot(error, its))
        if both > 0:
            found[name] = (later - value) / both
    return found


def compared(before: dict, after: dict) -> dict:
    """Return what stays of a diagnosis when a constant is added, and what does not."""
    names = [[s for s in each["steps"] if s not in (CONSTANT, OFFSET)] for each in (before, after)]
    ratios = {gap: after["gaps"][gap] / before["gaps"][gap] for gap in SAME}
    z = taylor(before, after)
    worst = max(z, key=lambda name: abs(z[name]))
    return dict(
        names=sorted(names[0]) == sorted(names[1]),
        verdict=after["verdict"] == before["verdict"] or _only_zero(before, after),
        gap=not any(abs(ratio - 1) > SAME[gap] for gap, ratio in ratios.items()),
        follows=all(abs(each) <= WITHIN for each in z.values()),
        once={CONSTANT, OFFSET}.intersection(after["steps"]) != {CONSTANT, OFFSET},
        worst=(worst, z[worst]),
        ratios=ratios,
        z=z,
    )


def _only_zero(before: dict, after: dict) -> bool:
    """Return whether nothing was missing before, and a zero error is all that is named after."""
    named = (before["verdict"], after["verdict"]) == ("nothing_missing", "named")
    return named and {CONSTANT, OFFSET}.issuperset(after["steps"])


def run(args: argparse.Namespace) -> None:
    done = done_in(args.out, ("name", "seed", "share", "duration", "discovery"))
    tasks = [
        task
        for seed in args.seeds
        for name in args.names or NAMES
        for share in (0.0, *args.shares)
        if (task := (name, seed, share, args.duration, args.discover)) not in done
    ]
    for task in tasks:
        append(args.out, one(*task))


def show(args: argparse.Namespace) -> list[dict]:
    records = [r for r in records_in(args.paths) if "error" not in r or print(_case(r), r["error"])]
    plain = {(r["name"], r["seed"]): r for r in records if r["share"] == 0}
    kept = ("names", "verdict", "gap", "follows", "once")
    counts: dict[str, list[dict]] = defaultdict(list)
    for r in records:
        before = plain.get((r["name"], r["seed"]))
        if before is None or r is before:
            continue
        each = compared(before, r)
        counts[r["name"]].append(each)
        if not all(each[what] for what in kept):
            lost = ", ".join(what for what in kept if not each[what])
            name, z = each["worst"]
            gaps = ", ".join(f"{ratio:.3f}" for ratio in each["ratios"].values())
            print(
                f"{_case(r)} not: {lost}; gaps {gaps}; {name} {z:+.1f}; {'+'.join(r['steps'])} ({r['verdict']})"
            )
            print(f"{'':35s} at 0: {'+'.join(before['steps'])} ({before['verdict']})")
    print(
        f"\n{'hidden':22s} cases  names  verdict  gap  coefficients  one zero error at most  worst |z|, median"
    )
    figures = []
    for name, rows in [*counts.items(), ("all", [row for each in counts.values() for row in each])]:
        same = [sum(row[what] for row in rows) for what in kept]
        unchanged = sum(all(row[what] for what in kept) for row in rows)
        counts_of = dict(unchanged=unchanged, cases=len(rows), names=same[0], verdicts=same[1])
        figures.append(dict(hidden=name.replace("_", " "), seeds=seeds_of([*plain.values()])) | counts_of)
        worst = [abs(row["worst"][1]) for row in rows]
        print(f"{name:22s} {len(rows):5d}  {same[0]:5d}  {same[1]:7d}  {same[2]:3d}  {same[3]:12d}  {same[4]:22d}"
              f"  {max(worst, default=0):9.2f}  {np.median(worst) if worst else 0:.2f}")  # fmt: skip
    print(f"processor time of a diagnosis: {np.median([r['cpu'] for r in records]):.1f} s in the median, "
          f"{max(r['cpu'] for r in records):.1f} s at most")  # fmt: skip
    return figures


def _case(record: dict) -> str:
    return f"{record['name']:20s} {record['seed']} {record['share']:+5.2f}  "


if __name__ == "__main__":
    main(
        __doc__,
        run,
        show,
        shares=dict(nargs="+", type=float, default=SHARES, help="of the largest amplitude, beside zero"),
        duration=dict(type=float, default=4.0, help="of a run, s"),
        discover=dict(action="store_true", help="discover in the place of diagnose"),
    )
