"""Pictures of a discovery inside a structure: the recovered force–state loops, and what each sensor is worth."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from sindyjoint.numeric import Array
from sindyjoint.reporting.figures.kind import Kind, by_name, each, fixed
from sindyjoint.reporting.style import ACCENT, INK, PALETTE

if TYPE_CHECKING:
    from matplotlib.axes import Axes


# Loss of a sensor at which the scale of the picture ends.
MOST = 10.0


@dataclass(frozen=True, eq=False)
class RecoveredLoop:
    """Angle and moment of a joint over a period of its strongest run, rad and N·m, and the law's moment there."""

    joint: str
    run: str
    angle: Array
    moment: Array
    law: Array


@dataclass(frozen=True, eq=False)
class StructureFigures:
    """What the pictures are drawn from.

    Parameters
    ----------
    rig : str
    joints, sensors : tuple of str
    worth : ndarray, shape (joints, sensors)
        By what factor the error of a joint's moment grows without a sensor; at most a hundred.
    loops : tuple of RecoveredLoop
    simulated : bool
    """

    rig: str
    joints: tuple[str, ...]
    sensors: tuple[str, ...]
    worth: Array
    loops: tuple[RecoveredLoop, ...]
    simulated: bool = False


def worth(data: StructureFigures, ax: Axes) -> Axes:
    """Draw for each joint and sensor by what factor the moment's error grows without the sensor."""
    shown = np.clip(data.worth, 1.0, MOST)
    ax.imshow(np.log(shown), cmap="Blues", vmin=0.0, vmax=np.log(MOST), aspect="auto")
    for row, values in enumerate(data.worth):
        for column, value in enumerate(values):
            text = f"{value:.2g}" if value < 100 else "∞"
            ax.text(
                column, row, text, ha="center", va="center", color="white" if value > 3 else INK, fontsize=7
            )
    ax.set_xticks(range(len(data.sensors)), list(data.sensors), rotation=30, ha="right")
    ax.set_yticks(range(len(data.joints)), list(data.joints))
    ax.grid(False)
    ax.set_title("Growth of the moment's error without the sensor")
    return ax


def _loop(loop: RecoveredLoop, ax: Axes) -> Axes:
    ax.plot(1e3 * loop.angle, loop.moment, color=PALETTE[0], label="recovered")
    if loop.law.size:
        ax.plot(1e3 * loop.angle, loop.law, ".", color=ACCENT, markersize=2, label="found law, moving")
    ax.set(xlabel="Angle (mrad)", ylabel="Moment (N m)", title=f"{loop.joint}, {loop.run}")
    ax.legend(loc="upper left")
    return ax


KINDS = by_name(
    Kind(
        "recovered",
        "Recovered loops",
        "Moment of each joint over its angle, recovered from the structure's sensors, in a period of the run that "
        "moves it most, or in the first second of one that does not repeat; dots: the moment of the law found, "
        "where the joint moves.",
        each(lambda data: data.loops, _loop),
    ),
    Kind(
        "worth",
        "What each sensor is worth",
        "By what factor the standard error of a joint's moment grows when a sensor is taken away (1: it adds nothing; "
        "∞: without it the joint is not determined).",
        fixed(worth),
        wide=True,
        height=lambda data: 1.3 + 0.35 * len(data.joints),
    ),
)
