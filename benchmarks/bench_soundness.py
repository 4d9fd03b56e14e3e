"""Faults found, and false alarms: what the check of the data says of injected faults and of sound campaigns.

python benchmarks/bench_soundness.py run --out soundness.jsonl --seeds 100 101 102 --jobs 2
python benchmarks/bench_soundness.py show soundness.jsonl
python benchmarks/bench_soundness.py run --out verdicts.jsonl --seeds 100 101 --verdicts --names sound moment_late
python benchmarks/bench_soundness.py run --out verdicts.jsonl --seeds 100 101 --verdicts discovery
python benchmarks/bench_soundness.py show verdicts.jsonl

``run`` appends one line per joint and kind and skips those that the file holds already. Names: faults of
tests/soundness/check.py, ``sound`` (the same joints as they are), ``law`` (each seed another effect of
tests/diagnosis/hidden_effects.py: a law that is no fault), ``multisine`` and ``sweep``. With ``--verdicts`` discovery
and diagnosis answer, too (or discovery alone, much sooner), whatever stops them accepted: ``show`` then lists each
*confirmed* or *refuted* that the sound campaign denies (``sound`` must be among the names), and each law above 0.8 that
is not there.
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

from benchmarks.resumed import append, done_in, main, records_in, seeds_of  # noqa: E402

SOUND = {
    "sound": "sound sines", "law": "another law under sines", "multisine": "under multisines",
    "sweep": "under sweeps",
}  # fmt: skip


# What is right to name where a fault is in the data: the effects that the catalogue has for faults of channels.
NUISANCES = {
    "angle_offset",
    "constant_moment",
    "channel_delay",
    "moment_drift",
    "angle_drift",
    "stiffness_drift",
}
SURE = 0.8


def one_joint(seed: int, names: list[str], verdicts: str | None = None) -> list[dict]:
    """Return the records of one random joint: it is simulated once for all faults."""
    from sindyjoint.errors import InputError
    from tests.soundness.faults import FAULTS, sound_campaign

    try:
        clean = sound_campaign(seed) if {"sound", *FAULTS} & set(names) else None
    except InputError as error:  # two of its levels are one
        unmade = dict(unmade=str(error), found=False, findings=[], cpu=0.0, runs=0)
        return [dict(name=name, seed=seed, **unmade) for name in names]
    return [one(name, seed, clean, verdicts) for name in names]


def one(name: str, seed: int, clean, verdicts: str | None = None) -> dict:
    from sindyjoint.errors import SimulationError
    from sindyjoint.soundness.check import find_faults
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
    record = dict(name=name, seed=seed, run=run, found=hit, findings=listed, cpu=cpu, runs=len(campaign.runs))
    if verdicts:
        record["answers"] = answers(
            campaign, tuple({f.id for f in findings if f.severity == "stops"}), verdicts == "diagnosis"
        )
    return record


def answers(campaign, accept: tuple[str, ...], diagnosed: bool) -> dict:
    """Return what discovery and diagnosis answer of a campaign, what stops them accepted; an error ends an answer."""
    from sindyjoint.errors import SindyJointError
    from sindyjoint.workflows.diagnose import diagnose
    from sindyjoint.workflows.discover import discover

    told: dict = {}
    try:
        found = discover(campaign, accept=accept).verdict
        told.update(terms=found.verdict, missing=found.missing, extra=found.extra)
        if not diagnosed:
            return told
        result = diagnose(campaign, accept=accept, advise=False)
        told.update(verdict=result.verdict, steps=[(s.members, s.probability) for s in result.steps])
    except SindyJointError as error:
        told["error"] = f"{type(error).__name__}: {error}"
    return told


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
    if args.verdicts:  # a joint takes minutes: what is done of it is kept
        tasks = [(seed, [name]) for seed, some in tasks for name in some]
    jobs = (delayed(one_joint)(*task, args.verdicts) for task in tasks if task[1])
    for records in Parallel(n_jobs=args.jobs, return_as="generator_unordered")(jobs):
        for record in records:
            append(args.out, record)
        print(f"seed {records[0]['seed']}: {sum(r['found'] for r in records)} faults found", flush=True)


def row(data: str, records: list[dict], right: int, wrong: list[str]) -> dict:
    """Return a row of the guide's page: faults found, or sound campaigns without an alarm."""
    seconds = float(np.median([r["cpu"] for r in records]))
    counts = dict(right=right, of=len(records), wrong=wrong, seconds=seconds)
    return dict(kind="check", data=data, seeds=seeds_of(records)) | counts


def show(args: argparse.Namespace) -> list[dict]:
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
    put = [r for records in faults.values() for r in records]
    every, rows = [r["found"] for r in put], []
    if every:
        print(f"found: {sum(every)} of {len(every)}, {100 * np.mean(every):.1f} %; {len(faults)} kinds")
        wrong = [f"{r['name']} {r['seed']}" for r in put if not r["found"]]
        data = f"{len(faults)} kinds of fault"
        rows.append(row(data, put, sum(every), wrong))
    for name in SOUND:
        alarms = [(r["seed"], f) for r in table[name] for f in r["findings"] if f[2] != "note"]
        if table[name]:
            print(
                f"{name}: {len({seed for seed, _ in alarms})} of {len(table[name])} campaigns with a false alarm"
            )
            quiet = len(table[name]) - len({seed for seed, _ in alarms})
            rows.append(row(SOUND[name], table[name], quiet, [f"{f[0]} {seed}" for seed, f in alarms]))
        for seed, finding in alarms:
            print(f"    {seed}: {finding}")
    rows += show_answers([r for records in table.values() for r in records if "answers" in r])
    times = [r["cpu"] for records in table.values() for r in records]
    print(f"processor time: median {np.median(times):.2f} s, longest {max(times):.2f} s")
    return rows


def show_answers(records: list[dict]) -> list[dict]:
    """Print the verdicts that the sound campaign of the same joint denies, and sure names of laws not there."""
    from collections import Counter

    sound = {r["seed"]: r["answers"] for r in records if r["name"] == "sound"}
    bad = [r for r in records if r["name"] not in SOUND]
    if not bad:
        return []
    opposite = {"confirmed": "refuted", "refuted": "confirmed"}
    denied = [
        r for r in bad if opposite.get(r["answers"].get("terms")) == sound.get(r["seed"], {}).get("terms", "")
    ]
    named = [(r, [s for s in r["answers"].get("steps", ()) if s[1] > SURE]) for r in bad]
    wrong = [(r, s) for r, steps in named for s in steps if not set(s[0]) & NUISANCES]
    print(f"verdicts under faults: {dict(Counter(r['answers'].get('terms', 'error') for r in bad))}")
    print(f"denied by the sound campaign: {len(denied)} of {len(bad)}")
    for r in denied:
        print(f"    {r['name']} {r['seed']}: {r['answers']['terms']}, {r['answers']['extra']}")
    print(f"a law that is not there above {SURE}: {len({id(r) for r, _ in wrong})} of {len(bad)}")
    for r, (members, probability) in wrong:
        print(f"    {r['name']} {r['seed']}: {' or '.join(members)} {probability:.2f}")
    told = Counter(_beside(r["answers"].get("terms"), sound.get(r["seed"], {}).get("terms")) for r in bad)
    by = "diagnosis" if any("steps" in r["answers"] for r in bad) else "discovery"
    seeds = dict(
        kind="answers", by=by, seeds=seeds_of(bad), of=len(bad), contradicted=len(denied), named=len(wrong)
    )
    return [seeds | {what: told[what] for what in ("same", "undecided", "none", "other")}]


def _beside(answer: str | None, sound: str | None) -> str:
    """Return how a verdict under a fault stands to that of the sound campaign."""
    if answer is None or answer == "undecided":
        return answer or "none"
    return "same" if answer == sound else "other"


if __name__ == "__main__":
    main(
        __doc__,
        run,
        show,
        jobs=dict(type=int, default=1),
        verdicts=dict(nargs="?", choices=["discovery", "diagnosis"], const="diagnosis"),
    )
