"""Whether the error model is calibrated: what the true law leaves of unseen runs, in units of the noise that is stated.

python benchmarks/bench_calibration.py run --out calibration.jsonl --seeds 0 100
python benchmarks/bench_calibration.py show calibration.jsonl

Random joints of tests/recovery/random_joints.py under each kind of test, ``--names``: periodic, multisine, sweep, free,
quasi-static; white noise on both channels of .1 to 5 % (of the RMS), 10 to 1000 samples a period, both drawn
log-uniformly. The paper's law is discovered through the door; the misfit is the ``trust`` gap, and the error on what
was left out of the fit, over the floor beside them. 1 is right. ``run`` appends one line per campaign and resumes.
"""

from __future__ import annotations

import os
import sys
import time
from dataclasses import replace
from pathlib import Path

for variable in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"):
    os.environ.setdefault(variable, "1")

import numpy as np  # noqa: E402

root = Path(__file__).resolve().parents[1]
sys.path[:0] = [str(root), str(root / "tests" / "recovery")]

from benchmarks.resumed import append, done_in, main, records_in  # noqa: E402

KINDS = ("periodic", "multisine", "sweep", "free", "quasi-static")


def made(kind: str, seed: int):
    """Return the plan of a joint, its test, the noise and the samples of a period."""
    from random_joints import aperiodic_campaign, random_plan

    rng = np.random.default_rng((50_000, seed, KINDS.index(kind)))
    noise = float(np.exp(rng.uniform(np.log(1e-3), np.log(0.05))))
    per = float(np.exp(rng.uniform(np.log(10), np.log(1000))))
    plan = random_plan(seed, duration=8.0, drive="moment")
    if kind == "periodic":
        plan = replace(plan, sample_rate=per * max(plan.frequencies))
        clean = plan.campaign(0.0)
    elif kind in ("multisine", "sweep"):
        plan = replace(plan, sample_rate=per * 8.0)
        clean = aperiodic_campaign(plan, 0.0, kind, duration=10.0)
    elif kind == "free":
        plan, clean = _swings(plan, per)
    else:  # what goes along the path is made of noisy samples
        return plan, _cycles(plan, per, noise, rng), noise, per
    runs = tuple(
        replace(run, **{c: _noisy(getattr(run, c), noise, rng) for c in ("moment", "angle")})
        for run in clean.runs
    )
    return plan, clean.with_runs(runs), noise, per


def _noisy(signal, noise, rng):
    return signal + noise * np.sqrt(np.mean(signal**2)) * rng.standard_normal(signal.size)


def _swings(plan, per):
    """Return free decays from four angles, without a moment, of a joint with little friction."""
    from sindyjoint.mechanics import simulate
    from sindyjoint.record import Campaign, Joint, Run
    from tests.made_models import sampled

    law = replace(plan.law, M_F=0.02 * plan.law.M_F, inertia=20.0)
    plan = replace(plan, law=law, sample_rate=per * np.sqrt(law.k1 / law.inertia) / (2 * np.pi))
    runs = []
    for number, share in enumerate((0.85, 0.7, 0.55, 0.4)):
        free = sampled(np.zeros(int(8.0 * 256) + 2), 256)
        motion = simulate(law, free, 6.0, plan.sample_rate, initial=(share * plan.angle_limit, 0.0))
        runs.append(Run(f"swing {number}", np.zeros_like(motion.angle), motion.angle, plan.sample_rate))
    return plan, Campaign(Joint(name="free", inertia=law.inertia), tuple(runs), simulated=True)


def _cycles(plan, per, noise, rng):
    """Return three slow cycles at three levels as samples without a time."""
    from sindyjoint.record import Campaign

    samples, angles = max(int(per), 40), []
    for level in (0.9, 0.6, 0.35):
        angles.append(
            level * plan.angle_limit * np.sin(2 * np.pi * np.arange(3 * samples + 1) / samples + 0.3)
        )
    law = plan.law
    moments = [law.k1 * a + law.k2 * a**2 + law.k3 * a**3 + law.M_F * np.sign(np.gradient(a)) for a in angles]
    moments, angles = ([_noisy(signal, noise, rng) for signal in each] for each in (moments, angles))
    return Campaign.from_arrays(moment=moments, angle=angles, time=None, name="slow")


def one(kind: str, seed: int) -> dict:
    from random_joints import TRUE_IDS

    from sindyjoint import discover
    from sindyjoint.errors import SindyJointError

    plan, campaign, noise, per = made(kind, seed)
    record = dict(kind=kind, seed=seed, noise=noise, samples=per)
    start = time.process_time()
    try:
        found = discover(campaign, "paper")
    except SindyJointError as error:  # too few moving samples beside the noise, as one may draw them
        return dict(record, refused=f"{type(error).__name__}: {error}"[:200])
    if not found.found:
        return dict(record, refused=found.reason[:200])
    trust, truth = found.trust, dict(zip(TRUE_IDS, plan.truth, strict=True))
    terms = [term for term in found.model.terms if term.id in truth]
    return dict(
        record,
        seconds=time.process_time() - start,
        ids=list(found.model.ids),
        gap=trust.explained.gap,
        floor=trust.explained.floor,
        interval=trust.explained.interval,
        error=trust.predicts.error,
        sentence=trust.explained.sentence,
        z={t.id: float((t.coefficient - truth[t.id]) / t.standard_error) for t in terms},
        inside={t.id: bool(t.interval95[0] <= truth[t.id] <= t.interval95[1]) for t in terms},
    )


def run(given) -> None:
    done = done_in(given.out, ("kind", "seed"))
    for seed in range(*given.seeds):
        for kind in given.names or KINDS:
            if (kind, seed) not in done:
                append(given.out, one(kind, seed))


def show(given) -> list[dict]:
    records = records_in(given.paths)
    rows = []
    for kind in KINDS:
        for few, title in ((False, "30 to 1000"), (True, "10 to 30")):
            found = [r for r in records if r["kind"] == kind and (r["samples"] < 30) == few]
            known = [r for r in found if "floor" in r and np.isfinite(r["floor"])]
            if not known:
                continue
            ratio = np.array([r["gap"] / r["floor"] for r in known])
            inside = [value for r in known for value in r["inside"].values()]
            row = dict(
                test=kind, samples=title, campaigns=len(found), with_floor=len(known),
                misfit=float(np.median(ratio)), low=float(np.quantile(ratio, 0.05)),
                high=float(np.quantile(ratio, 0.95)),
                left_out=float(np.median([r["error"] / r["floor"] for r in known])),
                inside=float(np.mean(inside)), coefficients=len(inside),
            )  # fmt: skip
            rows.append(row)
            print(
                f"{kind:13} {title:10} {len(known)} of {len(found)} with a floor; gap over floor {row['misfit']:.3f} "
                f"({row['low']:.2f} to {row['high']:.2f}), left out {row['left_out']:.3f}; "
                f"coefficients inside {100 * row['inside']:.1f} % of {len(inside)}"
            )
    return rows


if __name__ == "__main__":
    main(__doc__, run, show)
