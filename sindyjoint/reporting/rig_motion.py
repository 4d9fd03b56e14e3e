"""A rig in motion for people: its lines on a terminal, its pictures, its page and folder."""

from __future__ import annotations

import os
import sys
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from sindyjoint.reporting.style import DASHES, INK, MUTED, PALETTE, legend_above, plain, prefixed, shortened
from sindyjoint.reporting.tables import csv_text

if TYPE_CHECKING:
    from matplotlib.axes import Axes

    from sindyjoint.reporting.provenance import Provenance
    from sindyjoint.workflows.rig import RigMotion

Array = NDArray[np.float64]

WIDTH = 100
# What a picture shows of a curve.
DRAWN_SAMPLES = 4000
COLUMNS = ("Joint", "Largest angle", "Locked", "Slips until", "Dissipated", "Share")


@dataclass(frozen=True, eq=False)
class RigFigures:
    """What the pictures of a rig in motion are drawn from.

    Parameters
    ----------
    name : str
    time : ndarray, shape (n,)
        s.
    displacement : dict of str to ndarray, shape (n,)
        m.
    joints : tuple of str
    angle : ndarray, shape (joints, n)
        rad.
    locked : ndarray, shape (joints,)
        Share of the time.
    heat : dict of str to float
        J.
    """

    name: str
    time: Array
    displacement: dict[str, Array]
    joints: tuple[str, ...]
    angle: Array
    locked: Array
    heat: dict[str, float]


def figures_of(result: RigMotion) -> RigFigures:
    """Return what is drawn of a rig in motion."""
    response = result.response
    step = -(-response.time.size // DRAWN_SAMPLES)
    return RigFigures(
        name=result.rig.name,
        time=response.time[::step],
        displacement={name: values[::step] for name, values in response.displacement.items()},
        joints=response.joints,
        angle=response.angle[:, ::step],
        locked=response.stuck.mean(axis=1),
        heat=result.heat,
    )


def deflection(result: RigFigures, ax: Axes) -> Axes:
    """Draw the deflection of the output points over time."""
    _lines(ax, result.time, result.displacement, "m")
    ax.set_ylabel(f"Deflection ({ax.get_ylabel()})")
    ax.set_title(plain(shortened(result.name)))
    return ax


def angles(result: RigFigures, ax: Axes) -> Axes:
    """Draw the angle of every joint over time."""
    _lines(ax, result.time, dict(zip(result.joints, result.angle, strict=True)), "rad")
    ax.set_ylabel(f"Joint angle ({ax.get_ylabel()})")
    return ax


def _lines(ax: Axes, time: Array, signals: dict[str, Array], unit: str) -> None:
    largest = max((float(np.abs(values).max()) for values in signals.values()), default=1.0)
    factor, shown = prefixed(largest, unit)
    for index, (name, values) in enumerate(signals.items()):
        color, dash = PALETTE[index % len(PALETTE)], DASHES[index % len(DASHES)]
        ax.plot(time, values * factor, lw=0.8, color=color, ls=dash, label=plain(shortened(name, 18)))
    ax.set_xlabel("Time (s)")
    ax.set_ylabel(shown)
    legend_above(ax, -(-len(signals) // 2) + 1, columns=2)


def heat(result: RigFigures, ax: Axes) -> Axes:
    """Draw who dissipates how much of what became heat."""
    total = sum(result.heat.values()) or 1.0
    shares = [100 * value / total for value in result.heat.values()]
    return _bars(ax, list(result.heat), shares, "Share of what became heat, %", PALETTE[0])


def locked(result: RigFigures, ax: Axes) -> Axes:
    """Draw the share of the time in which each joint is locked."""
    return _bars(
        ax, list(result.joints), (100 * result.locked).tolist(), "Share of the time locked, %", MUTED
    )


def _bars(ax: Axes, names: list[str], shares: list[float], label: str, color: str) -> Axes:
    ax.barh(range(len(names)), shares, color=color)
    for index, share in enumerate(shares):
        ax.text(share + 1, index, f"{share:.1f}", va="center", color=INK)
    ax.set_yticks(range(len(names)), [plain(shortened(name, 18)) for name in names])
    ax.invert_yaxis()
    ax.set_xlim(0, 115)
    ax.set_xlabel(label)
    return ax


def joint_rows(result: RigMotion) -> list[tuple[str, ...]]:
    """Return a row per joint and one of the beams; see :data:`COLUMNS`."""
    response, total = result.response, sum(result.heat.values()) or 1.0

    def amount(value: float, unit: str) -> str:
        factor, shown = prefixed(value, unit)
        return f"{value * factor:.3g} {shown}"

    rows = []
    for index, name in enumerate(response.joints):
        lost = result.heat[name]
        rows.append(
            (
                name,
                amount(float(np.abs(response.angle[index]).max()), "rad"),
                f"{100 * response.stuck[index].mean():.1f} %",
                f"{result.last_slips[index]:.2f} s",
                amount(lost, "J"),
                f"{100 * (lost / total):.1f} %",
            )
        )
    lost = response.beam_dissipation
    return [*rows, ("beams", "–", "–", "–", amount(lost, "J"), f"{100 * (lost / total):.1f} %")]


def mode_rows(result: RigMotion) -> list[tuple[str, ...]]:
    """Return a row per mode: its frequency with slipping and with locked joints."""
    return [
        (str(mode), f"{low:.3f} Hz", f"{high:.3f} Hz")
        for mode, (low, high) in enumerate(zip(result.slipping, result.locked, strict=False), 1)
    ]


def show_rig_motion(result: RigMotion) -> None:
    """Print frequencies, peaks, and what each joint did."""
    from rich.console import Console
    from rich.markup import escape
    from rich.table import Table

    console = Console(width=None if sys.stdout.isatty() else WIDTH, highlight=False)
    console.print(
        f"{escape(result.rig.name)} (simulated), {result.response.time[-1]:.3g} s after the pulse\n"
    )
    for columns, rows in ((("mode", "joints slip", "joints locked"), mode_rows(result)),
                          (tuple(map(str.lower, COLUMNS)), joint_rows(result))):  # fmt: skip
        table = Table(box=None, pad_edge=False, padding=(0, 2, 0, 0))
        for column in columns:
            table.add_column(column, justify="left" if column in ("mode", "joint") else "right", no_wrap=True)
        for row in rows:
            table.add_row(*map(escape, row))
        console.print(table)
        console.print()
    for name, values in result.response.displacement.items():
        factor, unit = prefixed(float(np.abs(values).max()), "m")
        console.print(f"largest deflection at {escape(name)}: {np.abs(values).max() * factor:.3g} {unit}")


def rig_page(result: RigMotion, origin: Provenance, pictures: dict[str, bytes]) -> str:
    """Return the report as one HTML text."""
    from sindyjoint.reporting.page import render
    from sindyjoint.reporting.result_pages import inlined

    total = sum(result.heat.values()) or 1.0
    first = max(result.heat, key=lambda name: result.heat[name])
    locked_at = float(result.last_slips.max(initial=0.0))
    return render(
        "rig.html.j2",
        title=f"{result.rig.name} in motion",
        origin=origin,
        result=result,
        headline=f"Most of the energy, {100 * (result.heat[first] / total):.0f} %, is dissipated in: {first}.",
        reason=f"The joints slip for the last time {locked_at:.2f} s after the pulse.",
        modes=mode_rows(result),
        columns=COLUMNS,
        rows=joint_rows(result),
        **inlined(figures_of(result), pictures),
    )


def response_csv(result: RigMotion) -> str:
    """Return time, force, deflections, joint angles and moments as CSV, SI units."""
    response = result.response
    names = ["time_s", "force_N", *(f"{name}_m" for name in response.displacement)]
    names += [f"{name}_{what}" for name in response.joints for what in ("angle_rad", "moment_Nm")]
    columns = [response.time, response.force, *response.displacement.values()]
    for angle, moment in zip(response.angle, response.moment, strict=True):
        columns += [angle, moment]
    return csv_text(names, [[f"{value:.9g}" for value in row] for row in zip(*columns, strict=True)])


def write_rig_motion(
    result: RigMotion,
    folder: str | os.PathLike[str],
    command_line: str | Sequence[str] | None = None,
    files: Sequence[str | os.PathLike[str]] = (),
) -> Path:
    """Write report.html, rig.json, response.csv and figures, all of them or none."""
    from sindyjoint.reporting.output import draw_all, json_text, write_folder
    from sindyjoint.reporting.provenance import provenance
    from sindyjoint.reporting.saved import DATA_FILE, saved_text

    figures = figures_of(result)
    pictures = draw_all(figures)
    texts = {
        DATA_FILE: saved_text(figures),
        "report.html": rig_page(result, provenance(None, None, command_line, files), pictures),
        "rig.json": json_text(result.to_dict()),
        "response.csv": response_csv(result),
    }
    return write_folder(folder, pictures, texts)
