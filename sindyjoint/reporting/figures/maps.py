"""The force–state map: averaged cells, counts, the model's surface and its cuts."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from sindyjoint.numeric import Array
from sindyjoint.reporting.data import ReportData
from sindyjoint.reporting.figures.labels import rate_label
from sindyjoint.reporting.figures.layout import colour_scale
from sindyjoint.reporting.style import (
    DIVERGING,
    FIXED_INK,
    INK,
    MUTED,
    PALETTE,
    SEQUENTIAL,
    legend_above,
    prefixed,
)
from sindyjoint.text import quantities

if TYPE_CHECKING:
    from matplotlib.axes import Axes


def map_moment(data: ReportData, ax: Axes) -> Axes:
    """Draw the averaged transfer moment of every cell, with the model's contours over it."""
    q = quantities(data.model.joint.motion)
    limit = float(np.nanmax(np.abs(data.surface.moment)))
    factor, unit = prefixed(limit, q.moment_unit)
    _cells(data, ax, data.surface.moment * factor, DIVERGING, (-limit * factor, limit * factor), unit)
    if data.model.terms:
        _contours(data, ax, factor, limit * factor)
    ax.set_title(f"Mean {q.moment.lower()}" + (", model contours" if data.model.terms else ""))
    return ax


def map_counts(data: ReportData, ax: Axes) -> Axes:
    """Draw how many moving samples each cell holds."""
    counts = np.where(data.surface.filled, data.surface.count.astype(float), np.nan)
    _cells(data, ax, counts, SEQUENTIAL, (0.0, float(np.nanmax(counts))), "samples")
    ax.set_title("Moving samples per cell")
    return ax


def map_residual(data: ReportData, ax: Axes) -> Axes:
    """Draw the mean residual, measured less model, of every cell."""
    q = quantities(data.model.joint.motion)
    values = data.residual_map.moment
    limit = float(np.nanmax(np.abs(values))) or 1.0
    factor, unit = prefixed(limit, q.moment_unit)
    _cells(data, ax, values * factor, DIVERGING, (-limit * factor, limit * factor), unit)
    ax.set_title("Mean residual, measured less model")
    return ax


def cut_at_zero_rate(data: ReportData, ax: Axes) -> Axes:
    """Draw the cut at θ̇ = 0: cell means just above and just below, the model, and the friction step between."""
    q = quantities(data.model.joint.motion)
    middle = data.surface.n // 2
    x_factor, x_unit = prefixed(float(np.max(np.abs(data.surface.angle_edges))), q.angle_unit)
    y_factor, y_unit = prefixed(float(np.nanmax(np.abs(data.surface.moment))), q.moment_unit)
    nodes = np.linspace(data.surface.angle_edges[0], data.surface.angle_edges[-1], data.upper.shape[0])
    sides = ((middle, data.upper[:, 0], ">", 0), (middle - 1, data.lower[:, -1], "<", 1))
    for column, sheet, sign, index in sides:
        colour = PALETTE[index]
        near = _nearest(data, column, 1 if sign == ">" else -1)
        rows = np.flatnonzero(near >= 0)
        x = data.surface.angle[rows, near[rows]] * x_factor
        y = data.surface.moment[rows, near[rows]] * y_factor
        label = f"slowest cells, {q.rate_symbol} {sign} 0"
        ax.plot(x, y, linestyle="none", marker="os"[index], markersize=3, color=colour, label=label)
        if data.model.terms:
            rate = data.surface.rate[rows, near[rows]]
            modelled = data.model.moment(data.surface.angle[rows, near[rows]], rate) * y_factor
            ax.plot(x, modelled, linestyle="none", marker=".", markersize=2.5, color=INK)
            ax.plot(nodes * x_factor, sheet * y_factor, color=colour, linestyle=("-", "--")[index])
    if data.model.terms:
        _mark_step(data, ax, x_factor, y_factor, y_unit)
        ax.plot([], [], linestyle="none", marker=".", markersize=4, color=INK, label="model in those cells")
        ax.plot([], [], color=MUTED, label=f"model at {q.rate_symbol} = 0±")
    ax.set(
        xlabel=f"{q.angle} {q.angle_symbol} ({x_unit})",
        ylabel=f"{q.transfer} ({y_unit})",
        title=f"Cut at {q.rate_symbol} = 0",
    )
    legend_above(ax, 4 if data.model.terms else 2)
    return ax


def cut_at_centre(data: ReportData, ax: Axes) -> Axes:
    """Draw the cut at the middle of the tested angles: cell means and model over θ̇, with the friction step."""
    q = quantities(data.model.joint.motion)
    edges = data.surface.angle_edges
    middle, quarter = 0.5 * float(edges[0] + edges[-1]), 0.25 * float(edges[-1] - edges[0])
    centre = 0.0 if abs(middle) < quarter else middle
    row = int(np.clip(np.searchsorted(edges, centre, side="right") - 1, 0, data.surface.n - 1))
    x_factor, x_unit = prefixed(float(data.surface.rate_edges[-1]), q.rate_unit)
    y_factor, y_unit = prefixed(float(np.nanmax(np.abs(data.surface.moment))), q.moment_unit)
    filled = np.flatnonzero(data.surface.filled[row])
    rate = data.surface.rate[row, filled]
    spread = data.surface.spread[row, filled] * y_factor
    ax.errorbar(
        rate * x_factor,
        data.surface.moment[row, filled] * y_factor,
        yerr=spread,
        linestyle="none",
        marker="o",
        markersize=3,
        elinewidth=0.7,
        color=PALETTE[0],
        label="cell mean ± spread",
    )
    if data.model.terms:
        top = float(data.surface.rate_edges[-1])
        rates = np.concatenate(
            [np.linspace(-top, -1e-9 * top, 60), [np.nan], np.linspace(1e-9 * top, top, 60)]
        )
        # The mean angle within the cell: comparing at its middle would show the width of the cell as a misfit.
        angle = float(np.average(data.surface.angle[row, filled], weights=data.surface.count[row, filled]))
        ax.plot(
            rates * x_factor,
            data.model.moment(np.full_like(rates, angle), rates) * y_factor,
            color=INK,
            label="model",
        )
    name, unit = q.angle_symbol, prefixed(float(np.max(np.abs(edges))), q.angle_unit)
    ax.set(
        xlabel=rate_label(data.model, x_unit),
        ylabel=f"{q.transfer} ({y_unit})",
        title=f"Cut at {name} = {centre * unit[0]:.3g}" + (f" {unit[1]}" if centre else ""),
    )
    legend_above(ax, 2)
    return ax


def _cells(
    data: ReportData, ax: Axes, values: Array, colours: str, limits: tuple[float, float], label: str
) -> None:
    """Draw a field over the cells, with its scale; empty cells stay empty."""
    q = quantities(data.model.joint.motion)
    x_factor, x_unit = prefixed(float(np.max(np.abs(data.surface.angle_edges))), q.angle_unit)
    y_factor, y_unit = prefixed(float(data.surface.rate_edges[-1]), q.rate_unit)
    mesh = ax.pcolormesh(
        data.surface.angle_edges * x_factor,
        data.surface.rate_edges * y_factor,
        np.ma.masked_invalid(values.T),
        cmap=colours,
        vmin=limits[0],
        vmax=limits[1],
        # Cells as vectors with their seams show through in some viewers; a picture inside the vector file does not.
        rasterized=True,
    )
    ax.grid(False)
    colour_scale(ax, mesh, label)
    ax.set(xlabel=f"{q.angle} {q.angle_symbol} ({x_unit})", ylabel=rate_label(data.model, y_unit))


def _contours(data: ReportData, ax: Axes, factor: float, limit: float) -> None:
    q = quantities(data.model.joint.motion)
    x_factor, _ = prefixed(float(np.max(np.abs(data.surface.angle_edges))), q.angle_unit)
    y_factor, _ = prefixed(float(data.surface.rate_edges[-1]), q.rate_unit)
    levels = np.linspace(-limit, limit, 9)[1:-1]
    angles = np.linspace(data.surface.angle_edges[0], data.surface.angle_edges[-1], data.upper.shape[0])
    top = float(data.surface.rate_edges[-1])
    rates = np.linspace(0, top, data.upper.shape[1])
    for sheet, side in ((data.upper, rates), (data.lower, rates - top)):
        # A field without the level has no contour to draw, and matplotlib would warn.
        inside = levels[(levels > sheet.min() * factor) & (levels < sheet.max() * factor)]
        if inside.size:
            ax.contour(
                angles * x_factor,
                side * y_factor,
                sheet.T * factor,
                levels=inside,
                colors=FIXED_INK,
                linewidths=0.5,
            )


def _nearest(data: ReportData, column: int, direction: int) -> NDArray[np.intp]:
    """Return, for each angle, the filled cell nearest to zero rate within a quarter of the rates; −1 without one."""
    reach = max(1, data.surface.n // 8)
    columns = [c for c in range(column, column + direction * reach, direction) if 0 <= c < data.surface.n]
    return np.array(
        [next((c for c in columns if data.surface.filled[row, c]), -1) for row in range(data.surface.n)]
    )


def _mark_step(data: ReportData, ax: Axes, x_factor: float, factor: float, unit: str) -> None:
    """Mark the jump of the model at zero rate."""
    row = data.upper.shape[0] // 2
    above, below = data.upper[row, 0] * factor, data.lower[row, -1] * factor
    if abs(above - below) < 0.02 * float(np.nanmax(np.abs(data.surface.moment))) * factor:
        return
    x = 0.5 * float(data.surface.angle_edges[0] + data.surface.angle_edges[-1]) * x_factor
    ax.annotate("", (x, above), (x, below), arrowprops={"arrowstyle": "<->", "color": INK, "linewidth": 0.8})
    # In the corner, where neither of the two rising curves passes.
    ax.text(0.98, 0.03, f"step {above - below:.3g} {unit}", fontsize=7, ha="right", transform=ax.transAxes)
