"""Does the answer hang on the method? The same question to every selector, frequency and library.

    python examples/05_compare.py [folder for the picture]

A square of the picture: that method, frequency or library chose that term. In its first row the area of a square is the
share of resampled campaigns that choose it: how much of the answer is luck.
"""

import sys
from pathlib import Path

from sindyjoint.mechanics.virtual import virtual_campaign
from sindyjoint.reporting.registry import draw
from sindyjoint.reporting.style import figure_bytes
from sindyjoint.workflows.compare import compare

campaign = virtual_campaign(frequencies=[3, 4.5, 6], levels=[0.9, 0.6, 0.4], duration=4, random_state=5)
found = compare(campaign, methods=("stlsq", "best_subset", "frols"), replicates=50, random_state=5)

print(found.agreement)
for choice in (*found.methods, *found.frequencies, *found.libraries):
    others = ", ".join(choice.extra) or "nothing else"
    print(f"{choice.name:20} {5 - len(choice.missing)} of the paper's five terms, and {others}")
for test in found.tests:
    print(f"{test.name}: {test.answer}; {test.reason}")

folder = Path(sys.argv[1] if len(sys.argv) > 1 else "results")
folder.mkdir(parents=True, exist_ok=True)
(folder / "05_compare.png").write_bytes(figure_bytes(draw("inclusion", found), "png", dpi=130))
print(f"picture: {folder / '05_compare.png'}")
