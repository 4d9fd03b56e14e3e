"""The joint inside a structure: its law from a force cell and five accelerometers, none of them at the joint's moment.

    python examples/13_joint_in_structure.py [folder for the picture]

A virtual test of the shipped pulse rig, nine sines with 1 % noise. The joint is cut open, its angle and moment are
recovered at each harmonic, and the law is sought in them. The picture shows the recovered loop.
"""

import sys
from dataclasses import replace
from pathlib import Path

import sindyjoint
from sindyjoint import draw, figure_bytes, load_rig_plan, virtual_rig_test

# In a terminal: sindyjoint simulate pulse-rig --out test; sindyjoint discover test/rig.toml
plan = load_rig_plan("pulse-rig")
drives = [drive for drive in plan.drives if drive.frequency != 3.0]
recorder = replace(plan.recorder, duration=12.0, settling=8.0)
test = virtual_rig_test(plan.test, drives, recorder, rng=1)

found = sindyjoint.discover_rig(test, rng=0)
(law,) = found.laws
truth = plan.test.structure.hinges[0].law
for term, true in zip(law.discovery.model.terms, truth.parameters, strict=True):
    print(
        f"{term.symbol:4} {term.coefficient:12.5g} ± {1.96 * term.standard_error:<8.2g} {term.unit:12} truth {true:.5g}"
    )
print(f"residual of the sensors: {found.misfit:.2f} times their noise")

folder = Path(sys.argv[1] if len(sys.argv) > 1 else "results")
folder.mkdir(parents=True, exist_ok=True)
(folder / "13_joint_in_structure.png").write_bytes(figure_bytes(draw("recovered", found), "png", dpi=110))
print(f"picture: {folder / '13_joint_in_structure.png'}")
