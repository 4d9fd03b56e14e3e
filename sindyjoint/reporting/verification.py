"""A verification for people: its lines on a terminal, its pictures, its folder."""

from __future__ import annotations

import os
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from sindyjoint.reporting.style import (
    INK,
    MUTED,
    PALETTE,
    legend_above,
    plain,
    prefixed,
    shortened,
)
from sindyjoint.response.oscillation import hilbert_envelope
from sindyjoint.text import percent

if TYPE_CHECKING:
    from matplotlib.axes import Axes

    from sindyjoint.response.verification import RunVerification, Verification

WIDTH = 100
CYCLES_SHOWN = 6
UNITS = {"angle": "rad", "displacement": "m", "moment": "N*m", "force": "N"}


def show_verification(result: Verification) -> None:
    """Print verdict, figures and cautions."""
    from rich.console import Console
    from rich.markup import escape
    from rich.table import Table

    console = Console(width=None if sys.stdout.isatty() else WIDTH, highlight=False)
    where = "the rig" if result.kind == "rig" else "the runs of"
    console.print(f"{escape(result.model.joint.name)} against {where} {escape(result.subject)}\n")
    console.print(f"  {escape(result.model.equation())}\n")
    table = Table(box=None, pad_edge=False, padding=(0, 2, 0, 0))
    for heading in ("run", "simulated by", "response NRMSE", "noise", "moment NRMSE", "amplitude", "period"):
        right = heading not in ("run", "simulated by")
        table.add_column(heading, justify="right" if right else "left", no_wrap=True)
    for run in result.runs:
        table.add_row(
            escape(shortened(run.name)),
            run.drive,
            percent(run.response_nrmse),
            percent(run.noise_floor),
            percent(run.moment_nrmse),
            percent(run.amplitude_rms_error),
            "–" if run.mean_period_difference is None else f"{1e3 * run.mean_period_difference:.3g} ms",
        )
    console.print(table)
    console.print(f"\n[bold]{result.verdict}[/]: {escape(result.reason)}")
    for warning in result.warnings:
        console.print(f"- {escape(warning)}")


def write_verification(
    result: Verification,
    folder: str | os.PathLike[str],
    command_line: str | Sequence[str] | None = None,
    seed: object = None,
    files: Sequence[str | os.PathLike[str]] = (),
) -> Path:
    """Write report.html, verification.json, model.json and figures, all of them or none.

    Parameters
    ----------
    result : Verification
    folder : path
    command_line, seed, files
        For the report's last section; see :func:`sindyjoint.reporting.provenance.provenance`.
    """
    from sindyjoint.reporting.output import draw_all, json_text, write_folder
    from sindyjoint.reporting.provenance import provenance
    from sindyjoint.reporting.result_pages import verification_page
    from sindyjoint.reporting.saved import DATA_FILE, saved_text, thinned

    pictures = draw_all(result)
    texts = {
        DATA_FILE: saved_text(thinned(result)),
        "report.html": verification_page(result, provenance(None, seed, command_line, files), pictures),
        "verification.json": json_text(details(result)),
        "model.json": result.model.to_json() + "\n",
    }
    return write_folder(folder, pictures, texts)


def details(result: Verification) -> dict[str, Any]:
    """Return what ``--json`` prints, and beside it what each run shows cycle by cycle."""
    record = result.to_dict()
    record["subject"] = {"kind": result.kind, "name": result.subject}
    record["reason"], record["tolerance"] = result.reason, result.tolerance
    for entry, run in zip(record["runs"], result.runs, strict=True):
        entry |= {
            "drive": run.drive,
            "channel": run.channel,
            "noise_floor": run.noise_floor,
            "amplitude_rms_error": run.amplitude_rms_error,
            "mean_period_difference": run.mean_period_difference,
            "failure": run.failure or None,
            "cycles": {
                name: None
                if swings is None
                else {
                    "time": swings.amplitude_time.tolist(),
                    "amplitude": swings.amplitude.tolist(),
                    "period": swings.period.tolist(),
                }
                for name, swings in zip(("measured", "simulated"), run.oscillations, strict=True)
            },
            "energy_per_cycle": None
            if run.energy is None
            else {"measured": run.energy[0].tolist(), "simulated": run.energy[1].tolist()},
        }
    return record


def response(run: RunVerification, ax: Axes, zoom: bool = False) -> Axes:
    """Draw measured and simulated response over time; zoomed, the first cycles alone."""
    factor, unit = prefixed(float(np.abs(run.measured).max()), UNITS[run.channel])
    kept = slice(0, _first_cycles(run)) if zoom else slice(None)
    time = run.time[kept]
    ax.plot(time, run.measured[kept] * factor, color=PALETTE[0], lw=1.6, label="measured")
    if run.simulated is not None:
        ax.plot(time, run.simulated[kept] * factor, color=INK, lw=0.8, ls=(0, (4, 1.5)), label="simulated")
    if run.band is not None:
        ax.fill_between(
            time, run.band.low[kept] * factor, run.band.high[kept] * factor, color=PALETTE[1], alpha=0.35,
            lw=0, label="95 % of the model", rasterized=time.size > 4000,
        )  # fmt: skip
    ax.set_xlabel("Time (s)")
    ax.set_ylabel(f"{run.channel.capitalize()} ({unit})")
    if zoom:
        legend_above(ax, 2, columns=2)
    else:
        ax.set_title(plain(shortened(run.name)))
    return ax


def _first_cycles(run: RunVerification) -> int:
    swings = run.oscillations[0]
    if swings is None:
        return max(2, run.time.size // 10)
    rate = 1 / (run.time[1] - run.time[0])
    return min(run.time.size, int(CYCLES_SHOWN * float(np.median(swings.period)) * rate))


def amplitude(run: RunVerification, ax: Axes) -> Axes:
    """Draw the amplitude of each swing, as a mark, and the envelope by Hilbert's transform as a line."""
    factor, unit = prefixed(float(np.abs(run.measured).max()), UNITS[run.channel])
    rate = 1 / (run.time[1] - run.time[0])
    for (label, swings, signal), color, marker in zip(_pair(run), (PALETTE[0], INK), ("o", "x"), strict=True):
        if swings is None or signal is None:
            continue
        ax.plot(
            swings.amplitude_time + run.time[0], swings.amplitude * factor, color=color, ls="none", marker=marker,
            ms=2.5, label=label,
        )  # fmt: skip
        envelope, _ = hilbert_envelope(signal, rate)
        # At either end the transform extrapolates.
        kept = slice(*(int(float(np.median(swings.period)) * rate) * side for side in (1, -1)))
        ax.plot(run.time[kept], envelope[kept] * factor, color=color, lw=0.7)
    ax.set_yscale("log")
    ax.set_xlabel("Time (s)")
    ax.set_ylabel(f"Amplitude ({unit})")
    legend_above(ax, 1, columns=2)
    return ax


def period(run: RunVerification, ax: Axes) -> Axes:
    """Draw the period from each turning point to the next but one as a mark, and Hilbert's as a line."""
    rate = 1 / (run.time[1] - run.time[0])
    for (label, swings, signal), color, marker in zip(_pair(run), (PALETTE[0], INK), ("o", "x"), strict=True):
        if swings is None or signal is None:
            continue
        ax.plot(
            swings.time[1:-1] + run.time[0], 1e3 * swings.period, color=color, ls="none", marker=marker,
            ms=2.5, label=label,
        )  # fmt: skip
        _, frequency = hilbert_envelope(signal, rate)
        kept = slice(*(2 * int(float(np.median(swings.period)) * rate) * side for side in (1, -1)))
        ax.plot(run.time[kept], 1e3 / frequency[kept], color=color, lw=0.7)
    ax.set_xlabel("Time (s)")
    ax.set_ylabel("Period (ms)")
    legend_above(ax, 1, columns=2)
    return ax


def error(run: RunVerification, ax: Axes) -> Axes:
    """Draw what is left between measurement and simulation."""
    if run.simulated is not None:
        left = run.simulated - run.measured
        factor, unit = prefixed(float(np.abs(left).max()), UNITS[run.channel])
        ax.plot(run.time, left * factor, color=MUTED, lw=0.4, rasterized=left.size > 4000)
        ax.set_ylabel(f"Simulated − measured ({unit})")
    ax.set_xlabel("Time (s)")
    return ax


def energy(run: RunVerification, ax: Axes) -> Axes:
    """Draw the energy dissipated in each cycle."""
    if run.energy is not None:
        largest = float(np.abs(run.energy).max())
        factor, unit = prefixed(largest, "J")
        cycles = np.arange(1, run.energy.shape[1] + 1)
        for values, color, marker, label in zip(
            run.energy, (PALETTE[0], INK), ("o", "x"), ("measured", "simulated"), strict=True
        ):
            seen = values > 1e-4 * largest
            ax.plot(
                cycles[seen],
                values[seen] * factor,
                color=color,
                ls="none",
                marker=marker,
                ms=2.5,
                label=label,
            )
        shown = run.energy[run.energy > 1e-4 * largest]
        if shown.size and shown.max() > 5 * shown.min():
            ax.set_yscale("log")
        ax.set_ylabel(f"Dissipated per cycle ({unit})")
        legend_above(ax, 1, columns=2)
    ax.set_xlabel("Cycle")
    return ax


def _pair(run: RunVerification) -> tuple[tuple[str, Any, Any], tuple[str, Any, Any]]:
    return (
        ("measured", run.oscillations[0], run.measured),
        ("simulated", run.oscillations[1], run.simulated),
    )
