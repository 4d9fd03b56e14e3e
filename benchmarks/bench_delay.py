"""Delays between the channels that `discover` says are there, where one is and where none is.

python benchmarks/bench_delay.py run --out delay.jsonl --seeds 7101 7106
python benchmarks/bench_delay.py show delay.jsonl

Every hidden effect of tests/diagnosis/hidden_laws.py (3, 6 or 12 % of the moment, .3, 1 or 3 % noise, joint and test
drawn by the seed) and none, each as it is and with the moment late by .5, 1, 1.5 or 2 samples. `run` appends one line
per campaign and resumes.
"""

from __future__ import annotations

import os
import sys
from dataclasses import replace
from pathlib import Path

for variable in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"):
    os.environ.setdefault(variable, "1")

root = Path(__file__).resolve().parents[1]
sys.path[:0] = [str(root)]

from benchmarks.resumed import append, done_in, main, records_in  # noqa: E402

SIZES, NOISES, SAMPLES = (0.03, 0.06, 0.12), (0.01, 0.003, 0.03), (0.5, 1.0, 1.5, 2.0)
NOTHING = "nothing"
# No set of terms is these: `discover` has no rows for what has a memory.
MEMORY = {
    "dahl_friction", "bouc_wen_hysteresis", "bouc_wen_general", "jenkins_element", "lugre_friction", "backlash_play",
    "maxwell_branch",
}  # fmt: skip


def one(effect: str, seed: int, place: int, late: bool) -> dict:
    """Return what is said of the delay of a campaign, in samples."""
    from sindyjoint import discover
    from sindyjoint.errors import SindyJointError
    from sindyjoint.numeric import delayed
    from tests.diagnosis.hidden_effects import hide

    size, noise = SIZES[(seed + place) % 3], NOISES[(seed // 3 + place) % 3]
    true = SAMPLES[(seed + place) % 4] if late else 0.0
    record = dict(effect=effect, seed=seed, late=late, size=size, noise=noise, true=true)
    campaign = hide(effect, seed, size, noise).campaign
    if late:
        runs = (replace(run, moment=delayed(run.moment, true), source=None) for run in campaign.runs)
        campaign = campaign.with_runs(tuple(runs))
    try:
        found = discover(campaign)
    except SindyJointError as error:
        return dict(record, refused=str(error)[:200])
    rate = campaign.runs[0].sample_rate
    said = any(" lag " in line or " lead " in line or "delay of" in line for line in found.warnings)
    return dict(
        record, said=bool(found.lag) or said, removed=found.lag * rate, error=found.skew.standard_error * rate,
        ids=list(found.model.ids),
    )  # fmt: skip


def run(given) -> None:
    from tests.diagnosis.hidden_effects import OUTSIDE
    from tests.diagnosis.hidden_laws import LAWS

    done = done_in(given.out, ("effect", "seed", "late"))
    for seed in range(*given.seeds):
        for place, effect in enumerate([NOTHING, *(name for name in LAWS if name not in OUTSIDE)]):
            for late in (False, True):
                if (effect, seed, late) not in done and (not given.names or effect in given.names):
                    append(given.out, one(effect, seed, place, late))


def show(given) -> list[dict]:
    records = [record for record in records_in(given.paths) if "refused" not in record]
    kinds = {
        NOTHING: lambda name: name == NOTHING,
        "what terms can say": lambda name: name != NOTHING and name not in MEMORY,
        "a memory": lambda name: name in MEMORY,
    }
    rows = []
    for title, belongs in kinds.items():
        own = [record for record in records if belongs(record["effect"])]
        none, late = ([r for r in own if r["late"] == wanted] for wanted in (False, True))
        removed = [r for r in late if r["removed"]]
        row = dict(
            lacking=title, false=sum(r["said"] for r in none), sound=len(none), said=sum(r["said"] for r in late),
            removed=len(removed), late=len(late),
            within=sum(abs(r["removed"] - r["true"]) < 3 * r["error"] for r in removed),
        )  # fmt: skip
        rows.append(row)
        print(
            f"{title:20} false {row['false']} of {row['sound']}; said {row['said']}, removed {row['removed']} of "
            f"{row['late']}, {row['within']} within three errors"
        )
    return rows


if __name__ == "__main__":
    main(__doc__, run, show)
