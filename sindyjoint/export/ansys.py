"""ANSYS Mechanical APDL: elements of the joint between two coincident nodes, and a rig of beams around them.

COMBIN39 carries the elastic part as a table, COMBIN40 Coulomb friction and viscous damping, COMBIN37 damping and
friction that grow with a power of angle or rate. A linear joint is one COMBIN40. Elements with internal states are
COMBIN40, each a spring in series with a slider, or two elements with a node between: Maxwell branch, gap and slider.
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np

from sindyjoint.equation.model import JointModel, ModelTerm
from sindyjoint.export import lumped
from sindyjoint.export.base import Cycles, Export, Represented, fidelity_table
from sindyjoint.export.elements import Gap, Maxwell, Slider, kind_of
from sindyjoint.export.parts import GIVE, Curve, Parts, contribution, power_law, total
from sindyjoint.export.sliders import pairs_of, represented
from sindyjoint.export.text import comment, number, preamble, words_of

POINTS = 19  # a COMBIN39 holds twenty
DEFAULT_RIG = "pulse-rig"


def export(model: JointModel, rig: str | Path = DEFAULT_RIG) -> Export:
    """Write ``joint.inp`` and, for a rotational joint, the deck of a rig that uses it.

    Parameters
    ----------
    model : JointModel
    rig : str or Path
        Name or file of the rig; every joint of it is given the model.
    """
    from sindyjoint.export.ansys_rig import rig_deck

    parts, cycles = Parts.of(model), Cycles.of(model)
    elements, added = _Elements(parts), _Hysteresis(model, cycles)
    rows = fidelity_table(model, cycles, {**elements.rows(cycles), **added.rows})
    notes = (
        "set JNTI and JNTJ to two coincident nodes, base's side first, then read this file; it defines element types "
        "and real constants behind those in use",
        "the joint's degree of freedom is "
        + ("ROTZ" if elements.rotation else "UX")
        + " of the nodal axes; couple the others (CP)",
        *elements.notes(),
        lumped.range_note(model, "the table goes on with its last slope"),
        *lumped.inertia_note(model),
    )
    text = comment(preamble(model, "ANSYS Mechanical APDL", rows, notes), "!")
    commands = [*elements.deck(), *added.lines(elements)]
    files: dict[str, str | bytes] = {"joint.inp": text + "\n".join(commands) + "\n"}
    if elements.rotation:
        name, structure = rig_deck(model, rig)
        files[name] = structure
    else:
        notes = (*notes, "no rig is written: its joints turn, and this one slides")
    return Export("ansys", files, rows, notes)


@dataclass(frozen=True)
class _Power:
    """A term for a COMBIN37: A·|θ|^p or A·|θ̇|^p as damping coefficient or friction limit."""

    term: ModelTerm
    exponent: float
    control: int  # KEYOPT(1): 0 the value of the control nodes, 2 its first derivative
    constant: int  # KEYOPT(6): 2 damping, 8 friction limit


class _Elements:
    """What each element carries."""

    def __init__(self, parts: Parts):
        self.parts = parts
        self.rotation = parts.model.joint.motion == "rotation"
        angle = parts.model.fitted.angle
        self.constants = tuple(t for t in parts.elastic if not t.expression.free_symbols)
        springs = tuple(t for t in parts.elastic if t not in self.constants)
        self.springs = springs
        self.linear = bool(springs) and parts.is_linear_spring
        nodes = parts.elastic_nodes(POINTS)
        values = total(springs, nodes, 0.0)
        middle = nodes.size // 2
        self.offset = float(values[middle])  # COMBIN39 passes through the origin
        self.curve = Curve(nodes, values - self.offset)
        self.rising = bool(np.all(np.diff(self.curve.y)[middle - 1 : middle + 1] > 0))
        self.friction = parts.friction if parts.friction > 0 else 0.0
        self.powers, self.remaining = _powers(parts)
        self.preload = self.offset * self.rising + sum(
            float(t.expression) * t.coefficient for t in self.constants
        )
        self.stick = GIVE * angle

    def rows(self, cycles: Cycles) -> dict[str, Represented]:
        words = words_of(self.parts.model)
        rows: dict[str, Represented] = {}
        if self.linear:
            rows |= {t.id: Represented("COMBIN40, K2", cycles.term(t)) for t in self.springs}
        elif self.rising:
            how = f"COMBIN39, table of {POINTS} points"
            for t in self.springs:
                at_rest = contribution(t, 0.0, 0.0)
                text = how + (", its value at zero in the COMBIN37 load" if at_rest else "")
                table = Curve(self.curve.x, contribution(t, self.curve.x, 0.0))
                rows[t.id] = Represented(text, table(cycles.angle))
        else:
            rows |= lumped.left_out(
                self.springs, "a COMBIN39 table must rise on both sides of zero, and this one does not"
            )
        rows |= {t.id: Represented("COMBIN37, AFORCE", cycles.term(t)) for t in self.constants}
        rows |= lumped.viscous_rows(self.parts, cycles, "COMBIN40, C")
        if self.friction:
            limit = np.full(cycles.angle.shape, self.friction)
            slider = cycles.slider(limit, self.friction / self.stick)
            for t in self.parts.coulomb:
                how = f"COMBIN40, FSLIDE; sticks as a spring that gives way by {GIVE:g} of the tested {words.angle}"
                rows[t.id] = Represented(how, slider * t.coefficient / self.friction)
        else:
            rows |= lumped.left_out(self.parts.coulomb, "friction must not be negative")
        for power in self.powers:
            rows[power.term.id] = self._power_row(power, cycles)
        why = (
            f"no element has a {words.moment} of this form "
            f"(COMBIN37 has powers of |{words.angle}| or of |{words.rate}|)"
        )
        return rows | lumped.left_out(self.remaining, why) | lumped.inertial_rows(self.parts)

    def _power_row(self, power: _Power, cycles: Cycles) -> Represented:
        if power.constant == 2:
            return Represented("COMBIN37, DAMP by C1*|CPAR|^C2", cycles.term(power.term))
        limit = power.term.coefficient * np.abs(cycles.angle) ** power.exponent
        slider = cycles.slider(limit, self._power_stiffness(power))
        return Represented("COMBIN37, FSLIDE by C1*|CPAR|^C2; sticks as a stiff spring", slider)

    def _power_stiffness(self, power: _Power) -> float:
        return power.term.coefficient * self.parts.model.fitted.angle**power.exponent / self.stick

    def notes(self) -> tuple[str, ...]:
        if not self.friction:
            return ()
        unit = words_of(self.parts.model).stiffness_unit
        return (
            f"while it sticks, friction is a spring of {self.friction / self.stick:.6g} {unit} (COMBIN40, K1); raise "
            "it where the stuck joint must be stiffer, at the price of smaller steps",
        )

    @property
    def dof(self) -> int:
        """ROTZ or UX, as KEYOPTs number them."""
        return 6 if self.rotation else 1

    def deck(self) -> list[str]:
        """Return the commands."""
        dof = self.dof
        words = words_of(self.parts.model)
        lines = [
            "/PREP7",
            "*GET,JNT_T,ETYP,0,NUM,MAX  ! highest numbers in use",
            "*GET,JNT_R,RCON,0,NUM,MAX",
        ]
        if self.springs and self.rising and not self.linear:
            points = [f"{number(v)}" for xy in zip(self.curve.x, self.curve.y, strict=True) for v in xy]
            constants = [points[i : i + 6] for i in range(0, len(points), 6)]
            lines += self.one("COMBIN39", [(3, dof)], constants, f"elastic {words.moment}")
        k2 = sum(t.coefficient for t in self.springs) if self.linear else 0.0
        if self.friction or self.parts.viscous or self.linear:
            k1 = self.friction / self.stick if self.friction else 0.0
            # K1, C, M, GAP, FSLIDE, K2. K1 and K2 must not both be zero: then a spring too soft to matter stands in.
            if not k1 and not k2:
                k2 = 1e-9 * abs(self.parts.damping)
            values = [k1, self.parts.damping, 0.0, 0.0, self.friction, k2]
            lines += self.one(
                "COMBIN40", [(3, dof)], [[number(v) for v in values]], "friction and viscous damping"
            )
        for power in self.powers:
            lines += self._combin37(power, dof)
        if self.preload:
            # STIF, DAMP, MASJ, ONVAL, OFFVAL, AFORCE
            values = [0.0, 0.0, 0.0, 0.0, 0.0, self.preload]
            lines += self.one(
                "COMBIN37", [(3, dof)], [[number(v) for v in values]], f"constant {words.moment}"
            )
        return lines

    def _combin37(self, power: _Power, dof: int) -> list[str]:
        slides = power.constant == 8
        stiffness = self._power_stiffness(power) if slides else 0.0
        first = [stiffness, 0.0, 0.0, 0.0, 0.0, 0.0]  # STIF, DAMP, MASJ, ONVAL, OFFVAL, AFORCE
        second = [0.0, 0.0, power.term.coefficient, power.exponent, 0.0, 0.0]  # MASI, START, C1, C2, C3, C4
        keys = [(1, power.control), (2, dof), (3, dof), (6, power.constant)]
        rows = [[number(v) for v in row] for row in (first, second)]
        if slides:
            # FSLIDE itself: nearly all of it comes from C1 and C2, but zero would take the slider away.
            rows.append([number(1e-6 * stiffness * self.stick)])
        return self.one("COMBIN37", keys, rows, power.term.id, control=True)

    def one(
        self,
        kind: str,
        keys: list[tuple[int, int]],
        constants: list[list[str]],
        what: str,
        control: bool = False,
        nodes: str = "JNTI,JNTJ",
    ) -> list[str]:
        """Return the commands of one element."""
        rows = [f"R,JNT_R,{','.join(constants[0])}", *(f"RMORE,{','.join(row)}" for row in constants[1:])]
        return [
            comment([what], "!").rstrip(),
            "JNT_T=JNT_T+1",
            "JNT_R=JNT_R+1",
            f"ET,JNT_T,{kind}",
            *(f"KEYOPT,JNT_T,{key},{value}" for key, value in keys),
            *rows,
            "TYPE,JNT_T",
            "REAL,JNT_R",
            f"E,{nodes},JNTI,JNTJ" if control else f"E,{nodes}",
        ]


@dataclass(frozen=True)
class _Half:
    """One of two elements in series: its name, the KEYOPT that takes the degree of freedom, and its constants."""

    kind: str
    key: int
    constants: tuple[float, ...]


class _Hysteresis:
    """Elements with internal states: pairs of spring and slider, and two elements with a node between."""

    def __init__(self, model: JointModel, cycles: Cycles):
        self.stick = GIVE * model.fitted.angle
        self.rows: dict[str, Represented] = {}
        self.pairs: list[tuple[str, Slider]] = []
        self.chains: list[tuple[str, _Half, _Half]] = []
        for element in model.elements:
            kind = kind_of(element, cycles)
            if isinstance(kind, Maxwell) and kind.stiffness > 0:
                halves = (
                    _Half("COMBIN14", 2, (kind.stiffness, 0.0)),
                    _Half("COMBIN14", 2, (0.0, kind.stiffness * kind.time)),
                )
                how = "2 x COMBIN14, a node between"
            elif isinstance(kind, Gap) and kind.moment > 0:
                halves = (self._limit(kind), _Half("COMBIN39", 3, _points(kind)))
                how = "COMBIN39 and COMBIN40, a node between"
            else:
                pairs = pairs_of(element, kind, cycles)
                self.pairs += [(element.id, slider) for slider in (pairs.sliders if pairs else ())]
                self.rows[element.id] = represented(pairs, "COMBIN40, K1 and FSLIDE")
                continue
            self.chains.append((element.id, *halves))
            self.rows[element.id] = Represented(how, cycles.element(element))

    def _limit(self, kind: Gap) -> _Half:
        return _Half("COMBIN40", 3, (kind.moment / self.stick, 0.0, 0.0, 0.0, kind.moment, 0.0))

    def lines(self, elements: _Elements) -> list[str]:
        """Return the commands."""
        lines = []
        for what, slider in self.pairs:
            limit = slider.stiffness * slider.deflection
            lines += _single(
                elements, what, _Half("COMBIN40", 3, (slider.stiffness, 0.0, 0.0, 0.0, limit, 0.0))
            )
        for what, first, second in self.chains:
            lines += ["*GET,JNT_N,NODE,0,NUM,MAX", "JNT_N=JNT_N+1", "N,JNT_N,NX(JNTI),NY(JNTI),NZ(JNTI)"]
            lines += _single(elements, what, first, "JNTI,JNT_N")
            lines += _single(elements, what, second, "JNT_N,JNTJ")
        return lines


def _points(kind: Gap) -> tuple[float, ...]:
    """Points of a COMBIN39, which must rise at zero: a millionth of the ramp's slope does."""
    return tuple(float(value) for point in zip(*kind.curve(1e-6), strict=True) for value in point)


def _single(elements: _Elements, what: str, half: _Half, nodes: str = "JNTI,JNTJ") -> list[str]:
    texts = [number(value) for value in half.constants]
    rows = [texts[i : i + 6] for i in range(0, len(texts), 6)]
    return elements.one(half.kind, [(half.key, elements.dof)], rows, what, nodes=nodes)


def _powers(parts: Parts) -> tuple[tuple[_Power, ...], tuple[ModelTerm, ...]]:
    """Split the remaining terms into those a COMBIN37 can carry and those it cannot."""
    powers, remaining = [], []
    for term in (*parts.other_rate, *parts.coupled):
        p, q, kind = power_law(term.expression) or (1.0, 1.0, "")
        if kind == "rate" and (p == 0 or q == 0):
            powers.append(_Power(term, p or q, 0 if p else 2, 2))
        elif kind == "sign" and q == 0 and term.coefficient > 0:
            powers.append(_Power(term, p, 0, 8))
        else:
            remaining.append(term)
    return tuple(powers), tuple(remaining)
