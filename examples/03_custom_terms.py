"""A new candidate term: a catalogue is a TOML file, and it can include the shipped ones.

    python examples/03_custom_terms.py [folder for the picture]

The joint of this virtual test has detents: a moment that is periodic in the angle, which no shipped catalogue holds.
With the five terms it stays in the residual; a catalogue with one more term finds it.
"""

import sys
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np
from matplotlib.figure import Figure

import sindyjoint
from sindyjoint import FunctionLaw, virtual_campaign

CATALOGUE = """
name = "detents"
description = "everything that is shipped, and a moment that repeats with the angle"
include = ["extended"]

[[term]]
id = "detent"
symbol = "M_d"
formula = "sin(theta / pitch)"
unit = "N*m"
name = "detent moment"
meaning = "moment that comes and goes with the angle, as of teeth, balls or a worn pin"
family = "stiffness"
source = "none: an example"
parameters = [{ name = "pitch", unit = "rad", value = 6e-5 }]
"""


def detent(theta, omega, direction, state, parameters, out):
    """Add 0.15 N·m that repeats every 2π · 60 µrad."""
    out[0] = parameters[0] * np.sin(theta / parameters[1])


campaign = virtual_campaign(hidden=FunctionLaw(detent, (0.15, 6e-5)), drive="displacement", rng=2)
plain = sindyjoint.discover(campaign, library="paper")
with TemporaryDirectory() as name:
    path = Path(name) / "detents.toml"
    path.write_text(CATALOGUE, encoding="utf-8")  # check yours with: sindyjoint libraries check detents.toml
    found = sindyjoint.discover(campaign, library=path)

print("paper's terms only:", plain.verdict.verdict, "-", plain.verdict.reason)
print("with detents:      ", found.verdict.verdict, "-", found.verdict.reason)
detents = found.model["detent"]
print(
    f"{detents.symbol} = {detents.coefficient:.4f} ± {detents.standard_error:.4f} {detents.unit} (0.15 was put in)"
)

figure = Figure(figsize=(9, 4), layout="constrained")
for axes, result, title in zip(
    figure.subplots(1, 2, sharey=True), (plain, found), ("five terms", "five terms and detents"), strict=True
):
    for state in result.states:
        residual = state.transfer_moment(0.02) - result.model.moment(state.angle, state.rate)
        axes.plot(
            1e3 * state.angle[state.moving][::7], residual[state.moving][::7], ".", color="#0072b2", ms=1
        )
    share = result.model.fitted.residual_rms / result.model.fitted.moment_rms
    axes.set(xlabel="angle, mrad", title=f"{title}: residual {share:.1%}")
    axes.axhline(0, color="0.5", lw=0.8)
figure.axes[0].set_ylabel("residual, N·m")

folder = Path(sys.argv[1] if len(sys.argv) > 1 else "results")
folder.mkdir(parents=True, exist_ok=True)
figure.savefig(folder / "03_custom_terms.png", dpi=110)
print(f"picture: {folder / '03_custom_terms.png'}")
