"""Curves of a joint and of a structure, on a terminal, as pictures, as a page, as files."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from rich.markup import escape

from sindyjoint.numeric import Array
from sindyjoint.reporting.figure import Axes, Kind, by_name, fixed, scaled
from sindyjoint.reporting.page import Blocks, Page, Section, capital, section
from sindyjoint.reporting.style import (
    DASHES,
    INK,
    MUTED,
    PALETTE,
    amount,
    legend_above,
    plain,
    prefixed,
    shortened,
)
from sindyjoint.reporting.tables import DASH, TextTable, csv_columns
from sindyjoint.reporting.view import View
from sindyjoint.substructure.forced import ForcedResponse, StructureCurves
from sindyjoint.substructure.joint_curves import MEASURES, JointCurve, JointCurves
from sindyjoint.substructure.modes import ModeCurve
from sindyjoint.text import quantities

UNITS = {"rotation": ("rad", "N*m/rad"), "translation": ("m", "N/m")}
DOTTED: Any = {"ls": (0, (1, 1.5))}


def _only(values: Array, where: NDArray[np.bool_]) -> Array:
    """Return the values where a mark holds, and one beyond on either side, so that lines meet."""
    wide = where | np.append(where[1:], False)
    return np.where(wide, values, np.nan)


def over_amplitude(data: JointCurves, ax: Axes, measure: str, name: str) -> Axes:
    """Draw a measure at each frequency with its 95 % band; dotted where the model was not tested."""
    angle, stiffness = UNITS[data.motion]
    unit = {"secant": stiffness, "energy": "J"}.get(measure, "")
    scale = scaled(name, [float(np.max(getattr(curve, measure))) for curve in data.curves], unit)
    what = f"{quantities(data.motion).angle} amplitude"
    across = scaled(what, data.tested_angle or data.curves[0].amplitude[-1], angle)
    for place, curve in enumerate(data.curves):
        color, dash = PALETTE[place % len(PALETTE)], DASHES[place % len(DASHES)]
        x, y = curve.amplitude * across.factor, getattr(curve, measure) * scale.factor
        low, high = (end * scale.factor for end in curve.interval95(measure))
        ax.fill_between(x, np.maximum(low, 1e-3 * y), high, color=color, alpha=0.2, lw=0)
        ax.plot(x, _only(y, curve.tested), color=color, ls=dash, label=f"{curve.frequency:.3g} Hz")
        ax.plot(x, _only(y, ~curve.tested), color=color, ls=(0, (1, 2)), lw=0.9)
    if data.tested_angle > 0:
        ax.axvline(data.tested_angle * across.factor, color=INK, lw=0.7, ls=(0, (4, 2)), label="tested up to")
    beside = measure == "secant"
    if beside:
        first = data.curves[0]
        look: Any = {"color": MUTED, "lw": 0.8, "ls": DASHES[2], "label": "storage stiffness"}
        ax.plot(first.amplitude * across.factor, first.storage * scale.factor, **look)
    ax.set(xscale="log", yscale="linear" if beside else "log", xlabel=across.label, ylabel=scale.label)
    legend_above(ax, 1 + beside, columns=2)
    return ax


JOINT_KINDS = by_name(
    Kind(
        "stiffness",
        "Stiffness over amplitude",
        "Stiffness between the ends of the loop under a harmonic motion; dots: beyond what was tested.",
        fixed(partial(over_amplitude, measure="secant", name="Secant stiffness")),
    ),
    Kind(
        "loss",
        "Loss factor over amplitude",
        "Energy per cycle over 2π times the stored energy; dots: beyond what was tested.",
        fixed(partial(over_amplitude, measure="loss_factor", name="Loss factor")),
    ),
    Kind(
        "energy",
        "Energy per cycle over amplitude",
        "Area of the loop; dots: beyond what was tested.",
        fixed(partial(over_amplitude, measure="energy", name="Energy per cycle")),
    ),
)


def over_frequency(data: StructureCurves, ax: Axes, receptance: bool) -> Axes:
    """Draw amplitude, or amplitude per force, over frequency at each level: dashed between folds, dotted untested.

    Beside the amplitude stands the backbone through the peaks; of a linear structure the receptances would be one
    curve.
    """
    per = [level.force if receptance else 1.0 for level in data.levels]
    name = "Receptance" if receptance else f"Deflection at {plain(shortened(data.point, 14))}"
    largest = [float(np.max(level.amplitude / force)) for level, force in zip(data.levels, per, strict=True)]
    scale = scaled(name, largest, "m/N" if receptance else "m")
    for place, (level, force) in enumerate(zip(data.levels, per, strict=True)):
        color, factor = PALETTE[place % len(PALETTE)], scale.factor / force
        if np.any(level.frequency_error) or np.any(level.log_error):
            (x0, y0), (x1, y1) = (level.band95(side) for side in (-1, 1))
            band = np.concatenate([x0, x1[::-1]]), np.concatenate([y0, y1[::-1]]) * factor
            ax.fill(*band, color=color, alpha=0.25, lw=0)
        x, y, stable = level.frequency, level.amplitude * factor, level.stable
        ax.plot(x, _only(y, stable & level.tested), color=color, label=f"{level.force:.3g} N")
        ax.plot(x, _only(y, ~stable), color=color, ls=(0, (4, 2)), lw=0.9)
        ax.plot(x, _only(y, stable & ~level.tested), color=color, lw=1.0, **DOTTED)
    ax.set(yscale="log", xlabel="Frequency (Hz)", ylabel=scale.label)
    if receptance:
        ax.axvline(data.locked[0], color=MUTED, lw=0.7, ls=DASHES[2], label="joints locked")
        ax.axvline(data.sliding[0], color=MUTED, lw=0.7, ls=DASHES[4], label="joints sliding freely")
    else:
        _backbones(data, ax, scale.factor)
    ax.legend(loc="upper right", labelspacing=0.3)
    return ax


def _backbones(data: StructureCurves, ax: Axes, factor: float) -> None:
    low, high = ax.get_ylim()
    for mode in data.modes:
        amplitude = mode.amplitude * factor
        seen = (amplitude >= low) & (amplitude <= high)
        if mode.point == data.point:
            label = f"backbone, mode {mode.number}" if seen.any() else None
            ax.plot(mode.frequency[seen], amplitude[seen], color=INK, lw=1.1, ls=DASHES[1], label=label)


def mode_over_amplitude(data: StructureCurves, ax: Axes, mode: ModeCurve, damping: bool) -> Axes:
    """Draw frequency or damping ratio of a mode over its amplitude."""
    values, errors = (
        (100 * mode.damping, 100 * mode.damping_error) if damping else (mode.frequency, mode.frequency_error)
    )
    scale = scaled(f"Deflection at {plain(shortened(mode.point, 14))}", mode.amplitude[-1], "m")
    x = mode.amplitude * scale.factor
    if np.any(errors):
        ax.fill_between(x, values - 1.96 * errors, values + 1.96 * errors, color=PALETTE[0], alpha=0.25, lw=0)
    ax.plot(x, _only(values, mode.tested), color=PALETTE[0])
    ax.plot(x, _only(values, ~mode.tested), color=PALETTE[0], **DOTTED)
    for place, (name, slip) in enumerate(zip(data.joints, mode.slips, strict=True)):
        if np.isfinite(slip) and 0 < slip <= mode.amplitude[-1]:
            dash, label = DASHES[1 + place % (len(DASHES) - 1)], f"{plain(shortened(name, 12))} slips"
            ax.axvline(slip * scale.factor, color=MUTED, lw=0.8, ls=dash, label=label)
    what = f"Damping ratio of mode {mode.number} (%)" if damping else f"Frequency of mode {mode.number} (Hz)"
    ax.set(xscale="log", xlabel=scale.label, ylabel=what)
    if damping:
        ax.set_ylim(bottom=0)
    if ax.get_legend_handles_labels()[1]:
        ax.legend(loc="best", labelspacing=0.3)
    return ax


STRUCTURE_KINDS = by_name(
    Kind(
        "response",
        "Frequency response by level",
        "First harmonic of the deflection at each level of the force, and the backbone through the peaks. Dashes: "
        "between two folds, where no test stays; dots: beyond what was tested.",
        lambda data: [partial(over_frequency, receptance=False)] if data.levels else [],
        wide=True,
    ),
    Kind(
        "receptance",
        "Receptance by level",
        "Deflection per force: of a linear structure the levels would be one curve.",
        lambda data: [partial(over_frequency, receptance=True)] if data.levels else [],
        wide=True,
    ),
    Kind(
        "backbone",
        "Frequency over amplitude",
        "Of each mode; a joint slips from its mark on. Dots: beyond what was tested.",
        lambda data: [partial(mode_over_amplitude, mode=mode, damping=False) for mode in data.modes],
    ),
    Kind(
        "damping",
        "Damping over amplitude",
        "Ratio to critical damping of each mode; a joint slips from its mark on. Dots: beyond what was tested.",
        lambda data: [partial(mode_over_amplitude, mode=mode, damping=True) for mode in data.modes],
    ),
)


# Rows of a joint's table for each frequency.
ROWS = 5


class JointCurvesView(
    View[JointCurves, JointCurves],
    data=JointCurves,
    kind="JointCurves",
    folder="joint-curves",
    kinds=JOINT_KINDS,
    record_file="curves.json",
):
    """Stiffness, loss and energy of a joint over amplitude."""

    def tables(self, result: JointCurves) -> tuple[TextTable, ...]:
        """Return the measures at some amplitudes of each frequency."""
        rows = tuple(row for curve in result.curves for row in _joint_rows(curve, result.motion))
        what = quantities(result.motion).angle
        columns = ("Frequency", what, "Secant stiffness", "Loss factor", "Energy per cycle", "Tested")
        return (TextTable("curves", "With half-widths of the 95 % intervals.", columns, rows),)

    def page(self, result: JointCurves, data: JointCurves, show: Blocks, folder: Path | None) -> Page:
        """Return how far stiffness and loss change, and all of it."""
        title, kicker = f"{result.name}: stiffness and loss over amplitude", "A joint over its amplitude"
        pictures = show.pictures("stiffness", "loss", "energy")
        part = section("curves", "Stiffness and loss", "", pictures, *map(show.table, self.tables(result)))
        said = joint_headline(result), f"Of the model {result.equation}."
        return _page(result, show, title, kicker, said, part)

    def files(self, result: JointCurves, data: JointCurves) -> dict[str, str]:
        """Return all curves as a table, SI units."""
        length, stiffness = (unit.replace("*", "") for unit in UNITS[result.motion])
        units = {"secant": f"_{stiffness}", "storage": f"_{stiffness}", "loss_factor": "", "energy": "_J"}
        tables = []
        for curve in result.curves:
            same = np.full(curve.amplitude.size, curve.frequency)
            table = {"frequency_Hz": same, f"amplitude_{length}": curve.amplitude}
            for name in MEASURES:
                values = getattr(curve, name), *curve.interval95(name)
                ends = (f"{name}{end}{units[name]}" for end in ("", "_low95", "_high95"))
                table |= dict(zip(ends, values, strict=True))
            tables.append(table | {"tested": curve.tested.astype(int)})
        return {"curves.csv": csv_columns(_stacked(tables))}

    def about(self, result: JointCurves) -> str:
        """Return how far stiffness and loss change."""
        return escape(f"{result.name}: {joint_headline(result)}")


class StructureCurvesView(
    View[StructureCurves, StructureCurves],
    data=StructureCurves,
    kind="StructureCurves",
    folder="structure-curves",
    kinds=STRUCTURE_KINDS,
    record_file="curves.json",
):
    """Frequency response by level, backbone and damping of a structure."""

    def tables(self, result: StructureCurves) -> tuple[TextTable, ...]:
        """Return the peak of each level, and the course of each mode."""
        length = UNITS[result.motion][0]
        return (
            TextTable(
                "levels", "The largest response at each level.",
                ("Force", "Peak at", "Amplitude", "Largest joint angle", "Jumps at"),
                tuple(_level_row(level, length) for level in result.levels),
            ),
            TextTable(
                "modes", "From the smallest to the largest amplitude.",
                ("Mode", "At", "Amplitude", "Frequency", "Damping", "Slips from"),
                tuple(_mode_row(mode, result.joints) for mode in result.modes),
            ),
        )  # fmt: skip

    def page(self, result: StructureCurves, data: StructureCurves, show: Blocks, folder: Path | None) -> Page:
        """Return how far the first mode changes, responses and modes."""
        title = f"{result.name}: response and modes over amplitude"
        kicker = "A structure over frequency and amplitude"
        how = f"The force acts at {result.at}; up to {result.harmonics} harmonics, and joints stick exactly."
        levels, modes = map(show.table, self.tables(result))
        forced = section("levels", "Frequency response", "", show.pictures("response", "receptance"), levels)
        free = section("modes", "Modes over amplitude", "", show.pictures("backbone", "damping"), modes)
        return _page(result, show, title, kicker, (structure_headline(result), how), forced, free)

    def files(self, result: StructureCurves, data: StructureCurves) -> dict[str, str]:
        """Return response and modes as tables, SI units; edges are points of the 95 % band's two edges."""
        quantity = "angle_rad" if result.motion == "rotation" else "elongation_m"
        names = [f"{joint}_{quantity}" for joint in result.joints]
        responses = [
            {
                "force_N": np.full(level.frequency.size, level.force),
                "frequency_Hz": level.frequency,
                "amplitude_m": level.amplitude,
                "phase_deg": np.degrees(level.phase),
                **dict(zip(("low95_frequency_Hz", "low95_amplitude_m"), level.band95(-1), strict=True)),
                **dict(zip(("high95_frequency_Hz", "high95_amplitude_m"), level.band95(1), strict=True)),
                **dict(zip(names, level.angle, strict=True)),
                "stable": level.stable.astype(int),
                "tested": level.tested.astype(int),
            }
            for level in result.levels
        ]
        modes = [
            {
                "mode": np.full(mode.amplitude.size, mode.number),
                "amplitude_m": mode.amplitude,
                "frequency_Hz": mode.frequency,
                "frequency_error_Hz": mode.frequency_error,
                "damping_ratio": mode.damping,
                "damping_ratio_error": mode.damping_error,
                "force_N": mode.force,
                **dict(zip(names, mode.angle, strict=True)),
                "tested": mode.tested.astype(int),
            }
            for mode in result.modes
        ]
        texts = {"response.csv": responses, "modes.csv": modes}
        return {name: csv_columns(_stacked(tables)) for name, tables in texts.items()}

    def about(self, result: StructureCurves) -> str:
        """Return how far the first mode changes."""
        return escape(f"{result.name} (simulated): {structure_headline(result)}")

    def details(self, result: StructureCurves) -> Iterator[str]:
        """Yield the number of points of each curve."""
        for mode in result.modes:
            yield f"mode {mode.number}: {mode.amplitude.size} amplitudes, {mode.harmonics} harmonics"
        for level in result.levels:
            yield f"{level.force:g} N: {level.frequency.size} frequencies, {level.harmonics} harmonics"


def _page(result: Any, show: Blocks, title: str, kicker: str, said: tuple[str, str], *parts: Section) -> Page:
    sentence, reason = said
    lead = show.verdict(capital(sentence)), show.paragraph(reason, "reason"), show.warnings(result.warnings)
    return Page(title, kicker, result.name, lead, [replace(part, link=part.heading) for part in parts])


def _stacked(tables: Sequence[Mapping[str, Any]]) -> dict[str, Any]:
    """Return tables of the same columns, one below the other."""
    return {name: np.concatenate([table[name] for table in tables]) for name in (tables[0] if tables else ())}


def joint_headline(result: JointCurves) -> str:
    """Return how far stiffness and loss change over the tested amplitudes, in a sentence."""
    curve = result.curves[0]
    within = curve.amplitude <= result.tested_angle if result.tested_angle > 0 else np.ones(1, bool)
    last = int(np.flatnonzero(within)[-1]) if np.any(within) else curve.amplitude.size - 1
    small, large = (amount(float(curve.secant[i]), UNITS[result.motion][1]) for i in (0, last))
    return (
        f"from {amount(float(curve.amplitude[0]), UNITS[result.motion][0])} to "
        f"{amount(float(curve.amplitude[last]), UNITS[result.motion][0])} the secant stiffness goes from {small} to "
        f"{large}, the loss factor at {curve.frequency:.3g} Hz from {curve.loss_factor[0]:.3g} to "
        f"{curve.loss_factor[last]:.3g}."
    )


def structure_headline(result: StructureCurves) -> str:
    """Return how far the first mode changes, in a sentence."""
    mode = result.modes[0]
    change = 100 * (mode.frequency[-1] / mode.frequency[0] - 1)
    return (
        f"up to {amount(float(mode.amplitude[-1]), 'm')} at {mode.point} mode {mode.number} goes from "
        f"{mode.frequency[0]:.3g} to {mode.frequency[-1]:.3g} Hz ({change:+.2g} %) and its damping reaches "
        f"{100 * mode.damping.max():.2g} %."
    )


def _joint_rows(curve: JointCurve, motion: str) -> Iterator[tuple[str, ...]]:
    length, stiffness = UNITS[motion]
    for i in np.unique(np.linspace(0, curve.amplitude.size - 1, ROWS).round().astype(int)):
        yield (
            f"{curve.frequency:.3g} Hz",
            amount(float(curve.amplitude[i]), length),
            _with_width(float(curve.secant[i]), float(curve.secant_error[i]), stiffness),
            _with_width(float(curve.loss_factor[i]), float(curve.loss_factor_error[i]), ""),
            _with_width(float(curve.energy[i]), float(curve.energy_error[i]), "J"),
            "yes" if curve.tested[i] else "no",
        )


def _level_row(level: ForcedResponse, length: str) -> tuple[str, ...]:
    frequency, amplitude = level.peak
    return (
        f"{level.force:.3g} N",
        f"{frequency:.4g} Hz",
        _with_width(amplitude, amplitude * level.peak_error, "m"),
        amount(float(level.angle.max()), length),
        ", ".join(f"{fold:.4g} Hz" for fold in level.folds) or DASH,
    )


def _mode_row(mode: ModeCurve, joints: Sequence[str]) -> tuple[str, ...]:
    slips = np.where(np.isfinite(mode.slips), mode.slips, np.inf)
    first = int(np.argmin(slips))
    return (
        str(mode.number),
        mode.point,
        f"{amount(float(mode.amplitude[0]), 'm')} … {amount(float(mode.amplitude[-1]), 'm')}",
        f"{mode.frequency[0]:.4g} … {mode.frequency[-1]:.4g} Hz",
        f"{100 * mode.damping[0]:.2g} … {100 * mode.damping[-1]:.2g} %",
        f"{amount(float(slips[first]), 'm')} ({joints[first]})" if 0 < slips[first] < np.inf else DASH,
    )


def _with_width(value: float, error: float, unit: str) -> str:
    factor, shown = prefixed(value, unit)
    width = f" ± {1.96 * error * factor:.2g}" if error > 0 else ""
    return f"{value * factor:.4g}{width} {shown}".rstrip()
