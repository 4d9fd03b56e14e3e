"""Abaqus: a connector with nonlinear elasticity, damping and friction (CONN3D2, HINGE or TRANSLATOR).

Elements with internal states are connectors beside it that constrain nothing (CARDAN or CARTESIAN): one with friction
and its stick stiffness is a spring in series with a slider; two with a node between are a Maxwell branch, or a gap and
a slider.
"""

from __future__ import annotations

import numpy as np

from sindyjoint.equation.model import JointModel, ModelTerm
from sindyjoint.export import lumped
from sindyjoint.export.base import Cycles, Export, Represented, fidelity_table
from sindyjoint.export.elements import Gap, Maxwell, kind_of
from sindyjoint.export.parts import GIVE, Curve, Parts, contribution, power_law, total
from sindyjoint.export.sliders import pairs_of, represented
from sindyjoint.export.text import comment, number, preamble, words_of

POINTS = 41
# Numbers that a model rarely uses: of the first element, and of the first node inside a Maxwell branch.
ELEMENT, BRANCH_NODE = 900001, 900001


def export(model: JointModel) -> Export:
    """Write ``joint.inp``, to be included into an input file."""
    parts, cycles = Parts.of(model), Cycles.of(model)
    sliding, remaining = _sliding_terms(parts)
    words = words_of(model)
    friction = _Friction(parts, sliding)
    damping = tuple(term for term in parts.other_rate if term not in sliding)
    curve = lumped.elastic_curve(parts, POINTS)
    rates = lumped.rate_curve(parts, damping)
    added = _Hysteresis(model, cycles)
    rows = fidelity_table(
        model,
        cycles,
        {
            **added.rows,
            **lumped.elastic_rows(parts, cycles, curve.x, f"connector elasticity, table of {POINTS} points"),
            **lumped.viscous_rows(parts, cycles, "connector damping, linear"),
            **lumped.rate_rows(parts, damping, cycles, rates.x, f"connector damping, table of {rates.x.size} points"),
            **friction.rows(cycles),
            **lumped.left_out(
                remaining,
                f"a connector has no {words.moment} that depends on "
                f"{words.angle} and {words.rate} together in this form",
            ),
            **lumped.inertial_rows(parts),
        },
    )  # fmt: skip
    notes = (
        "replace the two node numbers and the orientation; the connector's local 1-axis is the joint's axis",
        lumped.range_note(model, "elasticity and damping go on with the last slope"),
        *friction.notes(),
        *added.notes(),
        *lumped.inertia_note(model),
    )
    text = comment(preamble(model, "Abaqus", rows, notes), "**")
    text += _deck(model, parts, curve, rates if damping else None, friction)
    text += "".join(f"{line}\n" for line in added.lines())
    return Export("abaqus", {"joint.inp": text}, rows, notes)


def _sliding_terms(parts: Parts) -> tuple[tuple[ModelTerm, ...], tuple[ModelTerm, ...]]:
    """Split what may slide: friction by position and Coulomb friction, and the remaining coupled terms."""
    by_position = tuple(t for t in parts.coupled if (power_law(t.expression) or (0, 0, ""))[2] == "sign")
    return (*parts.coulomb, *by_position), tuple(t for t in parts.coupled if t not in by_position)


class _Friction:
    """Friction whose limit is a function of the position: internal contact force times a coefficient of one."""

    def __init__(self, parts: Parts, terms: tuple[ModelTerm, ...]):
        self.parts, self.terms = parts, terms
        self.nodes = parts.elastic_nodes(POINTS) if any(t in parts.coupled for t in terms) else np.zeros(1)
        # At an infinitely small positive rate the sign is 1 and nothing else remains.
        self.limit = total(terms, self.nodes, 1e-300)
        self.possible = bool(terms) and bool(np.all(self.limit >= 0)) and bool(self.limit.max() > 0)
        self.stiffness = float(self.limit.max()) / (GIVE * parts.model.fitted.angle)

    def rows(self, cycles: Cycles) -> dict[str, Represented]:
        if not self.possible:
            return lumped.left_out(self.terms, "friction must not be negative anywhere in the tested range")
        share = self._interpolated(cycles)
        whole = sum(share.values(), np.zeros(cycles.angle.shape))
        slider = cycles.slider(whole, self.stiffness)
        # Each term takes its share of the one slider.
        safe = np.where(whole > 0, whole, 1.0)
        return {
            term.id: Represented(
                "connector friction; sticks as a spring that gives way by "
                f"{GIVE:g} of the tested {words_of(self.parts.model).angle}",
                slider * share[term.id] / safe,
            )
            for term in self.terms
        }

    def _interpolated(self, cycles: Cycles) -> dict[str, np.ndarray]:
        if self.nodes.size == 1:
            return {t.id: np.full(cycles.angle.shape, t.coefficient) for t in self.terms}
        return {
            t.id: np.interp(cycles.angle, self.nodes, contribution(t, self.nodes, 1e-300)) for t in self.terms
        }

    def notes(self) -> tuple[str, ...]:
        if not self.possible:
            return ()
        unit = words_of(self.parts.model)
        return (
            f"while it sticks, friction is a spring of {self.stiffness:.6g} {unit.stiffness_unit} (STICK STIFFNESS); "
            "raise it where the stuck joint must be stiffer, at the price of smaller increments",
        )

    def lines(self, component: int) -> list[str]:
        if not self.possible:
            return []
        head = f"*CONNECTOR FRICTION, COMPONENT={component}, STICK STIFFNESS={number(self.stiffness)}"
        if self.nodes.size == 1:
            data = [head, f"{number(self.limit[0])},"]
        else:
            data = [f"{head}, INDEPENDENT COMPONENTS=POSITION", str(component)]
            data += [f"{number(f)}, {number(x)}" for x, f in zip(self.nodes, self.limit, strict=True)]
        return [*data, "*FRICTION", "1.0,"]


class _Hysteresis:
    """Elements with internal states: pairs of spring and slider, and two connectors with a node between."""

    def __init__(self, model: JointModel, cycles: Cycles):
        rotation = model.joint.motion == "rotation"
        self.component = 4 if rotation else 1
        # The first constrains as the joint does, and holds the node between two; the second constrains nothing.
        self.held, self.free = ("HINGE", "CARDAN") if rotation else ("TRANSLATOR", "CARTESIAN")
        self.stick = GIVE * model.fitted.angle
        self.rows: dict[str, Represented] = {}
        self.pairs: list[list[str]] = []
        self.chains: list[tuple[list[str], list[str]]] = []
        for element in model.elements:
            kind = kind_of(element, cycles)
            if isinstance(kind, Maxwell) and kind.stiffness > 0:
                damping = self._one("DAMPING", kind.stiffness * kind.time)
                self.chains.append((self._one("ELASTICITY", kind.stiffness), damping))
                how = "connector elasticity in series with damping"
            elif isinstance(kind, Gap) and kind.moment > 0:
                spring = [
                    f"*CONNECTOR ELASTICITY, COMPONENT={self.component}, NONLINEAR",
                    *_pairs(Curve(*kind.curve())),
                ]
                self.chains.append((self._friction(kind.moment / self.stick, kind.moment), spring))
                how = "connector elasticity in series with friction"
            else:
                pairs = pairs_of(element, kind, cycles)
                for slider in pairs.sliders if pairs else ():
                    limit = slider.stiffness * slider.deflection
                    self.pairs.append(self._friction(slider.stiffness, limit))
                self.rows[element.id] = represented(pairs, "connector friction with its stick stiffness")
                continue
            self.rows[element.id] = Represented(how, cycles.element(element))

    def notes(self) -> tuple[str, ...]:
        if not self.chains:
            return ()
        last = BRANCH_NODE + len(self.chains) - 1
        nodes = f"node {last}" if last == BRANCH_NODE else f"nodes {BRANCH_NODE} to {last}"
        return (f"define {nodes} at the joint's place, between two connectors in series",)

    def lines(self) -> list[str]:
        lines: list[str] = []
        element = ELEMENT
        for behaviour in self.pairs:
            element += 1
            lines += _connector(element, "1, 2", self.free, behaviour)
        for node, (first, second) in enumerate(self.chains, BRANCH_NODE):
            lines += _connector(element + 1, f"1, {node}", self.held, first)
            lines += _connector(element + 2, f"{node}, 2", self.free, second)
            element += 2
        return lines

    def _one(self, kind: str, value: float) -> list[str]:
        return [f"*CONNECTOR {kind}, COMPONENT={self.component}", f"{number(value)},"]

    def _friction(self, stiffness: float, limit: float) -> list[str]:
        head = f"*CONNECTOR FRICTION, COMPONENT={self.component}, STICK STIFFNESS={number(stiffness)}"
        return [head, f"{number(limit)},", "*FRICTION", "1.0,"]


def _connector(element: int, nodes: str, kind: str, behaviour: list[str]) -> list[str]:
    name = f"SINDYJOINT_{element}"
    return [
        f"*ELEMENT, TYPE=CONN3D2, ELSET={name}",
        f"{element}, {nodes}",
        f"*CONNECTOR SECTION, ELSET={name}, BEHAVIOR={name}_LAW",
        f"{kind},",
        "SINDYJOINT_AXES,",
        f"*CONNECTOR BEHAVIOR, NAME={name}_LAW",
        *behaviour,
    ]


def _deck(model: JointModel, parts: Parts, curve: Curve, rates: Curve | None, friction: _Friction) -> str:
    rotation = model.joint.motion == "rotation"
    kind, component = ("HINGE", 4) if rotation else ("TRANSLATOR", 1)
    lines = [
        "*ELEMENT, TYPE=CONN3D2, ELSET=SINDYJOINT",
        "** element number, node on the base's side, node on the far side",
        f"{ELEMENT}, 1, 2",
        "*ORIENTATION, NAME=SINDYJOINT_AXES, DEFINITION=COORDINATES",
        "1., 0., 0., 0., 1., 0.",
        "*CONNECTOR SECTION, ELSET=SINDYJOINT, BEHAVIOR=SINDYJOINT_LAW",
        f"{kind},",
        "SINDYJOINT_AXES,",
        "*CONNECTOR BEHAVIOR, NAME=SINDYJOINT_LAW, EXTRAPOLATION=LINEAR",
    ]
    if parts.elastic:
        lines += [f"*CONNECTOR ELASTICITY, COMPONENT={component}, NONLINEAR", *_pairs(curve)]
    if parts.viscous:
        lines += [f"*CONNECTOR DAMPING, COMPONENT={component}", f"{number(parts.damping)},"]
    if rates is not None:
        lines += [f"*CONNECTOR DAMPING, COMPONENT={component}, NONLINEAR", *_pairs(rates)]
    return "\n".join([*lines, *friction.lines(component)]) + "\n"


def _pairs(curve: Curve) -> list[str]:
    return [f"{number(y)}, {number(x)}" for x, y in zip(curve.x, curve.y, strict=True)]
