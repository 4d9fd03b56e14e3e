"""Laws found inside a structure: predicting another pulse, and beside those of the joint's own bench.

    python benchmarks/bench_structure_prediction.py run --rig pulse-rig --seeds 1 11 --out laws.jsonl
    python benchmarks/bench_structure_prediction.py show laws.jsonl

Each seed is a campaign of `bench_structure_discovery.py` (random joints, accelerometers, 1 % noise). The laws found
stand in the rig in the place of the true ones under two pulses that no run holds, and the amplitudes of the tip are
compared by half-cycle, as `verify` compares them. Every joint is also tested alone, a virtual campaign of twelve runs,
and the two laws are compared: χ² of the difference of their coefficients, by the sum of both covariances.
"""

from __future__ import annotations

import argparse
import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
from scipy.stats import chi2

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

from benchmarks.bench_structure_discovery import DRIVES, STATIONS, campaign
from benchmarks.resumed import append, done_in, main, records_in, seeds_of
from sindyjoint.errors import SimulationError, SindyJointError
from sindyjoint.mechanics.excitation import pulse
from sindyjoint.mechanics.rigs import load_rig
from sindyjoint.mechanics.virtual import virtual_campaign
from sindyjoint.mechanics.virtual_rig import with_laws
from sindyjoint.response.laws import model_law
from sindyjoint.response.oscillations import compare_oscillations, main_frequency, oscillation

# Pulses at the tip of each rig: the file's own scaled, and a longer half-sine of so many newtons and seconds.
SCALED = 0.8
HALF_SINE = {"pulse-rig": (20.0, 0.03), "four-panel-wing": (2.0, 0.1)}
LEVEL = 0.99


def other_pulses(name, rig):
    """Return excitations that no run holds, by name."""
    force, duration = HALF_SINE[name]
    return {f"{SCALED:g} of the file's": rig.excitation.scaled(SCALED),
            f"half-sine of {force:g} N over {duration:g} s": pulse(force, duration, "half-sine")}  # fmt: skip


def predicted(name, laws, models):
    """Return errors of the tip's response with the laws found, by pulse: of the amplitudes, and of the whole."""
    rig = load_rig(name)
    true = with_laws(rig, lambda hinge: laws[hinge.law.name])
    found = with_laws(rig, lambda hinge: model_law(models[hinge.law.name]))
    errors = {}
    for words, excitation in other_pulses(name, rig).items():
        try:
            here = _tip(true, excitation, rig.sample_rate)
        except SimulationError:
            continue  # the true joint does not bear this pulse: it passes its softening limit
        there = _tip(found, excitation, rig.sample_rate)
        frequency = main_frequency(here, rig.sample_rate)
        gap = compare_oscillations(
            oscillation(here, rig.sample_rate, frequency), oscillation(there, rig.sample_rate, frequency)
        )
        errors[words] = {
            "amplitude": None if gap is None else gap.amplitude_rms_error,
            "period": None if gap is None else gap.mean_period_difference * frequency,
            "response": float(np.std(there - here) / np.std(here)),
        }
    return errors


def _tip(rig, excitation, rate):
    return replace(rig, excitation=excitation).respond().displacement["tip"][: round(rig.duration * rate)]


def against_bench(law, model, seed):
    """Return χ² of a law's coefficients less those of the joint's own test, and what it is of."""
    from sindyjoint import discover

    bench = discover(virtual_campaign(law, random_state=1000 + seed), random_state=seed).model
    if set(bench.ids) != set(model.ids):
        return {"bench": list(bench.ids), "chi2": None}
    order = [bench.ids.index(name) for name in model.ids]
    apart = model.numbers - bench.numbers[order]
    covariance = model.covariance_matrix + bench.covariance_matrix[np.ix_(order, order)]
    return {
        "bench": list(bench.ids), "chi2": float(apart @ np.linalg.solve(covariance, apart)), "terms": apart.size,
        "apart": dict(zip(model.ids, (apart / np.sqrt(np.diag(covariance))).tolist(), strict=True)),
    }  # fmt: skip


def one(name, drive, refine, seed):
    """Return what was found of one campaign."""
    from sindyjoint.workflows.discover import discover_rig

    try:
        test, laws, _ = campaign(name, seed, drive)
        found = discover_rig(test, random_state=seed, refine=refine)
        models = {law.kind: law.discovery.model for law in found.laws if law.found}
        if models.keys() != laws.keys():
            return {"seed": seed, "error": "no law"}
        pulses = predicted(name, laws, models)
    except SindyJointError as error:
        return {"seed": seed, "error": str(error)}
    return {
        "seed": seed, "terms": {kind: list(model.ids) for kind, model in models.items()}, "pulses": pulses,
        "bench": {kind: against_bench(laws[kind], model, seed) for kind, model in models.items()},
    }  # fmt: skip


def run(arguments: argparse.Namespace) -> None:
    """Append what is found of each seed."""
    rig, drive = arguments.rig, arguments.drive
    done = done_in(arguments.out, ("rig", "drive", "seed"))
    for seed in range(*arguments.seeds):
        if (rig, drive, seed) not in done:
            append(arguments.out, dict(rig=rig, drive=drive) | one(rig, drive, arguments.refine, seed))


def show(arguments: argparse.Namespace) -> list[dict]:
    """Print errors by pulse and how many χ² lie below their 99 % point, and return them."""
    records = records_in(arguments.paths)
    return [
        row(rig, [r for r in records if r["rig"] == rig]) for rig in dict.fromkeys(r["rig"] for r in records)
    ]


def row(rig: str, records: list[dict]) -> dict:
    """Print and return the figures of a rig."""
    made = [record for record in records if "error" not in record]
    found = dict(rig=rig, seeds=seeds_of(records), structures=len(made), of=len(records))
    print(f"{rig}: {len(records)} campaigns, without a law: {[r['seed'] for r in records if 'error' in r]}")
    for what in ("amplitude", "response"):
        errors = [
            each[what] for record in made for each in record["pulses"].values() if each[what] is not None
        ]
        found[what] = [f"{100 * function(errors):.2g}" for function in (np.median, np.max)]
        print(f"{what}: median, largest {', '.join(found[what])} %; {len(errors)} pulses")
    laws = [law for record in made for law in record["bench"].values()]
    told = [law for law in laws if law["chi2"] is not None]
    below = sum(bool(law["chi2"] < chi2.ppf(LEVEL, law["terms"])) for law in told)
    print(
        f"same terms as on the bench {len(told)} of {len(laws)} laws; χ² below its {LEVEL:.0%} point: {below}"
    )
    return found | dict(below=below, laws=len(told))


if __name__ == "__main__":
    main(
        __doc__, run, show,
        rig={"choices": [*STATIONS], "default": "pulse-rig"},
        drive={"choices": [*DRIVES], "default": "sine"},
        refine={"action": "store_true"},
    )  # fmt: skip
