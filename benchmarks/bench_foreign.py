"""Verdicts on joints that another integrator made: laws of no catalogue, effects of the catalogue, nothing hidden.

python benchmarks/bench_foreign.py run --out foreign.jsonl --kind foreign --seeds 10 11
python benchmarks/bench_foreign.py run --out foreign.jsonl --kind catalogue --seeds 10 11
python benchmarks/bench_foreign.py run --out foreign.jsonl --kind nothing --seeds 10 11
python benchmarks/bench_foreign.py show foreign.jsonl

``run`` appends one line per campaign and skips those that the file holds already, so that it can be stopped and
resumed. Joints, drives and laws: tests/diagnosis/foreign_joints.py (SciPy) and tests/diagnosis/foreign_mujoco.py (kinds
that end in ``-mujoco``, where MuJoCo is installed). A foreign law counts where what the diagnosis leaves is more than
two noise floors: below, some admissible law of the catalogue explains the campaign, and to name it is no fault.
"""

from __future__ import annotations

import argparse
import os
import sys
import time
from collections import Counter, defaultdict
from pathlib import Path

for variable in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"):
    os.environ.setdefault(variable, "1")

import numpy as np  # noqa: E402

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

from benchmarks.resumed import append, done_in, main, records_in, seeds_of  # noqa: E402
from tests.diagnosis.foreign_judgement import KINDS, SURE, ZEROS, judge  # noqa: E402
from tests.diagnosis.foreign_laws import SAME  # noqa: E402

BASE = {
    "linear_stiffness", "quadratic_stiffness", "cubic_stiffness", "linear_damping", "coulomb_friction",
}  # fmt: skip
# What the guide's page calls each kind of joint, and what is right to answer.
CALLED = {
    "foreign": ("outside the catalogue", "*unknown*, *partly named*, *undecided*"),
    "catalogue": ("effects of the catalogue", "*named* or *ambiguous*, rightly"),
    "nothing": ("nothing hidden", "*nothing missing*, or a zero of a sensor"),
}


def one(kind: str, name: str, seed: int) -> dict:
    """Return what a diagnosis answers of one campaign."""
    from sindyjoint.errors import InputError
    from sindyjoint.workflows.diagnose import diagnose
    from tests.diagnosis.foreign_joints import RunawayError
    from tests.diagnosis.foreign_judgement import campaign_of, told

    record = dict(kind=kind, name=name, seed=seed)
    try:
        made = campaign_of(name, seed)
    except RunawayError as error:
        return {**record, "unmade": str(error)}
    try:
        cpu = time.process_time()
        result = diagnose(made.campaign, advise=False)
        cpu = time.process_time() - cpu
    except InputError as error:  # a run in which the joint sticks throughout is no run
        return {**record, "unmade" if "moving samples" in str(error) else "error": str(error)}
    except Exception as error:  # a benchmark goes on, and says what failed
        return {**record, "error": f"{type(error).__name__}: {error}"}
    return {**record, "noise": made.noise, "share": made.share, "cpu": cpu, **told(result)}


def run(args: argparse.Namespace) -> None:
    done = done_in(args.out, ("kind", "name", "seed"))
    for seed in args.seeds:
        for name in args.names or KINDS[args.kind]:
            if (args.kind, name, seed) not in done:
                record = one(args.kind, name, seed)
                append(args.out, record)
                print(line_of(record), flush=True)


def line_of(r: dict) -> str:
    begin = f"{r['name']:28s} {r['seed']:4d} "
    for what in ("unmade", "error"):
        if what in r:
            return f"{begin} {what.upper()} {r[what][:100]}"
    steps = "; ".join(f"{s['effect']} {s['probability']:.2f} [{len(s['members'])}]" for s in r["steps"])
    first, last, floor = (r[key][0] for key in ("initial", "final", "floor"))
    return (
        f"{begin} {r['share']:.2f} {r['noise']:.3f} {judge(r):9s} {r['verdict']:15s} "
        f"{100 * first:5.1f} → {100 * last:5.1f} ({100 * floor:4.1f}) % {r['cpu']:5.1f}s  {steps}"
    )


def false_names(r: dict) -> list[str]:
    """Return the laws that were named with more than 0.8, and are not what was hidden.

    Nor a channel's zero, nor one of the five terms, which come back as a step where an effect made them needless.
    """
    hidden = SAME.get(r["name"], {r["name"]}) | BASE
    sure = [s for s in r.get("steps", ()) if s["probability"] > SURE]
    return [s["effect"] for s in sure if not set(s["members"]) & (hidden | ZEROS)]


def row(kind: str, records: list[dict]) -> dict:
    """Return the row of a kind on the guide's page."""
    counted = [(r, judge(r)) for r in records if judge(r) != "mimicked"]
    wrong = [f"{r['name'].replace('_', ' ')} {r['seed']}: {what}" for r, what in counted if what != "right"]
    joints, answer = CALLED[kind.removesuffix("-mujoco")]
    return dict(
        joints=joints, seeds=seeds_of(records), answer=answer, right=len(counted) - len(wrong), of=len(counted),
        wrong=wrong, seconds=max(r["cpu"] for r in records if "cpu" in r),
    )  # fmt: skip


def show(args: argparse.Namespace) -> list[dict]:
    records = [r for r in records_in(args.paths) if "unmade" not in r]
    rows = []
    for kind in dict.fromkeys(r["kind"] for r in records):
        some = [r for r in records if r["kind"] == kind]
        rows.append(row(kind, some))
        table = defaultdict(Counter)
        for r in some:
            table[r["name"]][judge(r)] += 1
        print(f"\n== {kind}: {len(some)} campaigns")
        for name in sorted(table):
            print(f"  {name:32s}", ", ".join(f"{what} {count}" for what, count in table[name].most_common()))
        whole = Counter(judge(r) for r in some)
        counted = sum(count for what, count in whole.items() if what != "mimicked")
        print(f"  right {whole['right']} of {counted}: {whole['right'] / max(counted, 1):.1%}; {dict(whole)}")
        times = [r["cpu"] for r in some if "cpu" in r]
        print(f"  processor time: median {np.median(times):.1f} s, longest {max(times):.1f} s")
        sure = sum(bool(false_names(r)) for r in some)
        print(f"  with a law among the steps that was not there, above {SURE}: {sure}")
        print("  verdicts:", dict(Counter(r.get("verdict") for r in some)))
        for r in some:
            if judge(r) not in ("right", "mimicked"):
                print("   ", line_of(r))
    return rows


if __name__ == "__main__":
    main(__doc__, run, show, kind=dict(choices=sorted(KINDS), default="foreign"))
