"""A rig in motion: frequencies, peaks and dissipation, on a terminal, as pictures, as a page, as files."""

from collections.abc import Iterator
from dataclasses import dataclass
from functools import partial
from typing import Any

import numpy as np

from sindyjoint.numeric import Array
from sindyjoint.reporting.figure import Kind, bars, by_name, cycled, fixed, plot, scaled
from sindyjoint.reporting.page import Blocks, Page, section, sentence
from sindyjoint.reporting.results.verification import KEPT_SAMPLES
from sindyjoint.reporting.style import MUTED, PALETTE, Axes, amount, plain, shortened
from sindyjoint.reporting.tables import TextTable, csv_columns, escape, tabulate
from sindyjoint.reporting.view import View, listed
from sindyjoint.trust import Light, Trust, doubt
from sindyjoint.workflows.simulate import RigMotion


@dataclass(frozen=True, eq=False)
class RigFigures:
    """What the pictures of a rig in motion are drawn from.

    Parameters
    ----------
    name : str
    time : ndarray, shape (n,)
        s.
    displacement : dict of str to ndarray
        Of the output points, m.
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


def gather(result: RigMotion) -> RigFigures:
    """Return no more samples than a picture shows."""
    response = result.response
    step = -(-response.time.size // KEPT_SAMPLES)
    return RigFigures(
        result.rig.name,
        response.time[::step],
        {name: values[::step] for name, values in response.displacement.items()},
        response.joints,
        response.angle[:, ::step],
        response.stuck.mean(axis=1),
        result.heat,
    )


def over_time(result: RigFigures, ax: Axes, name: str, unit: str) -> None:
    """Draw the deflection of the output points, or the angle of every joint, over time."""
    signals = result.displacement if unit == "m" else dict(zip(result.joints, result.angle, strict=True))
    largest = [float(np.abs(values).max()) for values in signals.values()] or [1.0]
    curves = [
        (result.time, values, cycled(place, lw=0.8, label=shortened(called, 18)))
        for place, (called, values) in enumerate(signals.items())
    ]
    plot(ax, "Time (s)", scaled(name, largest, unit), curves, result.name * (unit == "m"), columns=2)


def shares(result: RigFigures, ax: Axes, of: str) -> None:
    """Draw who dissipates how much of what became heat, or how long each joint is locked."""
    total = sum(result.heat.values()) or 1.0
    known, label, colour = (
        (
            {name: value / total for name, value in result.heat.items()},
            "Share of what became heat, %",
            PALETTE[0],
        )
        if of == "heat"
        else (
            dict(zip(result.joints, result.locked.tolist(), strict=True)),
            "Share of the time locked, %",
            MUTED,
        )
    )
    names, values = [plain(shortened(name, 18)) for name in known], [100 * each for each in known.values()]
    bars(ax, names, values, 115, label, colour, "{:.1f}")


KINDS = by_name(
    Kind(
        "deflection",
        "Deflection",
        "Deflection of the output points over time.",
        fixed(partial(over_time, name="Deflection", unit="m")),
        wide=True,
    ),
    Kind(
        "angles",
        "Joint angles",
        "Angle of every joint over time; where a line is flat the joint is locked.",
        fixed(partial(over_time, name="Joint angle", unit="rad")),
        wide=True,
    ),
    Kind(
        "heat",
        "Dissipation",
        "Who dissipates how much of what became heat.",
        fixed(partial(shares, of="heat")),
    ),
    Kind(
        "locked",
        "Locked",
        "Share of the time in which each joint is locked.",
        fixed(partial(shares, of="time")),
    ),
)


def _tables(result: RigMotion) -> tuple[TextTable, ...]:
    """Return the frequencies of the modes, and what each joint and the beams did."""
    total, beams = sum(result.heat.values()) or 1.0, result.response.beam_dissipation
    return (
        tabulate(
            "modes",
            "With the joints' stiffness at standstill, and with locked joints.",
            enumerate(zip(result.slipping, result.locked, strict=False), 1),
            {
                "Mode": lambda mode: str(mode[0]),
                "Joints slip": lambda mode: f"{mode[1][0]:.3f} Hz",
                "Joints locked": lambda mode: f"{mode[1][1]:.3f} Hz",
            },
        ),
        tabulate(
            "joints",
            "From the pulse to the end of the simulation.",
            result.joints,
            {
                "Joint": lambda joint: joint.name,
                "Largest angle": lambda joint: amount(joint.peak_angle, "rad"),
                "Locked": lambda joint: f"{100 * joint.locked_share:.1f} %",
                "Slips until": lambda joint: f"{joint.last_slip:.2f} s",
                "Dissipated": lambda joint: amount(joint.dissipated, "J"),
                "Share": lambda joint: f"{100 * (joint.dissipated / total):.1f} %",
            },
            [("beams", *["–"] * 3, amount(beams, "J"), f"{100 * (beams / total):.1f} %")],
        ),
    )


def _trust(result: RigMotion) -> Trust:
    """Return whether the motion is one for which the joints' laws hold, and what to do with it."""
    return Trust(
        (
            doubt(
                "range", "; ".join(result.warnings), "no joint leaves the range for which its law is known"
            ),
            Light("data", "fair", "a simulation of the rig as its file describes it: nothing was measured"),
        ),
        (("sindyjoint curves RIG --out curves", "see its frequency response and modes over amplitude"),),
    )


def _page(result: RigMotion, data: RigFigures, show: Blocks) -> Page:
    """Return where the energy goes, what each joint did, frequencies and motion."""
    first, (modes, joints) = max(result.heat, key=lambda name: result.heat[name]), _tables(result)
    share = 100 * (result.heat[first] / (sum(result.heat.values()) or 1.0))
    last = f"The joints slip for the last time {result.last_slips.max(initial=0.0):.2f} s after the pulse."
    return Page(
        f"{data.name} in motion",
        "A structure with joints after its pulse",
        data.name,
        show.hero("deflection"),
        (
            show.verdict(f"Most of the energy, {share:.0f} %, is dissipated in: {first}."),
            show.paragraph(f"{last} {sentence(result.rig.description)}".rstrip(), "reason"),
        ),
        (),
        (
            section(
                "joints",
                "What each joint did",
                "Joints",
                show.tables(joints),
                show.pictures("heat", "locked"),
            ),
            section("modes", "Natural frequencies", "Frequencies", show.tables(modes)),
            section("motion", "Motion", "Motion", show.pictures("angles")),
        ),
    )


def _files(result: RigMotion, data: RigFigures) -> dict[str, str]:
    """Return time, force, deflections, joint angles and moments, SI units."""
    response = result.response
    columns: dict[str, Any] = {"time_s": response.time, "force_N": response.force}
    columns |= {f"{name}_m": values for name, values in response.displacement.items()}
    for name, angle, moment in zip(response.joints, response.angle, response.moment, strict=True):
        columns |= {f"{name}_angle_rad": angle, f"{name}_moment_Nm": moment}
    return {"response.csv": csv_columns(columns, 9)}


def _details(result: RigMotion) -> Iterator[str]:
    """Yield how it was simulated, and the balance of its energy."""
    response, heat = result.response, sum(result.heat.values())
    yield f"{response.time.size} samples, steps of {1e3 * response.step:g} ms, {response.events} events of joints"
    before, after = response.energy.max(), response.energy[-1]
    yield f"largest energy {before:.4g} J, remaining at the end {after:.4g} J, became heat {heat:.4g} J"


RIG = View(
    about=lambda result: f"{escape(result.rig.name)} (simulated), {result.duration:.3g} s after the pulse",
    data=RigFigures,
    kind="Rig",
    folder="rig",
    kinds=KINDS,
    record_file="rig.json",
    question="How does it move?",
    simulated=lambda result: True,
    drawn_from=gather,
    tables=_tables,
    page=_page,
    headline=_trust,
    printed=lambda result, console: (
        *listed(_tables(result)),
        *(
            f"largest deflection at {escape(point.name)}: {amount(point.peak, 'm')}"
            for point in result.points
        ),
    ),
    warnings=lambda result: (),
    files=_files,
    details=_details,
)
