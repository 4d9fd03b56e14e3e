"""No angle is measured, or it drifts: an accelerometer on the joint, alone or beside a displacement sensor.

    python examples/12_accelerometer.py [folder for the picture]

The same joint is tested three times at 1 % noise: with the angle's sensor, with an accelerometer instead of it, and
with both, the angle's sensor drifting by about half of what it measures. Sensors are fused by their noise at each
frequency; what an accelerometer does not see, the mean angle, is reported as not known.
"""

import sys
from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np

import sindyjoint

runs = {"frequencies": [3, 4.5, 6], "levels": [0.85, 0.5], "duration": 5, "rng": 5}
ideal = sindyjoint.simulate(noise=0, **runs)
campaigns = {
    "angle": sindyjoint.simulate(**runs),
    "accelerometer": sindyjoint.simulate(accelerometer="instead", **runs),
    "both, drifting": sindyjoint.simulate(accelerometer="beside", angle_drift=0.5, **runs),
}  # or, in a terminal: sindyjoint simulate --accelerometer beside --drift 0.5 --out FOLDER

models = {name: sindyjoint.discover(campaign).model for name, campaign in campaigns.items()}
print(f"{'':16}{'k1 (N·m/rad)':>16}{'k3 (N·m/rad³)':>22}{'c1 (N·m·s/rad)':>18}{'M_F (N·m)':>18}")
for name, model in models.items():
    terms = [model[i] for i in ("linear_stiffness", "cubic_stiffness", "linear_damping", "coulomb_friction")]
    print(f"{name:16}" + "".join(f"{t.coefficient:13.5g} ± {t.standard_error:<6.1g}" for t in terms))
print(campaigns["accelerometer"].warnings[1])

run, true = campaigns["both, drifting"].runs[1], ideal.runs[1].angle
error = np.std(run.angle - true + np.mean(true)) / np.std(true)
print(f"angle of {run.name}: error {100 * error:.2f} % of its RMS, sensor's alone "
      f"{100 * np.std(run.fusion.angle - true) / np.std(true):.0f} %")  # fmt: skip

fig, ax = plt.subplots(figsize=(7.2, 3.4), layout="constrained")
shown = slice(0, 2000)
ax.plot(run.time[shown], 1e3 * run.fusion.angle[shown], lw=0.8, color="0.65", label="displacement sensor")
ax.plot(run.time[shown], 1e3 * run.angle[shown], lw=1.6, label="fused with the accelerometer")
ax.plot(run.time[shown], 1e3 * true[shown], "k--", lw=0.8, label="true angle")
ax.set(xlabel="Time (s)", ylabel="Angle θ (mrad)")
ax.legend(loc="lower center", bbox_to_anchor=(0.5, 1.0), ncols=3, frameon=False)
folder = Path(sys.argv[1] if len(sys.argv) > 1 else "results")
folder.mkdir(parents=True, exist_ok=True)
fig.savefig(folder / "12_accelerometer.png", dpi=110)
print(f"picture: {folder / '12_accelerometer.png'}")
