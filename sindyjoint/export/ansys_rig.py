"""A rig of beams, joints and masses as an APDL deck: BEAM188, MASS21, and the elements of the joint."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np

from sindyjoint.equation.model import JointModel
from sindyjoint.errors import InputError
from sindyjoint.export.text import ascii_line, comment, heading, number
from sindyjoint.mechanics.beam import Beam
from sindyjoint.mechanics.excitation import Excitation
from sindyjoint.mechanics.rigs import Rig, load_rig
from sindyjoint.mechanics.structure import Hinge, LumpedMass, assemble

# A beam is given to us as EI and mass per length; with this Young's modulus they become a section.
YOUNGS_MODULUS = 70e9
DENSITY = 2700.0


@dataclass(frozen=True)
class _AtRest:
    """The model as a law without friction, for the natural frequency that damping is set by."""

    model: JointModel
    n_states: int = 0

    def moment(self, angle: Any, rate: Any, direction: Any, state: Any = None) -> Any:
        return self.model.moment(angle, 0.0)


@dataclass
class _Chain:
    """Commands for the parts in their order, and the end of the chain so far."""

    frequency: float
    lines: list[str] = field(default_factory=list)
    node: int = 1
    x: float = 0.0
    sections: int = 0
    points: dict[str, int] = field(default_factory=dict)

    def new_node(self, length: float) -> int:
        self.node += 1
        self.x += length
        self.lines.append(f"N,{self.node},{number(self.x)},0.0,0.0")
        return self.node


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
    # A joint without stiffness, a drive say, makes a mechanism: its beams then have the damping of the locked rig.
    locked = not bool(np.all(structure.tangent_stiffness() > 0))
    chain = _Chain(float(structure.frequencies(1, locked=locked)[0]))
    _base(chain, given)
    for item in items:
        _part(chain, item)
    chain.points["tip"] = chain.node
    name = ascii_line(given.name)
    file = "".join(c if c.isalnum() else "-" for c in name.lower()).strip("-") or "rig"
    if file == "joint":
        file = "rig"
    text = comment(
        [
            *heading(model, "ANSYS Mechanical APDL"), "", f"Rig: {name}. {ascii_line(given.description)}",
            f"{sum(isinstance(i, Hinge) for i in items)} joint(s), each with the law of joint.inp next to this file; "
            f"first frequency with {'locked joints' if locked else 'the stiffness at standstill'} "
            f"{chain.frequency:.4f} Hz.",
            "Plane motion in x and y. Beams have their bending stiffness and mass per length as a section of "
            f"E = {YOUNGS_MODULUS:g} Pa, shear is made stiff as in Euler-Bernoulli beams; material loss is damping in "
            "proportion to stiffness, equal to the loss factor at the first frequency.",
        ],
        "!",
    )  # fmt: skip
    lines = [
        "FINISH",
        "/CLEAR",
        f"/TITLE,{name[:70]}",
        "/PREP7",
        *_types(),
        *chain.lines,
        *_solve(chain, given),
    ]
    return f"{file}.inp", text + "\n".join(lines) + "\n"


def _types() -> list[str]:
    return [
        "ET,1,BEAM188",
        "KEYOPT,1,3,3  ! cubic shape functions",
        "ET,2,MASS21",
        "R,1,0.0  ! real constant 1 stays free for the beams",
        "N,1,0.0,0.0,0.0",
    ]


def _base(chain: _Chain, rig: Rig) -> None:
    if np.isfinite(rig.clamp_stiffness):
        chain.lines += [
            "ET,3,COMBIN14",
            "KEYOPT,3,2,6  ! torsion about z",
            f"R,3,{number(rig.clamp_stiffness)}",
            "N,1000000,0.0,0.0,0.0",
            "D,1000000,ALL,0.0",
            "TYPE,3",
            "REAL,3",
            "E,1000000,1",
            "D,1,UX,0.0",
            "D,1,UY,0.0",
        ]
    else:
        chain.lines.append("D,1,ALL,0.0")


def _part(chain: _Chain, item: Beam | Hinge | LumpedMass) -> None:
    chain.lines.append(comment([item.name], "!").rstrip())
    if isinstance(item, Beam):
        _beam(chain, item)
    else:
        if isinstance(item, Hinge):
            before, after = chain.node, chain.new_node(0.0)
            # Plane motion holds the other directions; the rotation about z goes through the joint's elements.
            chain.lines += [
                f"CP,NEXT,UY,{before},{after}",
                f"JNTI={before}",
                f"JNTJ={after}",
                "/INPUT,joint,inp",
            ]
        if item.mass or item.inertia:
            chain.sections += 1
            real = 100000 + chain.sections
            m, i = number(item.mass), number(item.inertia)
            chain.lines += [f"R,{real},{m},{m},{m},0.0,0.0,{i}", "TYPE,2", f"REAL,{real}", f"E,{chain.node}"]
    chain.points[item.name] = chain.node


def _beam(chain: _Chain, beam: Beam) -> None:
    chain.sections += 1
    section = chain.sections
    area = beam.mass_per_length / DENSITY
    inertia = beam.bending_stiffness / YOUNGS_MODULUS
    shear = 1e6 * beam.bending_stiffness / beam.length**2
    chain.lines += [
        f"MP,EX,{section},{number(YOUNGS_MODULUS)}",
        f"MP,PRXY,{section},0.3",
        f"MP,DENS,{section},{number(DENSITY)}",
    ]
    if beam.loss_factor:
        # A loss factor is twice the damping ratio: BETD * omega / 2 = loss / 2 at the first frequency.
        betad = beam.loss_factor / (2 * np.pi * chain.frequency)
        chain.lines.append(f"MP,BETD,{section},{number(betad)}")
    chain.lines += [
        f"SECTYPE,{section},BEAM,ASEC",
        # A, Iyy, Iyz, Izz, Iw, J
        f"SECDATA,{number(area)},{number(inertia)},0.0,{number(inertia)},0.0,{number(2 * inertia)}",
        f"SECCONTROL,{number(shear)},,{number(shear)}",
        "TYPE,1",
        f"MAT,{section}",
        "REAL,1",
        f"SECNUM,{section}",
    ]
    for _ in range(beam.elements):
        before = chain.node
        after = chain.new_node(beam.length / beam.elements)
        chain.lines.append(f"E,{before},{after}")


def _solve(chain: _Chain, rig: Rig) -> list[str]:
    table = pulse_table(rig.excitation, rig.duration)
    lines = [
        "! plane motion",
        "NSEL,ALL",
        *(f"D,ALL,{dof},0.0" for dof in ("UX", "UZ", "ROTX", "ROTY")),
        f"*DIM,PULSE,TABLE,{len(table)},1,1,TIME",
        *(f"PULSE({i},0)={number(t)}" for i, (t, _) in enumerate(table, 1)),
        *(f"PULSE({i},1)={number(f)}" for i, (_, f) in enumerate(table, 1)),
        f"F,{chain.points[rig.at]},FY,%PULSE%",
        "FINISH",
        "/SOLU",
        "ANTYPE,TRANS",
        "TRNOPT,FULL",
        "TIMINT,ON",
        "TINTP,0.0  ! no numerical damping",
        "NROPT,FULL",
        f"TIME,{number(rig.duration)}",
        "AUTOTS,OFF",
        f"DELTIM,{number(rig.step)}",
        "KBC,1",
        f"OUTRES,NSOL,{max(round(1 / (rig.sample_rate * rig.step)), 1)}",
        "SOLVE",
        "FINISH",
        "/POST26",
    ]
    lines += [f"NSOL,{i},{chain.points[name]},U,Y,POINT{i - 1}" for i, name in enumerate(rig.points, 2)]
    return [*lines, "PRVAR," + ",".join(str(i) for i in range(2, 2 + len(rig.points)))]


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
