"""Faults found in the channels of structures, and false alarms: what the check of a rig says of virtual tests.

    python benchmarks/bench_rig_soundness.py run --rig pulse-rig --drive multisine --seeds 3001 3011 --out faults.jsonl
    python benchmarks/bench_rig_soundness.py run --rig pulse-rig --drive sweep --seeds 3001 3005 --names sound --out ...
    python benchmarks/bench_rig_soundness.py show faults.jsonl

The tests are those of bench_structure_discovery.py, the faults those of tests/soundness/rig_faults.py; ``sound``: as it
is. `--wrong`: beams are 1 % stiffer and 0.5 % heavier (standard deviations) than the file says; it is checked as stated
in the file, and as ``undeclared`` where the file states nothing.
"""

from __future__ import annotations

import os
import sys
import time
from collections import defaultdict
from dataclasses import replace
from pathlib import Path

for variable in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"):
    os.environ.setdefault(variable, "1")

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

from benchmarks.bench_structure_discovery import campaign  # noqa: E402
from benchmarks.resumed import append, done_in, main, records_in, seeds_of  # noqa: E402

SOUND = ("sound", "undeclared")


def one(test, kind: str, seed: int) -> dict:
    """Return what the check finds with a fault put in, or of a sound test."""
    from sindyjoint.soundness.check import find_faults
    from tests.soundness.rig_faults import found, inject

    run, channel, put = None, None, test
    if kind == "undeclared":
        put = replace(test, uncertain=())
    elif kind != "sound":
        put, run, channel = inject(kind, test, seed)
    begun = time.process_time()
    findings = find_faults(put)
    record = {"kind": kind, "seed": seed, "run": run, "channel": channel, "cpu": time.process_time() - begun}
    record["findings"] = [(f.severity, f.id, f.run, f.channel, f.extent) for f in findings]
    if kind not in SOUND:
        record["found"] = found(kind, put, findings, run, channel)
        record["noted"] = found(kind, put, findings, run, channel, ("stops", "biases", "note"))
    return record


def whole(name: str, test):
    """Return a test that knows the parts of its structure, as one that is read from a file does."""
    from sindyjoint.mechanics.rig_test import Chain
    from sindyjoint.mechanics.rigs import load_rig

    rig = load_rig(name)
    return replace(test, chain=Chain(rig.items, rig.clamp_stiffness, {}, test.structure.loss_frequency))


def run(options) -> None:
    from tests.soundness.rig_faults import REPEATING, RIG_FAULTS

    kinds = options.names or ["sound", *(["undeclared"] if options.wrong else []), *RIG_FAULTS]
    if options.drive in ("sweep", "impact"):
        kinds = [kind for kind in kinds if kind not in REPEATING]
    said = f"{options.rig}, {options.drive}{', wrong' if options.wrong else ''}"
    done = done_in(options.out, ("test", "kind", "seed"))
    for seed in range(*options.seeds):
        missing = [kind for kind in kinds if (said, kind, seed) not in done]
        test = (
            whole(options.rig, campaign(options.rig, seed, options.drive, options.wrong)[0])
            if missing
            else None
        )
        for kind in missing:
            append(options.out, {"test": said} | one(test, kind, seed))


def show(options) -> list[dict]:
    groups = defaultdict(list)
    for record in records_in(options.paths):
        groups[record["test"], record["kind"]].append(record)
    rows = {}
    for (test, kind), records in sorted(groups.items()):
        row = rows.setdefault(
            test, dict(test=test, seeds=seeds_of(records), kinds=0, found=0, faults=0, quiet=0, sound=0)
        )
        if kind in SOUND:
            alarms = [[f for f in r["findings"] if f[0] != "note"] for r in records]
            said = f"false alarms in {sum(map(bool, alarms))} of {len(records)}"
            longest = max(r["cpu"] for r in records)
            print(f"{test}: {kind}: {said}, at most {longest:.1f} s", *sum(alarms, []), sep="\n   ")
            row["quiet"] += sum(not each for each in alarms)
            row["sound"] += len(records)
            continue
        hits = sum(r["found"] for r in records)
        row["kinds"] += 1
        row["found"] += hits
        row["faults"] += len(records)
        missed = "".join(f"; missed {r['seed']}" for r in records if not r["found"])
        print(
            f"{test}: {kind}: {hits} of {len(records)} ({sum(r['noted'] for r in records)} with notes){missed}"
        )
    for row in rows.values():
        print("{test}: {found} of {faults} faults found".format_map(row))
    return [*rows.values()]


if __name__ == "__main__":
    main(
        __doc__, run, show,
        rig=dict(choices=("pulse-rig", "four-panel-wing"), default="pulse-rig"),
        drive=dict(default="multisine", choices=("sine", "multisine", "sweep", "impact")),
        wrong=dict(action="store_true"),
    )  # fmt: skip
