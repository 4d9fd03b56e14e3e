"""Pairs of effects that a usual campaign leaves ambiguous, and the run that `plan` says would tell them apart.

    python -m benchmarks.bench_apart [SEEDS] [FIRST SEED]

One effect of a pair is hidden, by the simulator alone, in a random joint. Where the campaign leaves both in one class,
the planned run (or two) is made on that joint, and all is judged again: told apart is the true one alone.
"""

from __future__ import annotations

import sys
import time

import numpy as np

from sindyjoint import plan
from sindyjoint.diagnosis.campaign.designs import BY_MOMENT, PLANNED
from sindyjoint.errors import SindyJointError
from sindyjoint.planning.runs import PlannedRun
from sindyjoint.planning.tell_apart import chosen_effects
from sindyjoint.record import Campaign
from sindyjoint.workflows.diagnose import diagnose
from tests.diagnosis.further_runs import one_more
from tests.diagnosis.hidden_effects import CHANNELS, Hidden, hide
from tests.diagnosis.hidden_laws import LAWS

PAIRS = (
    ("dahl_friction", "lugre_friction"),
    ("dahl_friction", "bouc_wen_hysteresis"),
    ("lugre_friction", "bouc_wen_hysteresis"),
    ("maxwell_branch", "fractional_damping"),
    ("maxwell_branch", "dahl_friction"),
    ("inertia_error", "frequency_dependent_stiffness"),
    ("amplitude_dependent_damping", "position_dependent_friction"),
    ("quadratic_damping", "cubic_damping"),
)
NOISE, SIZE = 0.02, 0.04  # of each channel; of the moment, that the effect adds
FACTOR = 4.0  # by which the actuator's band is wider than the campaign's


def made(hidden: Hidden, run: PlannedRun, index: int):
    """Return a planned run of a hidden joint; one by a moment as the angle that it is meant to reach."""
    words = {name: text for text, name in PLANNED.items()}
    if run.drive == "angle":
        return one_more(hidden, run.frequency, run.level, words[run.waveform], NOISE, index)
    raise ValueError(BY_MOMENT)


def one(pair: tuple[str, str], truth: str, seed: int) -> dict:
    """Return what a pair comes to on a joint in which one of it is true."""
    # Even and odd seeds are driven by a moment and by an angle; the planned runs prescribe the angle.
    hidden = hide(truth, seed, SIZE, NOISE)
    effects, policy = chosen_effects(pair), dict(max_effects=1, advise=False, random_state=0)
    first = diagnose(hidden.campaign, effects=effects, **policy)
    members = next((s.members for s in first.steps), ())
    if len(members) < 2:
        return {
            "answer": "clear before" if members == (truth,) else "none" if not members else "wrong before"
        }
    tested = [run.frequency for run in hidden.campaign.runs]
    largest = max(float(np.abs(run.angle).max()) for run in hidden.campaign.runs)
    began = time.process_time()
    planned = plan(
        campaign=hidden.campaign, goal="tell-apart", effects=pair, drive="angle", limits={"angle": 1.2 * largest},
        band=(min(tested) / FACTOR, max(tested) * FACTOR), time=100.0,
    )  # fmt: skip
    seconds = time.process_time() - began
    if not planned.runs:
        return {"answer": "no run", "seconds": seconds, "words": planned.stop}
    campaign: Campaign = hidden.campaign
    for index, run in enumerate(planned.runs):
        campaign = campaign.with_runs((*campaign.runs, made(hidden, run, index)))
        again = diagnose(campaign, effects=effects, **policy)
        after = next((s.members for s in again.steps), ())
        if after == (truth,):
            break
    said = planned.apart.after[-1]
    answer = "told apart" if after == (truth,) else "wrong" if truth not in after else "together"
    runs = ", ".join(f"{r.waveform} {r.frequency:g} Hz {r.level:.3g}" for r in planned.runs)
    return {"answer": answer, "said": said, "seconds": seconds, "words": runs}


def main(seeds: int = 2, first: int = 4000) -> None:
    """Print a line for each pair and truth, and the shares."""
    found = []
    for seed in range(first, first + seeds):
        for pair in PAIRS:
            for truth in (name for name in pair if name in (*LAWS, *CHANNELS)):
                try:
                    record = one(pair, truth, seed)
                except SindyJointError as error:
                    record = {"answer": "error", "words": str(error)}
                found.append(record)
                detail = f"said {record.get('said', 0):.2f} {record.get('seconds', 0):.0f} s {record.get('words', '')}"
                print(f"{seed} {'/'.join(pair)} truth {truth}: {record['answer']}; {detail}", flush=True)
    for answer in sorted({r["answer"] for r in found}):
        print(f"{answer}: {sum(r['answer'] == answer for r in found)}")
    asked = [r for r in found if r["answer"] in ("told apart", "wrong", "together")]
    sure = [r for r in asked if r["said"] >= 0.9]
    for name, some in (("a run was planned", asked), ("and said to separate (0.9)", sure)):
        share = np.mean([r["answer"] == "told apart" for r in some]) if some else float("nan")
        print(f"{name}: {len(some)}, told apart {share:.0%}")


if __name__ == "__main__":
    main(*(int(text) for text in sys.argv[1:3]))
