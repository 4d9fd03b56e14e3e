"""Abaqus: a connector with nonlinear elasticity, damping and friction (CONN3D2, HINGE or TRANSLATOR).

Elements with internal states are connectors beside it that constrain nothing (CARDAN or CARTESIAN): one with friction
and its stick stiffness is a spring in series with a slider; two with a node between are a Maxwell branch, or a gap and
a slider.
"""

from __future__ import annotations

import numpy as np

from sindyjoint.equation.model import JointModel, ModelTerm
from sindyjoint.export import Export
from sindyjoint.export import fidelity as lumped
from sindyjoint.export.elements import Gap, Kind, Maxwell, Slider, written_as
from sindyjoint.export.fidelity import (
    Cycles,
    Represented,
    Rows,
    comment,
    fidelity_table,
    number,
    preamble,
    words_of,
)
from sindyjoint.export.parts import GIVE, Curve, Parts, contribution, power_law, total

POINTS = 41
# Numbers that a model rarely uses: of the first element, and of the first node inside a Maxwell branch.
ELEMENT, BRANCH_NODE = 900001, 900001
WAYS = {
    Maxwell: "connector elasticity in series with damping",
    Gap: "connector elasticity in series with friction",
}


def export(model: JointModel) -> Export:
    """Write ``joint.inp``, to be included into an input file."""
    parts, cycles, words = Parts.of(model), Cycles.of(model), words_of(model)
    # Friction by position slides as Coulomb friction does.
    by_position = tuple(t for t in parts.coupled if (power_law(t.expression) or (0, 0, ""))[2] == "sign")
    friction = _Friction(parts, (*parts.coulomb, *by_position))
    damping = tuple(term for term in parts.other_rate if term not in friction.terms)
    curve = lumped.elastic_curve(parts, POINTS)
    rates = lumped.rate_curve(parts, damping)
    pair = "connector friction with its stick stiffness"
    added, rows_of_elements = written_as(model, cycles, lambda kind: WAYS.get(type(kind), ""), pair)
    rows = fidelity_table(
        model,
        cycles,
        {
            **rows_of_elements,
            **lumped.elastic_rows(parts, cycles, curve.x, f"connector elasticity, table of {POINTS} points"),
            **lumped.viscous_rows(parts, cycles, "connector damping, linear"),
            **lumped.rate_rows(parts, damping, cycles, rates.x, f"connector damping, table of {rates.x.size} points"),
            **friction.rows(cycles),
            **lumped.left_out(
                tuple(t for t in parts.coupled if t not in by_position),
                f"a connector has no {words.moment} that depends on "
                f"{words.angle} and {words.rate} together in this form",
            ),
            **lumped.inertial_rows(parts),
        },
    )  # fmt: skip
    last = BRANCH_NODE + sum(not isinstance(kind, Slider) for _, kind in added) - 1
    nodes = f"node {last}" if last == BRANCH_NODE else f"nodes {BRANCH_NODE} to {last}"
    between = f"define {nodes} at the joint's place, between two connectors in series"
    raised = " (STICK STIFFNESS); raise it where the stuck joint must be stiffer, at the price of smaller increments"
    notes = (
        "replace the two node numbers and the orientation; the connector's local 1-axis is the joint's axis",
        lumped.range_note(model, "elasticity and damping go on with the last slope"),
        *lumped.sliding_note(model, friction.stiffness, raised),
        *((between,) if last >= BRANCH_NODE else ()),
        *lumped.inertia_note(model),
    )
    component, kind, free = (
        (4, "HINGE", "CARDAN") if model.joint.motion == "rotation" else (1, "TRANSLATOR", "CARTESIAN")
    )
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
    lines += _nonlinear("ELASTICITY", component, curve) if parts.elastic else []
    lines += _linear("DAMPING", component, parts.damping) if parts.viscous else []
    lines += _nonlinear("DAMPING", component, rates) if damping else []
    lines += friction.lines(component)
    lines += _hysteresis([kind for _, kind in added], component, kind, free, GIVE * model.fitted.angle)
    text = comment(preamble(model, "Abaqus", rows, notes), "**") + "".join(f"{line}\n" for line in lines)
    return Export("abaqus", {"joint.inp": text}, rows, notes)


class _Friction:
    """Friction whose limit is a function of the position: internal contact force times a coefficient of one."""

    def __init__(self, parts: Parts, terms: tuple[ModelTerm, ...]):
        self.parts, self.terms = parts, terms
        self.nodes = parts.elastic_nodes(POINTS) if any(t in parts.coupled for t in terms) else np.zeros(1)
        # At an infinitely small positive rate the sign is 1 and nothing else remains.
        self.limit = total(terms, self.nodes, 1e-300)
        possible = bool(terms) and bool(np.all(self.limit >= 0))
        self.stiffness = float(self.limit.max()) / (GIVE * parts.model.fitted.angle) if possible else 0.0

    def rows(self, cycles: Cycles) -> Rows:
        if not self.stiffness:
            return lumped.left_out(self.terms, "friction must not be negative anywhere in the tested range")
        share = {
            t.id: np.interp(cycles.angle, self.nodes, contribution(t, self.nodes, 1e-300)) for t in self.terms
        }
        whole = sum(share.values(), np.zeros(cycles.angle.shape))
        slider = cycles.slider(whole, self.stiffness)
        # Each term takes its share of the one slider.
        safe = np.where(whole > 0, whole, 1.0)
        angle = words_of(self.parts.model).angle
        how = f"connector friction; sticks as a spring that gives way by {GIVE:g} of the tested {angle}"
        return {term: Represented(how, slider * own / safe) for term, own in share.items()}

    def lines(self, component: int) -> list[str]:
        if not self.stiffness:
            return []
        if self.nodes.size == 1:
            return _sliding(component, self.stiffness, float(self.limit[0]))
        head, _, *tail = _sliding(component, self.stiffness, 0.0)
        data = [f"{number(f)}, {number(x)}" for x, f in zip(self.nodes, self.limit, strict=True)]
        return [f"{head}, INDEPENDENT COMPONENTS=POSITION", str(component), *data, *tail]


def _hysteresis(kinds: list[Kind], component: int, held: str, free: str, stick: float) -> list[str]:
    """Return pairs of spring and slider, then two connectors with a node between for what is more.

    The first of two constrains as the joint does, and holds the node between; the second constrains nothing.
    """
    lines, element, node = [], ELEMENT, BRANCH_NODE
    for kind in kinds:
        if isinstance(kind, Slider):
            element += 1
            sliding = _sliding(component, kind.stiffness, kind.stiffness * kind.deflection)
            lines += _connector(element, "1, 2", free, sliding)
    for kind in kinds:
        if isinstance(kind, Maxwell):
            first = _linear("ELASTICITY", component, kind.stiffness)
            second = _linear("DAMPING", component, kind.stiffness * kind.time)
        elif isinstance(kind, Gap):
            first = _sliding(component, kind.moment / stick, kind.moment)
            second = _nonlinear("ELASTICITY", component, Curve(*kind.curve()))
        else:
            continue
        lines += _connector(element + 1, f"1, {node}", held, first)
        lines += _connector(element + 2, f"{node}, 2", free, second)
        element, node = element + 2, node + 1
    return lines


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


def _linear(kind: str, component: int, value: float) -> list[str]:
    return [f"*CONNECTOR {kind}, COMPONENT={component}", f"{number(value)},"]


def _nonlinear(kind: str, component: int, curve: Curve) -> list[str]:
    points = [f"{number(y)}, {number(x)}" for x, y in zip(curve.x, curve.y, strict=True)]
    return [f"*CONNECTOR {kind}, COMPONENT={component}, NONLINEAR", *points]


def _sliding(component: int, stiffness: float, limit: float) -> list[str]:
    head = f"*CONNECTOR FRICTION, COMPONENT={component}, STICK STIFFNESS={number(stiffness)}"
    return [head, f"{number(limit)},", "*FRICTION", "1.0,"]
