"""Diagnose a virtual test with a hidden effect: where the gap lies, which effect causes it, the gap before and after.

python examples/07_diagnose_hidden_effect.py [folder for the picture]
"""

import sys
from pathlib import Path

from matplotlib.figure import Figure

import sindyjoint

# The same in one line of a shell: sindyjoint diagnose --random-state 2 --out diagnosis
result = sindyjoint.diagnose(rng=2)
print(f"{result.verdict}: {result.reason}")
for place in result.where:
    print(f"- {place.words}")
for step in result.steps:
    print(
        f"{step.effect}: moment gap {step.gap_before.moment:.2%} -> {step.gap_after.moment:.2%}",
        step.parameters,
    )
for advice in result.advice:
    print(
        f"to tell {' and '.join(advice.separates)} apart: {advice.waveform}, {advice.frequency} Hz, {advice.level} rad"
    )
print(f"hidden was: {result.hidden}")

figure = Figure(figsize=(12, 4.5), layout="constrained")
left, right = figure.subplots(1, 2, width_ratios=[2, 1])
result.plot("gap", left)
result.plot("rivals", right)
folder = Path(sys.argv[1] if len(sys.argv) > 1 else "results")
folder.mkdir(parents=True, exist_ok=True)
figure.savefig(folder / "07_diagnose_hidden_effect.png", dpi=110)
print(f"picture: {folder / '07_diagnose_hidden_effect.png'}")
