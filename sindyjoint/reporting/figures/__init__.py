"""Every figure by name: ``draw(kind, result)`` makes one alone, each panel is a function ``f(result, ax)``."""

from __future__ import annotations

import math
from difflib import get_close_matches
from typing import TYPE_CHECKING, Any

from matplotlib.axes import Axes
from matplotlib.ticker import AutoLocator, MaxNLocator

from sindyjoint.errors import UnknownNameError
from sindyjoint.reporting.data import gather
from sindyjoint.reporting.figures.kinds import DISCOVERY, OTHERS, kinds_of
from sindyjoint.reporting.style import DOUBLE_COLUMN, new_figure, style

if TYPE_CHECKING:
    from matplotlib.figure import Figure

__all__ = ["DISCOVERY", "as_data", "draw", "drawable", "kinds_of"]


def as_data(result: Any) -> Any:
    """Return what figures are drawn from: a discovery gathered, any other result as it is."""
    return result if isinstance(result, OTHERS) else gather(result)


def draw(kind: str, result: Any, width: float = DOUBLE_COLUMN) -> Figure:
    """Draw a figure.

    Parameters
    ----------
    kind : str
        One of those that :func:`kinds_of` gives for the result.
    result : Discovery, ReportData, Verification, Diagnosis or Comparison
    width : float
        Inches; below 5 the panels stand one under the other.

    Returns
    -------
    matplotlib Figure
        Free of any global state.

    Raises
    ------
    UnknownNameError
        For an unknown kind, or one that the result cannot show.
    """
    data = as_data(result)
    kinds = kinds_of(data)
    if kind not in kinds:
        near = get_close_matches(kind, kinds, 1)
        hint = f"did you mean {near[0]!r}? " if near else ""
        raise UnknownNameError(f"figure {kind!r} is not known; {hint}one of {', '.join(kinds)} is wanted")
    panels = kinds[kind].panels(data)
    if not panels:
        raise UnknownNameError(
            f"figure {kind!r} has nothing to show here; one of {', '.join(drawable(data))} has"
        )
    columns = 1 if width < 5 or len(panels) == 1 else (3 if len(panels) > 4 else 2)
    rows = math.ceil(len(panels) / columns)
    chosen = kinds[kind]
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


def drawable(result: Any, parts: bool = False) -> list[str]:
    """Return the kinds that a result can show; with ``parts``, single panels too."""
    data = as_data(result)
    return [name for name, kind in kinds_of(data).items() if (parts or not kind.part) and kind.panels(data)]
