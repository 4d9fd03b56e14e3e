"""A plan beside the plain grid: random joints of its range, played as virtual tests, then discovered.

How many of the obtained half-widths lie in their predicted 90 % bands, how much narrower the widest relative interval
is than that of the 3 × 3 grid of the same duration, and whether any limit is broken.

    python -m benchmarks.bench_plan [moment|angle] [JOINTS] [FIRST SEED] [--until ENOUGH] [--alone] [--json FILE]
    python -m benchmarks.bench_plan --table [--json FILE]

With a prescribed moment each coefficient of the inter-panel joint differs by up to 20 %; with a prescribed angle its
stiffness lies between 5 and 8 kN·m/rad and its friction between 1 and 3 N·m. ENOUGH is a relative half-width at which
the plan ends. ``--alone`` leaves the grid out. ``--table`` shows the plans of five joints beside their grids instead.
"""

from __future__ import annotations

import argparse
import time
from collections import Counter
from collections.abc import Iterator, Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from benchmarks.resumed import with_rows, write_rows
from sindyjoint import discover, plan
from sindyjoint.equation.model import JointModel
from sindyjoint.errors import SindyJointError
from sindyjoint.mechanics import PaperLaw
from sindyjoint.planning import PlannedRun
from sindyjoint.planning.information import Sensors, chosen_terms, half_widths, run_information, stacked
from sindyjoint.planning.plan import Plan, play
from sindyjoint.planning.prior import JointRange
from sindyjoint.record import Campaign, Joint
from sindyjoint.response.laws import model_law

RANGES = {
    "moment": {},
    "angle": {"linear_stiffness": (5000.0, 8000.0), "coulomb_friction": (1.0, 3.0)},
}
LIMITS = {"moment": 8.0, "rate": 0.08}


SMALL = PaperLaw(4200.0, -1e5, -6e8, 22.0, 0.6, 0.01, "small joint, tested to 2.6 N·m")
DAMPER = PaperLaw(2e5, -1e7, -1e10, 900.0, 40.0, 2.0, "translation damper")


def five_joints() -> Iterator[tuple[str, dict[str, Any]]]:
    """Yield the name of a joint, and the options of its plan."""
    yield "inter-panel joint", {"like": "inter-panel"}
    yield "panel root joint", {"like": "panel-root"}
    runs = [PlannedRun("moment", "sine", f, x, "N*m", 6.0) for f in (2.0, 4.0, 6.0) for x in (1.3, 2.0, 2.6)]
    yield SMALL.name, {"campaign": play(SMALL, runs, Sensors(), 5)}
    runs = [
        PlannedRun("moment", "sine", f, x, "N", 6.0) for f in (2.0, 4.0, 6.0) for x in (110.0, 155.0, 200.0)
    ]
    made = play(DAMPER, runs, Sensors(), 5)
    slides = Joint(DAMPER.name, "translation", DAMPER.inertia)
    yield DAMPER.name, {"campaign": replace(made, joint=slides)}
    yield "weak friction, 0.05–0.15 N·m", {"ranges": {"coulomb_friction": (0.05, 0.15)}}


def widest_of(made: Plan, runs: Sequence[PlannedRun]) -> float:
    """Return the widest relative half-width that some runs alone leave, without those of a campaign before them."""
    told = stacked([stacked([run_information(run, made.model, made.sensors)]) for run in runs])
    return float(np.max(np.ravel(half_widths(told)) / np.abs(made.model.coefficients)))


def table() -> list[dict]:
    """Print the plans of five joints beside their grids of equal length, and return them as rows."""
    rows = []
    for name, options in five_joints():
        began = time.process_time()
        made = plan(**options)
        seconds = time.process_time() - began
        ratio = [p.relative / g.relative for p, g in zip(made.predicted, made.grid, strict=True)]
        widest = max(p.relative for p in made.predicted) / max(g.relative for g in made.grid)
        alone = widest_of(made, made.runs) / widest_of(made, made.grid_runs)
        runs = Counter((run.frequency, run.level) for run in made.runs)
        shown = ", ".join(
            f"{f:g} Hz: " + " ".join(f"{n}×{x:.4g}" for (at, x), n in sorted(runs.items()) if at == f)
            for f in sorted({f for f, _ in runs})
        )
        ratios = [f"{each:.2f}" for each in ratio]
        often = Counter(run.frequency for run in made.runs)
        counts = "/".join(f"{f:g}×{n}" for f, n in sorted(often.items()))
        rows.append(dict(joint=name, runs=counts, ratios=ratios, alone=alone, widest=widest, seconds=seconds))
        print(f"| {name} | {shown} | {' '.join(ratios)} | {alone:.2f} | {widest:.2f} | {seconds:.0f} s |")
    return rows


def joints_of(made: Plan, count: int, seed: int) -> Iterator[tuple[int, JointModel]]:
    """Yield joints drawn uniformly from the plan's range, each with its seed."""
    joint = JointRange(made.model, np.array(made.low), np.array(made.high))
    for number in range(seed, seed + count):
        rng = np.random.default_rng(number)
        yield number, made.model.with_numbers(rng.uniform(joint.low, joint.high))


def broken_limits(made: Plan, true: JointModel, clean: Campaign) -> int:
    """Return how many runs pass a limit of the actuator or the softening limit; ``clean`` has no noise."""
    low, high = model_law(true).softening_limit
    broken = 0
    for run in clean.runs:
        rate = np.gradient(run.angle, 1 / run.sample_rate)
        broken += bool(
            run.angle.min() < low
            or run.angle.max() > high
            or np.abs(run.angle).max() > made.actuator.angle
            or np.abs(rate).max() > made.actuator.rate
            or np.abs(run.moment).max() > made.actuator.moment
        )
    return broken


def main(drive: str, count: int, seed: int, until: float | None = None, alone: bool = False) -> list[dict]:
    """Print a line for each joint, and the shares; return these."""
    began = time.perf_counter()
    made = plan(drive=drive, ranges=RANGES[drive], limits=LIMITS, time=90.0, until=until, random_state=0)
    print(f"plan of {len(made.runs)} runs in {time.perf_counter() - began:.1f} s", flush=True)
    print(f"{made.seconds:.0f} of 90 s; {made.stop}", flush=True)
    reached = []
    inside, gains, held, foretold, broken, failed = [], [], [], [], 0, [0, 0]
    for number, true in joints_of(made, count, seed):
        law = model_law(true)
        widest, runs = [], (made.runs,) if alone else (made.runs, made.grid_runs)
        broken += broken_limits(
            made, true, play(law, made.runs, type(made.sensors)(made.sensors.sample_rate, 1e-9), number)
        )
        for at, planned in enumerate(runs):
            campaign = play(law, planned, made.sensors, number)
            told = stacked([stacked([run_information(run, true, made.sensors)]) for run in planned])
            complete = bool(chosen_terms(told, true.coefficients[None]).all())
            try:
                found = discover(campaign, random_state=0).model
                half = {t.id: (t.interval95[1] - t.interval95[0]) / 2 for t in found.terms}
                widest.append(max(half[i] / abs(true[i].coefficient) for i in made.terms))
            except (SindyJointError, KeyError) as error:
                print(f"  {number} {'grid' if at else 'plan'}: {type(error).__name__} {error}", flush=True)
                widest.append(np.inf)
                failed[at] += 1
                foretold.append(not complete)
                continue
            foretold.append(complete)
            for each in made.predicted if not at else ():
                inside.append((each.id, each.band90[0] <= half[each.id] <= each.band90[1]))
                error = abs(found[each.id].coefficient - true[each.id].coefficient)
                held.append(error <= half[each.id])
        reached.append(until is not None and widest[0] <= until)
        # Where neither finds all terms neither is wider.
        gains.append(widest[0] / widest[-1] if np.isfinite(widest).any() else 1.0)
        print(f"{number} widest {' grid '.join(f'{each:.4f}' for each in widest)}", flush=True)
    ratio = np.array(gains)
    print(f"in their 90 % band: {100 * np.mean([ok for _, ok in inside]):.1f} % of {len(inside)} half-widths")
    for term in made.terms:
        print(f"  {term}: {100 * np.mean([ok for name, ok in inside if name == term]):.1f} %")
    if not alone:
        print(
            f"widest over that of the grid: median {np.median(ratio):.3f}, wider in {np.mean(ratio > 1):.1%}"
        )
    print(f"intervals that hold the truth: {np.mean(held):.1%}; limits broken {broken} times")
    if until is not None:
        print(f"stopped by the rule, the goal is reached in {np.mean(reached):.1%}")
    print(
        f"not all terms found with the plan: {failed[0]}; whether all are found, foretold in {np.mean(foretold):.1%}"
    )
    return [
        dict(
            drive=drive, joints=count, seeds=f"{seed} to {seed + count - 1}", narrower=1 - float(np.median(ratio)),
            wider=int(np.sum(ratio > 1)), inside=sum(ok for _, ok in inside), widths=len(inside), held=sum(held),
            intervals=len(held), broken=broken, failed=failed[0], failed_grid=failed[1], reached=sum(reached),
        )
    ]  # fmt: skip


if __name__ == "__main__":
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("drive", choices=RANGES, nargs="?", default="moment")
    parser.add_argument("count", type=int, nargs="?", default=100)
    parser.add_argument("seed", type=int, nargs="?", default=1000)
    parser.add_argument("--until", type=float)
    parser.add_argument("--alone", action="store_true")
    parser.add_argument("--table", action="store_true")
    given = vars(with_rows(parser).parse_args())
    path, tabled = given.pop("json"), given.pop("table")
    write_rows(path, table() if tabled else main(**given))
