"""Pictures of a discovery over the state: loops, force–state map and cuts, where the residual lies."""

from functools import cache
from typing import Any

import numpy as np

from sindyjoint.numeric import Array
from sindyjoint.reporting.figure import (
    Curve,
    Scale,
    angle_scale,
    coloured_cells,
    cycled,
    moment_cells,
    moment_scale,
    nothing,
    plot,
    rate_scale,
    scaled,
    short_numbers,
    spread,
    time_label,
)
from sindyjoint.reporting.results.discovery_data import PHASE_BINS, Loop, ReportData, run_labels
from sindyjoint.reporting.style import DIVERGING, FIXED_INK, INK, MUTED, PALETTE, SEQUENTIAL, Axes, shortened
from sindyjoint.text import quantities

NOISE_FLOOR: Any = {"color": MUTED, "lw": 1.6, "zorder": 1, "label": "noise floor"}

# ---- loops: once as a picture, once to be zoomed


def loop_groups(data: ReportData) -> dict[str, list[Loop]]:
    """Return the runs by frequency; aperiodic ones together."""
    keys = ["aperiodic" if loop.frequency is None else f"{loop.frequency:.4g} Hz" for loop in data.loops]
    return {
        group: [loop for key, loop in zip(keys, data.loops, strict=True) if key == group] for group in keys
    }


def _loop_scales(data: ReportData) -> tuple[Scale, Scale]:
    motion = data.model.joint.motion
    x, y = (np.concatenate([getattr(loop, name) for loop in data.loops]) for name in ("angle", "moment"))
    return angle_scale(motion, x), moment_scale(motion, y)


def _modelled(data: ReportData, loop: Loop) -> Array:
    """Return the model over a loop; where the joint sticks it says no more than "between the two friction levels"."""
    return np.where(loop.moving, loop.model, np.nan) if data.model.terms else np.empty(0)


def loops(data: ReportData, ax: Axes, group: str) -> None:
    """Draw measured moment–angle loops of a frequency (colours) and the model over them (black dots)."""
    dots: Any = {"color": INK, "ls": "none", "marker": "."}
    has_model = bool(data.model.terms)
    curves: list[Curve] = []
    for place, loop in enumerate(spread(loop_groups(data)[group])):
        label = loop.run if loop.level is None else f"level {loop.level}"
        every = slice(None, None, max(1, loop.angle.size // 90))
        model = loop.angle[every], _modelled(data, loop)[every], dots | {"ms": 1.8}
        curves += [(loop.angle, loop.moment, cycled(place, label=shortened(label))), model][: 1 + has_model]
    curves += [([], [], dots | {"ms": 3, "label": "model, moving"})] * has_model
    plot(ax, *_loop_scales(data), curves, group, columns=2)


def loops_payload(data: ReportData) -> dict[str, Any]:
    """Return the loops for zooming, by frequency."""
    x, y = _loop_scales(data)
    # Beyond this many runs each loop is thinned, so that the page of a hundred runs stays small.
    step = max(1, -(-sum(loop.angle.size for loop in data.loops) // 24_000))
    labels = run_labels(data.loops)
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


def map_moment(data: ReportData, ax: Axes) -> None:
    """Draw the averaged transfer moment of every cell, with the model's contours over it."""
    mean = f"Mean {quantities(data.model.joint.motion).moment.lower()}"
    moment_cells(ax, data.surface, data.model, mean + ", model contours" * bool(data.model.terms))
    if data.model.terms:
        _contours(data, ax)


def _contours(data: ReportData, ax: Axes) -> None:
    x, y, z = _map_scales(data)
    limit = float(np.nanmax(np.abs(data.surface.moment))) * z.factor
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


def map_counts(data: ReportData, ax: Axes) -> None:
    """Draw how many moving samples each cell holds."""
    counts = np.where(data.surface.filled, data.surface.count.astype(float), np.nan)
    coloured_cells(
        ax, data.surface, data.model, counts, (0.0, float(np.nanmax(counts))), "samples",
        "Moving samples per cell",
    )  # fmt: skip


def map_residual(data: ReportData, ax: Axes) -> None:
    """Draw the mean residual, measured less model, of every cell."""
    moment_cells(ax, data.residual_map, data.model, "Mean residual, measured less model")


def cut_at_zero_rate(data: ReportData, ax: Axes) -> None:
    """Draw the cut at θ̇ = 0: cell means just above and just below, the model, and the friction step between."""
    q, surface = quantities(data.model.joint.motion), data.surface
    x, _, z = _map_scales(data)
    middle, dots = surface.n // 2, {"ls": "none", "marker": ".", "color": INK}
    sides = (1, ">", "o", "-", data.upper[:, 0]), (-1, "<", "s", "--", data.lower[:, -1])
    curves: list[Curve] = []
    for color, (side, sign, marker, dashes, sheet) in zip(PALETTE, sides, strict=False):
        near = _nearest(data, middle - (side < 0), side)
        cells = np.flatnonzero(near >= 0), near[near >= 0]
        angle, label = surface.angle[cells], f"slowest cells, {q.rate_symbol} {sign} 0"
        marks = {"color": color, "ls": "none", "marker": marker, "ms": 3, "label": label}
        curves.append((angle, surface.moment[cells], marks))
        if data.model.terms:
            curves += [
                (angle, data.model.moment(angle, surface.rate[cells]), dots | {"ms": 2.5}),
                (_nodes(data), sheet, {"color": color, "ls": dashes}),
            ]
    if data.model.terms:
        _mark_step(data, ax, x, z)
        curves += [
            ([], [], dots | {"ms": 4, "label": "model in those cells"}),
            ([], [], {"color": MUTED, "label": f"model at {q.rate_symbol} = 0±"}),
        ]
    plot(ax, x, z, curves, f"Cut at {q.rate_symbol} = 0")


def _nearest(data: ReportData, column: int, direction: int) -> Any:
    """Return, for each angle, the filled cell nearest to zero rate within a quarter of the rates; −1 without one."""
    reach = max(1, data.surface.n // 8)
    columns = [c for c in range(column, column + direction * reach, direction) if 0 <= c < data.surface.n]
    return np.array([next((c for c in columns if row[c]), -1) for row in data.surface.filled])


def _mark_step(data: ReportData, ax: Axes, x: Scale, z: Scale) -> None:
    """Mark the jump of the model at zero rate."""
    row = data.upper.shape[0] // 2
    above, below = data.upper[row, 0] * z.factor, data.lower[row, -1] * z.factor
    if abs(above - below) < 0.02 * float(np.nanmax(np.abs(data.surface.moment))) * z.factor:
        return
    middle = 0.5 * float(data.surface.angle_edges[0] + data.surface.angle_edges[-1]) * x.factor
    ax.annotate(
        "", (middle, above), (middle, below), arrowprops={"arrowstyle": "<->", "color": INK, "linewidth": 0.8}
    )
    # In the corner, where neither of the two rising curves passes.
    ax.text(0.98, 0.03, f"step {above - below:.3g} {z.unit}", fontsize=7, ha="right", transform=ax.transAxes)


def cut_at_centre(data: ReportData, ax: Axes) -> None:
    """Draw the cut at the middle of the tested angles: cell means and model over θ̇, with the friction step."""
    q, surface = quantities(data.model.joint.motion), data.surface
    x, y, z = _map_scales(data)
    edges = surface.angle_edges
    middle, quarter = 0.5 * float(edges[0] + edges[-1]), 0.25 * float(edges[-1] - edges[0])
    centre = 0.0 if abs(middle) < quarter else middle
    row = int(np.clip(np.searchsorted(edges, centre, side="right") - 1, 0, surface.n - 1))
    cells = row, np.flatnonzero(surface.filled[row])
    means: Any = {"fmt": "o", "ms": 3, "elinewidth": 0.7, "color": PALETTE[0], "label": "cell mean ± spread"}
    curves = [(surface.rate[cells], surface.moment[cells], means | {"yerr": surface.spread[cells]})]
    if data.model.terms:
        top = float(surface.rate_edges[-1])
        positive = np.linspace(1e-9 * top, top, 60)
        rates = np.concatenate([-positive[::-1], [np.nan], positive])
        # The mean angle within the cell: comparing at its middle would show the width of the cell as a misfit.
        angle = float(np.average(surface.angle[cells], weights=surface.count[cells]))
        curves.append(
            (rates, data.model.moment(np.full_like(rates, angle), rates), {"color": INK, "label": "model"})
        )
    unit = f" {x.unit}" if centre else ""
    plot(ax, y, z, curves, f"Cut at {q.angle_symbol} = {centre * x.factor:.3g}{unit}")


def map_payload(data: ReportData) -> dict[str, Any]:
    """Return the force–state map for turning: cells, the model's two sheets, axes."""
    x, y, z = _map_scales(data)
    surface, has_model = data.surface, bool(data.model.terms)
    values = [field * z.factor for field in (surface.moment, surface.spread, data.residual_map.moment)]
    return {
        "axes": [
            x.to_dict() | {"edges": short_numbers(surface.angle_edges * x.factor)},
            y.to_dict() | {"edges": short_numbers(surface.rate_edges * y.factor)},
            z.to_dict(),
        ],
        "cells": [
            [int(i), int(j), int(surface.count[i, j]), *(short_numbers(field[i, j]) for field in values)]
            for i, j in np.argwhere(surface.filled)
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

    return [to_hex(colormaps[name](position)) for position in np.linspace(0, 1, 33)]


# ---- the residual


def residual_phase(data: ReportData, ax: Axes) -> None:
    """Draw the mean residual over the phase of the cycle, one line per frequency; gaps where the joint sticks."""
    q = quantities(data.model.joint.motion)
    lines = {
        group: np.ma.masked_invalid(courses).mean(axis=0).filled(np.nan)
        for group, members in loop_groups(data).items()
        if (courses := [loop.residual_over_phase for loop in members if loop.residual_over_phase.size])
    }
    if not lines:
        return nothing(ax, "no periodic run: there is no phase to fold on")
    top = _top(list(lines.values()))
    phase = (np.arange(PHASE_BINS) + 0.5) * 360 / PHASE_BINS
    curves = [
        (phase, lines[group], cycled(place, label=group)) for place, group in enumerate(spread(list(lines)))
    ]
    up = scaled("Mean residual", max(top, np.nan_to_num(data.model.fitted.noise_floor)), q.moment_unit)
    plot(
        ax,
        f"Phase from the largest {q.angle.lower()} (°)",
        up,
        [*curves, (None, 0, {"color": INK, "lw": 0.6})],
        "Residual over the cycle",
        legend="upper center",
        columns=3,
        xlim=(0, 360),
        xticks=range(0, 361, 90),
        ylim=(-1.15 * top * up.factor, 1.9 * top * up.factor),
    )


def residual_time(data: ReportData, ax: Axes) -> None:
    """Draw the RMS residual in intervals of time, with the noise floor."""
    labels, chosen, fitted = run_labels(data.loops), spread(data.loops), data.model.fitted
    motion, floor = data.model.joint.motion, fitted.noise_floor
    curves: list[Curve] = [
        *(
            (loop.time, loop.residual_over_time, cycled(place, label=shortened(labels[loop.run], 18)))
            for place, loop in enumerate(chosen)
        ),
        (None, floor, NOISE_FLOOR),
    ]
    top = _top([loop.residual_over_time for loop in chosen])
    up = scaled("RMS residual", top, quantities(motion).moment_unit)
    shown = "" if len(chosen) == len(data.loops) else f", {len(chosen)} of {len(data.loops)} runs"
    ends = (0, 1.05 * up.factor * max(top, float(np.nan_to_num(floor))))
    across = time_label(fitted.quasi_static, motion)
    plot(ax, across, up, curves, f"Residual over time{shown}", columns=2, ylim=ends)


def _top(arrays: list[Any]) -> float:
    finite = [np.abs(a[np.isfinite(a)]) for a in arrays]
    return max((float(a.max()) for a in finite if a.size), default=1.0)
