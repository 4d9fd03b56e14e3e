"""A rig in motion: frequencies, peaks and dissipation, on a terminal, as pictures, as a page, as files."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from rich.markup import escape

from sindyjoint.numeric import Array
from sindyjoint.reporting.figure import Axes, Kind, bars, by_name, fixed
from sindyjoint.reporting.page import Blocks, Page, section
from sindyjoint.reporting.style import (
    DASHES,
    MUTED,
    PALETTE,
    amount,
    legend_above,
    plain,
    prefixed,
    shortened,
)
from sindyjoint.reporting.tables import DASH, Console, TextTable, csv_columns
from sindyjoint.reporting.view import View
from sindyjoint.workflows.rig import RigMotion

# What a picture shows of a curve.
DRAWN_SAMPLES = 4000


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


def deflection(result: RigFigures, ax: Axes) -> Axes:
    """Draw the deflection of the output points over time."""
    _lines(ax, result.time, result.displacement, "m")
    ax.set(ylabel=f"Deflection ({ax.get_ylabel()})", title=plain(shortened(result.name)))
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
    ax.set(xlabel="Time (s)", ylabel=shown)
    legend_above(ax, -(-len(signals) // 2) + 1, columns=2)


def heat(result: RigFigures, ax: Axes) -> Axes:
    """Draw who dissipates how much of what became heat."""
    total = sum(result.heat.values()) or 1.0
    shares = [100 * value / total for value in result.heat.values()]
    return bars(ax, _names(result.heat), shares, 115, "Share of what became heat, %", PALETTE[0], "{:.1f}")


def locked(result: RigFigures, ax: Axes) -> Axes:
    """Draw the share of the time in which each joint is locked."""
    shares = (100 * result.locked).tolist()
    return bars(ax, _names(result.joints), shares, 115, "Share of the time locked, %", MUTED, "{:.1f}")


def _names(names: Iterable[str]) -> list[str]:
    return [plain(shortened(name, 18)) for name in names]


KINDS = by_name(
    Kind(
        "deflection", "Deflection", "Deflection of the output points over time.", fixed(deflection), wide=True
    ),
    Kind(
        "angles",
        "Joint angles",
        "Angle of every joint over time; where a line is flat the joint is locked.",
        fixed(angles),
        wide=True,
    ),
    Kind("heat", "Dissipation", "Who dissipates how much of what became heat.", fixed(heat)),
    Kind("locked", "Locked", "Share of the time in which each joint is locked.", fixed(locked)),
)


class RigView(
    View[RigMotion, RigFigures],
    data=RigFigures,
    kind="Rig",
    folder="rig",
    kinds=KINDS,
    record_file="rig.json",
):
    """A rig in motion."""

    def simulated(self, result: RigMotion | RigFigures) -> bool:
        """Return True: a rig moves only in a simulation."""
        return True

    def drawn_from(self, result: RigMotion) -> RigFigures:
        """Return no more samples than a picture shows."""
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

    def tables(self, result: RigMotion) -> tuple[TextTable, ...]:
        """Return the frequencies of the modes, and what each joint and the beams did."""
        modes = tuple(
            (str(mode), f"{low:.3f} Hz", f"{high:.3f} Hz")
            for mode, (low, high) in enumerate(zip(result.slipping, result.locked, strict=False), 1)
        )
        columns = ("Joint", "Largest angle", "Locked", "Slips until", "Dissipated", "Share")
        return (
            TextTable(
                "modes",
                "With the joints' stiffness at standstill, and with locked joints.",
                ("Mode", "Joints slip", "Joints locked"),
                modes,
            ),
            TextTable("joints", "From the pulse to the end of the simulation.", columns, _joint_rows(result)),
        )

    def page(self, result: RigMotion, data: RigFigures, show: Blocks, folder: Path | None) -> Page:
        """Return where the energy goes, what each joint did, frequencies and motion."""
        first = max(result.heat, key=lambda name: result.heat[name])
        share = 100 * (result.heat[first] / (sum(result.heat.values()) or 1.0))
        locked_at = float(result.last_slips.max(initial=0.0))
        modes, joints = self.tables(result)
        reason = f"The joints slip for the last time {locked_at:.2f} s after the pulse."
        if result.rig.description:
            reason += f" {result.rig.description}."
        return Page(
            f"{data.name} in motion",
            "A structure with joints after its pulse",
            data.name,
            (
                show.verdict(f"Most of the energy, {share:.0f} %, is dissipated in: {first}."),
                show.paragraph(reason, "reason"),
                show.pictures("deflection"),
            ),
            (
                section(
                    "joints",
                    "What each joint did",
                    "Joints",
                    show.table(joints),
                    show.pictures("heat", "locked"),
                ),
                section("modes", "Natural frequencies", "Frequencies", show.table(modes)),
                section("motion", "Motion", "Motion", show.pictures("angles")),
            ),
        )

    def files(self, result: RigMotion, data: RigFigures) -> dict[str, str]:
        """Return time, force, deflections, joint angles and moments, SI units."""
        response = result.response
        columns = {"time_s": response.time, "force_N": response.force}
        columns |= {f"{name}_m": values for name, values in response.displacement.items()}
        for name, angle, moment in zip(response.joints, response.angle, response.moment, strict=True):
            columns |= {f"{name}_angle_rad": angle, f"{name}_moment_Nm": moment}
        return {"response.csv": csv_columns(columns, 9)}

    def about(self, result: RigMotion) -> str:
        """Return the rig and how long it is followed."""
        return f"{escape(result.rig.name)} (simulated), {result.response.time[-1]:.3g} s after the pulse"

    def show_result(self, result: RigMotion, console: Console) -> None:
        """Print frequencies, what each joint did, and peaks."""
        super().show_result(result, console)
        for name, values in result.response.displacement.items():
            deflection = amount(float(np.abs(values).max()), "m")
            console.print(f"largest deflection at {name}: {deflection}", markup=False)

    def details(self, result: RigMotion) -> Iterator[str]:
        """Yield how it was simulated, and the balance of its energy."""
        response = result.response
        yield f"{response.time.size} samples, steps of {1e3 * response.step:g} ms, {response.events} events of joints"
        before, after = response.energy.max(), response.energy[-1]
        heat = sum(result.heat.values())
        yield f"largest energy {before:.4g} J, remaining at the end {after:.4g} J, became heat {heat:.4g} J"


def _joint_rows(result: RigMotion) -> tuple[tuple[str, ...], ...]:
    response, total = result.response, sum(result.heat.values()) or 1.0
    rows = [
        (
            name,
            amount(float(np.abs(response.angle[index]).max()), "rad"),
            f"{100 * response.stuck[index].mean():.1f} %",
            f"{result.last_slips[index]:.2f} s",
            amount(result.heat[name], "J"),
            f"{100 * (result.heat[name] / total):.1f} %",
        )
        for index, name in enumerate(response.joints)
    ]
    lost = response.beam_dissipation
    return (*rows, ("beams", DASH, DASH, DASH, amount(lost, "J"), f"{100 * (lost / total):.1f} %"))
