"""How often the advised run resolves what was ambiguous: it is made on the hidden joint, and all is diagnosed again.

python benchmarks/bench_advice.py run --out advice.jsonl --names dahl_friction maxwell_branch --seeds 0 1 2
python benchmarks/bench_advice.py show advice.jsonl

Resolved: the true name alone. Narrower: fewer names, the true one among them. Runs are added in the order of the
advice until the class is resolved.
"""

from __future__ import annotations

import argparse
import os
import sys
import time
from collections import Counter
from pathlib import Path

for variable in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"):
    os.environ.setdefault(variable, "1")

import numpy as np  # noqa: E402

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

from benchmarks.resumed import append, done_in, main, records_in  # noqa: E402

SAME = {"stop": "dead_zone"}
# Most often not told apart from others.
AMBIGUOUS = ("dahl_friction", "lugre_friction", "bouc_wen_hysteresis", "jenkins_element", "maxwell_branch",
             "constant_moment", "angle_offset", "inertia_error", "frequency_dependent_stiffness")  # fmt: skip


def one(name: str, seed: int, size: float, noise: float) -> dict:
    from sindyjoint.workflows.diagnose import diagnose
    from tests.diagnosis.further_runs import one_more
    from tests.diagnosis.hidden_effects import hide

    record = dict(name=name, seed=seed, size=size, noise=noise)
    truth = SAME.get(name, name)
    start = time.process_time()
    hidden = hide(name, seed, size, noise)
    result = diagnose(hidden.campaign)
    record.update(drive=hidden.plan.drive, verdict=result.verdict, before=_answer(result), after=[], runs=[])
    if result.verdict != "ambiguous" or not any(truth in s.members for s in result.steps):
        return {**record, "seconds": time.process_time() - start}
    campaign = hidden.campaign
    members = next(s.members for s in result.steps if truth in s.members)
    for index, advice in enumerate(a for a in result.advice if truth in a.separates):
        run = dict(
            frequency=advice.frequency,
            level=advice.level,
            waveform=advice.waveform,
            said=advice.expected_confidence,
        )
        record["runs"].append(run)
        if not advice.frequency:
            break
        more = one_more(hidden, advice.frequency, advice.level, advice.waveform, noise, index)
        campaign = campaign.with_runs((*campaign.runs, more))
        again = diagnose(campaign)
        record["after"].append(_answer(again))
        run["probability"] = next(
            (dict(s["all"]).get(truth, 0.0) for s in _answer(again) if truth in dict(s["all"])), 0.0
        )
        if any(s["members"] == [truth] for s in record["after"][-1]):
            break
    record["members"] = list(members)
    return {**record, "seconds": time.process_time() - start}


def _answer(result) -> list[dict]:
    return [
        dict(effect=s.effect, members=list(s.members), all=[[s.effect, s.probability], *map(list, s.rivals)])
        for s in result.steps
    ]


def judge(r: dict) -> str:
    truth = SAME.get(r["name"], r["name"])
    if r["verdict"] != "ambiguous":
        return "not ambiguous"
    if "members" not in r:
        return "truth not in the class"
    if not r["after"]:
        return "no run advised"
    last = [s["members"] for s in r["after"][-1] if truth in s["members"]]
    if not last:
        return "truth lost"
    if last[0] == [truth]:
        return "resolved"
    return "narrower" if len(last[0]) < len(r["members"]) else "as before"


def run(args: argparse.Namespace) -> None:
    done = done_in(args.out, ("name", "seed", "size", "noise"))
    for seed in args.seeds:
        for name in args.names or AMBIGUOUS:
            if (name, seed, args.size, args.noise) in done:
                continue
            try:
                record = one(name, seed, args.size, args.noise)
            except Exception as error:  # a benchmark goes on, and says what failed
                print(f"{name} {seed} ERROR {type(error).__name__}: {error}", flush=True)
                continue
            append(args.out, record)
            told = "; ".join(
                f"{x['frequency']:g} Hz {x['level']:.3g} {x['waveform'][:10]} "
                f"said {x['said']:.2f} got {x.get('probability', 0):.2f}"
                for x in record["runs"]
            )
            after = record["after"][-1] if record["after"] else []
            before = [s["members"] for s in record["before"]]
            line = f"{name:28s} {seed:3d} {record['drive'][0]} {judge(record):14s} {before} -> "
            print(f"{line}{[s['members'] for s in after]}  {told}  {record['seconds']:.0f}s", flush=True)


def show(args: argparse.Namespace) -> list[dict]:
    records = records_in(args.paths)
    count = Counter(judge(r) for r in records)
    print(dict(count))
    ambiguous = sum(n for k, n in count.items() if k != "not ambiguous")
    made = ambiguous - count["no run advised"] - count["truth not in the class"]
    better = count["resolved"] + count["narrower"]
    print(f"resolved {count['resolved']}/{ambiguous}, resolved or narrower {better}/{ambiguous}")
    print(f"of those with a run advised: resolved {count['resolved']}/{made}, or narrower {better}/{made}")
    said = np.array([r["runs"][-1]["said"] for r in records if r["after"]])
    got = np.array([r["runs"][-1].get("probability", 0.0) for r in records if r["after"]])
    for low, high in ((0, 0.6), (0.6, 0.8), (0.8, 0.95), (0.95, 1.01)):
        some = (said >= low) & (said < high)
        if some.any():
            print(
                f"said {said[some].mean():.2f}, the true name then had {got[some].mean():.2f} ({some.sum()})"
            )
    for name in sorted({r["name"] for r in records}):
        print(f"  {name:30s}", dict(Counter(judge(r) for r in records if r["name"] == name)))
    return [
        dict(
            campaigns="ambiguous, the hidden effect in the class",
            count=ambiguous - count["truth not in the class"],
            of=ambiguous,
        ),
        dict(
            campaigns="of these with a run advised",
            count=made,
            of=ambiguous - count["truth not in the class"],
        ),
        dict(campaigns="resolved by the advised runs", count=count["resolved"], of=made),
        dict(campaigns="resolved or narrower", count=better, of=made),
    ]


if __name__ == "__main__":
    main(__doc__, run, show, size=dict(type=float, default=0.06), noise=dict(type=float, default=0.01))
