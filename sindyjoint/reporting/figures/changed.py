"""The picture of two tests: how far each coefficient moved, and what does not matter."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from sindyjoint.judgement.changed import Shift
from sindyjoint.reporting.figures.kind import Kind, by_name, fixed
from sindyjoint.reporting.figures.labels import math_symbol
from sindyjoint.reporting.style import ACCENT, INK, PALETTE, RULE

if TYPE_CHECKING:
    from matplotlib.axes import Axes


@dataclass(frozen=True, eq=False)
class ChangeFigures:
    """What the picture is drawn from.

    Parameters
    ----------
    joint : str
    shifts : tuple of Shift
    margin : float
    simulated : bool
    """

    joint: str
    shifts: tuple[Shift, ...]
    margin: float
    simulated: bool = False

    @property
    def drawn(self) -> tuple[Shift, ...]:
        """Those that are in both tests."""
        return tuple(shift for shift in self.shifts if np.isfinite(shift.change))


def shifts(data: ChangeFigures, ax: Axes) -> Axes:
    """Draw the relative change of each coefficient with its 95 % interval, over the margin."""
    rows = data.drawn
    ax.axvspan(-100 * data.margin, 100 * data.margin, color=RULE, alpha=0.6, lw=0)
    ax.axvline(0, color=INK, linewidth=0.8)
    reach = 1.4 * data.margin
    for row, shift in enumerate(rows):
        colour = ACCENT if shift.answer.startswith("changed") else PALETTE[0]
        ax.plot([100 * end for end in shift.interval], [row, row], color=colour, solid_capstyle="butt")
        ax.plot(100 * shift.change, row, "o", color=colour, markersize=4)
        if abs(shift.change) < 3:
            reach = max(reach, *(min(abs(end), 3.0) * 1.1 for end in shift.interval))
    ax.set(
        xlim=(-100 * reach, 100 * reach),
        yticks=range(len(rows)),
        yticklabels=[math_symbol(shift.symbol) for shift in rows],
        ylim=(len(rows) - 0.5, -0.5),
        xlabel="Change (% of the value before)",
        title="After against before",
    )
    return ax


KINDS = by_name(
    Kind(
        "shifts",
        "After against before",
        "Relative change of each coefficient with its 95 % interval; grey: the margin within which a change does not "
        "matter; orange: changed beyond noise and calibration.",
        lambda data: fixed(shifts)(data) if data.drawn else [],
        wide=True,
        height=lambda data: 0.9 + 0.28 * len(data.drawn),
    )
)
