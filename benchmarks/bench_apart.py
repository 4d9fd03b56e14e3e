"""Pairs of effects that a usual campaign leaves ambiguous, and the run that `plan` says would tell them apart.

    python -m benchmarks.bench_apart run --out apart.jsonl --seeds 4000 4040 [--names dahl_friction/lugre_friction]
    python -m benchmarks.bench_apart show apart.jsonl

One effect of a pair is hidden, by the simulator alone, in a random joint under a prescribed angle: three frequencies,
two levels, four seconds each. Where that leaves both in one class, the planned run (or two) is made on that joint, and
all is judged again: told apart is the true one alone. Where it is not, single runs all over the actuator's range are
made, the truth known, until one tells them apart with two draws of the noise; without any the pair counts as one that
no run can separate.

What comes after an effect is named (its numbers freed of what the processing does to them) is left out: it names
nothing. A campaign takes seconds; what is done already is not done again.
"""

from __future__ import annotations

import argparse
import os
import time
from collections import Counter
from dataclasses import replace
from itertools import product

for variable in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"):
    os.environ.setdefault(variable, "1")

import numpy as np  # noqa: E402

from benchmarks.resumed import append, done_in, main, records_in  # noqa: E402
from sindyjoint import plan  # noqa: E402
from sindyjoint.diagnosis.campaign.designs import PLANNED  # noqa: E402
from sindyjoint.diagnosis.campaign.problem import CampaignProblem  # noqa: E402
from sindyjoint.errors import SindyJointError  # noqa: E402
from sindyjoint.planning.separating_runs import chosen_effects  # noqa: E402
from sindyjoint.record import Run  # noqa: E402
from sindyjoint.workflows.diagnose import diagnose  # noqa: E402
from tests.diagnosis.further_runs import one_more  # noqa: E402
from tests.diagnosis.hidden_effects import CHANNELS, Hidden, hide  # noqa: E402
from tests.diagnosis.hidden_laws import LAWS  # noqa: E402

PAIRS = (
    ("dahl_friction", "lugre_friction"),
    ("dahl_friction", "bouc_wen_hysteresis"),
    ("lugre_friction", "bouc_wen_hysteresis"),
    ("jenkins_element", "bouc_wen_hysteresis"),
    ("dahl_friction", "jenkins_element"),
    ("jenkins_element", "backlash_play"),
    ("maxwell_branch", "fractional_damping"),
    ("maxwell_branch", "dahl_friction"),
    ("inertia_error", "frequency_dependent_stiffness"),
    ("amplitude_dependent_damping", "position_dependent_friction"),
    ("quadratic_damping", "cubic_damping"),
    ("quadratic_damping", "stribeck_friction"),
    ("quintic_stiffness", "dead_zone"),
)
# Of the moment, that the effect adds; noise of each channel.
CASES = ((0.04, 0.02), (0.03, 0.05))
USUAL = dict(drive="displacement", levels=(0.85, 0.6), sample_rate=500.0, duration=4.0)
FREQUENCIES = ((3.0, 4.5, 6.0), (4.0, 5.0, 6.0))
FACTOR = 4.0  # by which the actuator's band is wider than the campaign's
REACH = 1.2  # by which its angle is larger
WORDS = {name: text for text, name in PLANNED.items()}
TIME = 40.0  # s, for two runs
WIDE = 5  # frequencies of the search with the truth known
KEYS = ("pair", "truth", "seed", "size", "noise")


def further(
    hidden: Hidden, noise: float, index: int, frequency: float, level: float, waveform: str, duration: float
) -> Run:
    """Return a further run of a hidden joint under an angle."""
    longer = replace(hidden, plan=replace(hidden.plan, duration=duration))
    return one_more(longer, frequency, level, WORDS[waveform], noise, index)


def answer_of(campaign, effects) -> tuple[str, ...]:
    """Return the names that are given to the gap."""
    found = diagnose(campaign, effects=effects, max_effects=1, advise=False, random_state=0)
    return next((step.members for step in found.steps), ())


def one(pair: tuple[str, str], truth: str, seed: int, size: float, noise: float) -> dict:
    """Return what a pair comes to on a joint in which one of it is true."""
    hidden = hide(truth, seed, size, noise, frequencies=FREQUENCIES[seed % 2], **USUAL)
    effects = chosen_effects(pair)
    tested = [run.frequency for run in hidden.campaign.runs]
    largest = max(float(np.abs(run.angle).max()) for run in hidden.campaign.runs)
    limits, band = {"angle": REACH * largest}, (min(tested) / FACTOR, max(tested) * FACTOR)
    planned = plan(
        campaign=hidden.campaign, goal="tell-apart", effects=pair, drive="angle", limits=limits, band=band, time=TIME,
    )  # fmt: skip
    apart = planned.apart
    record = {"words": apart.words, "before": apart.before, "said": list(apart.after), "runs": []}
    if apart.words.startswith(("told apart already", "the campaign shows none")):
        return {**record, "answer": "clear before"}
    campaign, after = hidden.campaign, pair
    for index, run in enumerate(planned.runs):
        campaign = campaign.with_runs(
            (
                *campaign.runs,
                further(hidden, noise, index, run.frequency, run.level, run.waveform, run.duration),
            )
        )
        record["runs"].append(f"{run.waveform} {run.frequency:g} Hz {run.level:.3g}")
        after = answer_of(campaign, effects)
        record["after"] = list(after)
        if after == (truth,):
            return {**record, "answer": "told apart"}
    answer = "no run" if not planned.runs else "together" if truth in after else "wrong"
    return {
        **record,
        "answer": answer,
        "separated by": separated_by(hidden, effects, truth, noise, band, limits["angle"]),
    }


def separated_by(hidden: Hidden, effects, truth: str, noise: float, band, angle: float) -> str:
    """Return a single run that tells the truth apart, the truth known; empty where none of a wide grid does."""
    every = np.geomspace(*band, WIDE)
    grid = product(("sine", "triangle"), (0.9 * angle, 0.3 * angle), [*every[::2], *every[1::2]])
    for index, (waveform, level, frequency) in enumerate(grid):
        if waveform != "sine" and 9 * frequency > band[1]:
            continue
        tries = (
            further(hidden, noise, 100 + 2 * index + again, frequency, level, waveform, TIME / 2)
            for again in (0, 1)
        )
        try:
            # With either of two draws of the noise: by one alone some run of many does by chance.
            if all(
                answer_of(hidden.campaign.with_runs((*hidden.campaign.runs, run)), effects) == (truth,)
                for run in tries
            ):
                return f"{waveform} {frequency:.3g} Hz {level:.3g}"
        except SindyJointError:
            continue
    return ""


def run(args: argparse.Namespace) -> None:
    """Append a record for each pair, truth, size and seed."""
    CampaignProblem.finished = lambda problem: problem  # type: ignore[method-assign]
    done = done_in(args.out, KEYS)
    names = args.names or ["/".join(pair) for pair in PAIRS]
    for seed, (size, noise), name in product(range(*args.seeds), CASES, names):
        pair = tuple(name.split("/"))
        for truth in (each for each in pair if each in (*LAWS, *CHANNELS)):
            key = (name, truth, seed, size, noise)
            if key in done:
                continue
            began = time.process_time()
            try:
                record = one(pair, truth, seed, size, noise)
            except SindyJointError as error:
                record = {"answer": "error", "words": str(error)}
            record = {**dict(zip(KEYS, key, strict=True)), **record, "seconds": time.process_time() - began}
            append(args.out, record)
            print(
                f"{seed} {size:g}/{noise:g} {name} truth {truth}: {record['answer']} {record.get('said', '')} "
                f"{record.get('runs', '')} {record.get('separated by', '')} {record['seconds']:.1f} s",
                flush=True,
            )


def show(args: argparse.Namespace) -> list[dict]:
    """Print the shares and return them."""
    records = records_in(args.paths)
    print(dict(Counter(r["answer"] for r in records)))
    asked = [r for r in records if r["answer"] in ("told apart", "together", "wrong", "no run")]
    none = [r for r in asked if r["answer"] != "told apart" and not r["separated by"]]
    able = [r for r in asked if r not in none]
    print(f"left ambiguous: {len(asked)}; of these no run separates {len(none)}")
    rows = [
        dict(campaigns="left in one class with the rival", count=len(asked), of=len(records)),
        dict(campaigns="of these separable by a run", count=len(able), of=len(asked)),
    ]
    sure = [r for r in able if r["said"] and r["said"][-1] >= 0.9]
    for title, some in (("by planned runs", able), ("where the plan expects 0.9 or more", sure)):
        told = sum(r["answer"] == "told apart" for r in some)
        print(f"{title}: told apart {told} of {len(some)}, {told / max(len(some), 1):.0%}")
        rows.append(dict(campaigns=f"{title}: told apart", count=told, of=len(some)))
    for name in sorted({r["pair"] for r in asked}):
        mine = [r for r in able if r["pair"] == name]
        told = sum(r["answer"] == "told apart" for r in mine)
        print(f"  {name}: {told} of {len(mine)}; none separates {sum(r['pair'] == name for r in none)}")
    return rows


if __name__ == "__main__":
    main(__doc__, run, show)
