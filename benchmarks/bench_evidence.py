"""How far the evidence can be trusted: coverage of intervals, size and power of the frequency tests.

python benchmarks/bench_evidence.py coverage --campaigns 300 --noise 0.01
python benchmarks/bench_evidence.py coverage --campaigns 100 --samples 10 12
python benchmarks/bench_evidence.py power --campaigns 60
python benchmarks/bench_evidence.py time
"""

from __future__ import annotations

import argparse
import os
import sys
import time
from pathlib import Path

os.environ.setdefault("OMP_NUM_THREADS", "1")

import numpy as np  # noqa: E402
from joblib import Parallel, delayed  # noqa: E402

sys.path.insert(0, str(Path(__file__).resolve().parents[1] / "tests" / "recovery"))
from random_joints import (  # noqa: E402
    TRUE_IDS,
    aperiodic_campaign,
    maxwell_campaign,
    random_plan,
    rising_stiffness,
)

FREQUENCIES = (3.0, 4.0, 5.0, 6.0)
LEVELS = (0.92, 0.63, 0.35)
NAMES = ("k1", "k2", "k3", "c1", "M_F")


APERIODIC = ("multisine", "sweep")


def plan_of(seed: int, drive: str | None = None, sample_rate: float = 1000.0):
    fixed = {"drive": "moment" if drive in APERIODIC else drive} if drive else {}
    return random_plan(
        seed, frequencies=FREQUENCIES, levels=LEVELS, sample_rate=sample_rate, duration=5.0, **fixed
    )


def sparse_campaign(seed, noise, drive, samples):
    """Return a campaign whose highest frequency has a random number of samples per period between two limits.

    Of sinusoids each run has its own rate, ten samples per period at least: a run of fewer is refused. Of a multisine
    or a sweep, 20 s long, the line at 8 Hz counts.
    """
    plan = plan_of(seed, drive)
    least, most = samples
    if drive not in APERIODIC:
        least = max(10.0, least)
    per = float(np.random.default_rng((30_000, seed)).uniform(least, most))
    if drive in APERIODIC:
        plan = plan_of(seed, drive, sample_rate=8.0 * per)
        return plan, aperiodic_campaign(plan, noise, drive, duration=20.0)
    parts = [
        plan.campaign(
            noise,
            frequencies=(frequency,),
            sample_rate=per * frequency,
            duration=20.0,
            random_state=(10_000 + seed, index),
        )
        for index, frequency in enumerate(plan.frequencies)
    ]
    return plan, parts[0].with_runs(tuple(run for part in parts for run in part.runs))


def analyse(campaign, library="paper", states="auto"):
    """Return what is discovered on states as measured and on completed ones."""
    from sindyjoint.workflows.discover import discover

    plain = discover(campaign, library=library, states=states, correct=False)
    return plain, discover(campaign, library=library, states=states)


def row_bootstrap(found, replicates=200, seed=0):
    """95 % intervals as pysindy's EnsembleOptimizer makes them: least squares on rows drawn with replacement."""
    from sindyjoint.states import regression_rows

    rows = regression_rows(found.states, found.campaign.joint.inertia)
    from sindyjoint.discovery.rows import state_columns

    columns = state_columns(found.regressor.terms_, rows.X)
    scale = np.sqrt(np.mean(columns**2, axis=0))
    columns = columns / scale
    rng = np.random.default_rng(seed)
    drawn = []
    for _ in range(replicates):
        weight = rng.multinomial(len(rows.y), np.full(len(rows.y), 1 / len(rows.y)))
        gram = columns.T @ (columns * weight[:, None])
        drawn.append(np.linalg.solve(gram, columns.T @ (rows.y * weight)) / scale)
    return np.percentile(drawn, [2.5, 97.5], axis=0)


def one_coverage(seed: int, noise: float, drive: str | None, states: str, samples=None) -> dict:
    from sindyjoint.errors import SindyJointError
    from sindyjoint.judgement.discovery import frequency_tests

    plan = plan_of(seed, drive)
    try:
        if samples:
            plan, campaign = sparse_campaign(seed, noise, drive, samples)
        else:
            campaign = aperiodic_campaign(plan, noise, drive) if drive in APERIODIC else plan.campaign(noise)
        found, fixed = analyse(campaign, states=states)
    except SindyJointError as error:  # it snaps through, or too little moves with so few samples
        return dict(seed=seed, drive=plan.drive, refused=str(error))
    if found.model.ids != TRUE_IDS:
        return dict(seed=seed, drive=plan.drive, ids=found.model.ids)
    low, high = row_bootstrap(found)
    tests = frequency_tests(fixed)

    def inside(model):
        return [t.interval95[0] <= v <= t.interval95[1] for t, v in zip(model.terms, plan.truth, strict=True)]

    return dict(
        seed=seed,
        drive=plan.drive,
        ids=found.model.ids,
        plain=inside(found.model),
        corrected=inside(fixed.model),
        rows=((low <= plan.truth) & (plan.truth <= high)).tolist(),
        error=(found.model.coefficients / plan.truth - 1).tolist(),
        corrected_error=(fixed.model.coefficients / plan.truth - 1).tolist(),
        p_plain=[test.p_value for test in frequency_tests(found)],
        p=[test.p_value for test in tests],
        answers=[test.answer for test in tests],
    )


def coverage(given) -> None:
    records = Parallel(n_jobs=given.jobs)(
        delayed(one_coverage)(seed, given.noise, given.drive, given.states, given.samples)
        for seed in range(given.first, given.first + given.campaigns)
    )
    good = [r for r in records if "p" in r]
    print(
        f"{len(good)} of {len(records)} campaigns at {given.noise:g} noise with all five terms, "
        f"{sum('refused' in r for r in records)} refused; library: paper; states: {given.states}"
    )
    for drive in ("all", *sorted({r["drive"] for r in good})):
        part = [r for r in good if drive in ("all", r["drive"])]
        print(f"\n{drive} ({len(part)})" + " " * 24 + "".join(f"{name:>8}" for name in (*NAMES, "pooled")))
        lines = {
            "coverage, as measured": ("plain", 100),
            "coverage, completed": ("corrected", 100),
            "coverage, bootstrap of rows": ("rows", 100),
        }
        for label, (key, factor) in lines.items():
            values = factor * np.mean([r[key] for r in part], axis=0)
            _row(label, [*values, np.mean(values)])
        for label, key in (
            ("RMS error %, as measured", "error"),
            ("RMS error %, completed", "corrected_error"),
        ):
            _row(label, 100 * np.sqrt(np.mean(np.square([r[key] for r in part]), axis=0)), 3)
        if not any(r["p"] for r in part):
            continue  # runs without a frequency
        for label, key in (("false alarms %, as measured", "p_plain"), ("false alarms %, completed", "p")):
            _row(label, 100 * np.mean(np.array([r[key] for r in part]) < 0.05, axis=0))
        for answer in ("independent within margin", "cannot tell"):
            _row(f"% {answer}", 100 * np.mean(np.array([r["answers"] for r in part]) == answer, axis=0))


def _row(label: str, values, digits: int = 1) -> None:
    print(f"  {label:<32}" + "".join(f"{v:>8.{digits}f}" for v in values))


def one_power(seed: int, noise: float, effect: str, drive: str | None) -> dict:
    from sindyjoint.judgement.discovery import frequency_tests

    plan = plan_of(seed, drive)
    campaign = (
        rising_stiffness(plan, noise, 0.10)
        if effect == "rise"
        else maxwell_campaign(plan, noise, 600.0, 0.03)
    )
    _, found = analyse(campaign)
    tests = {test.name: test for test in frequency_tests(found)}
    return {name: (test.p_value < 0.05, test.change, test.answer) for name, test in tests.items()}


def power(given) -> None:
    for effect, label in (
        ("rise", "k1 rises by 10 % over 3–6 Hz"),
        ("maxwell", "Maxwell branch 600 N·m/rad, 0.03 s"),
    ):
        records = Parallel(n_jobs=given.jobs)(
            delayed(one_power)(seed, given.noise, effect, given.drive) for seed in range(given.campaigns)
        )
        print(
            f"\n{label}, {given.noise:g} noise, {len(records)} campaigns: significant change, of it beyond the margin"
        )
        for name in TRUE_IDS:
            hits = [r[name] for r in records if name in r]
            if hits:
                share, change = np.mean([h[0] for h in hits]), np.median([h[1] for h in hits])
                beyond = np.mean([h[2] == "depends on frequency" for h in hits])
                print(f"  {name:<22} {share:>6.1%} {beyond:>6.1%} of {len(hits)}, median trend {change:+.1%}")
        print(f"  any coefficient        {np.mean([any(h[0] for h in r.values()) for r in records]):>6.1%}")


def timing(given) -> None:
    """Everything that is asked of 12 runs of 10 s at 1 kHz, from factors and from rows."""
    from sindyjoint.discovery.methods import METHODS, column_path
    from sindyjoint.discovery.selection import choose_by_evidence, path_of
    from sindyjoint.discovery.uncertainty import cross_validate, inclusion
    from sindyjoint.mechanics.virtual import virtual_campaign
    from sindyjoint.states import campaign_states, regression_rows
    from sindyjoint.workflows.compare import compare
    from sindyjoint.workflows.discover import discover

    campaign = virtual_campaign(random_state=0)
    discover(campaign)
    for method in METHODS:  # imports and compilation are not what is timed
        column_path(method, discover(campaign).regressor.evidence_, random_state=0)
    clock = _Clock()
    states = campaign_states(campaign)
    clock.lap("force states")
    found = discover(campaign)
    clock.lap("discover (states, skew, factors, selection)")
    evidence = found.regressor.evidence_
    cross_validate(evidence)
    clock.lap("leaving one frequency out, four folds")
    inclusion(evidence, 500, random_state=0)
    clock.lap("500 replicates of the whole selection, exact best subsets")
    for method in METHODS:
        choose_by_evidence(path_of(evidence, column_path(method, evidence, random_state=0)))
    clock.lap(f"{len(METHODS)} methods")
    clock.total()
    clock = _Clock()
    compare(campaign)
    clock.lap("the whole of sindyjoint compare, all of this and more")
    _from_rows(regression_rows(states, campaign.joint.inertia), found)


class _Clock:
    """Wall and processor seconds of one stage after another: on a busy machine only the latter means anything."""

    def __init__(self) -> None:
        self.first = self.last = (time.perf_counter(), time.process_time())

    def lap(self, label: str) -> None:
        now = (time.perf_counter(), time.process_time())
        print(f"  {label:<60} {now[0] - self.last[0]:>7.3f} s wall {now[1] - self.last[1]:>7.3f} s processor")
        self.last = now

    def total(self) -> None:
        self.last, first = self.first, self.last
        wall, processor = first[0] - self.last[0], first[1] - self.last[1]
        print(f"  {'together, after reading':<60} {wall:>7.3f} s wall {processor:>7.3f} s processor")


def _from_rows(rows, found) -> None:
    """Time the same refits on the rows themselves: for each fold and size of the path, and for each replicate."""
    from sindyjoint.discovery.rows import state_columns

    columns = state_columns(found.regressor.terms_, rows.X)
    scale = np.sqrt(np.mean(columns**2, axis=0))
    columns = columns / scale
    start = time.perf_counter()
    np.linalg.lstsq(columns, rows.y, rcond=None)
    once = time.perf_counter() - start
    start = time.perf_counter()
    np.linalg.lstsq(columns[:, :5], rows.y, rcond=None)
    five = time.perf_counter() - start
    sizes, folds = columns.shape[1], 4
    path = sum(range(1, sizes + 1)) / sizes / sizes * once * sizes
    print(
        f"from {len(rows.y)} rows: one fit of {sizes} columns {once:.3f} s, of 5 columns {five:.3f} s; "
        f"{folds} folds of a path about {folds * path:.1f} s, 500 replicates of the path about {500 * path:.0f} s, "
        f"of the chosen five terms {500 * five:.1f} s"
    )


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("what", choices=["coverage", "power", "time"])
    parser.add_argument("--campaigns", type=int, default=300)
    parser.add_argument("--first", type=int, default=0)
    parser.add_argument("--noise", type=float, default=0.01)
    parser.add_argument(
        "--samples",
        type=float,
        nargs=2,
        metavar=("LEAST", "MOST"),
        help="per period of the highest frequency",
    )
    parser.add_argument("--states", default="auto", choices=["auto", "periodic", "broadband"])
    parser.add_argument("--drive", choices=["moment", "rig", "displacement", *APERIODIC])
    parser.add_argument("--jobs", type=int, default=2)
    given = parser.parse_args()
    {"coverage": coverage, "power": power, "time": timing}[given.what](given)


if __name__ == "__main__":
    main()
