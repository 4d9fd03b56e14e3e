"""The stopping rule: joints of a range, tested run by run as `plan --campaign` says, until it says stop.

Each is held beside the plain 3 x 3 grid, whose runs are made longer until its widest interval is as narrow.

    python -m benchmarks.bench_stopping [moment|angle] [JOINTS] [FIRST SEED] [--until ENOUGH] [--alone] [--json FILE]

Ranges are those of `bench_plan`. ENOUGH is the relative half-width that is the goal. ``--alone`` leaves the grid out.
"""

from __future__ import annotations

import argparse
import time
from dataclasses import replace

import numpy as np

from benchmarks.bench_plan import LIMITS, RANGES, broken_limits, joints_of
from benchmarks.resumed import with_rows, write_rows
from sindyjoint import discover, plan
from sindyjoint.equation.model import JointModel
from sindyjoint.errors import SindyJointError
from sindyjoint.planning import PlannedRun
from sindyjoint.planning.plan import Plan, play
from sindyjoint.record import Campaign, Run
from sindyjoint.response.laws import model_law

RUN = 5.0  # s
ALL = 150.0  # s, when nothing has been made
LONGER = 1.12
ENOUGH = {"moment": 0.05, "angle": 0.012}


class Tested:
    """A joint that is tested run by run; every run has its own noise."""

    def __init__(self, true: JointModel, sensors, seed: int) -> None:
        self.true, self.sensors, self.seed = true, sensors, seed
        self.planned: list[PlannedRun] = []
        self.runs: list[Run] = []
        self.campaign: Campaign | None = None

    def make(self, run: PlannedRun) -> None:
        """Make a run."""
        number = len(self.runs)
        made = play(model_law(self.true), [run], self.sensors, [self.seed, number])
        self.runs.append(replace(made.runs[0], name=f"{number + 1:02d}"))
        self.planned.append(run)
        self.campaign = replace(made, runs=tuple(self.runs))


def widest_of(campaign: Campaign, true: JointModel) -> tuple[float, list[bool], float]:
    """Return the widest relative half-width, which intervals hold the truth, and the largest relative error."""
    try:
        found = discover(campaign, random_state=0).model
        half = {t.id: (t.interval95[1] - t.interval95[0]) / 2 for t in found.terms}
        error = {t.id: abs(found[t.id].coefficient - t.coefficient) for t in true.terms}
        widest = max(half[t.id] / abs(found[t.id].coefficient) for t in true.terms)
        return (
            widest,
            [error[i] <= half[i] for i in error],
            max(error[t.id] / abs(t.coefficient) for t in true.terms),
        )
    except (SindyJointError, KeyError):
        return np.inf, [], np.inf


def tested(first: Plan, true: JointModel, seed: int, drive: str, until: float) -> tuple[Tested, Plan, float]:
    """Return a joint tested until the plan says stop, the last plan, and the longest time of a step, s."""
    test, made, longest = Tested(true, first.sensors, seed), first, 0.0
    while made.runs and len(test.runs) * RUN < ALL:
        test.make(made.runs[0])
        began = time.perf_counter()
        left = max(ALL - len(test.runs) * RUN, RUN)
        made = plan(
            "inter-panel", campaign=test.campaign, drive=drive, ranges=RANGES[drive], limits=LIMITS, time=left,
            run_time=RUN, until=until, band=(2.0, 8.0),
        )  # fmt: skip
        longest = max(longest, time.perf_counter() - began)
    return test, made, longest


def grid_time(first: Plan, true: JointModel, seed: int, until: float) -> float:
    """Return how long the grid must last until its widest interval is narrow enough, s."""
    duration = 9 * RUN
    while duration < 1000:
        runs = [replace(run, duration=duration / len(first.grid_runs)) for run in first.grid_runs]
        if widest_of(play(model_law(true), runs, first.sensors, [seed, 1000]), true)[0] <= until:
            return duration
        duration *= LONGER
    return np.inf


def main(drive: str, count: int, seed: int, until: float | None = None, alone: bool = False) -> list[dict]:
    """Print a line for each joint, and the shares; return these."""
    until = until or ENOUGH[drive]
    began = time.perf_counter()
    first = plan(drive=drive, ranges=RANGES[drive], limits=LIMITS, time=ALL, run_time=RUN, until=until)
    print(
        f"before any run: {first.seconds:.0f} s in {time.perf_counter() - began:.1f} s: {first.stop}",
        flush=True,
    )
    reached, shares, held, broken, steps, errors = [], [], [], 0, [], []
    for number, true in joints_of(first, count, seed):
        test, last, longest = tested(first, true, number, drive, until)
        assert test.campaign is not None
        widest, holds, error = widest_of(test.campaign, true)
        grid = np.nan if alone else grid_time(first, true, number, until)
        mine = len(test.runs) * RUN
        quiet = replace(first.sensors, noise=1e-9)
        made = replace(first, runs=tuple(test.planned))
        broken += broken_limits(made, true, play(model_law(true), test.planned, quiet, 0))
        reached.append(bool(last.now and last.now.reached and widest <= until))
        shares.append(0.0 if grid == np.inf else mine / grid)
        held += holds
        steps.append(longest)
        errors.append(error <= until)
        print(f"{number}: {mine:.0f} s, {100 * widest:.2f} %; grid {grid:.0f} s; {last.stop}", flush=True)
    print(f"stopped, and the goal is reached: {np.mean(reached):.1%} of {count}")
    print(f"every coefficient within the goal of its truth: {np.mean(errors):.1%}")
    print(f"time over that of the grid: median {np.median(shares):.2f}, largest {np.max(shares):.2f}")
    print(f"intervals that hold the truth: {np.mean(held):.1%} of {len(held)}; limits broken {broken} times")
    print(f"longest step {max(steps):.1f} s; all {time.perf_counter() - began:.0f} s")
    return [
        dict(
            drive=drive, goal=until, joints=count, seeds=f"{seed} to {seed + count - 1}", reached=sum(reached),
            within=sum(errors), share=float(np.median(shares)), longest_share=max(shares), held=sum(held),
            intervals=len(held), broken=broken, seconds=max(steps),
        )
    ]  # fmt: skip


if __name__ == "__main__":
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("drive", choices=RANGES, nargs="?", default="moment")
    parser.add_argument("count", type=int, nargs="?", default=40)
    parser.add_argument("seed", type=int, nargs="?", default=3000)
    parser.add_argument("--until", type=float)
    parser.add_argument("--alone", action="store_true")
    given = vars(with_rows(parser).parse_args())
    path = given.pop("json")
    write_rows(path, main(**given))
