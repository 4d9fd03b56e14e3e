"""Joints inside a structure: their laws and how well its sensors show them, in words, pictures, files."""

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np

from sindyjoint.judgement.joint_laws import JointLaw, place_of_kind
from sindyjoint.judgement.rig_discovery import RigDiscovery
from sindyjoint.numeric import Array
from sindyjoint.reporting.equation import model_table
from sindyjoint.reporting.figure import Curve, Kind, by_name, each, fixed, plot, written_cells
from sindyjoint.reporting.mathml import mathml
from sindyjoint.reporting.page import Blocks, Page, markup, section, sentence
from sindyjoint.reporting.style import ACCENT, INK, PALETTE, Axes, amount
from sindyjoint.reporting.tables import Console, TextTable, escape, tabulate
from sindyjoint.reporting.view import FINDING, View

# Loss of a sensor at which the scale of the picture ends.
MOST = 10.0


@dataclass(frozen=True, eq=False)
class RecoveredLoop:
    """Angle and moment of a joint over a period of its strongest run, rad and N·m, and the law's moment there."""

    joint: str
    run: str
    angle: Array
    moment: Array
    law: Array


@dataclass(frozen=True, eq=False)
class StructureFigures:
    """What the pictures are drawn from.

    Parameters
    ----------
    rig : str
    joints, sensors : tuple of str
    worth : ndarray, shape (joints, sensors)
        By what factor the error of a joint's moment grows without a sensor; at most a hundred.
    loops : tuple of RecoveredLoop
    simulated : bool
    """

    rig: str
    joints: tuple[str, ...]
    sensors: tuple[str, ...]
    worth: Array
    loops: tuple[RecoveredLoop, ...]
    simulated: bool = False


def worth(data: StructureFigures, ax: Axes) -> None:
    """Draw for each joint and sensor by what factor the moment's error grows without the sensor."""
    words = np.where(data.worth < 100, np.vectorize("{:.2g}".format)(data.worth), "∞")
    written_cells(
        ax, np.log(np.clip(data.worth, 1.0, MOST)), words, np.where(data.worth > 3, "white", INK),
        (data.joints, data.sensors), 7, 30, cmap="Blues", vmin=0.0, vmax=np.log(MOST), aspect="auto",
    )  # fmt: skip
    ax.set_title("Growth of the moment's error without the sensor")


def _loop(loop: RecoveredLoop, ax: Axes) -> None:
    curves: list[Curve] = [
        (1e3 * loop.angle, loop.moment, {"color": PALETTE[0], "label": "recovered"}),
        (
            1e3 * loop.angle,
            loop.law,
            {"color": ACCENT, "ls": "none", "marker": ".", "ms": 2, "label": "found law, moving"},
        ),
    ]
    plot(
        ax, "Angle (mrad)", "Moment (N·m)", curves[: 1 + bool(np.isfinite(loop.law).any())],
        f"{loop.joint}, {loop.run}", legend="upper left",
    )  # fmt: skip


KINDS = by_name(
    Kind(
        "recovered",
        "Recovered loops",
        "Moment of each joint over its angle, recovered from the structure's sensors, in a period of the run that "
        "moves it most, or in the first second of one that does not repeat; dots: the moment of the law found, "
        "where the joint moves.",
        each(lambda data: data.loops, _loop),
    ),
    Kind(
        "worth",
        "What each sensor is worth",
        "By what factor the standard error of a joint's moment grows when a sensor is taken away (1: it adds nothing; "
        "∞: without it the joint is not determined).",
        fixed(worth),
        wide=True,
        height=lambda data: 1.3 + 0.35 * len(data.joints),
    ),
)


TERMS = ("Term", "Symbol", "Of", "Value", "Unit", "95 % interval")


def gather(result: RigDiscovery) -> StructureFigures:
    """Return the loops, and what each sensor is worth."""
    return StructureFigures(
        result.test.name,
        tuple(each.joint for each in result.seen),
        tuple(sensor.name for sensor in result.test.sensors),
        np.minimum(result.worth, 100.0),
        tuple(_loops(result)),
        result.simulated,
    )


def _tables(result: RigDiscovery) -> tuple[TextTable, ...]:
    """Return the terms of every law, how each joint is shown, and the structure's numbers."""
    update = result.update
    known = () if update is None else (update.names, update.prior, update.change, update.standard_error)
    rows = tuple(
        (law.kind, *row)
        for law in result.laws
        if law.discovery is not None
        for row in model_table(law.discovery.model).take(*TERMS).rows
    )
    return (
        TextTable("terms", "Terms by kind of joint", ("Kind", *TERMS), rows, text=("Unit",)),
        tabulate(
            "joints",
            "Standard errors of the strongest harmonic, of the run that shows the joint best.",
            result.seen,
            {
                "Joint": lambda one: one.joint,
                "Recovered angle": lambda one: amount(one.largest_angle, "rad"),
                "Error of angle": lambda one: f"{100 * one.angle_error:.2g} %",
                "Error of moment": lambda one: f"{100 * one.moment_error:.2g} %",
            },
        ),
        tabulate(
            "numbers",
            "Numbers of the structure",
            zip(*known, strict=True),
            {
                "Number": lambda row: row[0],
                "Stated": lambda row: f"± {100 * row[1]:.2g} %",
                "Change": lambda row: f"{100 * row[2]:+.2f} %",
                "Known to": lambda row: f"± {100 * row[3]:.2g} %",
            },
        ),
    )


def _page(result: RigDiscovery, data: StructureFigures, show: Blocks) -> Page:
    """Return each law, its terms, and how the joints were recovered."""
    terms, joints, numbers = map(show.tables, _tables(result))
    said = markup("<b>{}</b>: {}"), markup(' (<a href="{}/report.html">its page</a>)')
    laws = []
    for law in result.laws:
        there = "" if law.discovery is None else said[1].format(place_of_kind(law.kind))
        laws.append(show.verdict(said[0].format(law.kind, law_words(law)) + there))
        if law.discovery and law.found:
            laws.append(show.equation(markup(mathml(law.discovery.model))))
        laws.append(show.paragraph(sentence(verdict_words(law))))
    how = (
        "The joints are cut open; their moments are unknown inputs of the linear rest, and follow from the sensors "
        "at each harmonic by least squares weighted with their noise. "
    )
    return Page(
        f"{data.rig}: the law of its joints",
        "Joints inside a structure",
        data.rig,
        show.hero("recovered"),
        laws,
        (show.warnings(_warnings(result)),),
        (
            section("laws", "Laws", "Laws", terms, show.pictures("recovered")),
            section(
                "recovery",
                "Recovery",
                "Recovery",
                show.paragraph(how + _misfit(result)),
                joints,
                show.pictures("worth"),
                numbers,
            ),
        ),
    )


def _about(result: RigDiscovery) -> str:
    """Return how many runs, sensors and joints there are."""
    return (
        f"[bold]{escape(result.test.name)}{' (simulated)' * result.simulated}[/]: {len(result.recoveries)} run(s), "
        f"{len(result.test.sensors)} sensor(s), {len(result.seen)} joint(s)"
    )


def _printed(result: RigDiscovery, console: Console) -> Iterator[Any]:
    """Yield laws, joints and the structure's numbers."""
    for law in result.laws:
        yield f"\n[bold]{escape(law.kind)}[/]: {escape(law_words(law))}"
        if law.discovery is not None and law.found:
            lines = law.discovery.model.equation(), verdict_words(law)
            yield "\n".join(f"  {escape(line)}" for line in lines if line)
    for table in filter(lambda table: table.rows, _tables(result)):
        yield from (f"\n[bold]{escape(table.title)}[/]", table.headed())
    yield f"\n{_misfit(result)}"


def _details(result: RigDiscovery) -> Iterator[str]:
    """Yield what each run recovered."""
    for recovery in result.recoveries:
        spectra = recovery.spectra
        repeats = f"{spectra.edges.size - 1} blocks" if spectra.repeats else "the whole record"
        yield (
            f"{recovery.run.name}: {spectra.frequency:.6g} Hz, {spectra.angular.size} harmonics, {repeats}, "
            f"residual of the sensors {np.sqrt(recovery.misfit / max(recovery.degrees, 1)):.2f} times their noise"
        )


def law_words(law: JointLaw) -> str:
    """Return in a sentence what was found of a kind of joint."""
    if law.discovery is None:
        return law.reason
    if not law.found:
        return f"no model: {law.discovery.reason}"
    words = (
        f"{len(law.discovery.model.terms)} terms from {len(law.recovered)} recovered run(s) of "
        f"{' and '.join(law.joints)}"
    )
    return f"{words}; {law.alike}" if law.alike else words


def verdict_words(law: JointLaw) -> str:
    """Return what becomes of the paper's terms in a kind of joint that is one of its, and why."""
    if law.discovery is None or not law.found or not law.discovery.leads_with_paper:
        return ""
    verdict = law.discovery.verdict
    return f"paper's term set {verdict.verdict}: {verdict.reason}"


def _loops(result: RigDiscovery) -> Iterator[RecoveredLoop]:
    for law in result.laws:
        model = None if law.discovery is None else law.discovery.model
        for joint in dict.fromkeys(one.joint for one in law.recovered):
            states = (one.states for one in law.recovered if one.joint == joint)
            state = max(states, key=lambda state: float(np.ptp(state.angle)))
            rows = np.arange(0, int(state.sample_rate / (state.frequency or 1.0)) + 1)
            rows = rows[:: max(1, rows.size // 400)]
            # A period ends where it began.
            rows = np.append(rows, rows[: bool(state.frequency)])
            shown, moving = np.full(rows.size, np.nan), rows[state.moving[rows]]
            if model is not None and model.terms:
                shown[state.moving[rows]] = model.moment(state.angle[moving], state.rate[moving])
            name = result.test.structure.hinges[joint].name
            yield RecoveredLoop(
                name, state.run.removesuffix(f" · {name}"), state.angle[rows], state.moment[rows], shown
            )


def _misfit(result: RigDiscovery) -> str:
    if not np.isfinite(result.misfit):
        return (
            "There are as many sensors as joints: nothing shows whether the structure is the one described."
        )
    return f"The residual of the sensors is {result.misfit:.2f} times their noise."


def _warnings(result: RigDiscovery) -> tuple[str, ...]:
    """Return what to be aware of, and how the laws were refined."""
    return (*result.warnings, *(() if result.refinement is None else result.refinement.notes))


STRUCTURE_JOINTS = View(
    about=_about,
    data=StructureFigures,
    kind="StructureJoints",
    folder="structure",
    kinds=KINDS,
    record_file="structure.json",
    judged_by=lambda result: FINDING,
    drawn_from=gather,
    tables=_tables,
    headline=lambda result: result.trust,
    page=_page,
    printed=_printed,
    warnings=_warnings,
    details=_details,
)
