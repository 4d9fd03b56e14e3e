"""Pictures of a verification: response, decay, energy of each run; and the responses to be zoomed."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from functools import partial
from typing import Any

import numpy as np

from sindyjoint.reporting.figure import (
    Axes,
    Kind,
    Panel,
    Scale,
    by_name,
    scaled,
    short_numbers,
    spread,
    time_label,
)
from sindyjoint.reporting.style import (
    INK,
    MUTED,
    PALETTE,
    legend_above,
    plain,
    shortened,
)
from sindyjoint.response.oscillation import hilbert_envelope
from sindyjoint.response.verification import Band, RunVerification, Verification

CYCLES_SHOWN = 6
UNITS = {
    "angle": "rad", "displacement": "m", "velocity": "m/s", "acceleration": "m/s^2", "moment": "N*m", "force": "N",
}  # fmt: skip
# More samples of a response than these no picture shows, and no screen.
KEPT_SAMPLES, RESPONSE_SAMPLES = 6000, 3000


def thinned(result: Verification) -> Verification:
    """Return a verification with no more samples than a picture shows."""
    return replace(result, runs=tuple(_thinned(run) for run in result.runs))


def _thinned(run: RunVerification) -> RunVerification:
    step = -(-run.time.size // KEPT_SAMPLES)
    band = run.band and Band(run.band.low[::step], run.band.high[::step], run.band.draws, run.band.failed)
    simulated = None if run.simulated is None else run.simulated[::step]
    return replace(run, time=run.time[::step], measured=run.measured[::step], simulated=simulated, band=band)


def _scale(run: RunVerification, name: str = "") -> Scale:
    return scaled(name or run.channel.capitalize(), run.measured, UNITS[run.channel])


def _time(run: RunVerification) -> str:
    return time_label(run.drive == "path", "translation" if run.channel == "force" else "rotation")


def response(run: RunVerification, ax: Axes, zoom: bool = False) -> Axes:
    """Draw measured and simulated response over time; zoomed, only the first cycles."""
    scale, kept = _scale(run), slice(_first_cycles(run) if zoom else None)
    time = run.time[kept]
    ax.plot(time, run.measured[kept] * scale.factor, color=PALETTE[0], lw=1.6, label="measured")
    if run.simulated is not None:
        look: Any = {"color": INK, "lw": 0.8, "ls": (0, (4, 1.5)), "label": "simulated"}
        ax.plot(time, run.simulated[kept] * scale.factor, **look)
    if run.band is not None:
        ax.fill_between(
            time, run.band.low[kept] * scale.factor, run.band.high[kept] * scale.factor, color=PALETTE[1],
            alpha=0.35, lw=0, label="95 % of the model", rasterized=time.size > 4000,
        )  # fmt: skip
    ax.set(xlabel=_time(run), ylabel=scale.label)
    if zoom:
        legend_above(ax, 2, columns=2)
    else:
        ax.set_title(plain(shortened(run.name)))
    return ax


def _first_cycles(run: RunVerification) -> int:
    oscillation = run.oscillations[0]
    if oscillation is None:
        return max(2, run.time.size // 10)
    rate = 1 / (run.time[1] - run.time[0])
    return min(run.time.size, int(CYCLES_SHOWN * float(np.median(oscillation.period)) * rate))


def response_payload(runs: Sequence[RunVerification], virtual: bool = False) -> dict[str, Any]:
    """Return the response over time, of the runs (of a virtual test) and as simulated, for zooming, run by run."""
    curves = []
    for run in runs:
        scale, step = _scale(run), -(-run.time.size // RESPONSE_SAMPLES)
        signals = {"virtual test" if virtual else "measured": run.measured, "simulated": run.simulated}
        for label, signal in signals.items():
            if signal is not None:
                curves.append(
                    {
                        "label": label,
                        "run": f"{run.name}, {label}",
                        "group": run.name,
                        "x": short_numbers(run.time[::step]),
                        "y": short_numbers(signal[::step] * scale.factor),
                        "model": [],
                        "axis": scale.to_dict(),
                    }
                )
    path = bool(runs) and runs[0].drive == "path"
    length = "m" if path and runs[0].channel == "force" else "rad"
    across = Scale("Travelled path", length, symbol="s") if path else Scale("Time", "s", symbol="t")
    return {
        "x": across.to_dict(),
        "y": Scale("Response", "").to_dict(),
        "palette": (PALETTE[0], PALETTE[1], INK),
        "each": True,
        "runs": curves,
    }


def amplitude(run: RunVerification, ax: Axes) -> Axes:
    """Draw the amplitude of each half-cycle, as a mark, and the envelope by Hilbert's transform as a line."""
    scale = _scale(run, "Amplitude")
    # At either end the transform extrapolates: over one period here, over two below.
    _draw_by_half_cycle(
        run,
        ax,
        1,
        lambda s: (s.amplitude_time, s.amplitude * scale.factor),
        lambda height, _: height * scale.factor,
    )
    ax.set(yscale="log", ylabel=scale.label)
    legend_above(ax, 1, columns=2)
    return ax


def period(run: RunVerification, ax: Axes) -> Axes:
    """Draw the period from each turning point to the next but one as a mark, and Hilbert's as a line."""
    _draw_by_half_cycle(
        run, ax, 2, lambda s: (s.time[1:-1], 1e3 * s.period), lambda _, frequency: 1e3 / frequency
    )
    ax.set_ylabel("Period (ms)")
    legend_above(ax, 1, columns=2)
    return ax


def _draw_by_half_cycle(
    run: RunVerification,
    ax: Axes,
    cut: int,
    marks: Callable[[Any], tuple[Any, Any]],
    line: Callable[[Any, Any], Any],
) -> None:
    """Draw values by half-cycle as marks, and those of Hilbert's transform as a line, its ends cut off."""
    rate = 1 / (run.time[1] - run.time[0])
    signals = zip(("measured", "simulated"), run.oscillations, (run.measured, run.simulated), strict=True)
    for (label, oscillation, signal), color, marker in zip(signals, (PALETTE[0], INK), "ox", strict=True):
        if oscillation is not None and signal is not None:
            time, values = marks(oscillation)
            ax.plot(time + run.time[0], values, color=color, ls="none", marker=marker, ms=2.5, label=label)
            kept = slice(*(cut * int(float(np.median(oscillation.period)) * rate) * side for side in (1, -1)))
            ax.plot(run.time[kept], line(*hilbert_envelope(signal, rate))[kept], color=color, lw=0.7)
    ax.set_xlabel(_time(run))


def error(run: RunVerification, ax: Axes) -> Axes:
    """Draw the residual, simulation less measurement."""
    assert run.simulated is not None
    residual = run.simulated - run.measured
    scale = scaled("Simulated − measured", residual, UNITS[run.channel])
    ax.plot(run.time, residual * scale.factor, color=MUTED, lw=0.4, rasterized=residual.size > 4000)
    ax.set(ylabel=scale.label, xlabel=_time(run))
    return ax


def energy(run: RunVerification, ax: Axes) -> Axes:
    """Draw the energy dissipated in each cycle."""
    assert run.energy is not None
    scale = scaled("Dissipated per cycle", run.energy, "J")
    known = run.energy > 1e-4 * float(np.abs(run.energy).max())
    cycles = np.arange(1, run.energy.shape[1] + 1)
    looks = (PALETTE[0], "o", "measured"), (INK, "x", "simulated")
    for values, seen, (color, marker, label) in zip(run.energy, known, looks, strict=True):
        shown = values[seen] * scale.factor
        ax.plot(cycles[seen], shown, color=color, ls="none", marker=marker, ms=2.5, label=label)
    if known.any() and run.energy[known].max() > 5 * run.energy[known].min():
        ax.set_yscale("log")
    ax.set(ylabel=scale.label, xlabel="Cycle")
    legend_above(ax, 1, columns=2)
    return ax


def _of_runs(draw: Callable[[Any, Axes], Axes], has: Callable[[Any], bool]) -> Callable[[Any], list[Panel]]:
    """Return panels that draw one run each."""

    def panels(result: Any) -> list[Panel]:
        shown = spread([run for run in result.runs if has(run)])
        return [partial(_of_run, draw=draw, run=run, named=len(result.runs) > 1) for run in shown]

    return panels


def _of_run(result: Any, ax: Axes, draw: Callable[[Any, Axes], Axes], run: Any, named: bool) -> Axes:
    draw(run, ax)
    if named:
        ax.set_title(plain(shortened(run.name)))
    return ax


KINDS = by_name(
    Kind(
        "response",
        "Response",
        "Measured and simulated response over time, with the band that the uncertainty of the coefficients allows.",
        _of_runs(response, lambda run: True),
        wide=True,
    ),
    Kind(
        "cycles",
        "First cycles",
        "The first cycles of the measured and the simulated response.",
        _of_runs(partial(response, zoom=True), lambda run: True),
    ),
    Kind(
        "envelope",
        "Envelope",
        "Amplitude of every half-cycle, measured and simulated, with the envelope by Hilbert's transform.",
        _of_runs(amplitude, lambda run: any(run.oscillations)),
    ),
    Kind(
        "period",
        "Period",
        "Period of every cycle, measured and simulated.",
        _of_runs(period, lambda run: any(run.oscillations)),
    ),
    Kind(
        "error",
        "Error",
        "Simulated less measured response over time.",
        _of_runs(error, lambda run: run.simulated is not None),
        wide=True,
    ),
    Kind(
        "energy",
        "Energy",
        "Energy dissipated in every cycle, measured and simulated.",
        _of_runs(energy, lambda run: run.energy is not None),
    ),
)
