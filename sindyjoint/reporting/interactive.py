"""What the page's drawings need, scaled to the units that they show."""

from __future__ import annotations

from collections.abc import Sequence
from functools import cache
from typing import Any

import numpy as np

from sindyjoint.reporting.data import ReportData, run_labels
from sindyjoint.reporting.figures.loops import loop_groups
from sindyjoint.reporting.figures.verification import UNITS
from sindyjoint.reporting.style import DIVERGING, INK, PALETTE, SEQUENTIAL, prefixed
from sindyjoint.response.verification import RunVerification
from sindyjoint.text import quantities

# Beyond this many runs each loop is thinned, so that the page of a hundred runs stays small.
DRAWN_SAMPLES = 24_000
COLOURS = 33
# What a screen shows of one response.
RESPONSE_SAMPLES = 3000


def map_payload(data: ReportData) -> dict[str, Any]:
    """Return the force–state map for turning: cells, the model's two sheets, axes."""
    q, surface = quantities(data.model.joint.motion), data.surface
    x, x_unit = prefixed(float(np.max(np.abs(surface.angle_edges))), q.angle_unit)
    y, y_unit = prefixed(float(surface.rate_edges[-1]), q.rate_unit)
    z, z_unit = prefixed(float(np.nanmax(np.abs(surface.moment))), q.moment_unit)
    rows, columns = np.nonzero(surface.filled)
    cells = [
        [
            int(i),
            int(j),
            int(surface.count[i, j]),
            _short(surface.moment[i, j] * z),
            _short(surface.spread[i, j] * z),
            _short(data.residual_map.moment[i, j] * z),
        ]
        for i, j in zip(rows, columns, strict=True)
    ]
    has_model = bool(data.model.terms)
    return {
        "axes": [
            _axis(q.angle, q.angle_symbol, x_unit, surface.angle_edges * x),
            _axis("Direction", f"d{q.angle_symbol}/ds", "1", surface.rate_edges)
            if data.model.fitted.quasi_static
            else _axis(q.rate, q.rate_symbol, y_unit, surface.rate_edges * y),
            {"name": q.transfer, "unit": z_unit},
        ],
        "cells": cells,
        "upper": _rows(data.upper * z) if has_model else [],
        "lower": _rows(data.lower * z) if has_model else [],
        "colours": {"moment": _ramp(DIVERGING), "residual": _ramp(DIVERGING), "count": _ramp(SEQUENTIAL)},
    }


def loops_payload(data: ReportData) -> dict[str, Any]:
    """Return the loops for zooming, by frequency."""
    q = quantities(data.model.joint.motion)
    x, x_unit = prefixed(max(float(np.max(np.abs(loop.angle))) for loop in data.loops), q.angle_unit)
    y, y_unit = prefixed(max(float(np.max(np.abs(loop.moment))) for loop in data.loops), q.moment_unit)
    step = max(1, -(-sum(loop.angle.size for loop in data.loops) // DRAWN_SAMPLES))
    labels = dict(zip((loop.run for loop in data.loops), run_labels(data.loops), strict=True))
    groups = {loop.run: group for group, members in loop_groups(data).items() for loop in members}
    has_model = bool(data.model.terms)
    return {
        "x": _label(q.angle, q.angle_symbol, x_unit),
        "y": _label(q.transfer, "", y_unit),
        "palette": PALETTE,
        "runs": [
            {
                "label": labels[loop.run],
                "run": loop.run,
                "group": groups[loop.run],
                "x": _numbers(loop.angle[::step] * x),
                "y": _numbers(loop.moment[::step] * y),
                "model": _numbers(np.where(loop.moving, loop.model * y, np.nan)[::step]) if has_model else [],
            }
            for loop in data.loops
        ],
    }


def response_payload(runs: Sequence[RunVerification], virtual: bool = False) -> dict[str, Any]:
    """Return the response over time, of the runs (of a virtual test) and as simulated, for zooming, run by run."""
    curves = []
    of_runs = "virtual test" if virtual else "measured"
    for run in runs:
        factor, unit = prefixed(float(np.max(np.abs(run.measured))), UNITS[run.channel])
        step = -(-run.time.size // RESPONSE_SAMPLES)
        for label, signal in ((of_runs, run.measured), ("simulated", run.simulated)):
            if signal is not None:
                curves.append(
                    {
                        "label": label,
                        "run": f"{run.name}, {label}",
                        "group": run.name,
                        "x": _numbers(run.time[::step]),
                        "y": _numbers(signal[::step] * factor),
                        "model": [],
                        "axis": {"name": run.channel.capitalize(), "unit": unit},
                    }
                )
    return {
        "x": _path(runs[0].channel) if runs and runs[0].drive == "path" else _label("Time", "t", "s"),
        "y": {"name": "Response", "unit": ""},
        "palette": (PALETTE[0], PALETTE[1], INK),
        "each": True,
        "runs": curves,
    }


def _axis(name: str, symbol: str, unit: str, edges: Any) -> dict[str, Any]:
    return {"name": name, "symbol": symbol, "unit": unit, "edges": _numbers(edges)}


def _path(channel: str) -> dict[str, str]:
    """Return the label of the travelled path, which takes the place of a time that is not known."""
    return _label("Travelled path", "s", "m" if channel == "force" else "rad")


def _label(name: str, symbol: str, unit: str) -> dict[str, str]:
    return {"name": name, "symbol": symbol, "unit": unit}


def _short(value: float) -> float | None:
    return float(f"{value:.4g}") if np.isfinite(value) else None


def _numbers(values: Any) -> list[float | None]:
    return [_short(float(value)) for value in np.asarray(values)]


def _rows(values: Any) -> list[list[float | None]]:
    return [_numbers(row) for row in values]


@cache
def _ramp(name: str) -> list[str]:
    """Return a matplotlib colour map as a short list of colours."""
    from matplotlib import colormaps
    from matplotlib.colors import to_hex

    return [to_hex(colormaps[name](position)) for position in np.linspace(0, 1, COLOURS)]
