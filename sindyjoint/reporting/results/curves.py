"""Curves of a joint and of a structure, on a terminal, as a page, as files."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from rich.markup import escape

from sindyjoint.reporting.figures.curves import JOINT_KINDS, STRUCTURE_KINDS, UNITS
from sindyjoint.reporting.style import prefixed
from sindyjoint.reporting.text_table import DASH, TextTable, csv_text, print_whole, terminal, terminal_table
from sindyjoint.reporting.view import View
from sindyjoint.substructure.forced import ForcedResponse
from sindyjoint.substructure.joint_curves import MEASURES, JointCurve, JointCurves
from sindyjoint.substructure.modes import ModeCurve
from sindyjoint.substructure.structure_curves import StructureCurves

# Rows of a joint's table for each frequency.
ROWS = 5


class JointCurvesView(View[JointCurves, JointCurves]):
    """Stiffness, loss and energy of a joint over amplitude."""

    results = (JointCurves,)
    data = JointCurves
    kind = "JointCurves"
    folder = "joint-curves"
    kinds = JOINT_KINDS
    template = "curves.html.j2"
    record_file = "curves.json"

    def tables(self, result: JointCurves) -> tuple[TextTable, ...]:
        """Return the measures at some amplitudes of each frequency."""
        rows = tuple(row for curve in result.curves for row in _joint_rows(curve, result.motion))
        what = "Angle" if result.motion == "rotation" else "Displacement"
        columns = ("Frequency", what, "Secant stiffness", "Loss factor", "Energy per cycle", "Tested")
        return (TextTable("curves", "With half-widths of the 95 % intervals.", columns, rows),)

    def content(self, result: JointCurves, data: JointCurves, folder: Path | None) -> dict[str, Any]:
        """Return what the page shows."""
        return {
            "title": f"{result.name}: stiffness and loss over amplitude",
            "name": result.name,
            "kicker": "A joint over its amplitude",
            "headline": joint_headline(result),
            "reason": f"Of the model {result.equation}.",
            "sections": (("curves", "Stiffness and loss", "curves", ("stiffness", "loss", "energy")),),
        }

    def files(self, result: JointCurves, data: JointCurves) -> dict[str, str]:
        """Return all curves as a table."""
        return {"curves.csv": joint_csv(result)}

    def show(self, result: JointCurves) -> None:
        """Print the measures at some amplitudes."""
        _print(f"{result.name}: {joint_headline(result)}", self.tables(result), result.warnings)


class StructureCurvesView(View[StructureCurves, StructureCurves]):
    """Frequency response by level, backbone and damping of a structure."""

    results = (StructureCurves,)
    data = StructureCurves
    kind = "StructureCurves"
    folder = "structure-curves"
    kinds = STRUCTURE_KINDS
    template = "curves.html.j2"
    record_file = "curves.json"

    def tables(self, result: StructureCurves) -> tuple[TextTable, ...]:
        """Return the peak of each level, and the course of each mode."""
        levels = ("Force", "Peak at", "Amplitude", "Largest joint angle", "Jumps at")
        modes = ("Mode", "At", "Amplitude", "Frequency", "Damping", "Slips from")
        length = UNITS[result.motion][0]
        rows = tuple(_level_row(level, length) for level in result.levels)
        return (
            TextTable("levels", "The largest response at each level.", levels, rows),
            TextTable(
                "modes", "From the smallest to the largest amplitude.", modes,
                tuple(_mode_row(mode, result.joints) for mode in result.modes),
            ),
        )  # fmt: skip

    def content(self, result: StructureCurves, data: StructureCurves, folder: Path | None) -> dict[str, Any]:
        """Return what the page shows."""
        return {
            "title": f"{result.name}: response and modes over amplitude",
            "name": result.name,
            "kicker": "A structure over frequency and amplitude",
            "headline": structure_headline(result),
            "reason": f"The force acts at {result.at}; up to {result.harmonics} harmonics, and joints stick exactly.",
            "sections": (
                ("levels", "Frequency response", "levels", ("response", "receptance")),
                ("modes", "Modes over amplitude", "modes", ("backbone", "damping")),
            ),
        }

    def files(self, result: StructureCurves, data: StructureCurves) -> dict[str, str]:
        """Return response and modes as tables."""
        return {"response.csv": response_csv(result), "modes.csv": modes_csv(result)}

    def show(self, result: StructureCurves) -> None:
        """Print peaks and modes."""
        _print(
            f"{result.name} (simulated): {structure_headline(result)}", self.tables(result), result.warnings
        )

    def details(self, result: StructureCurves) -> Iterator[str]:
        """Yield the number of points of each curve."""
        for mode in result.modes:
            yield f"mode {mode.number}: {mode.amplitude.size} amplitudes, {mode.harmonics} harmonics"
        for level in result.levels:
            yield f"{level.force:g} N: {level.frequency.size} frequencies, {level.harmonics} harmonics"


def _print(first: str, tables: Sequence[TextTable], warnings: Sequence[str]) -> None:
    console = terminal()
    console.print(f"{escape(first)}\n")
    for table in tables:
        if table.rows:
            print_whole(terminal_table([column.lower() for column in table.columns], table.rows), console)
            console.print()
    for warning in warnings:
        console.print(f"- {escape(warning)}")


def joint_headline(result: JointCurves) -> str:
    """Return how far stiffness and loss change over the tested amplitudes, in a sentence."""
    curve = result.curves[0]
    within = curve.amplitude <= result.tested_angle if result.tested_angle > 0 else np.ones(1, bool)
    last = int(np.flatnonzero(within)[-1]) if np.any(within) else curve.amplitude.size - 1
    small, large = (_amount(float(curve.secant[i]), UNITS[result.motion][1]) for i in (0, last))
    return (
        f"from {_amount(float(curve.amplitude[0]), UNITS[result.motion][0])} to "
        f"{_amount(float(curve.amplitude[last]), UNITS[result.motion][0])} the secant stiffness goes from {small} to "
        f"{large}, the loss factor at {curve.frequency:.3g} Hz from {curve.loss_factor[0]:.3g} to "
        f"{curve.loss_factor[last]:.3g}."
    )


def structure_headline(result: StructureCurves) -> str:
    """Return how far the first mode changes, in a sentence."""
    mode = result.modes[0]
    change = 100 * (mode.frequency[-1] / mode.frequency[0] - 1)
    return (
        f"up to {_amount(float(mode.amplitude[-1]), 'm')} at {mode.point} mode {mode.number} goes from "
        f"{mode.frequency[0]:.3g} to {mode.frequency[-1]:.3g} Hz ({change:+.2g} %) and its damping reaches "
        f"{100 * mode.damping.max():.2g} %."
    )


def _joint_rows(curve: JointCurve, motion: str) -> Iterator[tuple[str, ...]]:
    length, stiffness = UNITS[motion]
    for i in np.unique(np.linspace(0, curve.amplitude.size - 1, ROWS).round().astype(int)):
        yield (
            f"{curve.frequency:.3g} Hz",
            _amount(float(curve.amplitude[i]), length),
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
        _amount(float(level.angle.max()), length),
        ", ".join(f"{fold:.4g} Hz" for fold in level.folds) or DASH,
    )


def _mode_row(mode: ModeCurve, joints: Sequence[str]) -> tuple[str, ...]:
    slips = np.where(np.isfinite(mode.slips), mode.slips, np.inf)
    first = int(np.argmin(slips))
    return (
        str(mode.number),
        mode.point,
        f"{_amount(float(mode.amplitude[0]), 'm')} … {_amount(float(mode.amplitude[-1]), 'm')}",
        f"{mode.frequency[0]:.4g} … {mode.frequency[-1]:.4g} Hz",
        f"{100 * mode.damping[0]:.2g} … {100 * mode.damping[-1]:.2g} %",
        f"{_amount(float(slips[first]), 'm')} ({joints[first]})" if 0 < slips[first] < np.inf else DASH,
    )


def _amount(value: float, unit: str) -> str:
    factor, shown = prefixed(value, unit)
    return f"{value * factor:.3g} {shown}".rstrip()


def _with_width(value: float, error: float, unit: str) -> str:
    factor, shown = prefixed(value, unit)
    width = f" ± {1.96 * error * factor:.2g}" if error > 0 else ""
    return f"{value * factor:.4g}{width} {shown}".rstrip()


def joint_csv(result: JointCurves) -> str:
    """Return all curves of a joint as CSV, SI units."""
    length, stiffness = (unit.replace("*", "") for unit in UNITS[result.motion])
    units = {"secant": f"_{stiffness}", "storage": f"_{stiffness}", "loss_factor": "", "energy": "_J"}
    names = ["frequency_Hz", f"amplitude_{length}"]
    names += [f"{name}{end}{units[name]}" for name in MEASURES for end in ("", "_low95", "_high95")]
    rows = []
    for curve in result.curves:
        columns = [np.full(curve.amplitude.size, curve.frequency), curve.amplitude]
        for name in MEASURES:
            columns += [getattr(curve, name), *curve.interval95(name)]
        rows += [
            [*(f"{v:.7g}" for v in row), int(tested)]
            for row, tested in zip(np.array(columns).T, curve.tested, strict=True)
        ]
    return csv_text([*names, "tested"], rows)


def response_csv(result: StructureCurves) -> str:
    """Return the frequency response at all levels as CSV, SI units; edges are points of the 95 % band's two edges."""
    names = ["force_N", "frequency_Hz", "amplitude_m", "phase_deg", "low95_frequency_Hz", "low95_amplitude_m"]
    names += ["high95_frequency_Hz", "high95_amplitude_m", *_joint_columns(result)]
    rows = []
    for level in result.levels:
        columns = [np.full(level.frequency.size, level.force), level.frequency, level.amplitude]
        columns += [np.degrees(level.phase), *level.band95(-1), *level.band95(1), *level.angle]
        rows += [
            [*(f"{v:.7g}" for v in row), int(stable), int(tested)]
            for row, stable, tested in zip(np.array(columns).T, level.stable, level.tested, strict=True)
        ]
    return csv_text([*names, "stable", "tested"], rows)


def _joint_columns(result: StructureCurves) -> list[str]:
    quantity = "angle_rad" if result.motion == "rotation" else "elongation_m"
    return [f"{joint}_{quantity}" for joint in result.joints]


def modes_csv(result: StructureCurves) -> str:
    """Return the modes over amplitude as CSV, SI units."""
    names = [
        "mode",
        "amplitude_m",
        "frequency_Hz",
        "frequency_error_Hz",
        "damping_ratio",
        "damping_ratio_error",
    ]
    names += ["force_N", *_joint_columns(result), "tested"]
    rows = []
    for mode in result.modes:
        columns = [mode.amplitude, mode.frequency, mode.frequency_error, mode.damping, mode.damping_error]
        rows += [
            [mode.number, *(f"{v:.7g}" for v in row), int(tested)]
            for row, tested in zip(np.array([*columns, mode.force, *mode.angle]).T, mode.tested, strict=True)
        ]
    return csv_text(names, rows)
