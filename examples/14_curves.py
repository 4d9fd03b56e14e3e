"""What a designer works with: a joint's law as stiffness, loss and energy, and what it does to a structure.

    python examples/14_curves.py [folder for the picture]

The law of the paper's inter-panel joint is discovered from a virtual test. Its curves, with 95 % bands, are those of
the joint alone; in the pulse rig the same law bends the frequency response and damps the first mode.
"""

import sys
from pathlib import Path

import numpy as np

import sindyjoint
from sindyjoint import INTER_PANEL, draw, figure_bytes

model = sindyjoint.discover().model

# In a terminal: sindyjoint curves results --out curves
joint = sindyjoint.curves(model, frequencies=[4.0])
curve = joint.curves[0]
true = np.pi * INTER_PANEL.c1 * 2 * np.pi * 4.0 * curve.amplitude**2 + 4 * INTER_PANEL.M_F * curve.amplitude
low, high = curve.interval95("energy")
print(joint)
print(f"energy per cycle within its band: {np.mean((low <= true) & (true <= high)):.0%} of the amplitudes\n")

# In a terminal: sindyjoint curves pulse-rig --model results --modes 1 --out curves
structure = sindyjoint.curves("pulse-rig", model=model, modes=1)
print(structure)

folder = Path(sys.argv[1] if len(sys.argv) > 1 else "results")
folder.mkdir(parents=True, exist_ok=True)
(folder / "14_curves.png").write_bytes(figure_bytes(draw("response", structure), "png", dpi=110))
print(f"picture: {folder / '14_curves.png'}")
