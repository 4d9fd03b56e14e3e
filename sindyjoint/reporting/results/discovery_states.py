"""Pictures of a discovery over the state: loops, force–state map and cuts, where the residual lies."""

from __future__ import annotations

from functools import cache
from typing import Any

import numpy as np

from sindyjoint.numeric import Array
from sindyjoint.reporting.figure import (
    Axes,
    Scale,
    angle_scale,
    coloured_cells,
    moment_scale,
    nothing,
    rate_scale,
    short_numbers,
    spread,
    time_label,
)
from sindyjoint.reporting.results.discovery_data import Loop, ReportData, run_labels
from sindyjoint.reporting.style import (
    DASHES,
    DIVERGING,
    FIXED_INK,
    INK,
    MUTED,
    PALETTE,
    SEQUENTIAL,
    legend_above,
    plain,
    prefixed,
    shortened,
)
from sindyjoint.text import quantities

MOST_LOOPS = 6
# Beyond this many runs each loop is thinned, so that the page of a hundred runs stays small.
DRAWN_SAMPLES = 24_000
COLOURS = 33


# ---- loops: once as a picture, once to be zoomed


def loop_groups(data: ReportData) -> dict[str, list[Loop]]:
    """Return the runs by frequency; aperiodic ones together."""
    found: dict[str, list[Loop]] = {}
    for loop in data.loops:
        key = f"{loop.frequency:.4g} Hz" if loop.frequency is not None else "aperiodic"
        found.setdefault(key, []).append(loop)
    return found


def _loop_scales(data: ReportData) -> tuple[Scale, Scale]:
    motion = data.model.joint.motion
    x, y = (np.concatenate([getattr(loop, name) for loop in data.loops]) for name in ("angle", "moment"))
    return angle_scale(motion, x), moment_scale(motion, y)


def _modelled(data: ReportData, loop: Loop) -> Array:
    """Return the model over a loop; where the joint sticks it says no more than "between the two friction levels"."""
    return np.where(loop.moving, loop.model, np.nan) if data.model.terms else np.empty(0)


def loops(data: ReportData, ax: Axes, group: str) -> Axes:
    """Draw measured moment–angle loops of a frequency (colours) and the model over them (black dots)."""
    x, y = _loop_scales(data)
    chosen = spread(loop_groups(data)[group], MOST_LOOPS)
    for loop, color, dash in zip(chosen, PALETTE, DASHES, strict=False):
        angle, modelled = loop.angle * x.factor, _modelled(data, loop) * y.factor
        label = loop.run if loop.level is None else f"level {loop.level}"
        ax.plot(angle, loop.moment * y.factor, color=color, linestyle=dash, label=plain(shortened(label)))
        every = max(1, modelled.size // 90)
        if modelled.size:
            ax.plot(
                angle[::every], modelled[::every], color=INK, linestyle="none", marker=".", markersize=1.8
            )
    if data.model.terms:
        ax.plot([], [], color=INK, linestyle="none", marker=".", markersize=3, label="model, moving")
    ax.set(xlabel=x.label, ylabel=y.label, title=plain(shortened(group)))
    legend_above(ax, -(-(len(chosen) + bool(data.model.terms)) // 2), columns=2)
    return ax


def loops_payload(data: ReportData) -> dict[str, Any]:
    """Return the loops for zooming, by frequency."""
    x, y = _loop_scales(data)
    step = max(1, -(-sum(loop.angle.size for loop in data.loops) // DRAWN_SAMPLES))
    labels = dict(zip((loop.run for loop in data.loops), run_labels(data.loops), strict=True))
    groups = {loop.run: group for group, members in loop_groups(data).items() for loop in members}
    return {
        "x": x.to_dict(),
        "y": y.to_dict(),
        "palette": PALETTE,
        "runs": [
            {
                "label": labels[loop.run],
                "run": loop.run,
                "group": groups[loop.run],
                "x": short_numbers(loop.angle[::step] * x.factor),
                "y": short_numbers(loop.moment[::step] * y.factor),
                "model": short_numbers(_modelled(data, loop)[::step] * y.factor),
            }
            for loop in data.loops
        ],
    }


# ---- the force–state map: its cells, its cuts, and the whole of it to be turned


def _map_scales(data: ReportData) -> tuple[Scale, Scale, Scale]:
    motion, surface = data.model.joint.motion, data.surface
    angle, rate = angle_scale(motion, surface.angle_edges), rate_scale(data.model, surface.rate_edges[-1])
    return angle, rate, moment_scale(motion, surface.moment)


def _cells(
    data: ReportData, ax: Axes, values: Array, colours: str, limits: tuple[float, float], label: str
) -> None:
    x, y, _ = _map_scales(data)
    axes = ((data.surface.angle_edges, x), (data.surface.rate_edges, y))
    coloured_cells(ax, axes, values, colours, limits, label)


def map_moment(data: ReportData, ax: Axes) -> Axes:
    """Draw the averaged transfer moment of every cell, with the model's contours over it."""
    z = _map_scales(data)[2]
    limit = float(np.nanmax(np.abs(data.surface.moment))) * z.factor
    _cells(data, ax, data.surface.moment * z.factor, DIVERGING, (-limit, limit), z.unit)
    if data.model.terms:
        _contours(data, ax, limit)
    mean = f"Mean {quantities(data.model.joint.motion).moment.lower()}"
    ax.set_title(mean + (", model contours" if data.model.terms else ""))
    return ax


def _contours(data: ReportData, ax: Axes, limit: float) -> None:
    x, y, z = _map_scales(data)
    levels = np.linspace(-limit, limit, 9)[1:-1]
    top = float(data.surface.rate_edges[-1])
    rates = np.linspace(0, top, data.upper.shape[1])
    for sheet, side in ((data.upper * z.factor, rates), (data.lower * z.factor, rates - top)):
        # A field without the level has no contour to draw, and matplotlib would warn.
        inside = levels[(levels > sheet.min()) & (levels < sheet.max())]
        if inside.size:
            ax.contour(
                _nodes(data) * x.factor, side * y.factor, sheet.T, levels=inside, colors=FIXED_INK, linewidths=0.5
            )  # fmt: skip


def _nodes(data: ReportData) -> Array:
    """Return the angles at which the model's sheets are known."""
    edges = data.surface.angle_edges
    return np.linspace(edges[0], edges[-1], data.upper.shape[0])


def map_counts(data: ReportData, ax: Axes) -> Axes:
    """Draw how many moving samples each cell holds."""
    counts = np.where(data.surface.filled, data.surface.count.astype(float), np.nan)
    _cells(data, ax, counts, SEQUENTIAL, (0.0, float(np.nanmax(counts))), "samples")
    ax.set_title("Moving samples per cell")
    return ax


def map_residual(data: ReportData, ax: Axes) -> Axes:
    """Draw the mean residual, measured less model, of every cell."""
    limit = float(np.nanmax(np.abs(data.residual_map.moment))) or 1.0
    z = moment_scale(data.model.joint.motion, limit)
    shown = data.residual_map.moment * z.factor
    _cells(data, ax, shown, DIVERGING, (-limit * z.factor, limit * z.factor), z.unit)
    ax.set_title("Mean residual, measured less model")
    return ax


def cut_at_zero_rate(data: ReportData, ax: Axes) -> Axes:
    """Draw the cut at θ̇ = 0: cell means just above and just below, the model, and the friction step between."""
    q, surface = quantities(data.model.joint.motion), data.surface
    x, _, z = _map_scales(data)
    middle = surface.n // 2
    sides = ((middle, data.upper[:, 0], ">"), (middle - 1, data.lower[:, -1], "<"))
    for index, (column, sheet, sign) in enumerate(sides):
        near = _nearest(data, column, 1 if sign == ">" else -1)
        cells = np.flatnonzero(near >= 0), near[near >= 0]
        angle, colour = surface.angle[cells], PALETTE[index]
        ax.plot(
            angle * x.factor, surface.moment[cells] * z.factor, linestyle="none", marker="os"[index], markersize=3,
            color=colour, label=f"slowest cells, {q.rate_symbol} {sign} 0",
        )  # fmt: skip
        if data.model.terms:
            modelled = data.model.moment(angle, surface.rate[cells]) * z.factor
            ax.plot(angle * x.factor, modelled, linestyle="none", marker=".", markersize=2.5, color=INK)
            ax.plot(_nodes(data) * x.factor, sheet * z.factor, color=colour, linestyle=("-", "--")[index])
    if data.model.terms:
        _mark_step(data, ax, x, z)
        ax.plot([], [], linestyle="none", marker=".", markersize=4, color=INK, label="model in those cells")
        ax.plot([], [], color=MUTED, label=f"model at {q.rate_symbol} = 0±")
    ax.set(xlabel=x.label, ylabel=z.label, title=f"Cut at {q.rate_symbol} = 0")
    legend_above(ax, 4 if data.model.terms else 2)
    return ax


def _nearest(data: ReportData, column: int, direction: int) -> Any:
    """Return, for each angle, the filled cell nearest to zero rate within a quarter of the rates; −1 without one."""
    reach = max(1, data.surface.n // 8)
    columns = [c for c in range(column, column + direction * reach, direction) if 0 <= c < data.surface.n]
    rows = range(data.surface.n)
    return np.array([next((c for c in columns if data.surface.filled[row, c]), -1) for row in rows])


def _mark_step(data: ReportData, ax: Axes, x: Scale, z: Scale) -> None:
    """Mark the jump of the model at zero rate."""
    row = data.upper.shape[0] // 2
    above, below = data.upper[row, 0] * z.factor, data.lower[row, -1] * z.factor
    if abs(above - below) < 0.02 * float(np.nanmax(np.abs(data.surface.moment))) * z.factor:
        return
    middle = 0.5 * float(data.surface.angle_edges[0] + data.surface.angle_edges[-1]) * x.factor
    look = {"arrowstyle": "<->", "color": INK, "linewidth": 0.8}
    ax.annotate("", (middle, above), (middle, below), arrowprops=look)
    # In the corner, where neither of the two rising curves passes.
    step = f"step {above - below:.3g} {z.unit}"
    ax.text(0.98, 0.03, step, fontsize=7, ha="right", transform=ax.transAxes)


def cut_at_centre(data: ReportData, ax: Axes) -> Axes:
    """Draw the cut at the middle of the tested angles: cell means and model over θ̇, with the friction step."""
    q, surface = quantities(data.model.joint.motion), data.surface
    x, y, z = _map_scales(data)
    edges = surface.angle_edges
    middle, quarter = 0.5 * float(edges[0] + edges[-1]), 0.25 * float(edges[-1] - edges[0])
    centre = 0.0 if abs(middle) < quarter else middle
    row = int(np.clip(np.searchsorted(edges, centre, side="right") - 1, 0, surface.n - 1))
    cells = row, np.flatnonzero(surface.filled[row])
    ax.errorbar(
        surface.rate[cells] * y.factor, surface.moment[cells] * z.factor, yerr=surface.spread[cells] * z.factor,
        linestyle="none", marker="o", markersize=3, elinewidth=0.7, color=PALETTE[0], label="cell mean ± spread",
    )  # fmt: skip
    if data.model.terms:
        top = float(surface.rate_edges[-1])
        sides = np.linspace(-top, -1e-9 * top, 60), [np.nan], np.linspace(1e-9 * top, top, 60)
        rates = np.concatenate(sides)
        # The mean angle within the cell: comparing at its middle would show the width of the cell as a misfit.
        angle = float(np.average(surface.angle[cells], weights=surface.count[cells]))
        modelled = data.model.moment(np.full_like(rates, angle), rates)
        ax.plot(rates * y.factor, modelled * z.factor, color=INK, label="model")
    at = f"{q.angle_symbol} = {centre * x.factor:.3g}" + (f" {x.unit}" if centre else "")
    ax.set(xlabel=y.label, ylabel=z.label, title=f"Cut at {at}")
    legend_above(ax, 2)
    return ax


def map_payload(data: ReportData) -> dict[str, Any]:
    """Return the force–state map for turning: cells, the model's two sheets, axes."""
    x, y, z = _map_scales(data)
    surface, has_model = data.surface, bool(data.model.terms)
    values = [field * z.factor for field in (surface.moment, surface.spread, data.residual_map.moment)]
    cells = zip(*np.nonzero(surface.filled), strict=True)
    return {
        "axes": [
            x.to_dict() | {"edges": short_numbers(surface.angle_edges * x.factor)},
            y.to_dict() | {"edges": short_numbers(surface.rate_edges * y.factor)},
            z.to_dict(),
        ],
        "cells": [
            [int(i), int(j), int(surface.count[i, j]), *(short_numbers(field[i, j]) for field in values)]
            for i, j in cells
        ],
        "upper": short_numbers(data.upper * z.factor) if has_model else [],
        "lower": short_numbers(data.lower * z.factor) if has_model else [],
        "colours": {"moment": _ramp(DIVERGING), "residual": _ramp(DIVERGING), "count": _ramp(SEQUENTIAL)},
    }


@cache
def _ramp(name: str) -> list[str]:
    """Return a matplotlib colour map as a short list of colours."""
    from matplotlib import colormaps
    from matplotlib.colors import to_hex

    return [to_hex(colormaps[name](position)) for position in np.linspace(0, 1, COLOURS)]


# ---- the residual


def residual_phase(data: ReportData, ax: Axes) -> Axes:
    """Draw the mean residual over the phase of the cycle, one line per frequency; gaps where the joint sticks."""
    q = quantities(data.model.joint.motion)
    lines: dict[str, Any] = {}
    for group, members in loop_groups(data).items():
        folded = [loop.residual_over_phase for loop in members if loop.residual_over_phase.size]
        if folded:
            stacked = np.array(folded)
            known = np.count_nonzero(np.isfinite(stacked), axis=0)
            with np.errstate(invalid="ignore"):
                lines[group] = np.where(known, np.nansum(stacked, axis=0) / known, np.nan)
    if not lines:
        return nothing(ax, "no periodic run: there is no phase to fold on")
    factor, unit = prefixed(_top([*lines.values(), np.array([data.model.fitted.noise_floor])]), q.moment_unit)
    for group, color, dash in zip(spread(list(lines), MOST_LOOPS), PALETTE, DASHES, strict=False):
        phase = (np.arange(lines[group].size) + 0.5) * 360 / lines[group].size
        ax.plot(phase, lines[group] * factor, color=color, linestyle=dash, label=plain(shortened(group)))
    ax.axhline(0, color=INK, linewidth=0.6)
    known = any(np.isfinite(values).any() for values in lines.values())
    top = _top(list(lines.values())) * factor if known else 1.0
    ax.set(
        xlim=(0, 360), xticks=range(0, 361, 90), xlabel=f"Phase from the largest {q.angle.lower()} (°)",
        ylabel=f"Mean residual ({unit})", title="Residual over the cycle", ylim=(-1.15 * top, 1.9 * top),
    )  # fmt: skip
    ax.legend(loc="upper center", ncols=3, columnspacing=1.0)
    return ax


def residual_time(data: ReportData, ax: Axes) -> Axes:
    """Draw the RMS residual in intervals of time, with the noise floor."""
    labels = dict(zip((loop.run for loop in data.loops), run_labels(data.loops), strict=True))
    chosen = spread(data.loops, MOST_LOOPS)
    fitted, motion = data.model.fitted, data.model.joint.motion
    top = _top([loop.residual_over_time for loop in chosen])
    factor, unit = prefixed(top, quantities(motion).moment_unit)
    for loop, color, dash in zip(chosen, PALETTE, DASHES, strict=False):
        label = plain(shortened(labels[loop.run], 18))
        ax.plot(loop.time, loop.residual_over_time * factor, color=color, linestyle=dash, label=label)
    floor = fitted.noise_floor
    if np.isfinite(floor):
        ax.axhline(floor * factor, color=MUTED, linewidth=1.6, linestyle="-", zorder=1, label="noise floor")
    known = [run for loop in chosen if np.isfinite(run := loop.residual_over_time).any()]
    shown = "" if len(chosen) == len(data.loops) else f", {len(chosen)} of {len(data.loops)} runs"
    ax.set(
        ylim=(0, 1.05 * factor * max([np.nan_to_num(floor), *map(np.nanmax, known)])),
        xlabel=time_label(fitted.quasi_static, motion), ylabel=f"RMS residual ({unit})",
        title=f"Residual over time{shown}",
    )  # fmt: skip
    legend_above(ax, 1 + -(-(len(chosen) + 1) // 2), columns=2)
    return ax


def _top(arrays: list[Any]) -> float:
    finite = [np.abs(a[np.isfinite(a)]) for a in arrays]
    return max((float(a.max()) for a in finite if a.size), default=1.0)
