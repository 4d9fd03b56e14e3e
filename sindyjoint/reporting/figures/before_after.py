"""A campaign and its model before and after effects were added: maps, loops, residuals."""

from __future__ import annotations

from collections.abc import Sequence
from functools import partial
from typing import TYPE_CHECKING, Any

import numpy as np

from sindyjoint.numeric import Array
from sindyjoint.reporting.figures.kind import Panel, spread
from sindyjoint.reporting.figures.labels import rate_label, time_label
from sindyjoint.reporting.figures.layout import colour_scale
from sindyjoint.reporting.style import (
    DIVERGING,
    INK,
    MUTED,
    PALETTE,
    legend_above,
    plain,
    prefixed,
    shortened,
)
from sindyjoint.text import quantities

if TYPE_CHECKING:
    from matplotlib.axes import Axes

    from sindyjoint.diagnosis.result import Diagnosis, RunGap


CELLS = 24
SHOWN = 2  # runs


def maps(result: Diagnosis) -> list[Panel]:
    """Return the maps of the residual before and, where effects were added, after."""
    if not result.before:
        return []
    before = partial(_map, runs=result.before, title="Residual of the model alone", scale=not result.after)
    if not result.after:
        return [before]
    return [
        before,
        partial(_map, runs=result.after, title="Residual with the effects, same colours", scale=True),
    ]


def overlays(result: Diagnosis) -> list[Panel]:
    """Return measured and modelled curves and residuals of the runs of the largest and the smallest amplitude."""
    after = {run.run: run for run in result.after}
    panels: list[Panel] = []
    for run in spread(sorted(result.before, key=lambda run: -float(np.ptp(run.angle))), SHOWN):
        panels += [partial(draw, before=run, after=after.get(run.run)) for draw in (_loop, _residual)]
    return panels


def _map(result: Diagnosis, ax: Axes, runs: Sequence[RunGap], title: str, scale: bool) -> Axes:
    """Draw the mean residual in cells of (θ, θ̇); the colours are those of the map before."""
    q = quantities(result.model.joint.motion)
    edges = [_edges(result.before, name) for name in ("angle", "rate")]
    limit = float(np.nanmax(np.abs(_cells(result.before, edges)))) or 1.0
    factor, unit = prefixed(limit, q.moment_unit)
    (x_factor, x_unit), (y_factor, y_unit) = (
        prefixed(float(np.abs(e).max()), u) for e, u in zip(edges, (q.angle_unit, q.rate_unit), strict=True)
    )
    mesh = ax.pcolormesh(
        edges[0] * x_factor,
        edges[1] * y_factor,
        np.ma.masked_invalid(_cells(runs, edges).T * factor),
        cmap=DIVERGING,
        vmin=-limit * factor,
        vmax=limit * factor,
        rasterized=True,
    )
    ax.grid(False)
    if scale:
        colour_scale(ax, mesh, f"mean of measured less model ({unit})")
    ax.set(
        xlabel=f"{q.angle} {q.angle_symbol} ({x_unit})", ylabel=rate_label(result.model, y_unit), title=title
    )
    return ax


def _edges(runs: Sequence[RunGap], name: str) -> Array:
    values = np.concatenate([getattr(run, name) for run in runs])
    low, high = float(values.min()), float(values.max())
    if name == "rate":
        # Zero rate is an edge, so that no cell averages over the friction step.
        low, high = -max(-low, high), max(-low, high)
    return np.linspace(low, high if high > low else low + 1.0, CELLS + 1)


def _cells(runs: Sequence[RunGap], edges: Sequence[Array]) -> Array:
    """Return the mean residual of every cell, NaN where there is nothing, shape (n, n)."""
    angle, rate, residual = (
        np.concatenate([getattr(run, name) for run in runs]) for name in ("angle", "rate", "residual")
    )
    bins = [edges[0], edges[1]]
    count, *_ = np.histogram2d(angle, rate, bins)
    total, *_ = np.histogram2d(angle, rate, bins, weights=residual)
    mean: Array = np.where(count > 0, total / np.maximum(count, 1), np.nan)
    return mean


_MEASURED = {"color": PALETTE[0], "lw": 2.4, "alpha": 0.45}
_BEFORE: dict[str, Any] = {"color": PALETTE[1], "lw": 0.9, "ls": (0, (4, 1.5))}
_AFTER = {"color": INK, "lw": 0.8}


def _loop(result: Diagnosis, ax: Axes, before: RunGap, after: RunGap | None) -> Axes:
    """Draw the measured moment and the models' over the angle; over time where the run has no frequency."""
    q = quantities(result.model.joint.motion)
    factor, unit = prefixed(float(np.abs(before.measured).max()), q.moment_unit)
    _curve(result, ax, before, before.measured * factor, "measured", _MEASURED)
    _curve(result, ax, before, before.model * factor, "model alone", _BEFORE)
    if after is not None:
        _curve(result, ax, after, after.model * factor, "with the effects", _AFTER)
    _axes(result, ax, before, f"{_measured(result)} ({unit})")
    legend_above(ax, 2, columns=2)
    return ax


def _residual(result: Diagnosis, ax: Axes, before: RunGap, after: RunGap | None) -> Axes:
    """Draw the residuals of a run together with its noise."""
    q = quantities(result.model.joint.motion)
    factor, unit = prefixed(float(np.abs(before.residual).max()), q.moment_unit)
    noise, of = 2 * before.noise * factor, "noise of the mean period" if before.repeats else "noise"
    ax.axhspan(-noise, noise, color=MUTED, alpha=0.2, lw=0, label=f"{of}, ±2σ")
    _curve(result, ax, before, before.residual * factor, "residual of the model alone", _BEFORE)
    if after is not None:
        _curve(result, ax, after, after.residual * factor, "residual with the effects", _AFTER)
    _axes(result, ax, before, f"Measured less model ({unit})")
    legend_above(ax, 3)
    return ax


def _curve(result: Diagnosis, ax: Axes, run: RunGap, values: Array, label: str, look: dict[str, Any]) -> None:
    """Draw a curve in its pieces, which have one entry in the legend."""
    for x, y in _pieces(result, run, values):
        ax.plot(x, y, **look)
    ax.plot([], [], label=label, **look)


def _axes(result: Diagnosis, ax: Axes, run: RunGap, vertical: str) -> None:
    q = quantities(result.model.joint.motion)
    _, unit = _angle_unit(result)
    time = time_label(result.model.fitted.quasi_static, result.model.joint.motion)
    ax.set(xlabel=f"{q.angle} {q.angle_symbol} ({unit})" if run.frequency > 0 else time, ylabel=vertical)
    where = f"{run.frequency:.3g} Hz" + (f", level {run.level}" if run.level else "")
    ax.set_title(plain(shortened(where if run.repeats else run.run)))


def _measured(result: Diagnosis) -> str:
    """Return what the rows are: less the inertia's moment, unless the inertia is among the terms."""
    q = quantities(result.model.joint.motion)
    return q.moment if "inertia" in result.model.ids else q.transfer


def _angle_unit(result: Diagnosis) -> tuple[float, str]:
    q = quantities(result.model.joint.motion)
    return prefixed(max(float(np.abs(run.angle).max()) for run in result.before), q.angle_unit)


def _pieces(result: Diagnosis, run: RunGap, values: Array) -> list[tuple[Array, Array]]:
    """Return curves to draw: of a mean period by direction of motion, of another run by unbroken parts of a segment.

    Samples in which the joint sticks are no part of either, and no line crosses them.
    """
    factor, _ = _angle_unit(result)
    time, rate = run.time[: run.curve], run.rate[: run.curve]
    cut = np.diff(time) > 1.5 * np.median(np.diff(time))
    if run.repeats:
        cut |= np.diff(np.sign(rate)) != 0
    x = run.angle * factor if run.frequency > 0 else run.time
    return [(x[part], values[part]) for part in np.split(np.arange(run.curve), np.flatnonzero(cut) + 1)]
