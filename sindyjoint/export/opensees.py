"""OpenSees: a Python function that joins two nodes by a zeroLength element with materials in parallel.

Elements with internal states are the materials ElasticPP, BoucWen and ViscousDamper; a gap in series with a slider has
a node of its own. Everything else is spring-slider pairs (ElasticPP) fitted to it.
"""

from collections.abc import Iterable, Iterator, Sequence

from sindyjoint.equation.model import JointModel
from sindyjoint.export import Export
from sindyjoint.export.elements import BoucWen, Gap, Kind, Maxwell, Slider, written_as
from sindyjoint.export.fidelity import (
    Cycles,
    Represented,
    comment,
    elastic_curve,
    elastic_rows,
    fidelity_table,
    filled_in,
    inertia_note,
    inertial_rows,
    left_out,
    number,
    preamble,
    range_note,
    sliding_note,
    sliding_rows,
    viscous_rows,
    words_of,
)
from sindyjoint.export.parts import GIVE, Curve, Parts, power_law

POINTS = 201
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
    curve = elastic_curve(parts, POINTS)
    added, rows_of_elements = written_as(model, cycles, lambda kind: WAYS.get(type(kind), ""), "ElasticPP")
    rows = fidelity_table(
        model,
        cycles,
        {
            **elastic_rows(parts, cycles, curve.x, f"ElasticMultiLinear, table of {POINTS} points"),
            **viscous_rows(parts, cycles, "Elastic, eta"),
            **sliding_rows(parts, cycles, "ElasticPP"),
            **{t.id: Represented("Viscous", cycles.term(t)) for t in parts.other_rate if t.id in powers},
            **left_out(
                tuple(t for t in (*parts.other_rate, *parts.coupled) if t.id not in powers),
                f"no uniaxial material has a {words.moment} of this form of {words.rate}, or of it and {words.angle}",
            ),
            **inertial_rows(parts),
            **rows_of_elements,
        },
    )
    materials = list(_materials(parts, powers.values(), curve, [kind for _, kind in added]))
    aside = [tag for tag, material in enumerate(materials) if material[2]]
    parallel = [tag for tag in range(len(materials)) if tag not in aside]
    notes = (
        "import this file and call add_joint(ops, ...) after the two coincident nodes, with openseespy.opensees as ops",
        "steps short enough for the sliders: a hundredth of the shortest period or less",
        *sliding_note(model, parts.stuck_stiffness),
        range_note(model, "the table goes on with its last slope"),
        *inertia_note(model),
    )
    script = filled_in(
        "opensees.py.j2", materials=[(kind, _values(values)) for kind, values, _ in materials], parallel=parallel,
        joined=int(bool(parallel)), chains=list(zip(aside[::2], aside[1::2], strict=True)),
        direction=6 if model.joint.motion == "rotation" else 1,
    )  # fmt: skip
    text = comment(preamble(model, "OpenSees", rows, notes), "#") + script
    return Export("opensees", {"joint_opensees.py": text}, rows, notes)


Material = tuple[str, Sequence[float] | Curve, bool]


def _materials(
    parts: Parts, powers: Iterable[tuple[float, float]], curve: Curve, kinds: Sequence[Kind]
) -> Iterator[Material]:
    """Yield the materials with their values, and whether one is aside of those in parallel: in a pair with a node."""
    stick = GIVE * parts.model.fitted.angle
    if parts.elastic:
        yield "ElasticMultiLinear", curve, False
    if parts.damping:
        yield "Elastic", (0.0, parts.damping), False
    yield from (("Viscous", power, False) for power in powers)
    if parts.friction > 0:
        yield "ElasticPP", (parts.stuck_stiffness, stick), False
    for kind in kinds:
        if isinstance(kind, BoucWen):
            # Of the state as a share of its largest, so that its tolerance means something.
            size, scale = kind.deflection, kind.deflection ** (kind.n - 1)
            shape = (0.0, kind.stiffness * size, kind.n, kind.gamma * scale, kind.beta * scale, 1 / size)
            # It iterates to a change of 1e-12, in at most 50 steps.
            yield "BoucWen", (*shape, 0.0, 0.0, 0.0, 1e-12, 50), False
        elif isinstance(kind, Maxwell):
            yield "ViscousDamper", (kind.stiffness, kind.stiffness * kind.time, 1.0), False
        elif isinstance(kind, Gap):
            yield "ElasticMultiLinear", kind.curve(), True
            yield "ElasticPP", (kind.moment / stick, stick), True
        elif isinstance(kind, Slider):
            yield "ElasticPP", (kind.stiffness, kind.deflection), False


def _values(values: Sequence[float] | Curve) -> str:
    if isinstance(values, Curve):
        x, y = (f"*[{', '.join(map(number, each))}]" for each in (values.x, values.y))
        return f'"-strain", {x}, "-stress", {y}'
    return ", ".join(str(v) if isinstance(v, int) else number(v) for v in values)
