"""Coefficients that depend on an input: how often a dependence is found, falsely chosen, and held by its interval.

python benchmarks/bench_inputs.py run --out inputs.jsonl --seeds 0 200
python benchmarks/bench_inputs.py show inputs.jsonl

Each seed is a random joint about the paper's inter-panel joint: one to three of its coefficients depend linearly on a
temperature or a load of four or five levels, by 2 to 30 % over the range; 1 % noise, three frequencies, two levels.
"""

from __future__ import annotations

import sys
import time
from dataclasses import replace
from functools import partial
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))
from benchmarks.resumed import main, records_in, run_seeds  # noqa: E402

COEFFICIENTS = {
    "k1": "linear_stiffness", "k2": "quadratic_stiffness", "k3": "cubic_stiffness", "c1": "linear_damping",
    "M_F": "coulomb_friction",
}  # fmt: skip
# Of an input: unit, least, greatest value, SI.
INPUTS = {"temperature": ("K", 233.15, 333.15), "load": ("N", 50.0, 200.0)}


def draw(seed: int) -> dict:
    """Return the plan of a campaign."""
    rng = np.random.default_rng(seed)
    name = str(rng.choice(list(INPUTS)))
    chosen = rng.choice(list(COEFFICIENTS), size=rng.integers(1, 4), replace=False)
    moved = {str(c): float(rng.choice([-1, 1]) * rng.uniform(0.02, 0.30)) for c in chosen}
    scale = {c: float(np.exp(rng.uniform(-0.3, 0.3))) for c in COEFFICIENTS}
    return {"input": name, "levels": int(rng.integers(4, 6)), "moved": moved, "scale": scale}


def campaign_of(plan: dict, seed: int):
    """Return the campaign of a plan, and the true values at the middle of the range and their slopes."""
    from sindyjoint.inputs import Input
    from sindyjoint.mechanics import INTER_PANEL
    from sindyjoint.mechanics.virtual import virtual_campaign

    unit, low, high = INPUTS[plan["input"]]
    rng = np.random.default_rng([seed, 1])
    middle = {c: getattr(INTER_PANEL, c) * s for c, s in plan["scale"].items()}
    slope = {c: middle[c] * d / (high - low) for c, d in plan["moved"].items()}
    # Of the softest joint: the tested angles are the same at every level.
    limit = min(np.sqrt(middle["k1"] * (1 - 0.15) / (3 * abs(middle["k3"]) * 1.15)), 8.7e-4)
    runs = []
    for value in np.linspace(low, high, plan["levels"]):
        values = {c: v + slope.get(c, 0.0) * (value - (low + high) / 2) for c, v in middle.items()}
        made = virtual_campaign(
            replace(INTER_PANEL, **values), noise=0.01, frequencies=[3, 4.5, 6], levels=[0.9, 0.55], duration=4.0,
            angle_limit=limit, random_state=rng,
        )  # fmt: skip
        runs += [replace(r, name=f"{r.name} {value:.0f}", inputs={plan["input"]: value}) for r in made.runs]
    return replace(made, runs=tuple(runs), inputs=(Input(plan["input"], unit),)), middle, slope


def one(seed: int) -> dict:
    """Return what a discovery finds in the campaign of a seed."""
    from sindyjoint import discover
    from sindyjoint.discovery import fit_columns

    plan = draw(seed)
    campaign, middle, slope = campaign_of(plan, seed)
    start = time.perf_counter()
    found = discover(campaign)
    name, (_, low, high) = plan["input"], INPUTS[plan["input"]]
    proportional = f"coulomb_friction_proportional_to_{name}"
    ids = {c: f"{term}_by_{name}" for c, term in COEFFICIENTS.items()}
    evidence = found.regressor.evidence_
    ids = {c: proportional if term not in evidence.ids and c == "M_F" else term for c, term in ids.items()}
    true = [*COEFFICIENTS.values(), *(ids[c] for c in slope)]
    fit = fit_columns(evidence, [evidence.ids.index(term) for term in true])
    errors = dict(zip(true, fit.standard_errors.tolist(), strict=True))
    truth = dict(zip(COEFFICIENTS.values(), middle.values(), strict=True)) | {
        ids[c]: v for c, v in slope.items()
    }
    if proportional in truth:
        truth["coulomb_friction"] = middle["M_F"] - slope["M_F"] * (low + high) / 2
    model = found.model
    chosen = [term.id for term in model.terms if term.inputs]
    return {
        "seed": seed, "plan": plan, "seconds": time.perf_counter() - start, "ids": list(model.ids),
        # How often the change over the range is contained in its 95 % interval, both ends.
        "moves": {ids[c]: abs(v) / (2 * 1.96 * errors[ids[c]]) for c, v in slope.items()},
        "found": [term for term in chosen if term in truth],
        "false": [term for term in chosen if term not in truth],
        "inside": {
            t.id: bool(t.interval95[0] <= truth[t.id] <= t.interval95[1]) for t in model.terms if t.id in truth
        } if set(model.ids) == set(true) else {},
        "z": {t.id: (t.coefficient - truth[t.id]) / t.standard_error for t in model.terms if t.id in truth},
    }  # fmt: skip


def show(arguments) -> list[dict]:
    """Print the figures and return them."""
    records = records_in(arguments.paths)
    clear = [(term, r) for r in records for term, size in r["moves"].items() if size > 3]
    found = sum(term in r["found"] for term, r in clear)
    false = sum(bool(r["false"]) for r in records)
    inside = [value for r in records for value in r["inside"].values()]
    own = [value for r in records for term, value in r["inside"].items() if "_by_" in term or "_prop" in term]
    exact = sum(bool(r["inside"]) for r in records)
    print(f"campaigns                                    {len(records)}, {exact} with exactly the true terms")
    print(
        f"dependences beyond three intervals, found    {found} of {len(clear)} = {found / max(len(clear), 1):.1%}"
    )
    print(f"campaigns with a false dependence            {false} = {false / max(len(records), 1):.1%}")
    print(f"intervals that hold, all coefficients        {np.mean(inside):.1%} of {len(inside)}")
    print(f"intervals that hold, the dependences         {np.mean(own):.1%} of {len(own)}")
    counts = {
        "dependences of more than three intervals, found": (found, len(clear)),
        "campaigns without a dependence that is not there": (len(records) - false, len(records)),
        "95 % intervals that hold, exact terms": (sum(inside), len(inside)),
        "those of the dependences": (sum(own), len(own)),
    }
    return [dict(question=name, count=count, of=of) for name, (count, of) in counts.items()]


if __name__ == "__main__":
    main(__doc__, partial(run_seeds, one), show)
