"""Many joints: eight virtual campaigns at eight temperatures; the batch finds the joint with half the damping.

python examples/09_batch.py [folder for the picture]
"""

import sys
import tempfile
from dataclasses import replace
from pathlib import Path

from sindyjoint import INTER_PANEL, batch, virtual_campaign, write_campaign


def make_campaigns(folder: Path) -> None:
    """Write the campaigns: the stiffness falls by 0.1 % per kelvin, the damping of H-4 is halved."""
    for number, celsius in enumerate((20, -30, 55, 0, -15, 40, 10, -40)):
        law = replace(
            INTER_PANEL,
            k1=INTER_PANEL.k1 * (1 - 1e-3 * (celsius - 20)),
            c1=INTER_PANEL.c1 * (0.5 if number == 4 else 1.0),
        )
        campaign = virtual_campaign(
            law,
            drive="displacement",
            frequencies=(3.0, 4.0, 5.0),
            levels=(0.9, 0.6, 0.4),
            duration=3.0,
            rng=number,
        )
        joint = replace(campaign.joint, name="hinge", serial=f"H-{number}", temperature=celsius + 273.15)
        write_campaign(replace(campaign, joint=joint), folder / f"H-{number}")


def main() -> None:
    """Make the campaigns, discover all joints, print which one differs and the trends over temperature."""
    with tempfile.TemporaryDirectory() as folder:
        make_campaigns(Path(folder) / "campaigns")
        result = batch(Path(folder) / "campaigns", Path(folder) / "results", "paper")
        again = batch(Path(folder) / "campaigns", Path(folder) / "results", "paper")
    for difference in result.differences:
        print(f"{difference.id}: {difference.text}")
    for trend in result.population.trends:
        if trend.significant:
            print(
                f"{trend.coefficient} with the {trend.covariate}: {trend.slope:.3g} per K (p = {trend.p_adjusted:.1g})"
            )
    picture = Path(sys.argv[1] if len(sys.argv) > 1 else ".") / "09_batch.png"
    result.plot("joints").savefig(picture, dpi=150)
    print(f"run again: {again.kept} of {len(again.records)} campaigns were kept")


if __name__ == "__main__":
    main()
