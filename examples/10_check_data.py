"""Are the data sound? A campaign with two faults, the findings of the check, and the samples that no fit uses.

    python examples/10_check_data.py [folder for the picture]

The faults are spikes of a loose cable in one run and a saturated amplifier in another. The check finds both and masks
those samples; the coefficients stay within their standard errors.
"""

import sys
from dataclasses import replace
from pathlib import Path

import numpy as np

import sindyjoint

sound = sindyjoint.simulate(frequencies=[3, 4.5, 6], levels=[0.9, 0.6, 0.4], duration=6, noise=0.01, rng=5)
loose, limited, *others = sound.runs
angle = loose.angle.copy()
angle[[700, 2300, 4100, 4101]] += 0.05
limit = np.quantile(np.abs(limited.moment), 0.97)
faulty = sound.with_runs(
    (
        replace(loose, angle=angle),
        replace(limited, moment=np.clip(limited.moment, -limit, limit)),
        *others,
    )
)

check = sindyjoint.check(faulty)  # or, in a terminal: sindyjoint check FOLDER --out results
print(f"the data are {check.soundness.verdict}")
for finding in check.soundness.findings:
    print(f"- {finding.severity}: {finding.id}, {finding.channel} of {finding.run}: {finding.extent}")
    print(f"  {finding.effect}; {finding.remedy}")

found, reference = sindyjoint.discover(faulty), sindyjoint.discover(sound)
for line in found.warnings[:2]:
    print("-", line)
for term in found.model.terms:
    print(
        f"{term.symbol:4} {term.coefficient:12.5g} ± {term.standard_error:<8.2g} {term.unit:12} "
        f"without the faults {reference.model[term.id].coefficient:.5g}"
    )

folder = Path(sys.argv[1] if len(sys.argv) > 1 else "results")
folder.mkdir(parents=True, exist_ok=True)
check.plot("channels").savefig(folder / "10_check_data.png", dpi=110)
print(f"picture: {folder / '10_check_data.png'}")
