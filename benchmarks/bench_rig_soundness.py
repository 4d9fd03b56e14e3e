"""Faults found in the channels of structures, and false alarms: what the check of a rig says of virtual tests.

    python benchmarks/bench_rig_soundness.py run pulse-rig --drive multisine --seeds 3001 3011 --out faults.jsonl
    python benchmarks/bench_rig_soundness.py run pulse-rig --drive sweep --seeds 3001 3005 --names sound --out ...
    python benchmarks/bench_rig_soundness.py show faults.jsonl

The tests are those of bench_structure_discovery.py, the faults those of tests/soundness/rig_faults.py; ``sound``: as it
is. `--wrong`: beams are 1 % stiffer and 0.5 % heavier (standard deviations) than the file says; it is checked as stated
in the file, and as ``undeclared`` where the file states nothing.
"""

from __future__ import annotations

import argparse
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
from benchmarks.resumed import append, done_in, records_in  # noqa: E402

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


def show(options) -> None:
    groups = defaultdict(list)
    for record in records_in([options.out]):
        groups[record["test"], record["kind"]].append(record)
    totals: dict[str, list[int]] = defaultdict(lambda: [0, 0])
    for (test, kind), records in sorted(groups.items()):
        if kind in SOUND:
            alarms = [[f for f in r["findings"] if f[0] != "note"] for r in records]
            said = f"false alarms in {sum(map(bool, alarms))} of {len(records)}"
            longest = max(r["cpu"] for r in records)
            print(f"{test}: {kind}: {said}, at most {longest:.1f} s", *sum(alarms, []), sep="\n   ")
            continue
        hits = sum(r["found"] for r in records)
        totals[test][0] += hits
        totals[test][1] += len(records)
        print(f"{test}: {kind}: {hits} of {len(records)} ({sum(r['noted'] for r in records)} with notes)")
    for test, (hits, count) in totals.items():
        print(f"{test}: {hits} of {count} faults found")


if __name__ == "__main__":
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    commands = parser.add_subparsers(required=True)
    of_run = commands.add_parser("run")
    of_run.add_argument("rig", choices=("pulse-rig", "four-panel-wing"))
    of_run.add_argument("--drive", default="multisine", choices=("sine", "multisine", "sweep", "impact"))
    of_run.add_argument("--wrong", action="store_true")
    of_run.add_argument("--seeds", type=int, nargs=2, required=True)
    of_run.add_argument("--names", nargs="+")
    of_run.add_argument("--out", required=True)
    of_run.set_defaults(do=run)
    of_show = commands.add_parser("show")
    of_show.add_argument("out")
    of_show.set_defaults(do=show)
    given = parser.parse_args()
    given.do(given)
