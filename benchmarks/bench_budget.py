"""The budget of a gap: whether the largest part beside noise is of the kind that was hidden.

python benchmarks/bench_budget.py run --out budget.jsonl --seeds 0 16
python benchmarks/bench_budget.py run --out budget.jsonl --seeds 0 6 --noise 0.03
python benchmarks/bench_budget.py show budget.jsonl
"""

from __future__ import annotations

import os
import sys
from pathlib import Path

for variable in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"):
    os.environ.setdefault(variable, "1")

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

from benchmarks.resumed import append, done_in, main, records_in, seeds_of  # noqa: E402


def run(given) -> None:
    from tests.diagnosis.hidden_effects import hide
    from tests.diagnosis.test_diagnosis_budget import KINDS, PARTS, budget_of

    done = done_in(given.out, ("name", "seed", "size", "noise"))
    for seed in range(*given.seeds):
        for kind, names in KINDS.items():
            for name in given.names or names:
                key = (name, seed, given.size, given.noise)
                if key not in done and name in names:
                    budget, _ = budget_of(hide(*key).campaign)
                    record = dict(zip(("name", "seed", "size", "noise"), key, strict=True), hidden=kind)
                    append(given.out, record | dict(parts={part: getattr(budget, part) for part in PARTS}))


def is_right(record: dict) -> bool:
    """Return whether the largest part beside noise is what was hidden; of nothing, whether there is none."""
    others = {part: value for part, value in record["parts"].items() if part != "noise"}
    return (
        max(others.values()) == 0
        if record["hidden"] == "noise"
        else max(others, key=others.get) == record["hidden"]
    )


def show(given) -> list[dict]:
    records, rows = records_in(given.paths), []
    for size, noise in dict.fromkeys((r["size"], r["noise"]) for r in records):
        some = [r for r in records if (r["size"], r["noise"]) == (size, noise)]
        wrong = [f"{r['name'].replace('_', ' ')} {r['seed']}" for r in some if not is_right(r)]
        title = f"budget: {size:.0%}, noise {noise:.0%}, seeds {seeds_of(some)}"
        rows.append(dict(campaigns=title, count=len(some) - len(wrong), of=len(some), wrong=wrong))
        print("{campaigns}: {count} of {of}; {wrong}".format_map(rows[-1]))
    return rows


if __name__ == "__main__":
    main(__doc__, run, show, size=dict(type=float, default=0.06), noise=dict(type=float, default=0.01))
