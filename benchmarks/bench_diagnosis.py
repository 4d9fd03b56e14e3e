"""Hidden effects named: confusion, calibration, what is left of the gap, and time; and how often advice helps.

python benchmarks/bench_diagnosis.py run --out diagnosis.jsonl --seeds 0 1 2 3 --sizes 0.06 --noises 0.01 --jobs 2
python benchmarks/bench_diagnosis.py run --out sweeps.jsonl --seeds 4 5 --test sweep
python benchmarks/bench_diagnosis.py show diagnosis.jsonl

``run`` appends one line per campaign and skips those that the file holds already, so that it can be stopped and
resumed. Names: effects of tests/diagnosis/hidden_effects.py, ``nothing``, or two joined by ``+``.
"""

from __future__ import annotations

import argparse
import os
import sys
import time
from collections import Counter, defaultdict
from dataclasses import replace
from pathlib import Path

for variable in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"):
    os.environ.setdefault(variable, "1")

import numpy as np  # noqa: E402

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

from benchmarks.resumed import append, done_in, main, records_in, seeds_of  # noqa: E402
from tests.diagnosis.hidden_effects import OUTSIDE  # noqa: E402

# What the referee hides, under the name that the catalogue has for it.
SAME = {
    "stop": "dead_zone",
    "one_sided_stop": "dead_zone",
    "bouc_wen_general": "bouc_wen_hysteresis",
    "modulus_damping": "amplitude_dependent_damping",
    "stiffness_drift_on": "stiffness_drift",
}


# How the hidden joints are tested: 8 s at 1 kHz under a sinusoidal moment or angle, but for what is said here.
TESTS = {
    "usual": {},
    "undeclared": {},
    "slow": dict(sample_rate=500.0, duration=4.0),
    "fast": dict(sample_rate=5000.0, duration=5.0),
    "rig": dict(drive="rig"),
    "few": dict(frequencies=(3.5, 5.5)),
    "low": dict(frequencies=(0.7, 1.1, 1.6), duration=12.0),
    "high": dict(frequencies=(9.0, 13.0, 17.0), duration=5.0),
    "multisine": None,
    "sweep": None,
}
SURE = 0.8
# What the guide's page calls the tests.
CALLED = {
    "usual": "8 s at 1 kHz",
    "undeclared": "inertia not declared",
    "slow": "4 s at 500 Hz",
    "fast": "5 s at 5 kHz",
    "rig": "through a beam with inertia",
    "few": "two frequencies only",
    "low": "0.7 to 1.6 Hz, 12 s",
    "high": "9 to 17 Hz, 5 s",
    "multisine": "multisines of twelve lines, 1 to 8 Hz, 10 s",
    "sweep": "sweeps, 1 to 8 Hz and back, 10 s",
}


def one(name: str, seed: int, size: float, noise: float, test: str = "usual", advice: bool = True) -> dict:
    from sindyjoint.workflows.diagnose import diagnose
    from tests.diagnosis.hidden_effects import hide, hide_in_noise

    record = dict(name=name, seed=seed, size=size, noise=noise, test=test)
    fixed = TESTS[test]
    try:
        if fixed is None:
            hidden = hide_in_noise(name, test, seed, size, noise)
        else:
            hidden = hide(name, seed, size, noise, **fixed)
        campaign = hidden.campaign
        if test == "undeclared":
            campaign = replace(campaign, joint=replace(campaign.joint, inertia=None))
        start, cpu = time.perf_counter(), time.process_time()
        result = diagnose(campaign, advise=advice)
    except Exception as error:  # a benchmark goes on, and says what failed
        return {**record, "error": f"{type(error).__name__}: {error}"}
    truth = hidden.plan.law
    true = dict(
        linear_stiffness=truth.k1, quadratic_stiffness=truth.k2, cubic_stiffness=truth.k3,
        linear_damping=truth.c1, coulomb_friction=truth.M_F,
    )  # fmt: skip
    record.update(
        seconds=time.perf_counter() - start,
        cpu=time.process_time() - cpu,
        drive=hidden.plan.drive,
        verdict=result.verdict,
        steps=[
            dict(
                effect=s.effect,
                members=list(s.members),
                probability=s.probability,
                rivals=[list(r) for r in s.rivals],
                parameters=s.parameters,
            )
            for s in result.steps
        ],
        parameters=list(hidden.parameters),
        effects=[e.effect.id for e in result.effects],
        initial=[result.initial.moment, result.initial.response],
        final=[result.final.moment, result.final.response],
        floor=[result.noise_floor.moment, result.noise_floor.response],
        terms={
            k: 100 * (result.model[k].coefficient / v - 1) for k, v in true.items() if k in result.model.ids
        },
    )
    return record


def run(args: argparse.Namespace) -> None:
    from joblib import Parallel, delayed

    from tests.diagnosis.hidden_effects import CHANNELS, LAWS

    names = args.names or [n for n in (*LAWS, *CHANNELS, "nothing") if n not in OUTSIDE]
    if TESTS[args.test] is None:
        names = [n for n in names if n not in CHANNELS]
    if args.test == "undeclared":
        names = [n for n in names if n != "inertia_error"]
    done = done_in(args.out, ("name", "seed", "size", "noise", "test"))
    tasks = [
        task
        for seed in args.seeds
        for size in args.sizes
        for noise in args.noises
        for task in [(name, seed, size, noise, args.test) for name in names]
        if task not in done
    ]
    results = Parallel(n_jobs=args.jobs, return_as="generator_unordered")(
        delayed(one)(*t, not args.no_advice) for t in tasks
    )
    for record in results:
        append(args.out, record)
        print(line_of(record), flush=True)


def line_of(r: dict) -> str:
    if "error" in r:
        return f"{r['name']:28s} {r['seed']:4d} {r['size']:.2f} {r['noise']:.3f}  ERROR {r['error'][:90]}"
    steps = "; ".join(f"{s['effect']} {s['probability']:.2f} [{len(s['members'])}]" for s in r["steps"])
    ratios = [f / n if n else 0 for f, n in zip(r["final"], r["floor"], strict=True)]
    return (
        f"{r['name']:28s} {r['seed']:4d} {r['drive'][0]} {r['size']:.2f} {r['noise']:.3f} {judge(r):9s} "
        f"{r['verdict']:15s} "
        f"{ratios[0]:5.2f} {ratios[1]:5.2f} {r['cpu']:5.1f}s  {steps}"
    )


def judge(r: dict) -> str:
    """Return right, class, missed, extra, wrong: what the answer is worth."""
    wanted = set() if r["name"] == "nothing" else {SAME.get(n, n) for n in r["name"].split("+")}
    steps = r["steps"]
    if not steps:
        return "right" if not wanted else ("unknown" if r["verdict"] == "unknown" else "missed")
    if not wanted:
        return "wrong"
    first = steps[0]
    if len(wanted) > 1:
        found = {m for s in steps for m in s["members"]}
        return "right" if wanted <= found else "missed"
    (name,) = wanted
    if first["effect"] == name:
        return "right" if len(first["members"]) == 1 else "class"
    if name in first["members"]:
        return "class" if len(first["members"]) <= 4 else "wide"
    return "unknown" if r["verdict"] == "unknown" else "wrong"


def calibration(records: list[dict], bins: int = 10) -> tuple[float, list[tuple[float, float, int]]]:
    """Return the expected calibration error of the probabilities of all candidates of first steps, and the curve."""
    stated, true = [], []
    for r in records:
        if "error" in r or not r["steps"] or "+" in r["name"]:
            continue
        name = SAME.get(r["name"], r["name"])
        s = r["steps"][0]
        for effect, p in [(s["effect"], s["probability"]), *s["rivals"]]:
            stated.append(p)
            true.append(effect == name)
    return _curve(np.array(stated), np.array(true, dtype=float), bins)


def top_calibration(records: list[dict], bins: int = 10) -> tuple[float, list[tuple[float, float, int]]]:
    """Return the calibration error of the probability given to the name put first ("nothing" included)."""
    stated, true = [], []
    for r in records:
        if "error" in r or not r["steps"] or "+" in r["name"]:
            continue
        stated.append(r["steps"][0]["probability"])
        true.append(r["steps"][0]["effect"] == SAME.get(r["name"], r["name"]))
    return _curve(np.array(stated), np.array(true, dtype=float), bins)


def _curve(p: np.ndarray, t: np.ndarray, bins: int) -> tuple[float, list[tuple[float, float, int]]]:
    """Return the mean distance between what was said and what was true, and both in bins of what was said."""
    edges = np.minimum((p * bins).astype(int), bins - 1)
    curve = [(p[edges == b].mean(), t[edges == b].mean(), int((edges == b).sum())) for b in np.unique(edges)]
    return sum(abs(a - b) * n for a, b, n in curve) / max(p.size, 1), curve


def kind_of(record: dict) -> str:
    """Return in which row of the guide's page a campaign counts."""
    name = record["name"]
    if name in OUTSIDE:
        return "outside"
    return "nothing" if name == "nothing" else "two effects" if "+" in name else "effect"


def is_right(record: dict) -> bool:
    """Return whether an answer counts as right: of what no catalogue has, whether it names nothing surely."""
    if "error" in record:
        return False
    sure = any(step["probability"] > SURE for step in record["steps"])
    doubts = record["verdict"] in ("unknown", "undecided", "partly_named") and not sure
    return judge(record) in ("right", "class") or record["name"] in OUTSIDE and doubts


def row(kind: str, records: list[dict]) -> dict:
    """Return the row of campaigns of one kind, test, size and noise on the guide's page."""
    first, made = records[0], [r for r in records if "error" not in r]
    wrong = [r for r in records if not is_right(r)]
    terms = [abs(v) <= 3 for r in made if is_right(r) for v in r["terms"].values()]
    response = [r["final"][1] <= 1.2 * r["floor"][1] for r in made if r["floor"][1]]
    return dict(
        kind=kind, test=CALLED[first["test"]], size=first["size"], noise=first["noise"], seeds=seeds_of(records),
        right=len(records) - len(wrong), of=len(records),
        wrong=[f"{r['name'].replace('_', ' ')} {r['seed']}" for r in wrong],
        second=sum(len(r["steps"]) > 1 for r in made),
        sure=sum(r["steps"][0]["probability"] > SURE for r in wrong if r.get("steps")),
        response=float(np.mean(response)) if response else None, terms=float(np.mean(terms)) if terms else None,
    )  # fmt: skip


def show(args: argparse.Namespace) -> list[dict]:
    records, rows = records_in(args.paths), []
    for test, size, noise in sorted({(r["test"], r["size"], r["noise"]) for r in records}):
        some = [r for r in records if (r["test"], r["size"], r["noise"]) == (test, size, noise)]
        print(f"\n== {CALLED[test]}, size {size:.0%}, noise {noise:.1%}: {len(some)} campaigns")
        show_names(some)
        kinds = defaultdict(list)
        for r in some:
            kinds[kind_of(r)].append(r)
        rows += [row(kind, each) for kind, each in kinds.items()]
        if single := [r for r in kinds["effect"] if "error" not in r]:
            show_effects(single)
    for title, function in (("all candidates", calibration), ("the first name", top_calibration)):
        error, curve = function([r for r in records if r["name"] not in OUTSIDE])
        print(f"\nexpected calibration error, {title}: {error:.3f}")
        for stated, true, count in curve:
            print(f"  said {stated:.2f}  true {true:.2f}  ({count})")
    return rows


def show_names(records: list[dict]) -> None:
    """Print what became of each name."""
    table = defaultdict(Counter)
    for r in records:
        table[r["name"]]["error" if "error" in r else judge(r)] += 1
    for name in sorted(table):
        print(f"  {name:44s}", ", ".join(f"{what} {count}" for what, count in table[name].most_common()))


def show_effects(records: list[dict]) -> None:
    """Print the figures of campaigns with one effect: names, gaps, time, and what was taken for what."""
    good = sum(judge(r) in ("right", "class") for r in records)
    wrong = [r for r in records if judge(r) in ("wrong", "wide")]
    sure = sum(r["steps"][0]["probability"] > SURE for r in wrong)
    print(
        f"  right or in the class: {good}/{len(records)} = {good / len(records):.1%}; wrong at > 0.8: {sure}"
    )
    for k, what in enumerate(("moment", "response")):
        ratio = np.array([r["final"][k] / r["floor"][k] for r in records if r["floor"][k]])
        middle, high = np.nanmedian(ratio), np.nanquantile(ratio, 0.9)
        print(
            f"  final {what} gap over floor: median {middle:.2f}, 90 % below {high:.2f}, "
            f"≤ 1.2 in {np.mean(ratio <= 1.2):.0%}"
        )
    terms = [abs(v) for r in records for k, v in r["terms"].items() if judge(r) in ("right", "class")]
    print(f"  terms of the true model within 3 %: {np.mean(np.array(terms) <= 3):.0%}")
    times = [r["cpu"] for r in records]
    print(f"  processor time: median {np.median(times):.1f} s, longest {max(times):.1f} s")
    confused = Counter((r["name"], r["steps"][0]["effect"]) for r in wrong)
    for (name, other), count in confused.most_common():
        print(f"    {name} called {other}: {count}")


if __name__ == "__main__":
    main(
        __doc__,
        run,
        show,
        sizes=dict(nargs="+", type=float, default=[0.06]),
        noises=dict(nargs="+", type=float, default=[0.01]),
        test=dict(choices=TESTS, default="usual"),
        jobs=dict(type=int, default=1),
        no_advice=dict(action="store_true", help="leave out the search for further runs"),
    )
