"""Where in the cycle, and when, the model and the measurement disagree."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from sindyjoint.reporting.data import ReportData, run_labels
from sindyjoint.reporting.figures.kind import spread
from sindyjoint.reporting.figures.labels import time_label
from sindyjoint.reporting.figures.loops import MOST_LOOPS, loop_groups
from sindyjoint.reporting.style import DASHES, INK, MUTED, PALETTE, legend_above, plain, prefixed, shortened
from sindyjoint.text import quantities

if TYPE_CHECKING:
    from matplotlib.axes import Axes


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
    for index, (group, values) in enumerate(_few(lines).items()):
        phase = (np.arange(values.size) + 0.5) * 360 / values.size
        ax.plot(
            phase,
            values * factor,
            color=PALETTE[index],
            linestyle=DASHES[index],
            label=plain(shortened(group)),
        )
    ax.axhline(0, color=INK, linewidth=0.6)
    ax.set(
        xlim=(0, 360),
        xticks=range(0, 361, 90),
        xlabel=f"Phase from the largest {q.angle.lower()} (°)",
        ylabel=f"Mean residual ({unit})",
        title="Residual over the cycle",
    )
    top = (
        1.0 if not any(np.isfinite(v).any() for v in lines.values()) else _top(list(lines.values())) * factor
    )
    ax.set_ylim(-1.15 * top, 1.9 * top)
    ax.legend(loc="upper center", ncols=3, columnspacing=1.0)
    return ax


def residual_time(data: ReportData, ax: Axes) -> Axes:
    """Draw the RMS residual in intervals of time, with the noise floor."""
    q = quantities(data.model.joint.motion)
    labels = dict(zip((loop.run for loop in data.loops), run_labels(data.loops), strict=True))
    chosen = spread(data.loops, MOST_LOOPS)
    floor = data.model.fitted.noise_floor
    factor, unit = prefixed(_top([loop.residual_over_time for loop in chosen]), q.moment_unit)
    for index, loop in enumerate(chosen):
        ax.plot(
            loop.time,
            loop.residual_over_time * factor,
            color=PALETTE[index],
            linestyle=DASHES[index],
            label=plain(shortened(labels[loop.run], 18)),
        )
    if np.isfinite(floor):
        ax.axhline(floor * factor, color=MUTED, linewidth=1.6, linestyle="-", zorder=1, label="noise floor")
    tops = [
        np.nanmax(loop.residual_over_time) for loop in chosen if np.isfinite(loop.residual_over_time).any()
    ]
    ax.set_ylim(0, 1.05 * factor * max([np.nan_to_num(floor), *tops]))
    fitted = data.model.fitted
    ax.set(xlabel=time_label(fitted.quasi_static, data.model.joint.motion), ylabel=f"RMS residual ({unit})")
    shown = "" if len(chosen) == len(data.loops) else f", {len(chosen)} of {len(data.loops)} runs"
    ax.set_title(f"Residual over time{shown}")
    legend_above(ax, 1 + -(-(len(chosen) + 1) // 2), columns=2)
    return ax


def _few(lines: dict[str, Any]) -> dict[str, Any]:
    return {key: lines[key] for key in spread(list(lines), MOST_LOOPS)}


def _top(arrays: list[Any]) -> float:
    finite = [np.abs(a[np.isfinite(a)]) for a in arrays]
    return max((float(a.max()) for a in finite if a.size), default=1.0)


def nothing(ax: Axes, sentence: str) -> Axes:
    """Say in the picture why there is none."""
    ax.set_axis_off()
    ax.text(0.5, 0.5, sentence, ha="center", va="center", wrap=True, transform=ax.transAxes)
    return ax
