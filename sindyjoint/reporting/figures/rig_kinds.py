"""The kinds of figure of a reproduction of the paper, and of a rig in motion."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from typing import Any

from sindyjoint.reporting import reproduction_figures, rig_motion
from sindyjoint.reporting.figures.kind import Kind, Panel, fixed


def _per_joint(panel: Callable[..., Any]) -> Callable[[Any], list[Panel]]:
    return lambda result: [partial(panel, joint=joint) for joint in result.joints]


_SOLID: dict[str, Any] = {"height": lambda _: 3.2, "projection": "3d"}
_PAPER = reproduction_figures

REPRODUCTION: dict[str, Kind] = {
    kind.name: kind
    for kind in (
        Kind(
            "figure-05",
            "Figure 5",
            "Figure 5: moment over angle at 3 Hz; four of nine levels, periods averaged.",
            _per_joint(_PAPER.loops),
        ),
        Kind(
            "figure-06",
            "Figure 6",
            "Figure 6: force–state map of a linear spring, mass and damper: an oblique plane.",
            fixed(_PAPER.surface),
            **_SOLID,
        ),
        Kind(
            "figure-07",
            "Figure 7",
            "Figure 7: force–state maps at 3 Hz; moving samples averaged in 24 × 24 cells.",
            _per_joint(_PAPER.surface),
            **_SOLID,
        ),
        Kind("figure-09", "Figure 9", "Figure 9: the exciting force.", fixed(_PAPER.force)),
        Kind(
            "figure-10",
            "Figure 10",
            "Figure 10: displacement of the free end after the pulse, 20 s.",
            fixed(_PAPER.measured),
            wide=True,
        ),
        Kind(
            "figure-11",
            "Figure 11",
            "Figure 11: virtual test and identified model, first 10 s.",
            fixed(*(partial(_PAPER.compared, truth=truth) for truth in _PAPER.TRUTHS)),
        ),
        Kind(
            "amplitude-and-period",
            "Amplitude and period",
            "Amplitude and period, swing by swing, of both virtual tests and the model.",
            fixed(
                *(
                    partial(_PAPER.swings, truth=truth, of=of)
                    for truth in _PAPER.TRUTHS
                    for of in ("amplitude", "period")
                )
            ),
        ),
    )
}

RIG: dict[str, Kind] = {
    kind.name: kind
    for kind in (
        Kind(
            "deflection",
            "Deflection",
            "Deflection of the output points over time.",
            fixed(rig_motion.deflection),
            wide=True,
        ),
        Kind(
            "angles",
            "Joint angles",
            "Angle of every joint over time; where a line is flat the joint is locked.",
            fixed(rig_motion.angles),
            wide=True,
        ),
        Kind(
            "heat",
            "Dissipation",
            "Who dissipates how much of what became heat.",
            fixed(rig_motion.heat),
        ),
        Kind(
            "locked",
            "Locked",
            "Share of the time in which each joint is locked.",
            fixed(rig_motion.locked),
        ),
    )
}
