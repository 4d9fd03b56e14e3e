"""Every figure by name: ``draw(kind, result)`` makes one alone, each panel is a function ``f(result, ax)``."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from typing import TYPE_CHECKING, Any

from matplotlib.axes import Axes
from matplotlib.ticker import AutoLocator, MaxNLocator

from sindyjoint.errors import UnknownNameError
from sindyjoint.reporting.data import ReportData, gather
from sindyjoint.reporting.figures import evidence, loops, maps, residuals
from sindyjoint.reporting.style import DOUBLE_COLUMN, new_figure, style

if TYPE_CHECKING:
    from matplotlib.figure import Figure

Panel = Callable[[Any, Axes], Axes]
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
        ReportData → panels to draw, in order; none: the result has nothing of this kind.
    """

    name: str
    title: str
    caption: str
    panels: Callable[[ReportData], list[Panel]]


def _fixed(*panels: Panel) -> Callable[[ReportData], list[Panel]]:
    return lambda data: list(panels)


def _loops(data: ReportData) -> list[Panel]:
    groups = loops.spread(list(loops.loop_groups(data)), MOST_PANELS)
    return [partial(loops.loops, group=group) for group in groups]


def _residual(data: ReportData) -> list[Panel]:
    periodic = any(loop.residual_over_phase.size for loop in data.loops)
    phase: list[Panel] = [residuals.residual_phase] if periodic else []
    return [maps.map_residual, *phase, residuals.residual_time]


def _coefficients(data: ReportData) -> list[Panel]:
    return [partial(evidence.coefficient, term=term) for term in evidence.drawn_coefficients(data)]


def _with_terms(*panels: Panel) -> Callable[[ReportData], list[Panel]]:
    return lambda data: list(panels) if data.model.terms else []


KINDS: dict[str, Kind] = {
    kind.name: kind
    for kind in (
        Kind(
            "map",
            "Force–state map",
            "Transfer moment averaged over cells of angle and rate, samples per cell, and cuts through the map: at "
            "zero rate the friction shows as a step, at the middle angle as a jump of the line.",
            _fixed(maps.map_moment, maps.map_counts, maps.cut_at_rest, maps.cut_at_centre),
        ),
        Kind(
            "loops",
            "Moment–angle loops",
            "One period of each run, transfer moment over angle; black dots are the model where the joint moves.",
            _loops,
        ),
        Kind(
            "residual",
            "What the model leaves",
            "Residual over angle and rate, over the phase of the cycle, and over time. Structure that stands above the "
            "noise floor is an effect that the model lacks.",
            _residual,
        ),
        Kind(
            "path",
            "Choice of the terms",
            "Fit residual and held-out error over the number of terms, and the number of terms over the threshold.",
            _fixed(evidence.path, evidence.threshold),
        ),
        Kind(
            "coefficients",
            "Coefficients by frequency, or by part of the record",
            "The chosen terms fitted to each frequency (or part) alone, with 95 % intervals. Line: all together. "
            "Grey: ±10 %. Crosses: the paper's tables, where the joint is one of the paper's.",
            _coefficients,
        ),
        Kind(
            "covariance",
            "Covariance",
            "Correlation of the coefficients' errors; near ±1 the data cannot tell two terms apart.",
            _with_terms(evidence.covariance),
        ),
    )
}


def draw(kind: str, result: Any, width: float = DOUBLE_COLUMN) -> Figure:
    """Draw a figure.

    Parameters
    ----------
    kind : str
        One of :data:`KINDS`.
    result : Discovery or ReportData
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
    if kind not in KINDS:
        raise UnknownNameError(f"figure {kind!r} is not known; one of {', '.join(KINDS)} is wanted")
    data = gather(result)
    panels = KINDS[kind].panels(data)
    if not panels:
        raise UnknownNameError(
            f"figure {kind!r} has nothing to show here; one of {', '.join(drawable(data))} has"
        )
    columns = 1 if width < 5 or len(panels) == 1 else (3 if len(panels) > 4 else 2)
    rows = math.ceil(len(panels) / columns)
    cell = width / columns if len(panels) > 1 else min(width, 4.6)
    with style():
        figure = new_figure(cell * columns, rows * max(2.0, min(0.78 * cell, 2.7)))
        grid = figure.add_gridspec(rows, columns)
        for index, panel in enumerate(panels):
            row, column = divmod(index, columns)
            # Of an odd number of panels in two columns the last takes the whole row.
            alone = columns == 2 and index == len(panels) - 1 and column == 0
            _few_ticks(panel(data, figure.add_subplot(grid[row, :] if alone else grid[row, column])))
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


def drawable(result: Any) -> list[str]:
    """Return the kinds that a result can show."""
    data = gather(result)
    return [kind for kind, entry in KINDS.items() if entry.panels(data)]
