"""Does the result depend on the method? The same campaign for several methods, each frequency and each library.

    python examples/05_compare.py [folder for the picture]

A square in the picture: that method, frequency or library chose that term. In the first row the area of a square is the
fraction of resampled campaigns in which the term is chosen.
"""

import sys
from pathlib import Path

import sindyjoint

campaign = sindyjoint.simulate(frequencies=[3, 4.5, 6], levels=[0.9, 0.6, 0.4], duration=4, rng=5)
found = sindyjoint.compare(campaign, methods=("stlsq", "best_subset", "frols"), replicates=50, rng=5)

print(found.agreement)
for choice in (*found.methods, *found.frequencies, *found.libraries):
    others = ", ".join(choice.extra) or "nothing else"
    print(f"{choice.name:20} {5 - len(choice.missing)} of the paper's five terms, and {others}")
for test in found.tests:
    print(f"{test.name}: {test.answer}; {test.reason}")

folder = Path(sys.argv[1] if len(sys.argv) > 1 else "results")
folder.mkdir(parents=True, exist_ok=True)
found.plot("inclusion").savefig(folder / "05_compare.png", dpi=130)
print(f"picture: {folder / '05_compare.png'}")
