"""Pictures of a structure's diagnosis: a record beside the simulation before and after effects were added."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from sindyjoint.reporting.style import INK, MUTED, PALETTE, legend_above, plain, prefixed, shortened
from sindyjoint.workflows.oscillation import hilbert_envelope, main_frequency

if TYPE_CHECKING:
    from matplotlib.axes import Axes

    from sindyjoint.workflows.structure_gap import RecordGap

CYCLES_SHOWN = 6


def _curves(record: RecordGap) -> list[tuple[str, np.ndarray, dict[str, Any]]]:
    """Return label, signal and look of the measured and simulated curves."""
    curves: list[tuple[str, np.ndarray, dict[str, Any]]] = [
        ("measured", record.measured, {"color": PALETTE[0], "lw": 1.8}),
    ]
    if record.before is not None:
        curves.append(("model alone", record.before, {"color": MUTED, "lw": 0.9, "ls": (0, (1, 1))}))
    if record.after is not None:
        curves.append(("with the effects", record.after, {"color": INK, "lw": 0.8, "ls": (0, (4, 1.5))}))
    return curves


def overlay(record: RecordGap, ax: Axes, cycles: bool = False) -> Axes:
    """Draw measured and simulated displacement over time; with ``cycles``, the last ones of the record alone."""
    factor, unit = prefixed(float(np.abs(record.measured).max()), "m")
    kept = slice(None)
    if cycles:
        kept = _middle_cycles(record)
    for label, signal, look in _curves(record):
        ax.plot(
            record.time[kept], signal[kept] * factor, label=label, rasterized=signal[kept].size > 4000, **look
        )
    ax.set_xlabel("Time (s)")
    ax.set_ylabel(f"Displacement at {plain(shortened(record.name, 24))} ({unit})")
    if cycles:
        legend_above(ax, 3, columns=3)
    elif record.held_from:
        ax.axvline(record.held_from, color=MUTED, lw=0.6)
        ax.annotate("kept out of the fit →", (record.held_from, 0.97), xycoords=("data", "axes fraction"),
                    xytext=(3, 0), textcoords="offset points", va="top", color=MUTED)  # fmt: skip
    return ax


def _middle_cycles(record: RecordGap) -> slice:
    """Return a few cycles just behind the middle of the record: what the fit did not see, and has not yet died."""
    rate = 1 / (record.time[1] - record.time[0])
    first = int((record.held_from or 0.25 * record.time[-1]) * rate)
    count = int(CYCLES_SHOWN * rate / main_frequency(record.measured, rate))
    return slice(first, min(first + max(count, 2), record.time.size))


def envelope(record: RecordGap, ax: Axes) -> Axes:
    """Draw the envelopes by Hilbert's transform, on a logarithmic scale, beside the noise."""
    rate = 1 / (record.time[1] - record.time[0])
    factor, unit = prefixed(float(np.abs(record.measured).max()), "m")
    cut = int(rate / main_frequency(record.measured, rate))
    for label, signal, look in _curves(record):
        if np.ptp(signal) > 0:
            height, _ = hilbert_envelope(signal, rate)
            ax.plot(record.time[cut:-cut], height[cut:-cut] * factor, label=label, **look)
    ax.axhline(record.noise * factor, color=MUTED, lw=0.7, ls=(0, (4, 2)), label="noise (RMS)")
    ax.set_yscale("log")
    ax.set_xlabel("Time (s)")
    ax.set_ylabel(f"Envelope ({unit})")
    legend_above(ax, 4, columns=2)
    return ax
