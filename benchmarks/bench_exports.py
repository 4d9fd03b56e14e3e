"""Exported joints run by the programs that they are written for, beside the simulation of the package.

    python benchmarks/bench_exports.py --json exports.json
    python benchmarks/bench_exports.py --only mujoco opensees

For the paper's five terms, and for each kind of element with them: the largest difference of the angle as a share of
its largest, while the joint slips and at all times, under two periods of 5 N·m at 4 Hz; and what the fidelity table
says of the element. A target whose program is not installed is named, and left out. For MuJoCo, whose friction is a
constraint, the rate at which the joint creeps under nine tenths of its friction.
"""

from __future__ import annotations

import argparse
import os
import sys
import tempfile
import time
from pathlib import Path

for variable in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"):
    os.environ.setdefault(variable, "1")

ROOT = Path(__file__).resolve().parents[1]
sys.path[:0] = [str(ROOT), str(ROOT / "tests" / "export")]

from resimulated import RUNNERS, difference, drive, missing, mujoco_model  # noqa: E402

from benchmarks.resumed import with_rows, write_rows  # noqa: E402
from tests.export.made import ELEMENTS, PAPER, model_of  # noqa: E402

FRICTION = PAPER["coulomb_friction"]
CODE = ("python", "c", "fmu")  # the same law, compiled or not: the largest of the three is told
ABSENT = dict.fromkeys(RUNNERS, "–")
FITTED = 5e-3  # error of a pair of tables from which it counts as fitted


def table(targets: list[str]) -> list[dict]:
    """Print the differences of each target, and return those of each model."""
    cases = {"five terms": model_of()}
    cases |= {name: model_of(elements=[element]) for name, element in ELEMENTS.items()}
    rows = [dict(model=name.replace("_", " "), code=0.0) | ABSENT for name in cases]
    print(
        f"{'target':<10}{'model':<22}{'slipping':>10}{'always':>10}{'table':>10}{'processor':>11}  represented as"
    )
    for target in targets:
        if reason := missing(target):
            print(f"{target:<10}left out: {reason}")
            continue
        for row, (name, model) in zip(rows, cases.items(), strict=True):
            words, always, fitted = one(target, name, model)
            if target in CODE:
                row["code"] = max(row["code"], always)
            row |= {target: share(always) + (f" (fitted: {share(fitted)})" if fitted > FITTED else "")}
            print(f"{target:<10}{name:<22}{words}", flush=True)
    return rows


def share(value: float) -> str:
    """Return a share in per cent, two digits."""
    return f"{100 * value:.2g} %" if value > 1e-6 else "< 1e-4 %"


def one(target: str, name: str, model: object) -> tuple[str, float, float]:
    """Return the rest of a line, the largest difference, and the error that the fidelity table states."""
    from sindyjoint.export import export_model

    rows = {row.term: row for row in export_model(model, target).fidelity}
    row = rows.get(name, rows["all terms"])
    spent = time.process_time()
    with tempfile.TemporaryDirectory() as folder:
        slipping, always = difference(target, model, drive(), Path(folder))
    spent = time.process_time() - spent
    shares = "".join(f"{f'{100 * share:.2g} %':>10}" for share in (slipping, always, row.error))
    return f"{shares}{spent:>9.1f} s  {row.representation}", always, row.error


def creep() -> list[dict]:
    """Print how fast a joint of MuJoCo without stiffness moves under less than its friction; return it as rows."""
    if missing("mujoco"):
        return []
    import mujoco

    compiled = mujoco_model(model_of({"coulomb_friction": FRICTION, "linear_damping": 1e-3}))
    rows = []
    for step in (compiled.opt.timestep, 1e-4):
        # As the file writes it: the time constant of the constraint is two steps.
        compiled.opt.timestep = step
        compiled.dof_solref[0, 0] = 2 * step
        data = mujoco.MjData(compiled)
        data.qfrc_applied[0] = 0.9 * FRICTION
        for _ in range(int(0.1 / step)):
            mujoco.mj_step(compiled, data)
        print(
            f"creep of MuJoCo {mujoco.__version__} under 0.9 of its friction, step {step:g} s: "
            f"{data.qvel[0]:.3g} rad/s, "
            f"{data.qvel[0] / model_of().fitted.rate:.1e} of the largest tested rate"
        )
        words = f"creep under 0.9 of the friction, step {1e3 * step:g} ms"
        rows.append(dict(model=words, code=None) | ABSENT | dict(mujoco=f"{data.qvel[0]:.2g} rad/s"))
    return rows


def main() -> None:
    """Measure and print."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--only", nargs="+", choices=list(RUNNERS), default=list(RUNNERS))
    given = with_rows(parser).parse_args()
    rows = table(given.only)
    if "mujoco" in given.only:
        rows += creep()
    write_rows(given.json, rows)


if __name__ == "__main__":
    main()
