"""Two campaigns of one joint, unchanged or changed: how often a change is called, and found.

python benchmarks/bench_changed.py run --out changed.jsonl --seeds 0 100
python benchmarks/bench_changed.py show changed.jsonl

Each seed is a random joint about the paper's inter-panel joint, tested twice at 1 % noise as it is, and a third time
with one coefficient moved by three of its 95 % intervals, both ends of one of them, as the first test gives them. Where
the first test chose other terms in the place of that coefficient, it has no interval and counts as not found.
"""

from __future__ import annotations

import sys
from dataclasses import replace
from functools import partial
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))
from benchmarks.bench_inputs import COEFFICIENTS  # noqa: E402
from benchmarks.resumed import main, records_in, run_seeds  # noqa: E402


def one(seed: int) -> dict:
    """Return what is said of the joint of a seed, unchanged and changed."""
    from sindyjoint import changed, discover
    from sindyjoint.mechanics import INTER_PANEL
    from sindyjoint.mechanics.virtual import virtual_campaign

    rng = np.random.default_rng(seed)
    joint = replace(
        INTER_PANEL,
        **{c: getattr(INTER_PANEL, c) * float(np.exp(rng.uniform(-0.3, 0.3))) for c in COEFFICIENTS},
    )

    def tested(law):
        return discover(
            virtual_campaign(
                law, noise=0.01, frequencies=[3, 4.5, 6], levels=[0.85, 0.5], duration=4.0, random_state=rng
            )
        )

    before, same = tested(joint), tested(joint)
    moved = str(rng.choice(list(COEFFICIENTS)))
    record = {"seed": seed, "moved": moved, "false": [s.symbol for s in changed(before, same).moved]}
    if COEFFICIENTS[moved] not in before.model:
        return {**record, "told": [], "found": False}
    low, high = before.model[COEFFICIENTS[moved]].interval95
    other = tested(replace(joint, **{moved: getattr(joint, moved) + rng.choice([-1, 1]) * 3 * (high - low)}))
    told = [s.symbol for s in changed(before, other).moved]
    return {**record, "told": told, "found": moved in told}


def show(arguments) -> list[dict]:
    """Print the figures and return them."""
    records = records_in(arguments.paths)
    false, found = (sum(bool(r[key]) for r in records) for key in ("false", "found"))
    print(
        f"pairs {len(records)}: false alarms {false / len(records):.1%}, changes found {found / len(records):.1%}"
    )
    of = len(records)
    return [
        dict(question="changes found", count=found, of=of),
        dict(question="equal pairs without an alarm", count=of - false, of=of),
    ]


if __name__ == "__main__":
    main(__doc__, partial(run_seeds, one), show)
