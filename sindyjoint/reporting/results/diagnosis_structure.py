"""Pictures of a structure's diagnosis: a record and its simulation before and after effects were added."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np

from sindyjoint.diagnosis.falling import reported_together
from sindyjoint.diagnosis.result import Diagnosis, RecordGap
from sindyjoint.reporting.figure import MOST_PANELS, Axes, Kind, by_name, each, fixed
from sindyjoint.reporting.results.diagnosis_campaign import KINDS as DIAGNOSIS
from sindyjoint.reporting.results.diagnosis_campaign import budget_parts
from sindyjoint.reporting.results.verification import KEPT_SAMPLES
from sindyjoint.reporting.style import INK, MUTED, PALETTE, legend_above, plain, prefixed, shortened
from sindyjoint.response.oscillation import hilbert_envelope, main_frequency
from sindyjoint.text import percent, spelled

CYCLES_SHOWN = 6


def thinned(record: RecordGap) -> RecordGap:
    """Return a record with no more samples than a picture shows."""
    step = -(-record.time.size // KEPT_SAMPLES)
    before, after = (None if x is None else x[::step] for x in (record.before, record.after))
    return replace(
        record, time=record.time[::step], measured=record.measured[::step], before=before, after=after
    )


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


def overlay(record: RecordGap, ax: Axes) -> Axes:
    """Draw the measured displacement and, over it, the residuals before and after."""
    factor, unit = prefixed(float(np.abs(record.measured).max()), record.unit)
    looks: list[tuple[str, np.ndarray | None, dict[str, Any]]] = [
        ("measured", record.measured, {"color": PALETTE[0], "lw": 0.5, "alpha": 0.35}),
        ("residual of the model alone", _residual(record, record.before), {"color": PALETTE[1], "lw": 0.7}),
        ("residual with the effects", _residual(record, record.after), {"color": INK, "lw": 0.7}),
    ]
    for label, signal, look in looks:
        if signal is not None:
            ax.plot(record.time, signal * factor, label=label, rasterized=signal.size > 4000, **look)
    ax.set(
        xlabel="Time (s)",
        ylabel=f"{record.quantity.capitalize()} ({unit})",
        title=plain(shortened(record.name)),
    )
    if record.held_from:
        ax.axvline(record.held_from, color=MUTED, lw=0.6)
        ax.annotate("kept out of the fit →", (record.held_from, 0.03), xycoords=("data", "axes fraction"),
                    xytext=(3, 0), textcoords="offset points", color=MUTED)  # fmt: skip
    legend_above(ax, 3, columns=1)
    return ax


def _residual(record: RecordGap, simulated: np.ndarray | None) -> np.ndarray | None:
    return None if simulated is None else simulated - record.measured


def cycles(record: RecordGap, ax: Axes) -> Axes:
    """Draw a few cycles of what the fit did not see, measured and simulated."""
    factor, unit = prefixed(float(np.abs(record.measured).max()), record.unit)
    kept = _middle_cycles(record)
    for label, signal, look in _curves(record):
        ax.plot(record.time[kept], signal[kept] * factor, label=label, **look)
    ax.set(
        xlabel="Time (s)",
        ylabel=f"{record.quantity.capitalize()} ({unit})",
        title=plain(shortened(record.name)),
    )
    legend_above(ax, 3, columns=1)
    return ax


def gap_height(result: Diagnosis) -> float:
    """Return the height of the picture of the gap, inches: a bar is as thick whatever the number of steps."""
    return 1.2 + 0.4 * (1 + len(result.steps))


def gap_by_step(result: Diagnosis, ax: Axes) -> Axes:
    """Draw the response gap of the model alone and after each effect, on a logarithmic scale down to the noise."""
    groups = reported_together(result.steps)
    steps = (("\n".join(f"+ {spelled(s.effect)}" for s in each), each[-1].gap_after) for each in groups)
    rows = [("model alone", result.initial), *steps]
    values = [100 * gap.response for _, gap in rows]
    floor = 100 * result.noise_floor.response
    # What is not known is NaN: a simulation that failed, a floor that no record gave.
    known = [value for value in (floor, *values) if value == value] or [1.0]
    low = 0.5 * min(known)
    for row, value in enumerate(values):
        if value == value:
            ax.barh(row, value - low, left=low, height=0.6, color=PALETTE[0])
            ax.text(value * 1.05, row, percent(value / 100), va="center", color=INK)
    if floor == floor:
        ax.axvline(
            floor, color=PALETTE[1], linestyle=(0, (4, 2)), label=f"noise floor, {percent(floor / 100)}"
        )
        ax.legend(loc="lower right")
    ax.set(
        xscale="log",
        xlim=(low, 2.5 * max(known)),
        yticks=range(len(rows)),
        yticklabels=[label for label, _ in rows],
    )
    ax.invert_yaxis()
    ax.set(
        xlabel="relative RMS of what the fit did not see (%)", title="Gap between simulation and measurement"
    )
    return ax


def _middle_cycles(record: RecordGap) -> slice:
    """Return a few cycles just behind the middle of the record: what the fit did not see, and has not yet died."""
    rate = 1 / (record.time[1] - record.time[0])
    first = int((record.held_from or 0.25 * record.time[-1]) * rate)
    count = int(CYCLES_SHOWN * rate / main_frequency(record.measured, rate))
    return slice(first, min(first + max(count, 2), record.time.size))


def envelope(record: RecordGap, ax: Axes) -> Axes:
    """Draw the envelopes by Hilbert's transform, on a logarithmic scale, with the noise."""
    rate = 1 / (record.time[1] - record.time[0])
    factor, unit = prefixed(float(np.abs(record.measured).max()), record.unit)
    cut = int(rate / main_frequency(record.measured, rate))
    for label, signal, look in _curves(record):
        if np.ptp(signal) > 0:
            height, _ = hilbert_envelope(signal, rate)
            ax.plot(record.time[cut:-cut], height[cut:-cut] * factor, label=label, **look)
    ax.axhline(record.noise * factor, color=MUTED, lw=0.7, ls=(0, (4, 2)), label="noise (RMS)")
    ax.set(yscale="log", xlabel="Time (s)", ylabel=f"Envelope ({unit})", title=plain(shortened(record.name)))
    legend_above(ax, 5, columns=1)
    return ax


def _records(result: Diagnosis) -> tuple[RecordGap, ...]:
    return result.records[:MOST_PANELS]


def _decays(result: Diagnosis) -> tuple[RecordGap, ...]:
    """Return the records of a pulse; a steady motion has an envelope without shape."""
    return _records(result) if result.in_place is None else ()


KINDS = DIAGNOSIS | by_name(
    Kind(
        "gap",
        "Gap by step",
        "Response gap before and after each named effect, down to the noise floor; the scale is logarithmic.",
        fixed(gap_by_step),
        wide=True,
        height=gap_height,
    ),
    Kind(
        "overlay",
        "Before and after",
        "Measured response, and the residual of the simulations with the model alone and with the effects. "
        "What lies behind a line was kept out of the fit that is drawn.",
        each(_records, overlay),
        wide=True,
    ),
    Kind(
        "cycles",
        "A few cycles",
        "Some cycles of what was kept out of the fit, measured and simulated.",
        each(_records, cycles),
        wide=True,
    ),
    Kind(
        "envelope",
        "Envelope",
        "Envelope of the measured and the simulated displacement, with the noise.",
        each(_decays, envelope),
        wide=True,
    ),
    Kind(
        "budget",
        "Budget of the gap",
        "What the first gap is made of: effects of the joint without internal state and its coefficients (state), "
        "hysteresis in "
        "the joint (history), what lies outside the joint or is not explained (run), the time step (processing), "
        "noise.",
        lambda result: [budget_parts] if result.budget.total == result.budget.total else [],
        wide=True,
    ),
)
