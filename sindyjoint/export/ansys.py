"""ANSYS Mechanical APDL: elements of the joint between two coincident nodes, and a rig of beams around them.

COMBIN39 carries the elastic part as a table, COMBIN40 Coulomb friction and viscous damping, COMBIN37 damping and
friction that grow with a power of angle or rate. A linear joint is one COMBIN40. Elements with internal states are
COMBIN40, each a spring in series with a slider, or two elements with a node between: Maxwell branch, gap and slider.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import accumulate, chain
from pathlib import Path
from typing import Any

import numpy as np

from sindyjoint.equation.formula import variable_symbols
from sindyjoint.equation.model import JointModel, ModelTerm
from sindyjoint.errors import InputError
from sindyjoint.export import Export
from sindyjoint.export.elements import Gap, Maxwell, written_as
from sindyjoint.export.fidelity import (
    Cycles,
    Represented,
    Rows,
    ascii_line,
    comment,
    exact_rows,
    fidelity_table,
    filled_in,
    heading,
    inertia_note,
    inertial_rows,
    left_out,
    preamble,
    range_note,
    sliding_note,
    sliding_rows,
    words_of,
)
from sindyjoint.export.parts import GIVE, Curve, Parts, contribution, power_law, total
from sindyjoint.mechanics.beam import Beam
from sindyjoint.mechanics.excitation import Excitation
from sindyjoint.mechanics.rigs import load_rig
from sindyjoint.mechanics.structure import Hinge, Item, assemble

DEFAULT_RIG = "pulse-rig"
WAYS = {Maxwell: "2 x COMBIN14, a node between", Gap: "COMBIN39 and COMBIN40, a node between"}
# A term for a COMBIN37, A·|θ|^p or A·|θ̇|^p as damping coefficient or friction limit: exponent, KEYOPT(1): 0 the value
# of the control nodes, 2 its first derivative, and KEYOPT(6).
DAMPING, LIMIT = 2, 8
Power = tuple[ModelTerm, float, int, int]


def export(model: JointModel, rig: str | Path = DEFAULT_RIG) -> Export:
    """Write ``joint.inp`` and, for a rotational joint, the deck of a rig that uses it.

    Parameters
    ----------
    model : JointModel
    rig : str or Path
        Name or file of the rig; every joint of it is given the model.
    """
    cycles, elements = Cycles.of(model), _Elements(Parts.of(model))
    added, rows_of_elements = written_as(
        model, cycles, lambda kind: WAYS.get(type(kind), ""), "COMBIN40, K1 and FSLIDE"
    )
    rows = fidelity_table(model, cycles, {**elements.rows(cycles), **rows_of_elements})
    rotation = model.joint.motion == "rotation"
    raised = " (COMBIN40, K1); raise it where the stuck joint must be stiffer, at the price of smaller steps"
    notes = (
        "set JNTI and JNTJ to two coincident nodes, base's side first, then read this file; it defines element types "
        "and real constants behind those in use",
        f"the joint's degree of freedom is {'ROTZ' if rotation else 'UX'} of the nodal axes; couple the others (CP)",
        *sliding_note(model, elements.parts.stuck_stiffness, raised),
        range_note(model, "the table goes on with its last slope"),
        *inertia_note(model),
    )
    text = comment(preamble(model, "ANSYS Mechanical APDL", rows, notes), "!")
    text += filled_in(
        "joint.inp.j2", e=elements, added=added, title=_title, slides=LIMIT, moment=words_of(model).moment
    )
    files: dict[str, str | bytes] = {"joint.inp": text}
    if rotation:
        name, structure = rig_deck(model, rig)
        files[name] = structure
    else:
        notes = (*notes, "no rig is written: its joints turn, and this one slides")
    return Export("ansys", files, rows, notes)


class _Elements:
    """What each element carries."""

    def __init__(self, parts: Parts):
        self.parts = parts
        self.dof = 6 if parts.model.joint.motion == "rotation" else 1  # ROTZ or UX, as KEYOPTs number them
        self.stick = GIVE * parts.model.fitted.angle
        self.constants = tuple(t for t in parts.elastic if not t.expression.free_symbols)
        self.springs = tuple(t for t in parts.elastic if t not in self.constants)
        theta = variable_symbols()[0]
        self.linear = bool(self.springs) and all(t.expression == theta for t in parts.elastic)
        self.straight = sum(t.coefficient for t in self.springs) if self.linear else 0.0
        nodes = parts.elastic_nodes(19)  # a COMBIN39 holds twenty
        values, middle = total(self.springs, nodes, 0.0), nodes.size // 2
        offset = float(values[middle])  # COMBIN39 passes through the origin
        self.curve = Curve(nodes, values - offset)
        self.rising = bool(np.all(np.diff(self.curve.y)[middle - 1 : middle + 1] > 0))
        self.friction = max(parts.friction, 0.0)
        self.powers: list[Power] = []
        self.remaining: tuple[ModelTerm, ...] = ()
        for term in (*parts.other_rate, *parts.coupled):
            p, q, kind = power_law(term.expression) or (1.0, 1.0, "")
            if kind == "rate" and (p == 0 or q == 0):
                self.powers.append((term, p or q, 0 if p else 2, DAMPING))
            elif kind == "sign" and q == 0 and term.coefficient > 0:
                self.powers.append((term, p, 0, LIMIT))
            else:
                self.remaining += (term,)
        self.preload = offset * self.rising + sum(float(t.expression) * t.coefficient for t in self.constants)

    def rows(self, cycles: Cycles) -> Rows:
        words = words_of(self.parts.model)
        rows = exact_rows(self.springs, cycles, "COMBIN40, K2")
        if not self.linear and self.rising:
            for t in self.springs:
                table = Curve(self.curve.x, contribution(t, self.curve.x, 0.0))
                load = ", its value at zero in the COMBIN37 load" if contribution(t, 0.0, 0.0) else ""
                rows[t.id] = Represented(
                    f"COMBIN39, table of {self.curve.x.size} points{load}", table(cycles.angle)
                )
        elif not self.linear:
            rows = left_out(
                self.springs, "a COMBIN39 table must rise on both sides of zero, and this one does not"
            )
        rows |= exact_rows(self.constants, cycles, "COMBIN37, AFORCE")
        rows |= exact_rows(self.parts.viscous, cycles, "COMBIN40, C")
        rows |= sliding_rows(self.parts, self.parts.coulomb, cycles, "COMBIN40, FSLIDE")
        for term, exponent, _, constant in self.powers:
            how, moment = "COMBIN37, DAMP by C1*|CPAR|^C2", cycles.term(term)
            if constant == LIMIT:
                how = "COMBIN37, FSLIDE by C1*|CPAR|^C2; sticks as a stiff spring"
                limit = term.coefficient * np.abs(cycles.angle) ** exponent
                moment = cycles.slider(limit, self.stuck(term, exponent))
            rows[term.id] = Represented(how, moment)
        why = (
            f"no element has a {words.moment} of this form "
            f"(COMBIN37 has powers of |{words.angle}| or of |{words.rate}|)"
        )
        return rows | left_out(self.remaining, why) | inertial_rows(self.parts)

    def stuck(self, term: ModelTerm, exponent: float) -> float:
        """Return the stiffness with which a term sticks, whose friction limit is a power of the angle."""
        return term.coefficient * self.parts.model.fitted.angle**exponent / self.stick


def _title(what: str) -> str:
    return comment([what], "!").rstrip()


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
    # A beam is given to us as EI and mass per length; with this Young's modulus they become a section.
    parts, youngs_modulus = _parts(items), 70e9
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
            f"E = {youngs_modulus:g} Pa, shear is made stiff as in Euler-Bernoulli beams; material loss is damping in "
            "proportion to stiffness, equal to the loss factor at the first frequency.",
        ],
        "!",
    )  # fmt: skip
    points = {part["item"].name: part["end"] for part in parts} | {"tip": parts[-1]["end"]}
    deck = filled_in(
        "rig.inp.j2",
        name=name, rig=given, parts=parts, points=points,
        clamp_stiffness=given.clamp_stiffness if np.isfinite(given.clamp_stiffness) else None,
        youngs_modulus=youngs_modulus, density=2700.0, 
        omega=2 * np.pi * frequency, pulse=pulse_table(given.excitation, given.duration),
        every=max(round(1 / (given.sample_rate * given.step)), 1),
    )  # fmt: skip
    return f"{file}.inp", text + deck


def _parts(items: Sequence[Item]) -> list[dict[str, Any]]:
    """Return the parts, with number of section or real constant, new nodes with positions, and last node."""
    lengths = [
        [item.length / item.elements] * item.elements
        if isinstance(item, Beam)
        else [0.0] * isinstance(item, Hinge)
        for item in items
    ]
    nodes = list(enumerate(accumulate(chain(*lengths)), 2))
    ends = list(accumulate(map(len, lengths), initial=1))
    numbers = accumulate(int(isinstance(item, Beam) or item.mass + item.inertia > 0) for item in items)
    return [
        {"item": item, "title": _title(item.name), "number": number, "nodes": nodes[a - 1 : b - 1], "end": b}
        for item, number, a, b in zip(items, numbers, ends, ends[1:], strict=False)
    ]


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
