"""OpenSees: a Python function that joins two nodes by a zeroLength element with materials in parallel.

Elements with internal states are the materials ElasticPP, BoucWen and ViscousDamper; a gap in series with a slider has
a node of its own. Everything else is spring-slider pairs (ElasticPP) fitted to it.
"""

from __future__ import annotations

from sindyjoint.equation.model import JointModel
from sindyjoint.export import Export
from sindyjoint.export import fidelity as lumped
from sindyjoint.export.elements import BoucWen, Gap, Kind, Maxwell, Slider, written_as
from sindyjoint.export.fidelity import (
    Cycles,
    Represented,
    comment,
    fidelity_table,
    number,
    preamble,
    words_of,
)
from sindyjoint.export.parts import GIVE, Parts, power_law
from sindyjoint.numeric import Array

POINTS = 201
# BoucWen iterates to this change of its state, which is made to be of the size of one, in at most so many steps.
TOLERANCE, ITERATIONS = 1e-12, 50
WAYS = {
    BoucWen: "BoucWen",
    Maxwell: "ViscousDamper",
    Gap: "ElasticMultiLinear in series with ElasticPP, a node between",
}


def export(model: JointModel) -> Export:
    """Write ``joint_opensees.py``."""
    parts, cycles, words = Parts.of(model), Cycles.of(model), words_of(model)
    # Positive multiples of powers of the rate are what a Viscous material has.
    laws = [(term, power_law(term.expression) or (1, 0, "")) for term in parts.other_rate]
    powers = {
        t.id: (t.coefficient, q + 1)
        for t, (p, q, kind) in laws
        if (p, kind) == (0, "rate") and t.coefficient > 0
    }
    curve = lumped.elastic_curve(parts, POINTS)
    added, rows_of_elements = written_as(model, cycles, lambda kind: WAYS.get(type(kind), ""), "ElasticPP")
    rows = fidelity_table(
        model,
        cycles,
        {
            **lumped.elastic_rows(parts, cycles, curve.x, f"ElasticMultiLinear, table of {POINTS} points"),
            **lumped.viscous_rows(parts, cycles, "Elastic, eta"),
            **lumped.sliding_rows(parts, cycles, "ElasticPP"),
            **{t.id: Represented("Viscous", cycles.term(t)) for t in parts.other_rate if t.id in powers},
            **lumped.left_out(
                tuple(t for t in (*parts.other_rate, *parts.coupled) if t.id not in powers),
                f"no uniaxial material has a {words.moment} of this form of {words.rate}, or of it and {words.angle}",
            ),
            **lumped.inertial_rows(parts),
            **rows_of_elements,
        },
    )
    joint = _Joint(6 if model.joint.motion == "rotation" else 1, GIVE * model.fitted.angle)
    if parts.elastic:
        joint.table(curve.x, curve.y)
    if parts.damping:
        joint.material("Elastic", 0.0, parts.damping)
    for power in powers.values():
        joint.material("Viscous", *power)
    if parts.friction > 0:
        joint.material("ElasticPP", parts.stuck_stiffness, joint.stick)
    for _, kind in added:
        joint.add(kind)
    notes = (
        "import this file and call add_joint(ops, ...) after the two coincident nodes, with openseespy.opensees as ops",
        "steps short enough for the sliders: a hundredth of the shortest period or less",
        *lumped.sliding_note(model, parts.stuck_stiffness),
        lumped.range_note(model, "the table goes on with its last slope"),
        *lumped.inertia_note(model),
    )
    text = comment(preamble(model, "OpenSees", rows, notes), "#") + joint.script()
    return Export("opensees", {"joint_opensees.py": text}, rows, notes)


class _Joint:
    """The lines of the script: materials in parallel, and chains of two elements with a node between."""

    def __init__(self, direction: int, stick: float):
        self.direction, self.stick = direction, stick
        self.lines: list[str] = []
        self.parallel: list[int] = []
        self.chains: list[tuple[int, int]] = []

    def material(self, kind: str, *values: float, aside: bool = False) -> int:
        """Add a material; one ``aside`` is not among those in parallel."""
        return self._add(kind, ", ".join(str(v) if isinstance(v, int) else number(v) for v in values), aside)

    def table(self, x: Array, y: Array, aside: bool = False) -> int:
        """Add a table of moments over angles."""
        curves = [f"*[{', '.join(map(number, values))}]" for values in (x, y)]
        return self._add("ElasticMultiLinear", f'"-strain", {curves[0]}, "-stress", {curves[1]}', aside)

    def _add(self, kind: str, values: str, aside: bool) -> int:
        tag = len(self.lines)
        self.lines.append(f'ops.uniaxialMaterial("{kind}", first_material + {tag}, {values})')
        if not aside:
            self.parallel.append(tag)
        return tag

    def add(self, kind: Kind) -> None:
        """Add an element with internal states."""
        if isinstance(kind, BoucWen):
            # Of the state as a share of its largest, so that its tolerance means something.
            size, scale = kind.deflection, kind.deflection ** (kind.n - 1)
            self.material(
                "BoucWen", 0.0, kind.stiffness * size, kind.n, kind.gamma * scale, kind.beta * scale, 1 / size,
                0.0, 0.0, 0.0, TOLERANCE, ITERATIONS,
            )  # fmt: skip
        elif isinstance(kind, Maxwell):
            self.material("ViscousDamper", kind.stiffness, kind.stiffness * kind.time, 1.0)
        elif isinstance(kind, Gap):
            spring = self.table(*kind.curve(), aside=True)
            slider = self.material("ElasticPP", kind.moment / self.stick, self.stick, aside=True)
            self.chains.append((spring, slider))
        elif isinstance(kind, Slider):
            self.material("ElasticPP", kind.stiffness, kind.deflection)

    def script(self) -> str:
        """Return the function."""
        count, chains, joined = len(self.lines), len(self.chains), bool(self.parallel)
        head = [
            '"""A joint for OpenSees; the comment above says what it holds."""',
            "",
            f"MATERIALS = {count + joined}  # tags in use, from first_material on",
            f"ELEMENTS = {chains * 2 + joined}  # tags in use, from first_element on",
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
            lines.append(f'ops.uniaxialMaterial("Parallel", first_material + {count}, {tags})')
            lines.append(_zero_length("node_i", "node_j", 0, count))
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
