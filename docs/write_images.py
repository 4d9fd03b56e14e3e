"""Draw the pictures of the guide's pages on diagnosis and planning: ``python docs/write_images.py``, some minutes."""

from pathlib import Path

from sindyjoint.reporting.figure import Kind, drawn
from sindyjoint.reporting.registry import draw
from sindyjoint.reporting.results.diagnosis_pictures import gap_by_step, overlays
from sindyjoint.reporting.style import figure_bytes
from sindyjoint.workflows.diagnose import diagnose, diagnose_structure
from sindyjoint.workflows.plan import plan

IMAGES = Path(__file__).parent / "images"


def main() -> None:
    """Write the pictures."""
    found = diagnose(None, rng=2)
    kind = Kind(
        "gap", "Gap", "Gap by step, and the residual of one run.", lambda result: [], height=lambda _: 3.0
    )
    panels = [gap_by_step, overlays(found)[-1]]
    (IMAGES / "diagnosis-gap.png").write_bytes(figure_bytes(drawn(kind, panels, found, 8.0), "png", 150))
    structure = diagnose_structure("pulse-rig", rng=5)
    (IMAGES / "structure-gap.png").write_bytes(figure_bytes(draw("overlay", structure, 7.0), "png", 130))
    planned = plan(
        drive="angle",
        ranges={"linear_stiffness": (5000.0, 8000.0), "coulomb_friction": (1.0, 3.0)},
        limits={"moment": 8.0, "rate": 0.08},
        until=0.012,
    )
    (IMAGES / "plan-curve.png").write_bytes(figure_bytes(draw("curve", planned, 7.0), "png", 130))


if __name__ == "__main__":
    main()
