"""A rig of beams, joints and masses as an APDL deck: BEAM188, MASS21, and the elements of the joint."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
from jinja2 import Environment, PackageLoader

from sindyjoint.equation.model import JointModel
from sindyjoint.errors import InputError
from sindyjoint.export.text import ascii_line, comment, heading, number
from sindyjoint.mechanics.beam import Beam
from sindyjoint.mechanics.excitation import Excitation
from sindyjoint.mechanics.rigs import load_rig
from sindyjoint.mechanics.structure import Hinge, LumpedMass, assemble

# A beam is given to us as EI and mass per length; with this Young's modulus they become a section.
YOUNGS_MODULUS = 70e9
DENSITY = 2700.0


@dataclass(frozen=True)
class _AtRest:
    """The terms of the model as a law without friction, for the natural frequency that damping is set by."""

    model: JointModel
    n_states: int = 0

    def moment(self, angle: Any, rate: Any, direction: Any, state: Any = None) -> Any:
        return self.model.without_elements().moment(angle, 0.0)


def rig_deck(model: JointModel, rig: str | Path) -> tuple[str, str]:
    """Return the name and the text of the deck.

    Parameters
    ----------
    model : JointModel
        Law of every joint of the rig.
    rig : str or Path
        Name of a shipped rig, or a TOML file.

    Raises
    ------
    InputError, MissingInputError, UnknownNameError
        As :func:`sindyjoint.mechanics.rigs.load_rig`.
    """
    law: Any = _AtRest(model)
    given = load_rig(rig, {"model": law})
    items = tuple(replace(item, law=law) if isinstance(item, Hinge) else item for item in given.items)
    if not any(isinstance(item, Hinge) for item in items):
        raise InputError(f"rig {given.name!r} has no joint; there is nothing to export the model into")
    structure = assemble(items, given.clamp_stiffness)
    at_rest = "the stiffness of the terms at standstill" if model.elements else "the stiffness at standstill"
    # A joint without stiffness, a drive say, makes a mechanism: its beams then have the damping of the locked rig.
    locked = not bool(np.all(structure.tangent_stiffness() > 0))
    frequency = float(structure.frequencies(1, locked=locked)[0])
    parts = _parts(items, frequency)
    name = ascii_line(given.name)
    file = "".join(c if c.isalnum() else "-" for c in name.lower()).strip("-") or "rig"
    if file == "joint":
        file = "rig"
    text = comment(
        [
            *heading(model, "ANSYS Mechanical APDL"), "", f"Rig: {name}. {ascii_line(given.description)}",
            f"{sum(isinstance(i, Hinge) for i in items)} joint(s), each with the law of joint.inp next to this file; "
            f"first frequency with {'locked joints' if locked else at_rest} "
            f"{frequency:.4f} Hz.",
            "Plane motion in x and y. Beams have their bending stiffness and mass per length as a section of "
            f"E = {YOUNGS_MODULUS:g} Pa, shear is made stiff as in Euler-Bernoulli beams; material loss is damping in "
            "proportion to stiffness, equal to the loss factor at the first frequency.",
        ],
        "!",
    )  # fmt: skip
    points = {part["item"].name: part["end"] for part in parts} | {"tip": parts[-1]["end"]}
    deck = _environment().get_template("rig.inp.j2").render(
        name=name, rig=given, parts=parts, points=points,
        clamp_stiffness=given.clamp_stiffness if np.isfinite(given.clamp_stiffness) else None,
        youngs_modulus=YOUNGS_MODULUS, density=DENSITY, pulse=pulse_table(given.excitation, given.duration),
        every=max(round(1 / (given.sample_rate * given.step)), 1),
    )  # fmt: skip
    return f"{file}.inp", text + deck


def _environment() -> Environment:
    templates = PackageLoader("sindyjoint.export")
    found = Environment(loader=templates, trim_blocks=True, lstrip_blocks=True, keep_trailing_newline=True)
    found.filters["number"] = number
    return found


def _parts(items: Sequence[Beam | Hinge | LumpedMass], frequency: float) -> list[dict[str, Any]]:
    """Return the parts, with number of section or real constant, new nodes with positions, and last node."""
    parts: list[dict[str, Any]] = []
    node, x, count = 1, 0.0, 0
    for item in items:
        section: dict[str, float] | None = None
        lengths = [0.0] if isinstance(item, Hinge) else []
        if isinstance(item, Beam):
            lengths = [item.length / item.elements] * item.elements
            section = {
                "area": item.mass_per_length / DENSITY,
                "inertia": item.bending_stiffness / YOUNGS_MODULUS,
                "shear": 1e6 * item.bending_stiffness / item.length**2,
                # BETD: a loss factor is twice the damping ratio, BETD * omega / 2 = loss / 2 at the first frequency.
                "damping": item.loss_factor / (2 * np.pi * frequency),
            }
        if section or item.mass or item.inertia:  # type: ignore[union-attr]
            count += 1
        nodes = []
        for length in lengths:
            node, x = node + 1, x + length
            nodes.append((node, x))
        title = comment([item.name], "!").rstrip()
        parts.append(
            {"item": item, "title": title, "number": count, "section": section, "nodes": nodes, "end": node}
        )
    return parts


def pulse_table(excitation: Excitation, duration: float) -> list[tuple[float, float]]:
    """Return times and values of an excitation as a table of straight lines; a jump takes a millionth of a piece.

    Examples
    --------
    >>> from sindyjoint.mechanics.excitation import pulse
    >>> pulse_table(pulse(65.0, 0.005), 1.0)
    [(0.0, 65.0), (0.004999995, 65.0), (0.005, 0.0), (1.0, 0.0)]
    """
    table: list[tuple[float, float]] = []
    step, size = excitation.step, float(np.abs(excitation.pieces * excitation.scale).max())
    for i in range(len(excitation.pieces)):
        start, end = i * step, (i + 1) * step
        if start >= duration:
            break
        first, last = (float(v) for v in excitation(np.array([start, end - 1e-6 * step])))
        if table and abs(first - table[-1][1]) <= 1e-4 * size:
            table.pop()  # continuous: one point is enough
        table += [(start, first), (end - 1e-6 * step, last)]
    time, value = table.pop()
    return [*table, (max(time, duration), value)]
