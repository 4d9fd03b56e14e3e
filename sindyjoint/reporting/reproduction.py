"""The reproduction of the paper for people: figures, tables and a page of text."""

from __future__ import annotations

import csv
import io
import json
import os
import sys
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from sindyjoint.files.atomic import output_folder
from sindyjoint.paper import FREQUENCIES, PULSE, SYMBOLS, TERMS, UNITS
from sindyjoint.reporting.style import (
    DIVERGING,
    DOUBLE_COLUMN,
    INK,
    PALETTE,
    SINGLE_COLUMN,
    figure_bytes,
    new_figure,
    pretty_unit,
    style,
)
from sindyjoint.reporting.verification import amplitude, period

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

    from sindyjoint.states import ForceStates
    from sindyjoint.surface import ForceStateMap
    from sindyjoint.workflows.paper_tables import TableCheck
    from sindyjoint.workflows.reproduce import JointReproduction, Reproduction
    from sindyjoint.workflows.verification import RunVerification

WIDTH = 118


# ---- figures


def loops(joint: JointReproduction, ax: Axes) -> Axes:
    """Draw moment over angle at 3 Hz for some of the levels: one period each (Figure 5)."""
    for state, color in zip(joint.loops[:7:2], PALETTE, strict=False):
        theta, moment = _one_period(state)
        ax.plot(1e3 * theta, moment, color=color, lw=0.9)
    ax.set_xlabel("Angle $\\theta$ (mrad)")
    ax.set_ylabel("Moment $M$ (N·m)")
    ax.set_title(f"{joint.table.joint}, 3 Hz")
    return ax


def _one_period(state: ForceStates) -> tuple[np.ndarray, np.ndarray]:
    """Angle and mean moment of all periods, closed, on a grid of phases."""
    assert state.frequency is not None
    count = 240
    phase = np.mod((state.time - state.time[0]) * state.frequency, 1.0)
    cell = np.minimum((phase * count).astype(int), count - 1)
    number = np.bincount(cell, minlength=count)
    theta, moment = (np.bincount(cell, x, minlength=count) / number for x in (state.angle, state.moment))
    return np.append(theta, theta[0]), np.append(moment, moment[0])


def surface(given: ForceStateMap, ax: Any, step: bool = True) -> Any:
    """Draw the averaged cells as a surface (Figures 6 and 7); with a friction step, one on each side of zero rate."""
    from matplotlib.ticker import MaxNLocator
    from matplotlib.tri import Triangulation

    limit = float(np.nanmax(np.abs(given.moment)))
    width = [float(edges[1] - edges[0]) for edges in (given.angle_edges, given.rate_edges)]
    for side in (given.rate > 0, given.rate < 0) if step else (given.filled,):
        keep = given.filled & side
        x, y, z = given.angle[keep], given.rate[keep], given.moment[keep]
        mesh = Triangulation(x / width[0], y / width[1])
        corners = np.stack([mesh.x, mesh.y], axis=1)[mesh.triangles]
        longest = np.linalg.norm(corners - np.roll(corners, 1, axis=1), axis=2).max(axis=1)
        # Cells that no run passed stay open, but for the gaps between neighbouring rings.
        mesh = Triangulation(1e3 * x, 1e3 * y, mesh.triangles[longest < 8])
        ax.plot_trisurf(
            mesh, z, cmap=DIVERGING, vmin=-limit, vmax=limit, lw=0.15, edgecolor=(0.1, 0.1, 0.1, 0.5)
        )
    ax.set_xlabel("$\\theta$ (mrad)", labelpad=-4)
    ax.set_ylabel("$\\dot{\\theta}$ (mrad/s)", labelpad=-4)
    ax.set_zlabel("$M_T$ (N·m)", labelpad=-6)
    ax.tick_params(pad=-2)
    ax.xaxis.set_major_locator(MaxNLocator(4))
    ax.yaxis.set_major_locator(MaxNLocator(4))
    # From where the surface is not seen edge on; drawn smaller, since the layout does not know of axis labels in 3-D.
    ax.view_init(elev=24, azim=-58 if step else -125)
    ax.set_box_aspect(None, zoom=0.86)
    return ax


def force(result: Reproduction, ax: Axes) -> Axes:
    """Draw the pulse (Figure 9)."""
    time = np.linspace(-0.005, 0.02, 2001)
    values = np.where(time < 0, 0.0, result.pulse.rig.excitation(np.maximum(time, 0.0)))
    ax.plot(1e3 * time, values, color=PALETTE[0])
    ax.set_xlabel("Time (ms)")
    ax.set_ylabel("Force (N)")
    return ax


def response(run: RunVerification, ax: Axes, until: float, compared: bool) -> Axes:
    """Draw the displacement of the free end (Figure 10), with the simulation over it (Figure 11)."""
    kept = run.time <= until
    ax.plot(run.time[kept], 1e3 * run.measured[kept], color=PALETTE[0], lw=0.8, label="virtual test")
    if compared and run.simulated is not None:
        ax.plot(
            run.time[kept], 1e3 * run.simulated[kept], color=INK, lw=0.7, ls=(0, (3, 1.5)), label="identified model"
        )  # fmt: skip
    ax.set_xlabel("Time (s)")
    ax.set_ylabel("Displacement (mm)")
    ax.margins(x=0.01)
    return ax


def _figure_5(result: Reproduction) -> Figure:
    figure = new_figure(DOUBLE_COLUMN, 3.0)
    for joint, ax in zip(result.joints, figure.subplots(1, 2), strict=True):
        loops(joint, ax)
    return figure


def _figure_6(result: Reproduction) -> Figure:
    figure = new_figure(SINGLE_COLUMN, 3.2)
    surface(result.linear, figure.add_subplot(projection="3d"), step=False)
    return figure


def _figure_7(result: Reproduction) -> Figure:
    figure = new_figure(DOUBLE_COLUMN, 3.4)
    for place, joint in enumerate(result.joints, 1):
        ax = figure.add_subplot(1, 2, place, projection="3d")
        surface(joint.surface, ax).set_title(f"{joint.table.joint}, 3 Hz")
    return figure


def _figure_9(result: Reproduction) -> Figure:
    figure = new_figure(SINGLE_COLUMN, 2.2)
    force(result, figure.subplots())
    return figure


def _figure_10(result: Reproduction) -> Figure:
    figure = new_figure(DOUBLE_COLUMN, 2.4)
    response(result.pulse.plain.runs[0], figure.subplots(), PULSE.compared, False)
    return figure


def _figure_11(result: Reproduction) -> Figure:
    figure = new_figure(DOUBLE_COLUMN, 4.6)
    rows = figure.subplots(2, 1, sharex=True)
    titles = ("the truth holds nothing the model lacks", "the truth's friction gives way before it slips")
    for run, ax, title in zip(
        (result.pulse.plain.runs[0], result.pulse.richer.runs[0]), rows, titles, strict=True
    ):
        response(run, ax, 10.0, True).set_title(title)
    rows[0].legend(loc="upper right", ncols=2)
    rows[0].set_xlabel("")
    return figure


def _swings(result: Reproduction) -> Figure:
    figure = new_figure(DOUBLE_COLUMN, 4.6)
    axes = figure.subplots(2, 2, sharex=True)
    for run, row in zip((result.pulse.plain.runs[0], result.pulse.richer.runs[0]), axes, strict=True):
        amplitude(run, row[0])
        period(run, row[1])
    axes[0, 0].set_title("the truth holds nothing the model lacks")
    axes[1, 0].set_title("the truth's friction gives way before it slips")
    return figure


#: File name, what the figure is, and how it is drawn.
FIGURES: tuple[tuple[str, str, Callable[[Reproduction], Figure]], ...] = (
    ("figure-05", "Figure 5: moment over angle at 3 Hz; four of nine levels, periods averaged", _figure_5),
    (
        "figure-06",
        "Figure 6: force–state map of a linear spring, mass and damper: an oblique plane",
        _figure_6,
    ),
    ("figure-07", "Figure 7: force–state maps at 3 Hz; moving samples averaged in 24 × 24 cells", _figure_7),
    ("figure-09", "Figure 9: the exciting force", _figure_9),
    ("figure-10", "Figure 10: displacement of the free end after the pulse, 20 s", _figure_10),
    ("figure-11", "Figure 11: virtual test and identified model, first 10 s", _figure_11),
    (
        "amplitude-and-period",
        "Amplitude and period, swing by swing, of both virtual tests and the model",
        _swings,
    ),
)


def draw_reproduction(result: Reproduction) -> dict[str, Figure]:
    """Return every figure by the name of its file."""
    with style():
        return {name: draw(result) for name, _, draw in FIGURES}


# ---- text


# Powers of ten that k1, k2, k3, c1, M_F are printed in.
_POWERS = (3, 5, 9, 1, 0)


def table_rows(joint: JointReproduction) -> list[list[str]]:
    """Return a table as rows of text: identified, and the paper's value in brackets."""
    heading = [
        f"{symbol} [{f'1e{power} ' if power > 1 else ''}{pretty_unit(unit)}]"
        for symbol, unit, power in zip(SYMBOLS, UNITS, _POWERS, strict=True)
    ]
    scale = 10.0 ** np.array([power if power > 1 else 0 for power in _POWERS])

    def cells(values: Any) -> list[str]:
        return [_four_digits(value) for value in np.asarray(values) / scale]

    paper = joint.table
    rows = [["", *heading]]
    for label, ours, theirs in (
        *((f"{f:g} Hz", r, p) for f, r, p in zip(FREQUENCIES, joint.rows, paper.rows, strict=True)),
        ("average", joint.average, paper.average),
        ("deviation", joint.deviation, paper.deviation),
    ):
        rows.append([label, *(f"{a} ({b})" for a, b in zip(cells(ours), cells(theirs), strict=True))])
    rows.append(["furthest", *(f"{value:.2f}" for value in joint.largest_error)])
    rows.append(["paper's way, 3 Hz", *cells(joint.paper_fit.coefficients)])
    return rows


def _four_digits(value: float) -> str:
    """Return four digits, trailing zeros included, as the paper prints them."""
    digits = 3 - int(np.floor(np.log10(abs(value)))) if value else 3
    return f"{value:.{max(digits, 0)}f}"


def check_rows(checks: Sequence[TableCheck]) -> list[list[str]]:
    """Return what the printed tables say as rows of text."""
    rows = [
        [
            "table",
            "parameter",
            "average",
            "printed",
            "s.d.",
            "printed",
            "change, 3–6 Hz",
            "possible",
            "answer",
        ]
    ]
    for check in checks:
        rows.append(
            [
                str(check.table),
                check.symbol,
                f"{check.average:.4g}",
                f"{check.printed_average:.4g}{'' if check.average_follows else ' !'}",
                f"{check.deviation:.4g}",
                f"{check.printed_deviation:.4g}{'' if check.deviation_follows else ' !'}",
                f"{check.test.change:+.1%} (p {check.test.p_trend:.2f})",
                f"{check.test.change_bound:.0%}",
                check.test.answer,
            ]
        )
    return rows


def _markdown(rows: list[list[str]]) -> str:
    lines = [f"| {' | '.join(row)} |" for row in rows]
    return "\n".join([lines[0], "|" + "---|" * len(rows[0]), *lines[1:]])


_LEGEND = (
    "Identified (paper). Deviation: population standard deviation over the frequencies. Furthest: largest distance "
    "of a row from the paper's, in the paper's deviations. Paper's way: cells averaged with the sticking samples in "
    "them, then a surface, on virtual runs at 3 Hz."
)


def page_text(result: Reproduction) -> str:
    """Return everything as one Markdown page."""
    parts = ["# The paper's tables and figures from virtual tests", ""]
    parts += [f"- {sentence}" for sentence in result.statements]
    for joint in result.joints:
        parts += ["", f"## Table {joint.table.number}: {joint.table.joint}", "", _LEGEND, ""]
        parts.append(_markdown(table_rows(joint)))
    parts += ["", "## What the printed tables show", "", _markdown(check_rows(result.checks)), ""]
    parts += [
        "`!`: does not follow from the printed rows. *Possible*: the largest change that the four values leave",
        "",
    ]
    parts[-2] += " possible at 5 % risk."
    parts += ["## Figures", ""]
    parts += [f"![{caption}](figures/{name}.svg)\n\n{caption}\n" for name, caption, _ in FIGURES]
    return "\n".join(parts)


def tables_csv(result: Reproduction) -> str:
    """Return Tables 1 and 2, identified and printed, as CSV."""
    buffer = io.StringIO()
    writer = csv.writer(buffer, lineterminator="\n")
    writer.writerow(
        ["table", "joint", "frequency_hz", "term", "symbol", "unit", "identified", "standard_error", "paper"]
    )
    for joint in result.joints:
        for f, ours, errors, theirs in zip(
            FREQUENCIES, joint.rows, joint.errors, joint.table.rows, strict=True
        ):
            for i, term in enumerate(TERMS):
                writer.writerow(
                    [joint.table.number, joint.table.joint, f, term, SYMBOLS[i], UNITS[i], repr(float(ours[i])),
                     repr(float(errors[i])), repr(theirs[i])]
                )  # fmt: skip
    return buffer.getvalue()


def write_reproduction(result: Reproduction, folder: str | os.PathLike[str]) -> Path:
    """Write reproduction.md, reproduction.json, tables.csv and figures/*.svg, all of them or none."""
    with output_folder(folder) as stage:
        (stage / "figures").mkdir()
        for name, figure in draw_reproduction(result).items():
            (stage / "figures" / f"{name}.svg").write_bytes(figure_bytes(figure, "svg"))
        text = json.dumps(result.to_dict(), indent=1, ensure_ascii=False, allow_nan=False)
        for name, content in (
            ("reproduction.md", page_text(result)),
            ("reproduction.json", text + "\n"),
            ("tables.csv", tables_csv(result)),
        ):
            (stage / name).write_text(content, encoding="utf-8", newline="\n")
    return Path(folder)


def show_reproduction(result: Reproduction) -> None:
    """Print tables and statements."""
    for joint in result.joints:
        _print_table(
            f"Table {joint.table.number}: {joint.table.joint}, identified (paper)", table_rows(joint)
        )
    _console().print(_LEGEND + "\n")
    show_checks(result.checks, ())
    _print_statements(result.statements)


def show_checks(checks: Sequence[TableCheck], findings: Sequence[str]) -> None:
    """Print what the paper's printed tables show."""
    _print_table("The printed tables, recomputed from their rows", check_rows(checks))
    _print_statements(findings)


def _console() -> Any:
    from rich.console import Console

    return Console(width=None if sys.stdout.isatty() else WIDTH, highlight=False, markup=False)


def _print_table(title: str, rows: list[list[str]]) -> None:
    from rich.table import Table

    console = _console()
    console.print(title)
    table = Table(box=None, pad_edge=False, padding=(0, 2, 0, 0))
    for column, heading in enumerate(rows[0]):
        table.add_column(heading, justify="right" if column else "left")
    for row in rows[1:]:
        table.add_row(*row)
    console.print(table)
    console.print()


def _print_statements(said: Sequence[str]) -> None:
    console = _console()
    for sentence in said:
        console.print(f"- {sentence}")
