"""Intervals of the numbers of elements: how often those of a diagnosis hold the truth that a virtual test had hidden.

python benchmarks/bench_elements.py run --out elements.jsonl --seeds 0 1 2 3
python benchmarks/bench_elements.py run --out refined.jsonl --seeds 0 1 2 3 --refine
python benchmarks/bench_elements.py show elements.jsonl

Random joints with one element hidden, moved by a moment (even seeds) or by a motion (odd seeds). The element is the
only candidate, unless ``--all``: its numbers are asked for here, not its name. ``run`` appends one line per campaign
and resumes. A number counts where the form that was hidden is found.
"""

from __future__ import annotations

import argparse
import os
import sys
import time
from collections import Counter, defaultdict
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

for variable in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"):
    os.environ.setdefault(variable, "1")


import numpy as np  # noqa: E402

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

from benchmarks.resumed import append, done_in, main, records_in  # noqa: E402
from sindyjoint.record import Campaign  # noqa: E402

# What the numbers of the catalogue's elements are, from the parameters of the referee's law.
TRUTH: dict[str, Callable[[tuple[float, ...]], dict[str, float]]] = {
    "jenkins_element": lambda p: {"k_t": p[0] / p[1], "theta_y": p[1]},
    "dahl_friction": lambda p: {"k_z": p[0] / p[1], "theta_y": p[1]},
    "bouc_wen_hysteresis": lambda p: {"k_z": p[0] / p[1], "theta_y": p[1], "shape": p[3]},
    "maxwell_branch": lambda p: {"k_m": p[0], "tau": p[1]},
    "backlash_play": lambda p: {"M_g": p[0], "gap": p[1], "ramp": p[2]},
}
# By which law an element is hidden, where that has not its own name: numbers at an end of their range say little.
HIDDEN = {"bouc_wen_hysteresis": "bouc_wen_general"}
# What is measured: two to four levels at two frequencies, 3 s each at 500 Hz. The referee stops sliders in steps of
# its samples, so that it makes more of them.
TEST = dict(duration=3.0, frequencies=(3.5, 5.0))
SAMPLE_RATE = 500.0
FINER = {"moment": 8, "displacement": 32}


def one(name: str, seed: int, size: float, noise: float, refine: bool, every: bool) -> dict:
    from sindyjoint.diagnosis.effects import load_effects, select_effects
    from tests.diagnosis.hidden_effects import hide

    record = dict(name=name, seed=seed, size=size, noise=noise, refine=refine, every=every)
    try:
        finer = FINER["displacement" if seed % 2 else "moment"]
        hidden = hide(HIDDEN.get(name, name), seed, size, noise, sample_rate=finer * SAMPLE_RATE, **TEST)
        truth = TRUTH[name](hidden.parameters)
        record |= dict(drive=hidden.plan.drive, parameters=list(hidden.parameters), truth=truth)
        known = load_effects()
        candidates = known if every else select_effects(known, [name])
        start = time.process_time()
        found = _diagnosed(_thinned(hidden.campaign, finer), candidates, refine)
    except Exception as error:  # a benchmark goes on, and says what failed
        return {**record, "error": f"{type(error).__name__}: {error}"}
    elements = [element for element in found.pop("whole").elements if element.effect == name]
    record.update(
        cpu=time.process_time() - start,
        form=[state.rate for each in elements for state in each.states]
        + [column.formula for each in elements for column in each.columns],
        numbers={
            n.name: [n.value, n.standard_error, *n.interval95] for each in elements for n in each.numbers
        },
        **found,
    )
    return record


def _diagnosed(campaign: Campaign, candidates: tuple, refine: bool) -> dict:
    from sindyjoint.workflows.diagnose import diagnose

    result = diagnose(campaign, effects=candidates, advise=False, refine=refine)
    return dict(
        whole=result.whole,
        verdict=result.verdict,
        response=[result.initial.response, result.final.response, result.noise_floor.response],
        notes=[w for w in result.warnings if "determined" in w or "refined" in w],
    )


def _thinned(campaign: Campaign, finer: int) -> Campaign:
    """Return a campaign with every so-manieth sample; its noise is white, with and without."""
    runs = [
        replace(r, moment=r.moment[::finer], angle=r.angle[::finer], sample_rate=r.sample_rate / finer)
        for r in campaign.runs
    ]
    return campaign.with_runs(tuple(runs))


def as_hidden(record: dict) -> bool:
    """Whether the element found has the form of the hidden one: its numbers then mean the same."""
    if "numbers" not in record or set(record["numbers"]) != set(record["truth"]):
        return False
    form = " ".join(record["form"])
    if record["name"] == "backlash_play":
        return "(3/2)" not in form and "1.5" not in form
    if record["name"] == "bouc_wen_hysteresis":
        return ("theta_y**2" in form or "theta_y**(-2)" in form) == (record["parameters"][2] == 2.0)
    return True


def run(args: argparse.Namespace) -> None:
    from joblib import Parallel, delayed

    keys = ("name", "seed", "size", "noise", "refine", "every")
    done = done_in(args.out, keys)
    tasks = [
        task
        for seed in args.seeds
        for name in args.names or TRUTH
        if (task := (name, seed, args.size, args.noise, args.refine, args.all)) not in done
    ]
    for record in Parallel(n_jobs=args.jobs, return_as="generator_unordered")(
        delayed(one)(*t) for t in tasks
    ):
        append(args.out, record)


def show(args: argparse.Namespace) -> list[dict]:
    records = records_in(args.paths)
    counts: dict[tuple[str, ...], Counter] = defaultdict(Counter)
    held: dict[tuple[str, ...], list[tuple[bool, float, float]]] = defaultdict(list)
    for r in records:
        key = (r["name"], r.get("drive", "?"))
        state = "error" if "error" in r else "counted"
        if state == "counted" and not as_hidden(r):
            state = "other form" if r["numbers"] else "not found"
        counts[key][state] += 1
        for number, truth in r["truth"].items() if state == "counted" else ():
            value, error, low, high = r["numbers"][number]
            held[*key, number].append((low <= truth <= high, (value - truth) / error, error / abs(truth)))
    for key, count in sorted(counts.items()):
        print(f"{' '.join(key):34s}", ", ".join(f"{what} {n}" for what, n in count.most_common()))
    print(f"\n{'number':44s} intervals hold   median error, spread (standard errors)   standard error")
    for key, rows in sorted(held.items()):
        print(_line(" ".join(key), rows))
    for drive in ("moment", "displacement"):
        print(_line(f"all, {drive}", [row for key, rows in held.items() if key[1] == drive for row in rows]))
    print(_line("all", [row for rows in held.values() for row in rows]))
    rows = [_counted(name, {key: held[key] for key in held if key[0] == name}) for name in TRUTH]
    return [*rows, _counted("all", held)]


def _counted(name: str, held: dict[tuple[str, ...], list[tuple[bool, float, float]]]) -> dict:
    """Return how many intervals of a moment's and a motion's campaigns hold the truth, of how many."""
    found: dict = {"element": name.replace("_", " ")}
    for drive in ("moment", "displacement"):
        rows = [row for key, each in held.items() if key[1] == drive for row in each]
        found |= {f"{drive}_held": sum(row[0] for row in rows), f"{drive}_of": len(rows)}
    return found


def _line(name: str, rows: list[tuple[bool, float, float]]) -> str:
    if not rows:
        return f"{name:44s} none"
    inside, errors, sizes = map(np.array, zip(*rows, strict=True))
    middle = np.median(errors)
    spread = 1.4826 * np.median(np.abs(errors - middle))
    return (
        f"{name:44s} {inside.sum():4d}/{inside.size:<4d} {inside.mean():6.1%}   {middle:+6.2f} {spread:6.2f}"
        f"{'':26s}{np.median(sizes):8.2%}"
    )


if __name__ == "__main__":
    main(
        __doc__,
        run,
        show,
        size=dict(type=float, default=0.06),
        noise=dict(type=float, default=0.01),
        refine=dict(action="store_true", help="refine the whole model on the simulated response"),
        all=dict(action="store_true", help="all effects of the catalogue as candidates"),
        jobs=dict(type=int, default=1),
    )
