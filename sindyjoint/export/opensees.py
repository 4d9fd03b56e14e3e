"""OpenSees: a Python function that joins two nodes by a zeroLength element with materials in parallel.

Elements with internal states are the materials ElasticPP, BoucWen and ViscousDamper; a gap in series with a slider has
a node of its own. Everything else is spring-slider pairs (ElasticPP) fitted to it.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from sindyjoint.equation.element import JointElement
from sindyjoint.equation.model import JointModel, ModelTerm
from sindyjoint.export import lumped
from sindyjoint.export.base import Cycles, Export, Represented, fidelity_table
from sindyjoint.export.elements import BoucWen, Gap, Maxwell, kind_of
from sindyjoint.export.parts import GIVE, Parts, power_law
from sindyjoint.export.sliders import pairs_of, represented
from sindyjoint.export.text import comment, number, preamble, words_of

POINTS = 201
# BoucWen iterates to this change of its state, which is made to be of the size of one, in at most so many steps.
TOLERANCE, ITERATIONS = 1e-12, 50


def export(model: JointModel) -> Export:
    """Write ``joint_opensees.py``."""
    parts, cycles = Parts.of(model), Cycles.of(model)
    words = words_of(model)
    powers, other = _powers(parts.other_rate)
    joint = _Joint(model, parts)
    curve = lumped.elastic_curve(parts, POINTS)
    rows: dict[str, Represented] = {
        **lumped.elastic_rows(parts, cycles, curve.x, f"ElasticMultiLinear, table of {POINTS} points"),
        **lumped.viscous_rows(parts, cycles, "Elastic, eta"),
        **_coulomb_rows(parts, cycles),
        **{term.id: Represented("Viscous", cycles.term(term)) for term in powers},
        **lumped.left_out(
            (*other, *parts.coupled),
            f"no uniaxial material has a {words.moment} of this form of {words.rate}, or of it and {words.angle}",
        ),
        **lumped.inertial_rows(parts),
    }
    if parts.elastic:
        joint.table(curve.x, curve.y)
    if parts.damping:
        joint.material("Elastic", 0.0, parts.damping)
    for term in powers:
        joint.material("Viscous", term.coefficient, (power_law(term.expression) or (0, 0, ""))[1] + 1)
    if parts.friction > 0:
        give = GIVE * model.fitted.angle
        joint.material("ElasticPP", parts.friction / give, give)
    for element in model.elements:
        rows[element.id] = joint.element(element, cycles)
    table = fidelity_table(model, cycles, rows)
    notes = (
        "import this file and call add_joint(ops, ...) after the two coincident nodes, with openseespy.opensees as ops",
        "steps short enough for the sliders: a hundredth of the shortest period or less",
        *_friction_note(parts),
        lumped.range_note(model, "the table goes on with its last slope"),
        *lumped.inertia_note(model),
    )
    text = comment(preamble(model, "OpenSees", table, notes), "#") + joint.script()
    return Export("opensees", {"joint_opensees.py": text}, table, notes)


def _powers(terms: Sequence[ModelTerm]) -> tuple[list[ModelTerm], list[ModelTerm]]:
    """Split terms of the rate into positive multiples of its powers, which a Viscous material has, and others."""
    fits = [(power_law(t.expression) or (1, 0, ""))[::2] == (0, "rate") and t.coefficient > 0 for t in terms]
    return (
        [term for term, fit in zip(terms, fits, strict=True) if fit],
        [term for term, fit in zip(terms, fits, strict=True) if not fit],
    )


def _coulomb_rows(parts: Parts, cycles: Cycles) -> dict[str, Represented]:
    if not parts.friction > 0:
        return lumped.left_out(parts.coulomb, "friction must not be negative")
    limit = np.full(cycles.angle.shape, parts.friction)
    slider = cycles.slider(limit, parts.friction / (GIVE * parts.model.fitted.angle))
    how = f"ElasticPP; sticks as a spring that gives way by {GIVE:g} of the tested {words_of(parts.model).angle}"
    return {t.id: Represented(how, slider * t.coefficient / parts.friction) for t in parts.coulomb}


def _friction_note(parts: Parts) -> tuple[str, ...]:
    if not parts.friction > 0:
        return ()
    stiffness = parts.friction / (GIVE * parts.model.fitted.angle)
    unit = words_of(parts.model).stiffness_unit
    return (f"while it sticks, friction is a spring of {stiffness:.6g} {unit}",)


class _Joint:
    """The lines of the script: materials in parallel, and chains of two elements with a node between."""

    def __init__(self, model: JointModel, parts: Parts):
        self.direction = 6 if model.joint.motion == "rotation" else 1
        self.stick = GIVE * model.fitted.angle
        self.lines: list[str] = []
        self.count = 0
        self.parallel: list[int] = []
        self.chains: list[tuple[int, int]] = []

    def material(self, kind: str, *values: float, aside: bool = False) -> int:
        """Add a material; one ``aside`` is not among those in parallel."""
        numbers = ", ".join(str(v) if isinstance(v, int) else number(v) for v in values)
        return self._add(f'"{kind}"', numbers, aside)

    def table(self, x: np.ndarray, y: np.ndarray, aside: bool = False) -> int:
        """Add a table of moments over angles."""
        curves = [f"*[{', '.join(map(number, values))}]" for values in (x, y)]
        return self._add('"ElasticMultiLinear"', f'"-strain", {curves[0]}, "-stress", {curves[1]}', aside)

    def _add(self, kind: str, values: str, aside: bool) -> int:
        tag = self.count
        self.count += 1
        self.lines.append(f"ops.uniaxialMaterial({kind}, first_material + {tag}, {values})")
        if not aside:
            self.parallel.append(tag)
        return tag

    def element(self, element: JointElement, cycles: Cycles) -> Represented:
        """Add an element with internal states, and say how it is represented."""
        kind = kind_of(element, cycles)
        if isinstance(kind, BoucWen) and kind.stiffness > 0:
            size = kind.deflection
            # Of the state as a share of its largest, so that its tolerance means something.
            scale = size ** (kind.n - 1)
            self.material(
                "BoucWen", 0.0, kind.stiffness * size, kind.n, kind.gamma * scale, kind.beta * scale, 1 / size,
                0.0, 0.0, 0.0, TOLERANCE, ITERATIONS,
            )  # fmt: skip
            return Represented("BoucWen", cycles.element(element))
        if isinstance(kind, Maxwell) and kind.stiffness > 0:
            self.material("ViscousDamper", kind.stiffness, kind.stiffness * kind.time, 1.0)
            return Represented("ViscousDamper", cycles.element(element))
        if isinstance(kind, Gap) and kind.moment > 0:
            return self._gap(kind, element, cycles)
        pairs = pairs_of(element, kind, cycles)
        for slider in pairs.sliders if pairs else ():
            self.material("ElasticPP", slider.stiffness, slider.deflection)
        return represented(pairs, "ElasticPP")

    def _gap(self, kind: Gap, element: JointElement, cycles: Cycles) -> Represented:
        spring = self.table(*kind.curve(), aside=True)
        slider = self.material("ElasticPP", kind.moment / self.stick, self.stick, aside=True)
        self.chains.append((spring, slider))
        return Represented(
            "ElasticMultiLinear in series with ElasticPP, a node between", cycles.element(element)
        )

    def script(self) -> str:
        """Return the function."""
        chains, joined = len(self.chains), bool(self.parallel)
        elements = chains * 2 + joined
        head = [
            '"""A joint for OpenSees; the comment above says what it holds."""',
            "",
            f"MATERIALS = {self.count + joined}  # tags in use, from first_material on",
            f"ELEMENTS = {elements}  # tags in use, from first_element on",
            f"NODES = {chains}  # tags in use, from first_node on",
            f"DIRECTION = {self.direction}",
            "",
            "",
            "def add_joint(ops, node_i, node_j, first_element, first_material, first_node=None):",
            '    """Join node_i, the base\'s side, and node_j of the same place."""',
        ]
        lines = list(self.lines)
        if joined:
            tags = ", ".join(f"first_material + {tag}" for tag in self.parallel)
            lines.append(f'ops.uniaxialMaterial("Parallel", first_material + {self.count}, {tags})')
            lines.append(_zero_length("node_i", "node_j", 0, self.count))
        for index, (spring, slider) in enumerate(self.chains):
            at, place = f"first_node + {index}", joined + 2 * index
            lines += [
                f"ops.node({at}, *ops.nodeCoord(node_i))",
                "others = [dof for dof in range(1, len(ops.nodeDisp(node_i)) + 1)"
                " if dof != min(DIRECTION, len(ops.nodeDisp(node_i)))]",
                f"ops.equalDOF(node_i, {at}, *others)",
                _zero_length("node_i", at, place, slider),
                _zero_length(at, "node_j", place + 1, spring),
            ]
        return "\n".join([*head, *(f"    {line}" for line in lines or ["pass"])]) + "\n"


def _zero_length(i: str, j: str, element: int, material: int) -> str:
    return (
        f'ops.element("zeroLength", first_element + {element}, {i}, {j}, '
        f'"-mat", first_material + {material}, "-dir", DIRECTION)'
    )
