"""Data files: CSV files and a campaign.toml, read, discovered, and compared with a run that no fit has used.

    python examples/02_own_data.py [folder for the picture]

A virtual test makes the files as a data logger would write them: a header, a time column, volts that a gain turns into
newton-metres, milliradians. Put your files in their place.
"""

import sys
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np
from matplotlib.figure import Figure

import sindyjoint
from sindyjoint import force_states, virtual_campaign

CAMPAIGN = """
[joint]
name    = "hinge on the bench"
inertia = "0.02 kg*m^2"          # between the moment sensor and the joint; leave it out to have it identified

[channels]
time   = { column = "t",      unit = "s" }
moment = { column = "bridge", unit = "V", gain = "12.5 N*m/V" }
angle  = { column = "angle",  unit = "mrad" }
"""
RUN = """
[[run]]
file      = "{file}"
frequency = {frequency}          # Hz; leave it out for a sweep, a multisine, a free decay
level     = "{level}"
use       = "{use}"
"""

with TemporaryDirectory() as name:
    folder = Path(name)
    manifest = CAMPAIGN
    for run in virtual_campaign(frequencies=[3, 4.5, 6], levels=[0.9, 0.6, 0.4], noise=0.01, rng=5).runs:
        table = np.column_stack([run.time, run.moment / 12.5, 1e3 * run.angle])
        np.savetxt(
            folder / f"{run.name}.csv", table, delimiter=",", header="t,bridge,angle", comments="", fmt="%.6g"
        )
        use = "validate" if run.name == "4.5Hz-0.9" else "identify"
        manifest += RUN.format(file=f"{run.name}.csv", frequency=run.frequency, level=run.level, use=use)
    (folder / "campaign.toml").write_text(manifest, encoding="utf-8")
    campaign = sindyjoint.load_campaign(folder)  # or, in a terminal: sindyjoint discover FOLDER --out results

found = sindyjoint.discover(campaign)
print(found.model.equation())
for term in found.model.terms:
    print(f"{term.symbol:4} {term.coefficient:12.5g} ± {term.standard_error:<8.2g} {term.unit}")
for warning in found.warnings:
    print("-", warning)

kept_back = campaign.validation_runs[0]
state = force_states(kept_back)
measured, model = state.transfer_moment(found.model.inertia), found.model.moment(state.angle, state.rate)
error = np.sqrt(np.mean((measured - model)[state.moving] ** 2) / np.mean(measured[state.moving] ** 2))
print(
    f"run {kept_back.name}, never used for fitting: the residual is {error:.1%} of its RMS moment, noise included"
)

figure = Figure(figsize=(9, 3.6), layout="constrained")
axes = figure.subplots()
shown = slice(0, round(2.5 * state.sample_rate / state.frequency))
axes.plot(state.time[shown], measured[shown], ".", color="#0072b2", ms=3, label="measured")
axes.plot(
    state.time[shown],
    np.where(state.moving, model, np.nan)[shown],
    color="#d55e00",
    label="model, while the joint moves",
)
axes.set(
    ylim=(-9, 7),
    xlabel="time, s",
    ylabel="transfer moment, N·m",
    title=f"{kept_back.name}, not fitted: residual {error:.1%} of RMS",
)
axes.legend(ncols=2, loc="lower center", bbox_to_anchor=(0.5, -0.02), framealpha=1)

folder = Path(sys.argv[1] if len(sys.argv) > 1 else "results")
folder.mkdir(parents=True, exist_ok=True)
figure.savefig(folder / "02_own_data.png", dpi=110)
print(f"picture: {folder / '02_own_data.png'}")
