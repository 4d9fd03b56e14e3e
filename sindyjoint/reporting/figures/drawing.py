"""A kind of figure, drawn: its panels side by side, or one under the other where it is narrow."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any

from matplotlib.axes import Axes
from matplotlib.ticker import AutoLocator, MaxNLocator

from sindyjoint.reporting.figures.kind import Kind, Panel
from sindyjoint.reporting.style import new_figure, style

if TYPE_CHECKING:
    from collections.abc import Sequence

    from matplotlib.figure import Figure


def drawn(chosen: Kind, panels: Sequence[Panel], data: Any, width: float) -> Figure:
    """Return the panels of a kind of figure as one figure of a width in inches, free of any global state."""
    columns = 1 if width < 5 or len(panels) == 1 else (3 if len(panels) > 4 else 2)
    rows = math.ceil(len(panels) / columns)
    cell = width / columns if len(panels) > 1 or chosen.wide else min(width, 4.6)
    height = chosen.height(data) if chosen.height else max(2.0, min(0.78 * cell, 2.7))
    with style():
        figure = new_figure(cell * columns, rows * height)
        grid = figure.add_gridspec(rows, columns)
        for index, panel in enumerate(panels):
            row, column = divmod(index, columns)
            # Of an odd number of panels in two columns the last takes the whole row.
            alone = columns == 2 and index == len(panels) - 1 and column == 0
            place = grid[row, :] if alone else grid[row, column]
            _few_ticks(panel(data, figure.add_subplot(place, projection=chosen.projection)))
        engine = figure.get_layout_engine()
        assert engine is not None
        engine.execute(figure)
        # Laid out once: every later drawing would do it again, for half of the time that a figure takes.
        figure.set_layout_engine("none")
    return figure


def _few_ticks(ax: Axes) -> None:
    """Keep to six ticks: easier to read, and ticks are what drawing spends its time on."""
    for axis in (ax.xaxis, ax.yaxis):
        if isinstance(axis.get_major_locator(), AutoLocator):
            axis.set_major_locator(MaxNLocator(5, steps=[1, 2, 2.5, 5, 10]))
