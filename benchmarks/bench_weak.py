"""The weak form beside samples: exact sets of terms, and errors of k2 and M_F, on virtual tests of the paper's joint.

python benchmarks/bench_weak.py run --out weak.jsonl --seeds 0 8
python benchmarks/bench_weak.py show weak.jsonl
"""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

from benchmarks.resumed import append, done_in, main, records_in, seeds_of

NOISES = (0.001, 0.01, 0.05)
METHODS = {"weak": "weak form", "stlsq": "samples"}


def one(noise: float, seed: int) -> dict:
    """Return what either finds: whether the terms are the paper's, and the relative errors of k2 and M_F."""
    from sindyjoint import compare
    from sindyjoint.mechanics import INTER_PANEL
    from sindyjoint.mechanics.virtual import virtual_campaign
    from sindyjoint.paper import TERMS

    truth = {"quadratic_stiffness": INTER_PANEL.k2, "coulomb_friction": INTER_PANEL.M_F}
    found = compare(
        virtual_campaign("inter-panel", noise=noise, random_state=seed), methods=["stlsq", "weak"]
    )
    record: dict = dict(noise=noise, seed=seed)
    for method in found.methods:
        known = {term.id: term.coefficient for term in method.terms}
        errors = [abs(known.get(name, np.nan) / value - 1) for name, value in truth.items()]
        record[method.name] = dict(exact={*known} == {*TERMS}, errors=errors)
    return record


def run(given) -> None:
    done = done_in(given.out, ("noise", "seed"))
    for seed in range(*given.seeds):
        for noise in NOISES:
            if (noise, seed) not in done:
                append(given.out, one(noise, seed))


def show(given) -> list[dict]:
    records, rows = records_in(given.paths), []
    for noise in NOISES:
        some = [r for r in records if r["noise"] == noise]
        for method, title in METHODS.items() if some else ():
            errors = [f"{100 * np.nanmedian([r[method]['errors'][k] for r in some]):.2g}" for k in (0, 1)]
            exact = sum(r[method]["exact"] for r in some)
            rows.append(
                dict(rows=title, noise=noise, seeds=seeds_of(some), exact=exact, of=len(some), errors=errors)
            )
            print("{rows}, noise {noise:.1%}: exact {exact} of {of}; k2, M_F {errors} %".format_map(rows[-1]))
    return rows


if __name__ == "__main__":
    main(__doc__, run, show)
