"""A four-panel wing with discovered joints: natural frequencies, a transient, and the energy dissipated by each joint.

python examples/08_four_panel_wing.py [folder for the picture]
"""

import sys
from pathlib import Path

from matplotlib.figure import Figure

import sindyjoint
from sindyjoint import hinges, load_rig, model_law, virtual_campaign, with_laws

# Two joints are tested one by one; the models found take their places in the wing.
laws = {
    name: model_law(sindyjoint.discover(virtual_campaign(name, rng=0)).model)
    for name in ("inter-panel", "panel-root")
}
wing = load_rig("four-panel-wing")
wing = with_laws(wing, lambda hinge: laws["panel-root" if hinge.name == "root" else "inter-panel"])

structure = wing.structure()
slipping, locked = structure.frequencies(4), structure.frequencies(4, locked=True)
print("mode   slipping   locked")
for mode, (low, high) in enumerate(zip(slipping, locked, strict=True), 1):
    print(f"{mode:4}   {low:5.2f} Hz   {high:5.2f} Hz")

response = wing.respond()
total = response.joint_dissipation.sum() + response.beam_dissipation
print(f"{1e3 * total:.2f} mJ dissipated in {response.time[-1]:.0f} s:")
parts = dict(zip(response.joints, response.joint_dissipation, strict=True)) | {
    "panels": response.beam_dissipation
}
for name, heat in parts.items():
    print(f"  {name:8} {heat / total:6.1%}")
for hinge, stuck in zip(hinges(wing), response.stuck, strict=True):
    print(f"  {hinge.name:8} locked {stuck.mean():.0%} of the time")

figure = Figure(figsize=(10, 6), layout="constrained")
(motion, heat), (angles, locks) = figure.subplots(2, 2, width_ratios=[1.8, 1])
for point in wing.points:
    motion.plot(response.time, 1e3 * response.displacement[point], lw=1, label=point)
motion.set(
    xlabel="time, s", ylabel="deflection, mm", title="four panels, pushed at the tip for half a second"
)
motion.legend(frameon=False)
heat.barh(list(parts), [100 * value / total for value in parts.values()], color="#0072b2")
heat.set(xlabel="share of the dissipated energy, %", title="dissipated energy")
heat.invert_yaxis()
for name, angle in zip(response.joints, response.angle, strict=True):
    angles.plot(response.time, 1e6 * angle, lw=1, label=name)
angles.set(xlabel="time, s", ylabel="joint angle, µrad", title="the joints")
angles.legend(frameon=False, ncols=2)
locks.barh(list(response.joints), 100 * response.stuck.mean(axis=1), color="0.6")
locks.set(xlabel="share of the time locked, %", title="locked")
locks.invert_yaxis()

folder = Path(sys.argv[1] if len(sys.argv) > 1 else "results")
folder.mkdir(parents=True, exist_ok=True)
figure.savefig(folder / "08_four_panel_wing.png", dpi=110)
print(f"picture: {folder / '08_four_panel_wing.png'}")
