"""What is hidden in a structure named: confusion matrix, what is left of the gap, and time.

python benchmarks/bench_diagnosis_structure.py run --out structures.jsonl --seeds 0 1 2 3 4 5 6 7 8 9
python benchmarks/bench_diagnosis_structure.py show structures.jsonl

``run`` appends one line per pulse test and skips those that the file holds already, so that it can be stopped and
resumed. Names: those of tests/diagnosis/hidden_structures.py.
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

from benchmarks.resumed import append, done_in, main, records_in  # noqa: E402


def one(name: str, seed: int, noise: float, duration: float) -> dict:
    from sindyjoint.workflows.diagnose import diagnose_structure
    from tests.diagnosis.hidden_structures import hide

    record = dict(name=name, seed=seed, noise=noise, duration=duration)
    try:
        hidden = hide(name, seed, noise, duration)
        start, cpu = time.perf_counter(), time.process_time()
        result = diagnose_structure(hidden.rig, hidden.model)
    except Exception as error:  # a benchmark goes on, and says what failed
        return {**record, "error": f"{type(error).__name__}: {error}"}
    steps = [
        dict(effect=s.effect, members=list(s.members), probability=s.probability, parameters=s.parameters)
        for s in result.steps
    ]
    return record | dict(
        size=hidden.size, seconds=time.perf_counter() - start, cpu=time.process_time() - cpu,
        verdict=result.verdict, steps=steps, initial=result.initial.response, final=result.final.response,
        floor=result.noise_floor.response,
    )  # fmt: skip


def judge(r: dict) -> str:
    """Return right, class, extra, missed, unknown or wrong: what the answer is worth."""
    from tests.diagnosis.hidden_structures import CALLED, OUTSIDE

    steps = r["steps"]
    if r["verdict"] == "unknown":
        return "right" if r["name"] in OUTSIDE else "unknown"
    if r["name"] == "nothing":
        return "wrong" if steps else "right"
    if not steps:
        return "missed"
    wanted = CALLED.get(r["name"], {r["name"]})
    if steps[0]["effect"] in wanted:
        return "right" if len(steps[0]["members"]) == 1 else "class"
    return "class" if wanted & set(steps[0]["members"]) else "wrong"


def line_of(r: dict) -> str:
    if "error" in r:
        return f"{r['name']:16s} {r['seed']:3d} {r['noise']:.3f}  ERROR {r['error'][:90]}"
    steps = "; ".join(f"{s['effect']} {s['probability']:.2f} {s['members'][1:]}" for s in r["steps"])
    ratio = r["final"] / r["floor"]
    return (
        f"{r['name']:16s} {r['seed']:3d} {r['noise']:.3f} {r['size']:9.2e} {judge(r):8s} {r['verdict']:15s} "
        f"{r['initial']:6.3f} {ratio:5.2f} {r['cpu']:5.1f}s  {steps}"
    )


def run(args: argparse.Namespace) -> None:
    from tests.diagnosis.hidden_structures import NAMES

    done = done_in(args.out, ("name", "seed", "noise", "duration"))
    for seed in args.seeds:
        for name in args.names or NAMES:
            # Noise differs from seed to seed unless one is given.
            noise = args.noise if args.noise is not None else (0.003, 0.01, 0.03)[seed % 3]
            if (name, seed, noise, args.duration) in done:
                continue
            record = one(name, seed, noise, args.duration)
            append(args.out, record)
            print(line_of(record), flush=True)


def show(args: argparse.Namespace) -> None:
    records = records_in(args.paths)
    good = [r for r in records if "error" not in r]
    table, named = defaultdict(Counter), defaultdict(Counter)
    for r in records:
        table[r["name"]]["error" if "error" in r else judge(r)] += 1
        if "error" not in r:
            named[r["name"]][r["steps"][0]["effect"] if r["steps"] else r["verdict"]] += 1
    for name in table:
        print(f"{name:16s} {dict(table[name])}   named {dict(named[name])}")
    effects = [r for r in good if r["name"] != "nothing"]
    right = sum(judge(r) in ("right", "class") for r in effects)
    sure = sum(judge(r) == "wrong" and r["steps"][0]["probability"] > 0.8 for r in effects)
    print(f"right or in the class: {right}/{len(effects)}; wrong at more than 0.8: {sure}")
    ratio = [r["final"] / r["floor"] for r in effects]
    print(
        f"final gap over noise floor: median {np.median(ratio):.2f}, 90 % below {np.quantile(ratio, 0.9):.2f}, "
        f"at most 1.2 in {np.mean(np.array(ratio) <= 1.2):.0%}"
    )
    cpu = [r["cpu"] for r in good]
    print(f"processor time: median {np.median(cpu):.1f} s, longest {max(cpu):.1f} s")


if __name__ == "__main__":
    main(__doc__, run, show, noise=dict(type=float), duration=dict(type=float, default=6.0))
