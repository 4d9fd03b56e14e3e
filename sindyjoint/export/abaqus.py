"""Abaqus: a connector with nonlinear elasticity, damping and friction (CONN3D2, HINGE or TRANSLATOR).

Elements with internal states are connectors beside it that constrain nothing (CARDAN or CARTESIAN): one with friction
and its stick stiffness is a spring in series with a slider; two with a node between are a Maxwell branch.
"""

from __future__ import annotations

import numpy as np

from sindyjoint.equation.model import JointModel, ModelTerm
from sindyjoint.export import lumped
from sindyjoint.export.base import Cycles, Export, Represented, fidelity_table
from sindyjoint.export.elements import Maxwell, Slider, kind_of
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
    text += "".join(f"{line}\n" for line in added.lines(model.joint.motion == "rotation"))
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
    """Elements with internal states: pairs of spring and slider, and Maxwell branches."""

    def __init__(self, model: JointModel, cycles: Cycles):
        self.rows: dict[str, Represented] = {}
        self.pairs: list[Slider] = []
        self.branches: list[Maxwell] = []
        for element in model.elements:
            kind = kind_of(element, cycles)
            if isinstance(kind, Maxwell) and kind.stiffness > 0:
                self.branches.append(kind)
                moment = cycles.element(element)
                self.rows[element.id] = Represented("connector elasticity in series with damping", moment)
                continue
            pairs = pairs_of(element, kind, cycles)
            self.pairs += pairs.sliders if pairs else ()
            self.rows[element.id] = represented(pairs, "connector friction with its stick stiffness")

    def notes(self) -> tuple[str, ...]:
        if not self.branches:
            return ()
        last = BRANCH_NODE + len(self.branches) - 1
        return (f"define nodes {BRANCH_NODE} to {last} at the joint's place: they are inside its Maxwell branches",)

    def lines(self, rotation: bool) -> list[str]:
        free, component = ("CARDAN", 4) if rotation else ("CARTESIAN", 1)
        held = "HINGE" if rotation else "TRANSLATOR"
        lines: list[str] = []
        count = iter(range(ELEMENT + 1, 10**9))
        for slider in self.pairs:
            friction = [
                f"*CONNECTOR FRICTION, COMPONENT={component}, STICK STIFFNESS={number(slider.stiffness)}",
                f"{number(slider.stiffness * slider.deflection)},",
                "*FRICTION",
                "1.0,",
            ]
            lines += _connector(next(count), "1, 2", free, friction)
        for index, branch in enumerate(self.branches):
            node = BRANCH_NODE + index
            spring = [f"*CONNECTOR ELASTICITY, COMPONENT={component}", f"{number(branch.stiffness)},"]
            damper = [
                f"*CONNECTOR DAMPING, COMPONENT={component}",
                f"{number(branch.stiffness * branch.time)},",
            ]
            lines += _connector(next(count), f"1, {node}", held, spring)
            lines += _connector(next(count), f"{node}, 2", free, damper)
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
