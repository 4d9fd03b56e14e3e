"""The first discovery: a virtual test of the paper's inter-panel joint goes in, its equation comes out.

python examples/01_first_discovery.py [folder for the picture]
"""

import sys
from pathlib import Path

import numpy as np
from matplotlib.figure import Figure

import sindyjoint

found = sindyjoint.discover()  # no data given: the built-in virtual test
model = found.model

print(model.equation())
for term in model.terms:
    print(f"{term.symbol:4} {term.coefficient:12.5g} ± {term.standard_error:<8.2g} {term.unit}")
print(f"The paper's term set is {found.verdict.verdict}: {found.verdict.reason}.")

figure = Figure(figsize=(10, 4.2), layout="constrained")
loops, path = figure.subplots(1, 2, width_ratios=[1.25, 1])

# Left: one period of three runs at 4 Hz. While the joint sticks, its moment is no function of angle and rate.
for state in [state for state in found.states if round(state.frequency) == 4]:
    period = slice(0, round(state.sample_rate / state.frequency) + 1)
    angle, rate, moving = state.angle[period], state.rate[period], state.moving[period]
    measured = state.transfer_moment(model.inertia)[period]
    loops.plot(1e3 * angle[~moving], measured[~moving], ".", color="0.75", ms=4)
    loops.plot(1e3 * angle[moving], measured[moving], ".", color="#0072b2", ms=4)
    loops.plot(1e3 * angle, np.where(moving, model.moment(angle, rate), np.nan), color="#d55e00", lw=1.5)
loops.set(
    xlabel="angle, mrad", ylabel="transfer moment, N·m", title="measured (simulated here) and model, 4 Hz"
)
for label, style in (
    ("moving", ("#0072b2", ".", "")),
    ("sticking", ("0.75", ".", "")),
    ("model", ("#d55e00", "", "-")),
):
    loops.plot([], [], color=style[0], marker=style[1], ls=style[2], label=label)
loops.legend(frameon=False, loc="lower right")

# Right: why five terms. Each model of the path predicts the frequencies that were held out of its fit.
steps = found.selection.path
size, error = (
    [step.size for step in steps],
    [100 * step.held_out_rms / model.fitted.moment_rms for step in steps],
)
path.semilogy(size, error, "o-", color="#0072b2", ms=4, lw=1)
chosen = found.selection.chosen
path.semilogy(
    size[chosen], error[chosen], "o", color="#d55e00", ms=9, label=f"chosen: {size[chosen]} of {size[0]}"
)
path.axhline(
    100 * model.fitted.noise_floor / model.fitted.moment_rms, color="0.5", ls="--", lw=1, label="noise floor"
)
path.set(
    xlabel="terms in the model",
    ylabel="error on held-out frequencies, % of RMS moment",
    title="how many terms",
)
path.set_yticks([1, 2, 5, 10, 20, 50], ["1", "2", "5", "10", "20", "50"])
path.minorticks_off()
path.legend(frameon=False)

folder = Path(sys.argv[1] if len(sys.argv) > 1 else "results")
folder.mkdir(parents=True, exist_ok=True)
figure.savefig(folder / "01_first_discovery.png", dpi=110)
print(f"picture: {folder / '01_first_discovery.png'}")
