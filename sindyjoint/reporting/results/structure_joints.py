"""Joints inside a structure: their laws and how well its sensors show them, on a terminal, as a page, as files."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np

from sindyjoint.judgement.joint_laws import JointLaw
from sindyjoint.judgement.rig_discovery import RigDiscovery
from sindyjoint.reporting.equation import mathml
from sindyjoint.reporting.figures.structure_joints import KINDS, RecoveredLoop, StructureFigures
from sindyjoint.reporting.page import markup
from sindyjoint.reporting.style import amount
from sindyjoint.reporting.tables import model_table
from sindyjoint.reporting.text_table import TextTable, print_whole, terminal, terminal_table
from sindyjoint.reporting.view import FINDING, View

POINTS = 400  # of a loop in the picture
TERM_COLUMNS = ("Kind", "Term", "Symbol", "Of", "Value", "Unit", "95 % interval")


class StructureJointsView(View[RigDiscovery, StructureFigures]):
    """The laws of the joints inside a structure."""

    results = (RigDiscovery, StructureFigures)
    data = StructureFigures
    kind = "StructureJoints"
    folder = "structure"
    kinds = KINDS
    template = "structure.html.j2"
    record_file = "structure.json"
    judged_by = FINDING

    def gather(self, result: RigDiscovery | StructureFigures) -> StructureFigures:
        """Return what is drawn."""
        if isinstance(result, StructureFigures):
            return result
        return StructureFigures(
            result.test.name,
            tuple(each.joint for each in result.seen),
            tuple(sensor.name for sensor in result.test.sensors),
            np.minimum(result.worth, 100.0),
            tuple(_loops(result)),
            result.simulated,
        )

    def tables(self, result: RigDiscovery) -> tuple[TextTable, ...]:
        """Return the terms of every law, how each joint is shown, and the structure's numbers."""
        terms = [
            (law.kind, *cells)
            for law in result.laws if law.discovery is not None for cells in model_table(law.discovery.model).rows
        ]  # fmt: skip
        seen = [
            (
                each.joint,
                amount(each.largest_angle, "rad"),
                f"{100 * each.angle_error:.2g} %",
                f"{100 * each.moment_error:.2g} %",
            )
            for each in result.seen
        ]
        update = result.update
        numbers = () if update is None else tuple(
            (name, f"± {100 * stated:.2g} %", f"{100 * change:+.2f} %", f"± {100 * error:.2g} %")
            for name, stated, change, error in zip(
                update.names, update.prior, update.change, update.standard_error, strict=True
            )
        )  # fmt: skip
        return (
            TextTable("terms", "Terms by kind of joint", TERM_COLUMNS, tuple(terms)),
            TextTable(
                "joints", "Standard errors of the strongest harmonic, of the run that shows the joint best.",
                ("Joint", "Recovered angle", "Error of angle", "Error of moment"), tuple(seen),
            ),
            TextTable("numbers", "Numbers of the structure", ("Number", "Stated", "Change", "Known to"), numbers),
        )  # fmt: skip

    def content(self, result: RigDiscovery, data: StructureFigures, folder: Path | None) -> dict[str, Any]:
        """Return what the page shows."""
        return {
            "title": f"{result.test.name}: the law of its joints",
            "laws": [
                {
                    "kind": law.kind,
                    "equation": markup(mathml(law.discovery.model)) if law.discovery and law.found else "",
                    "page": f"{place_of_law(law)}/report.html" if law.discovery is not None else "",
                    "words": law_words(law),
                    "verdict": verdict_words(law),
                }
                for law in result.laws
            ],
            "misfit": _misfit(result),
            "refined": _refined(result),
        }

    def show(self, result: RigDiscovery) -> None:
        """Print laws, joints, the structure's numbers and warnings."""
        from rich.markup import escape

        console = terminal()
        simulated = " (simulated)" if result.simulated else ""
        console.print(
            f"[bold]{escape(result.test.name)}{simulated}[/]: {len(result.recoveries)} run(s), "
            f"{len(result.test.sensors)} sensor(s), {len(result.seen)} joint(s)"
        )
        for law in result.laws:
            console.print(f"\n[bold]{escape(law.kind)}[/]: {escape(law_words(law))}")
            if law.discovery is not None and law.found:
                console.print(f"  {escape(law.discovery.model.equation())}")
                console.print(f"  {escape(verdict_words(law))}")
        for table in self.tables(result):
            if table.rows:
                console.print(f"\n[bold]{escape(table.title)}[/]")
                print_whole(terminal_table([column.lower() for column in table.columns], table.rows), console)
        console.print(f"\n{_misfit(result)}")
        if _refined(result):
            console.print(_refined(result))
        for warning in result.warnings:
            console.print(f"- {escape(warning)}")

    def details(self, result: RigDiscovery) -> Iterator[str]:
        """Yield what each run recovered."""
        for recovery in result.recoveries:
            spectra = recovery.spectra
            repeats = f"{spectra.edges.size - 1} blocks" if spectra.repeats else "the whole record"
            yield (
                f"{recovery.run.name}: {spectra.frequency:.6g} Hz, {spectra.angular.size} harmonics, {repeats}, "
                f"left of the sensors {np.sqrt(recovery.misfit / max(recovery.degrees, 1)):.2f} of their noise"
            )


def place_of_law(law: JointLaw) -> str:
    """Return the folder within the results in which the discovery of a kind of joint stands."""
    return place_of_kind(law.kind)


def place_of_kind(kind: str) -> str:
    """Return the folder within the results of a kind of joint."""
    return "".join(c if c.isalnum() else "-" for c in kind).strip("-") or "joint"


def law_words(law: JointLaw) -> str:
    """Return in a sentence what was found of a kind of joint."""
    if law.discovery is None:
        return law.reason
    if not law.found:
        return f"no model: {law.discovery.reason}"
    runs = len(law.recovered)
    words = (
        f"{len(law.discovery.model.terms)} terms from {runs} recovered run(s) of {' and '.join(law.joints)}"
    )
    return f"{words}; {law.alike}" if law.alike else words


def verdict_words(law: JointLaw) -> str:
    """Return what becomes of the paper's terms in a kind of joint, and why; empty without a model."""
    if law.discovery is None or not law.found:
        return ""
    verdict = law.discovery.verdict
    return f"paper's term set {verdict.verdict}: {verdict.reason}"


def _loops(result: RigDiscovery) -> Iterator[RecoveredLoop]:
    for law in result.laws:
        for joint in dict.fromkeys(each.joint for each in law.recovered):
            own = [each for each in law.recovered if each.joint == joint]
            state = max(own, key=lambda each: float(np.ptp(each.states.angle))).states
            rows = np.arange(0, int(state.sample_rate / (state.frequency or 1.0)) + 1)
            rows = rows[:: max(1, rows.size // POINTS)]
            shown, model = (
                np.full(rows.size, np.nan),
                law.discovery.model if law.discovery is not None else None,
            )
            if model is not None and model.terms:
                moving = state.moving[rows]
                at = rows[moving]
                shown[moving] = model.moment(state.angle[at], state.rate[at])
            if state.frequency:
                # A period ends where it began.
                rows, shown = np.append(rows, rows[0]), np.append(shown, shown[0])
            name = result.test.structure.hinges[joint].name
            run = state.run.removesuffix(f" · {name}")
            yield RecoveredLoop(name, run, state.angle[rows], state.moment[rows], shown)


def _refined(result: RigDiscovery) -> str:
    notes = () if result.refinement is None else result.refinement.notes
    return "".join(f"{note[0].upper()}{note[1:]}." for note in notes)


def _misfit(result: RigDiscovery) -> str:
    if not np.isfinite(result.misfit):
        return (
            "There are as many sensors as joints: nothing shows whether the structure is the one described."
        )
    return f"What is left of the sensors is {result.misfit:.2f} times their noise."
