"""Verify a discovered joint in a structure: a pulse on the rig, and 20 s of its motion compared with the simulation.

python examples/06_verify_pulse.py [folder for the picture]
"""

import sys
from pathlib import Path

import numpy as np
from matplotlib.figure import Figure

import sindyjoint

# The model comes from vibration tests of the joint alone (here virtual ones).
model = sindyjoint.discover().model
print(model.equation())

# It takes the joint's place between two beams. The first truth holds nothing that the model lacks; in the second one
# the friction element deflects by 50 µrad before it slips (presliding).
cases = {
    "truth as discovered": sindyjoint.verify(model, "pulse-rig", draws=10),
    "truth with presliding": sindyjoint.verify(model, "pulse-rig", draws=10, presliding=5e-5),
}

figure = Figure(figsize=(10, 6), layout="constrained")
rows = figure.subplots(2, 2, width_ratios=[1.8, 1])
for (name, result), (response, period) in zip(cases.items(), rows, strict=True):
    print(
        f"{name}: {result.verdict}; response NRMSE {result.response_nrmse:.2%} (noise {result.noise_floor:.2%}), "
        f"amplitude {result.amplitude_rms_error:.2%} of the first peak, "
        f"period {1e3 * result.mean_period_difference:.2f} ms"
    )
    run = result.runs[0]
    early = run.time < 4
    response.plot(
        run.time[early], 1e3 * run.measured[early], color="#0072b2", label="measured (simulated here)"
    )
    response.plot(run.time[early], 1e3 * run.simulated[early], "--", color="0.1", lw=1, label="model")
    response.set(xlabel="time, s", ylabel="tip, mm", title=f"{name}: {result.verdict}")
    for half_cycles, style, label in zip(run.oscillations, ("o", "x"), ("measured", "model"), strict=True):
        color = "#0072b2" if label == "measured" else "0.1"
        period.plot(
            1e3 * half_cycles.amplitude[1:], 1e3 * half_cycles.period, style, ms=3, color=color, label=label
        )
    period.set(xscale="log", xlabel="amplitude, mm", ylabel="period, ms", title="period over amplitude")
    period.set_xticks([0.1, 0.2, 0.5, 1.0], ["0.1", "0.2", "0.5", "1"])
    period.minorticks_off()
rows[0, 0].legend(frameon=False, loc="upper right")
rows[0, 1].legend(frameon=False, loc="upper left")

heat = np.abs(cases["truth as discovered"].runs[0].energy[1, :4])
print(f"the first four cycles dissipate {', '.join(f'{1e3 * value:.2f}' for value in heat)} mJ")

folder = Path(sys.argv[1] if len(sys.argv) > 1 else "results")
folder.mkdir(parents=True, exist_ok=True)
figure.savefig(folder / "06_verify_pulse.png", dpi=110)
print(f"picture: {folder / '06_verify_pulse.png'}")
