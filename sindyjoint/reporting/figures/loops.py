"""Moment–angle loops of the runs, with the model over them."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from sindyjoint.reporting.data import Loop, ReportData
from sindyjoint.reporting.figures.kind import spread
from sindyjoint.reporting.style import DASHES, INK, PALETTE, legend_above, plain, prefixed, shortened
from sindyjoint.text import quantities

if TYPE_CHECKING:
    from matplotlib.axes import Axes

MOST_LOOPS = 6


def loops(data: ReportData, ax: Axes, group: str | None = None) -> Axes:
    """Draw measured moment–angle loops (colours) and the model over them (black dots).

    Parameters
    ----------
    data : ReportData
    ax : matplotlib Axes
    group : str, optional
        Label of a frequency, as :func:`loop_groups` gives it; ``None``: all runs.

    Returns
    -------
    matplotlib Axes
        The same.
    """
    groups = loop_groups(data)
    chosen = list(data.loops) if group is None else groups[group]
    chosen = spread(chosen, MOST_LOOPS)
    q = quantities(data.model.joint.motion)
    angle_factor, angle_unit = prefixed(max(np.max(np.abs(loop.angle)) for loop in data.loops), q.angle_unit)
    moment_factor, moment_unit = prefixed(
        max(np.max(np.abs(loop.moment)) for loop in data.loops), q.moment_unit
    )
    for index, loop in enumerate(chosen):
        x = loop.angle * angle_factor
        ax.plot(
            x,
            loop.moment * moment_factor,
            color=PALETTE[index % len(PALETTE)],
            linestyle=DASHES[index % len(DASHES)],
            label=plain(shortened(_label(loop, group))),
        )
        if data.model.terms:
            # Where the joint sticks the model says no more than "between the two friction levels".
            modelled = np.where(loop.moving, loop.model * moment_factor, np.nan)
            every = max(1, modelled.size // 90)
            ax.plot(x[::every], modelled[::every], color=INK, linestyle="none", marker=".", markersize=1.8)
    if data.model.terms:
        ax.plot([], [], color=INK, linestyle="none", marker=".", markersize=3, label="model, moving")
    ax.set(xlabel=f"{q.angle} {q.angle_symbol} ({angle_unit})", ylabel=f"{q.transfer} ({moment_unit})")
    if group is not None:
        ax.set_title(plain(shortened(group)))
    legend_above(ax, -(-(len(chosen) + bool(data.model.terms)) // 2), columns=2)
    return ax


def loop_groups(data: ReportData) -> dict[str, list[Loop]]:
    """Return the runs by frequency; aperiodic ones together."""
    found: dict[str, list[Loop]] = {}
    for loop in data.loops:
        key = f"{loop.frequency:.4g} Hz" if loop.frequency is not None else "aperiodic"
        found.setdefault(key, []).append(loop)
    return found


def _label(loop: Loop, group: str | None) -> str:
    if loop.level is None:
        return loop.run
    if group is None and loop.frequency is not None:
        return f"{loop.frequency:.4g} Hz, {loop.level}"
    return f"level {loop.level}"
