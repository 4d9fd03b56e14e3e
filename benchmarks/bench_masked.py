"""Coefficients beside samples that the check leaves out: spikes in both channels, a moment clipped at its peaks.

python benchmarks/bench_masked.py run --out masked.jsonl --seeds 0 10
python benchmarks/bench_masked.py show masked.jsonl
"""

from __future__ import annotations

import sys
from functools import partial
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

from benchmarks.resumed import main, records_in, run_seeds, seeds_of
from tests.soundness.test_lost import PAPER, clipped, spiked

FAULTS = {
    "5 spikes of 50 RMS in both channels of each run": spiked,
    "moment clipped at 3 % of the samples": clipped,
}


def one(seed: int) -> dict:
    """Return of each fault how many of the paper's coefficients lie within the intervals of the sound data."""
    from sindyjoint import discover, simulate

    clean = simulate(frequencies=[3, 4.5], levels=[0.9, 0.6, 0.4], duration=6, noise=0.01, random_state=seed)
    before, record = discover(clean).model, {"seed": seed}
    for name, put in FAULTS.items():
        found = discover(put(clean))
        shared = [term for term in PAPER if found.found and term in found.model and term in before]
        spans = {term: before[term].interval95 for term in shared}
        record[name] = [
            term for term, (low, high) in spans.items() if low < found.model[term].coefficient < high
        ]
    return record


def show(given) -> list[dict]:
    records = records_in(given.paths)
    rows = []
    for name in FAULTS:
        count, of = sum(len(r[name]) for r in records), len(PAPER) * len(records)
        rows.append(dict(fault=name, seeds=seeds_of(records), count=count, of=of))
        print("{fault}: {count} of {of}".format_map(rows[-1]))
    return rows


if __name__ == "__main__":
    main(__doc__, partial(run_seeds, one), show)
