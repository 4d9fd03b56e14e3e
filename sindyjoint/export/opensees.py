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
    filled_in,
    number,
    preamble,
    words_of,
)
from sindyjoint.export.parts import GIVE, Curve, Parts, power_law

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
    joint = _Joint(GIVE * model.fitted.angle)
    if parts.elastic:
        joint.table(curve)
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
    script = filled_in(
        "opensees.py.j2",
        materials=joint.materials,
        parallel=joint.parallel,
        joined=int(bool(joint.parallel)),
        chains=joint.chains,
        direction=6 if model.joint.motion == "rotation" else 1,
    )
    text = comment(preamble(model, "OpenSees", rows, notes), "#") + script
    return Export("opensees", {"joint_opensees.py": text}, rows, notes)


class _Joint:
    """What the script holds: materials, which of them are in parallel, and pairs of them with a node between."""

    def __init__(self, stick: float):
        self.stick = stick
        self.materials: list[tuple[str, str]] = []
        self.parallel: list[int] = []
        self.chains: list[tuple[int, int]] = []

    def material(self, kind: str, *values: float, aside: bool = False) -> int:
        """Add a material; one ``aside`` is not among those in parallel."""
        return self._add(kind, ", ".join(str(v) if isinstance(v, int) else number(v) for v in values), aside)

    def table(self, curve: Curve, aside: bool = False) -> int:
        """Add a table of moments over angles."""
        x, y = (f"*[{', '.join(map(number, values))}]" for values in (curve.x, curve.y))
        return self._add("ElasticMultiLinear", f'"-strain", {x}, "-stress", {y}', aside)

    def _add(self, kind: str, values: str, aside: bool) -> int:
        self.materials.append((kind, values))
        tag = len(self.materials) - 1
        self.parallel += [] if aside else [tag]
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
            spring = self.table(kind.curve(), aside=True)
            slider = self.material("ElasticPP", kind.moment / self.stick, self.stick, aside=True)
            self.chains.append((spring, slider))
        elif isinstance(kind, Slider):
            self.material("ElasticPP", kind.stiffness, kind.deflection)
