"""Faults found, and false alarms: what the check of the data says of injected faults and of sound campaigns.

python benchmarks/bench_soundness.py run --out soundness.jsonl --seeds 100 101 102 --jobs 2
python benchmarks/bench_soundness.py show soundness.jsonl

``run`` appends one line per joint and kind and skips those that the file holds already. Names: faults of
tests/soundness/faults.py, ``sound`` (the same joints as they are), ``law`` (each seed another effect of
tests/diagnosis/hidden_effects.py: a law that is no fault), ``multisine`` and ``sweep``.
"""

from __future__ import annotations

import argparse
import os
import sys
import time
from collections import defaultdict
from pathlib import Path

for variable in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"):
    os.environ.setdefault(variable, "1")

import numpy as np  # noqa: E402

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

from benchmarks.resumed import append, commands, done_in, records_in  # noqa: E402

SOUND = ("sound", "law", "multisine", "sweep")


def one_joint(seed: int, names: list[str]) -> list[dict]:
    """Return the records of one random joint: it is simulated once for all faults."""
    from tests.soundness.faults import FAULTS, sound_campaign

    clean = sound_campaign(seed) if {"sound", *FAULTS} & set(names) else None
    return [one(name, seed, clean) for name in names]


def one(name: str, seed: int, clean) -> dict:
    from sindyjoint.errors import SimulationError
    from sindyjoint.soundness.faults import find_faults
    from tests.soundness.faults import found, inject

    run = None
    if name == "sound":
        campaign = clean
    elif name in SOUND:
        try:
            campaign = sound_law(name, seed)
        except SimulationError as error:  # a joint that cannot be moved so
            return dict(name=name, seed=seed, unmade=str(error), found=False, findings=[], cpu=0.0, runs=0)
    else:
        campaign, run = inject(name, clean, seed)
    cpu = time.process_time()
    findings = find_faults(campaign)
    cpu = time.process_time() - cpu
    listed = [(f.id, f.run, f.severity, f.extent) for f in findings]
    hit = name not in SOUND and found(name, findings, run)
    return dict(name=name, seed=seed, run=run, found=hit, findings=listed, cpu=cpu, runs=len(campaign.runs))


def sound_law(name: str, seed: int):
    """Return a campaign with a law beyond the paper's, noise of 0.1 to 5 %; no fault of the data."""
    from tests.diagnosis.hidden_effects import LAWS, hide, hide_in_noise

    rng = np.random.default_rng((5, seed))
    effect, noise = list(LAWS)[seed % len(LAWS)], float(10 ** rng.uniform(-3, -1.3))
    if name == "law":
        return hide(effect, seed, float(rng.uniform(0.04, 0.15)), noise).campaign
    return hide_in_noise(effect, name, seed, 0.1, noise).campaign


def run(args: argparse.Namespace) -> None:
    from joblib import Parallel, delayed

    from tests.soundness.faults import FAULTS

    names = args.names or ["sound", "law", *FAULTS]
    done = done_in(args.out, ("name", "seed"))
    tasks = [(seed, [n for n in names if (n, seed) not in done]) for seed in args.seeds]
    jobs = (delayed(one_joint)(*task) for task in tasks if task[1])
    for records in Parallel(n_jobs=args.jobs, return_as="generator_unordered")(jobs):
        for record in records:
            append(args.out, record)
        print(f"seed {records[0]['seed']}: {sum(r['found'] for r in records)} faults found", flush=True)


def show(args: argparse.Namespace) -> None:
    table = defaultdict(list)
    for record in records_in(args.paths):
        if "unmade" not in record:
            table[record["name"]].append(record)
    faults = {name: records for name, records in table.items() if name not in SOUND}
    for name, records in faults.items():
        missed = [r["seed"] for r in records if not r["found"]]
        print(
            f"  {name:26s} {len(records) - len(missed):3d} of {len(records)}"
            + (f"  missed {missed}" if missed else "")
        )
    every = [r["found"] for records in faults.values() for r in records]
    if every:
        print(f"found: {sum(every)} of {len(every)}, {100 * np.mean(every):.1f} %; {len(faults)} kinds")
    for name in SOUND:
        alarms = [(r["seed"], f) for r in table[name] for f in r["findings"] if f[2] != "note"]
        if table[name]:
            print(
                f"{name}: {len({seed for seed, _ in alarms})} of {len(table[name])} campaigns with a false alarm"
            )
        for seed, finding in alarms:
            print(f"    {seed}: {finding}")
    times = [r["cpu"] for records in table.values() for r in records]
    print(f"processor time: median {np.median(times):.2f} s, longest {max(times):.2f} s")


if __name__ == "__main__":
    arguments = commands(__doc__, run, show, jobs=dict(type=int, default=1))
    arguments.do(arguments)
