"""Pictures of a structure's diagnosis: a record and its simulation before and after effects were added."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import replace
from typing import Any

import numpy as np

from sindyjoint.diagnosis.result import Diagnosis, RecordGap
from sindyjoint.numeric import Array
from sindyjoint.reporting.figure import MOST_PANELS, Axes, Kind, Scale, by_name, each, scaled
from sindyjoint.reporting.results.diagnosis_campaign import KINDS as DIAGNOSIS
from sindyjoint.reporting.results.verification_pictures import KEPT_SAMPLES
from sindyjoint.reporting.style import INK, MUTED, PALETTE, legend_above, plain, shortened
from sindyjoint.response.oscillation import hilbert_envelope, main_frequency

CYCLES_SHOWN = 6


def thinned(record: RecordGap) -> RecordGap:
    """Return a record with no more samples than a picture shows."""
    step = -(-record.time.size // KEPT_SAMPLES)
    before, after = (None if x is None else x[::step] for x in (record.before, record.after))
    return replace(
        record, time=record.time[::step], measured=record.measured[::step], before=before, after=after
    )


BEFORE: Any = {"color": MUTED, "lw": 0.9, "ls": (0, (1, 1)), "label": "model alone"}
AFTER: Any = {"color": INK, "lw": 0.8, "ls": (0, (4, 1.5)), "label": "with the effects"}
MEASURED: Any = {"color": PALETTE[0], "lw": 1.8, "label": "measured"}


def _curves(record: RecordGap) -> list[tuple[Array, Any]]:
    """Return signal and look of the measured and simulated curves."""
    curves = ((record.measured, MEASURED), (record.before, BEFORE), (record.after, AFTER))
    return [(signal, look) for signal, look in curves if signal is not None]


def _draw(
    record: RecordGap, ax: Axes, curves: Iterable[tuple[Array, Any]], kept: slice, name: str = ""
) -> Scale:
    """Draw signals over time, on an axis that suits what was measured."""
    scale = scaled(name or record.quantity.capitalize(), record.measured, record.unit)
    for signal, look in curves:
        ax.plot(record.time[kept], signal[kept] * scale.factor, **look)
    ax.set(xlabel="Time (s)", ylabel=scale.label, title=plain(shortened(record.name)))
    return scale


def overlay(record: RecordGap, ax: Axes) -> Axes:
    """Draw the measured displacement and, over it, the residuals before and after."""
    thin = {"lw": 0.7, "ls": "-", "rasterized": record.time.size > 4000}
    curves: list[tuple[Array, Any]] = [(record.measured, MEASURED | thin | {"lw": 0.5, "alpha": 0.35})]
    for simulated, color, of in (
        (record.before, PALETTE[1], "of the model alone"),
        (record.after, INK, "with the effects"),
    ):
        if simulated is not None:
            curves.append((simulated - record.measured, thin | {"color": color, "label": f"residual {of}"}))
    _draw(record, ax, curves, slice(None))
    if record.held_from:
        ax.axvline(record.held_from, color=MUTED, lw=0.6)
        ax.annotate("kept out of the fit →", (record.held_from, 0.03), xycoords=("data", "axes fraction"),
                    xytext=(3, 0), textcoords="offset points", color=MUTED)  # fmt: skip
    legend_above(ax, 3)
    return ax


def cycles(record: RecordGap, ax: Axes) -> Axes:
    """Draw a few cycles of what the fit did not see, measured and simulated."""
    _draw(record, ax, _curves(record), _middle_cycles(record))
    legend_above(ax, 3)
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
    cut = int(rate / main_frequency(record.measured, rate))
    moving = [(signal, look) for signal, look in _curves(record) if np.ptp(signal) > 0]
    heights = [(hilbert_envelope(signal, rate)[0], look) for signal, look in moving]
    scale = _draw(record, ax, heights, slice(cut, -cut), "Envelope")
    ax.axhline(record.noise * scale.factor, color=MUTED, lw=0.7, ls=(0, (4, 2)), label="noise (RMS)")
    ax.set_yscale("log")
    legend_above(ax, 5)
    return ax


def _records(result: Diagnosis) -> tuple[RecordGap, ...]:
    return result.records[:MOST_PANELS]


def _decays(result: Diagnosis) -> tuple[RecordGap, ...]:
    """Return the records of a pulse; a steady motion has an envelope without shape."""
    return _records(result) if result.in_place is None else ()


KINDS = DIAGNOSIS | by_name(
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
)
