"""What a kind of figure is: a name, how to read it, and the panels that it is made of; and its drawing."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, TypeAlias

import numpy as np

from sindyjoint.reporting.figures.layout import arrange
from sindyjoint.reporting.style import INK, style
from sindyjoint.text import power_of_ten

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

Panel: TypeAlias = "Callable[[Any, Axes], Axes]"

MOST_PANELS = 6


@dataclass(frozen=True)
class Kind:
    """A figure: its name, what it shows, and the panels it is made of.

    Parameters
    ----------
    name, title : str
    caption : str
        One sentence that says how to read it; also what a screen reader says.
    panels : callable
        Result → panels to draw, in order; none: the result has nothing of this kind.
    part : bool
        Whether it is a single panel of another kind.
    wide : bool
        Whether a single panel takes the whole width.
    height : callable, optional
        Result → height of a panel in inches; default: by its width.
    projection : str, optional
        Of the axes: ``"3d"``.
    columns : int, optional
        Of panels; default: by their number.
    """

    name: str
    title: str
    caption: str
    panels: Callable[[Any], list[Panel]]
    part: bool = False
    wide: bool = False
    height: Callable[[Any], float] | None = None
    projection: str | None = None
    columns: int | None = None


def fixed(*panels: Panel) -> Callable[[Any], list[Panel]]:
    """Return what gives the same panels for every result."""
    return lambda data: list(panels)


def each(
    items: Callable[[Any], Sequence[Any]], draw: Callable[[Any, Axes], Axes]
) -> Callable[[Any], list[Panel]]:
    """Return what gives a panel for each of some items of a result; ``draw`` draws one item."""
    return lambda data: [lambda _, ax, item=item: draw(item, ax) for item in items(data)]  # type: ignore[misc]


def spread(items: Sequence[Any], most: int = MOST_PANELS) -> list[Any]:
    """Return at most ``most`` of the items, evenly over the sequence, first and last among them."""
    if len(items) <= most:
        return list(items)
    return [items[i] for i in np.unique(np.linspace(0, len(items) - 1, most).round().astype(int))]


def by_name(*kinds: Kind) -> dict[str, Kind]:
    """Return the kinds of figure of a result by their names, in order."""
    return {kind.name: kind for kind in kinds}


def drawn(chosen: Kind, panels: Sequence[Panel], data: Any, width: float) -> Figure:
    """Return the panels of a kind of figure as one figure of a width in inches, free of any global state."""
    columns = 1 if width < 5 or len(panels) == 1 else chosen.columns or (3 if len(panels) > 4 else 2)
    rows = math.ceil(len(panels) / columns)
    cell = width / columns if len(panels) > 1 or chosen.wide else min(width, 4.6)
    height = chosen.height(data) if chosen.height else max(2.0, min(0.78 * cell, 2.7))
    with style():
        from matplotlib.figure import Figure

        figure = Figure(figsize=(cell * columns, rows * height))
        grid = figure.add_gridspec(rows, columns)
        for index, panel in enumerate(panels):
            row, column = divmod(index, columns)
            # Of an odd number of panels in two columns the last takes the whole row.
            single = columns == 2 and index == len(panels) - 1 and column == 0
            cell_spec = grid[row, :] if single else grid[row, column]
            _plain_ticks(panel(data, figure.add_subplot(cell_spec, projection=chosen.projection)))
        arrange(figure, rows, columns)
    return figure


def bars(
    ax: Axes,
    names: Sequence[str],
    values: Sequence[float],
    end: float,
    label: str,
    color: Any,
    written: str = "",
    height: float = 0.8,
) -> Axes:
    """Draw bars from top to bottom on an axis from zero to ``end``; ``written`` formats the values behind them."""
    ax.barh(range(len(names)), values, height=height, color=color)
    for row, value in enumerate(values):
        if written:
            ax.text(value + 0.008 * end, row, written.format(value), va="center", color=INK)
    ax.set(
        yticks=range(len(names)),
        yticklabels=names,
        ylim=(len(names) - 0.5, -0.5),
        xlim=(0, end),
        xlabel=label,
    )
    return ax


def _plain_ticks(ax: Axes) -> None:
    """Keep to six ticks, and to text that is no mathematics: drawing spends its time on ticks."""
    from matplotlib.ticker import AutoLocator, LogFormatter, MaxNLocator

    class Powers(LogFormatter):
        """Numbers of a logarithmic axis; which of them stand there is matplotlib's choice."""

        def __call__(self, x: float, pos: int | None = None) -> str:
            return power_of_ten(x) if super().__call__(x, pos) else ""

    for axis in (ax.xaxis, ax.yaxis):
        if isinstance(axis.get_major_locator(), AutoLocator):
            axis.set_major_locator(MaxNLocator(5, steps=[1, 2, 2.5, 5, 10]))
        if axis.get_scale() == "log":
            axis.set_major_formatter(Powers())
            axis.set_minor_formatter(Powers())
