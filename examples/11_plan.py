"""From nothing to a law: a rough idea of a joint, a plan of its test, the test (a virtual one), the discovery.

    python examples/11_plan.py [folder for the picture]

All that is known is that the stiffness lies between 5 and 8 kN·m/rad and the friction between 1 and 3 N·m. The planned
runs are then made on a joint of that range, and what they tell is held beside what was expected.
"""

import sys
from dataclasses import replace
from pathlib import Path

import sindyjoint
from sindyjoint import INTER_PANEL, draw, figure_bytes, play

# In a terminal: sindyjoint plan --drive angle --range "linear_stiffness=5..8 kN*m/rad" ... --out plan
plan = sindyjoint.plan(
    ranges={"linear_stiffness": (5000.0, 8000.0), "coulomb_friction": (1.0, 3.0)},
    drive="angle",
    limits={"moment": 8.0, "rate": 0.08},
    time=60.0,
)
print(plan)

# In a terminal: sindyjoint simulate --plan plan --out runs; sindyjoint discover runs
joint = replace(INTER_PANEL, k1=7100.0, M_F=1.4)
found = sindyjoint.discover(play(joint, plan.runs, plan.sensors, rng=3))
for term, true in zip(found.model.terms, joint.parameters, strict=True):
    half = (term.interval95[1] - term.interval95[0]) / 2
    low, high = next(each.band90 for each in plan.predicted if each.id == term.id)
    print(
        f"{term.symbol:4} {term.coefficient:12.5g} ± {half:<8.2g} (expected {low:.2g} to {high:.2g}) "
        f"{term.unit:12} truth {true:.5g}"
    )

folder = Path(sys.argv[1] if len(sys.argv) > 1 else "results")
folder.mkdir(parents=True, exist_ok=True)
(folder / "11_plan.png").write_bytes(figure_bytes(draw("widths", plan), "png", dpi=110))
print(f"picture: {folder / '11_plan.png'}")
