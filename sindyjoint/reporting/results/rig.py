"""A rig in motion: frequencies, peaks and dissipation, on a terminal, as a page, as files."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np

from sindyjoint.reporting.figures.rig import KINDS, RigFigures, figures_of
from sindyjoint.reporting.style import amount
from sindyjoint.reporting.text_table import DASH, TextTable, csv_text, print_whole, terminal, terminal_table
from sindyjoint.reporting.view import View
from sindyjoint.workflows.rig import RigMotion


class RigView(View[RigMotion, RigFigures]):
    """A rig in motion."""

    results = (RigMotion, RigFigures)
    data = RigFigures
    kind = "Rig"
    folder = "rig"
    kinds = KINDS
    template = "rig.html.j2"
    record_file = "rig.json"

    def simulated(self, result: RigMotion | RigFigures) -> bool:
        """Return True: a rig moves only in a simulation."""
        return True

    def gather(self, result: RigMotion | RigFigures) -> RigFigures:
        """Return what is drawn."""
        return result if isinstance(result, RigFigures) else figures_of(result)

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

    def content(self, result: RigMotion, data: RigFigures, folder: Path | None) -> dict[str, Any]:
        """Return what the page shows."""
        first = max(result.heat, key=lambda name: result.heat[name])
        share = 100 * (result.heat[first] / (sum(result.heat.values()) or 1.0))
        locked_at = float(result.last_slips.max(initial=0.0))
        return {
            "title": f"{result.rig.name} in motion",
            "headline": f"Most of the energy, {share:.0f} %, is dissipated in: {first}.",
            "reason": f"The joints slip for the last time {locked_at:.2f} s after the pulse.",
        }

    def files(self, result: RigMotion, data: RigFigures) -> dict[str, str]:
        """Return the response over time."""
        return {"response.csv": response_csv(result)}

    def show(self, result: RigMotion) -> None:
        """Print frequencies, peaks, and what each joint did."""
        from rich.markup import escape

        console = terminal()
        console.print(
            f"{escape(result.rig.name)} (simulated), {result.response.time[-1]:.3g} s after the pulse\n"
        )
        for table in self.tables(result):
            print_whole(terminal_table([column.lower() for column in table.columns], table.rows), console)
            console.print()
        for name, values in result.response.displacement.items():
            deflection = amount(float(np.abs(values).max()), "m")
            console.print(f"largest deflection at {escape(name)}: {deflection}")
        for warning in result.warnings:
            console.print(f"- {escape(warning)}")

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


def response_csv(result: RigMotion) -> str:
    """Return time, force, deflections, joint angles and moments as CSV, SI units."""
    response = result.response
    names = ["time_s", "force_N", *(f"{name}_m" for name in response.displacement)]
    names += [f"{name}_{what}" for name in response.joints for what in ("angle_rad", "moment_Nm")]
    columns = [response.time, response.force, *response.displacement.values()]
    for angle, moment in zip(response.angle, response.moment, strict=True):
        columns += [angle, moment]
    return csv_text(names, [[f"{value:.9g}" for value in row] for row in zip(*columns, strict=True)])
