"""Where the panels of a figure stand: margins as wide as the labels round each need, measured once.

matplotlib's own layout measures every panel twice and moves it in between, which takes longer than the drawing.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

PAD = 3.0  # points, round a panel with all its labels
TITLE_PAD, TITLE_LINE = 5.0, 10.0  # points
SCALE_TEXT = 12.0  # points, for a common factor of the numbers that stands above the axis


def colour_scale(ax: Axes, field: Any, label: str) -> None:
    """Put the scale of a coloured field to the right of its panel."""
    ax.figure.colorbar(field, cax=ax.inset_axes((1.03, 0.0, 0.035, 1.0)), label=label)


def arrange(figure: Figure, rows: int, columns: int) -> None:
    """Place the panels of a grid so that no label is cut off, their frames equal in size and aligned."""
    from matplotlib.backends.backend_agg import FigureCanvasAgg

    renderer = FigureCanvasAgg(figure).get_renderer()
    # Left and right of each column, above and below each row, as shares of the sheet.
    sides, levels = np.zeros((columns, 2)), np.zeros((rows, 2))
    for ax in figure.axes:
        left, right, above, below = _margins(ax, renderer)
        place = _place(ax)
        row, column = place.rowspan, place.colspan
        sides[column.start, 0] = max(sides[column.start, 0], left)
        sides[column.stop - 1, 1] = max(sides[column.stop - 1, 1], right)
        levels[row.start, 0] = max(levels[row.start, 0], above)
        levels[row.stop - 1, 1] = max(levels[row.stop - 1, 1], below)
    sides, levels = sides / figure.bbox.width, levels / figure.bbox.height
    width = max((1 - sides.sum()) / columns, 0.02)
    height = max((1 - levels.sum()) / rows, 0.02)
    starts = np.concatenate([[0.0], np.cumsum(sides.sum(axis=1) + width)])
    tops = 1 - np.concatenate([[0.0], np.cumsum(levels.sum(axis=1) + height)])
    for ax in figure.axes:
        place = _place(ax)
        row, column = place.rowspan, place.colspan
        x0 = starts[column.start] + sides[column.start, 0]
        x1 = starts[column.stop] - sides[column.stop - 1, 1]
        y0 = tops[row.stop] + levels[row.stop - 1, 1]
        y1 = tops[row.start] - levels[row.start, 0]
        ax.set_position((x0, y0, x1 - x0, y1 - y0))


def _place(ax: Axes) -> Any:
    """Return which rows and columns of the grid a panel takes."""
    place = ax.get_subplotspec()
    assert place is not None
    return place


def _margins(ax: Axes, renderer: Any) -> tuple[float, float, float, float]:
    """Return what stands left, right, above and below the frame of a panel, pixels."""
    point = ax.figure.dpi / 72
    frame = ax.get_window_extent(renderer)
    title = ax.get_title(loc="left")
    above = (TITLE_PAD + TITLE_LINE * (1 + title.count("\n"))) * point if title else 0.0
    boxes = [frame]
    if ax.name == "3d":
        # What stands round its box lies within its frame.
        axes: list[Any] = []
    else:
        axes = [ax.xaxis, ax.yaxis] if ax.axison else []
    boxes += [box for part in (*axes, *ax.child_axes) if (box := part.get_tightbbox(renderer)) is not None]
    if axes and ax.yaxis.get_offset_text().get_text():
        ax.set_title(title, pad=TITLE_PAD + SCALE_TEXT)
        above += SCALE_TEXT * point
    pad = PAD * point
    return (
        frame.x0 - min(box.x0 for box in boxes) + pad,
        max(box.x1 for box in boxes) - frame.x1 + pad,
        max(above, max(box.y1 for box in boxes) - frame.y1) + pad,
        frame.y0 - min(box.y0 for box in boxes) + pad,
    )
