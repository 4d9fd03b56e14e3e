"""Joints in programs of finite elements beside ANSYS: Abaqus, Nastran and OpenSees.

Abaqus: a connector with nonlinear elasticity, damping and friction (CONN3D2, HINGE or TRANSLATOR). Elements with
internal states are connectors beside it that constrain nothing (CARDAN or CARTESIAN): one with friction and its stick
stiffness is a spring in series with a slider; two with a node between are a Maxwell branch, or a gap and a slider.

Nastran: CBUSH with PBUSH and PBUSHT for a rotational joint, CBUSH1D with PBUSH1D for a translational one. A CBUSH has
no tabulated force of the rate. What depends on the rate beyond viscous damping is, for a rotational joint, a CBUSH1D
between two additional grid points, whose distance is tied to the relative rotation (MPC). Springs in series with
sliders are rods of an elastic-plastic material, tied in the same way; a Maxwell branch is a spring and a damper with a
scalar point between (CELAS2, CDAMP2).

OpenSees: a Python function that joins two nodes by a zeroLength element with materials in parallel. Elements with
internal states are the materials ElasticPP, BoucWen and ViscousDamper; a gap in series with a slider has a node of its
own. Everything else is spring-slider pairs (ElasticPP) fitted to it.
"""

import re
from collections.abc import Iterable, Iterator, Sequence

import numpy as np

from sindyjoint.equation.model import JointModel
from sindyjoint.export import Export
from sindyjoint.export.elements import BoucWen, Gap, Kind, Maxwell, Slider, written_as
from sindyjoint.export.fidelity import (
    Cycles,
    Represented,
    comment,
    elastic_curve,
    elastic_rows,
    exact_rows,
    fidelity_table,
    filled_in,
    inertia_note,
    inertial_rows,
    left_out,
    number,
    preamble,
    range_note,
    rate_curve,
    rate_rows,
    sliding_limit,
    sliding_note,
    sliding_rows,
    words_of,
)
from sindyjoint.export.parts import GIVE, POINTS, RARE, Curve, Parts, power_law, total

ABAQUS_WAYS = {
    Maxwell: "connector elasticity in series with damping",
    Gap: "connector elasticity in series with friction",
}


def export_abaqus(model: JointModel) -> Export:
    """Write ``joint.inp``, to be included into an input file."""
    parts, cycles, words = Parts.of(model), Cycles.of(model), words_of(model)
    # Friction by position slides as Coulomb friction does.
    by_position = tuple(t for t in parts.coupled if (power_law(t.expression) or (0, 0, ""))[2] == "sign")
    slipping = (*parts.coulomb, *by_position)
    # The limit is an internal contact force times a coefficient of one.
    limit, stiffness = sliding_limit(parts, slipping)
    damping = tuple(term for term in parts.other_rate if term not in slipping)
    curve = elastic_curve(parts, POINTS)
    rates = rate_curve(parts, damping)
    pair = "connector friction with its stick stiffness"
    added, rows_of_elements = written_as(model, cycles, lambda kind: ABAQUS_WAYS.get(type(kind), ""), pair)
    rows = fidelity_table(
        model,
        cycles,
        {
            **rows_of_elements,
            **elastic_rows(parts, cycles, curve.x, f"connector elasticity, table of {POINTS} points"),
            **exact_rows(parts.viscous, cycles, "connector damping, linear"),
            **rate_rows(parts, damping, cycles, rates.x, f"connector damping, table of {rates.x.size} points"),
            **sliding_rows(parts, slipping, cycles, "connector friction", " anywhere in the tested range"),
            **left_out(
                tuple(t for t in parts.coupled if t not in by_position),
                f"a connector has no {words.moment} that depends on "
                f"{words.angle} and {words.rate} together in this form",
            ),
            **inertial_rows(parts),
        },
    )  # fmt: skip
    last = RARE + sum(not isinstance(kind, Slider) for _, kind in added) - 1
    nodes = f"node {last}" if last == RARE else f"nodes {RARE} to {last}"
    between = f"define {nodes} at the joint's place, between two connectors in series"
    raised = " (STICK STIFFNESS); raise it where the stuck joint must be stiffer, at the price of smaller increments"
    notes = (
        "replace the two node numbers and the orientation; the connector's local 1-axis is the joint's axis",
        range_note(model, "elasticity and damping go on with the last slope"),
        *sliding_note(model, stiffness, raised),
        *((between,) if last >= RARE else ()),
        *inertia_note(model),
    )
    rotation = model.joint.motion == "rotation"
    text = comment(preamble(model, "Abaqus", rows, notes), "**") + filled_in(
        "abaqus.inp.j2",
        element=RARE,
        node=RARE,
        component=4 if rotation else 1,
        held="HINGE" if rotation else "TRANSLATOR",
        free="CARDAN" if rotation else "CARTESIAN",
        curve=curve if parts.elastic else None,
        damping=parts.damping if parts.viscous else None,
        rates=rates if damping else None,
        friction=(stiffness, limit.points) if stiffness else None,
        sliders=[kind for _, kind in added if isinstance(kind, Slider)],
        chains=[kind for _, kind in added if not isinstance(kind, Slider)],
        stick=GIVE * model.fitted.angle,
    )
    return Export("abaqus", {"joint.inp": text}, rows, notes)


# The notes say to change these numbers where they are taken.
NUMBERS = "element damper table_elastic table_rate still relative set far first".split()
AT = dict(zip(NUMBERS, range(RARE, RARE + len(NUMBERS)), strict=True))
NASTRAN_WAYS = {
    Maxwell: "CELAS2 and CDAMP2, a scalar point between",
    Gap: "CROD without hardening and CBUSH1D, a grid point between",
}


def export_nastran(model: JointModel) -> Export:
    """Write ``joint.bdf``, bulk data to be included."""
    parts, cycles = Parts.of(model), Cycles.of(model)
    rotation = model.joint.motion == "rotation"
    tabulated = (*parts.coulomb, *parts.other_rate)
    if not rotation and tabulated:
        tabulated = parts.rate  # a PBUSH1D has either a damping constant or a table
    curve = _rounded(elastic_curve(parts, POINTS))
    rates = _rounded(rate_curve(parts, tabulated))
    words = words_of(model)
    spring = f"{'PBUSHT KN' if rotation else 'PBUSH1D SPRING'} table of {POINTS} points"
    damper = f"PBUSH1D DAMPER table of {rates.x.size} points"
    added, rows_of_elements = written_as(
        model, cycles, lambda kind: NASTRAN_WAYS.get(type(kind), ""), "CROD, MATS1 without hardening"
    )
    carried = {
        **rows_of_elements,
        **elastic_rows(parts, cycles, curve.x, spring),
        **exact_rows(parts.viscous, cycles, "PBUSH B" if rotation else "PBUSH1D B"),
        **rate_rows(parts, tabulated, cycles, rates.x, damper),
        **left_out(
            parts.coupled,
            f"the bushings of Nastran have no {words.moment} of {words.angle} and {words.rate} together",
        ),
        **inertial_rows(parts),
    }
    # Of the deck as written, its numbers rounded to 16 characters.
    whole = curve(cycles.angle)
    if rotation or not tabulated:
        whole = whole + float(field(parts.damping)) * cycles.rate
    if tabulated:
        whole = whole + rates(cycles.rate)
    whole = whole + sum(row.moment for row in rows_of_elements.values() if row.moment is not None)
    tied = rotation and bool(tabulated) or any(not isinstance(kind, Maxwell) for _, kind in added)
    rows = fidelity_table(model, cycles, carried, whole)
    notes = (
        f"replace grid points 1 and 2 and, where taken, the numbers from {AT['element']} on; the "
        f"joint's axis is the basic {'z' if rotation else 'x'} axis (CID 0)",
        "tables act in nonlinear solutions only (SOL 129, 400); linear ones see the stiffness at "
        "standstill and the damping",
        *(
            (
                f"case control: MPC = {AT['set']}; it makes the x displacement of grid point {AT['relative']} the "
                + ("relative rotation, 1 m for 1 rad" if rotation else "relative displacement"),
            )
            if tied
            else ()
        ),
        range_note(model, "they go on with the last slope"),
        *inertia_note(model),
    )
    text = comment(preamble(model, "Nastran", rows, notes), "$", width=72)
    step = 1e-6 * model.fitted.angle
    of = {each: [kind for _, kind in added if isinstance(kind, each)] for each in (Slider, Gap, Maxwell)}
    low, high = total(parts.elastic, np.array([-step, step]), 0.0)
    deck = filled_in(
        "nastran.bdf.j2", at=AT, nodes=(1, 2), field=field, rounded=_rounded,
        fields=lambda curve: ",".join(map(field, curve.flat)), rotation=rotation,
        tied=tied, stiffness=float(high - low) / (2 * step), damping=parts.damping, curve=curve,
        rates=rates if tabulated else None, stick=GIVE * model.fitted.angle,
        sliders=of[Slider], gaps=of[Gap], branches=of[Maxwell],
    )  # fmt: skip
    text += "".join(f"{_card(line)}\n" for line in deck.splitlines())
    return Export("nastran", {"joint.bdf": text}, rows, notes)


def field(value: float) -> str:
    """Return a number in at most 16 characters, as Nastran reads it.

    Examples
    --------
    >>> field(-2684000000.123456789), field(6066.0), field(1.23456789012345e-10)
    ('-2684000000.1235', '6066.', '1.23456789012-10')
    """
    for digits in range(17, 0, -1):
        mantissa, _, exponent = f"{float(value):.{digits}g}".partition("e")
        text = mantissa + "." * ("." not in mantissa) + (f"{int(exponent):+d}" if exponent else "")
        if len(text) <= 16:
            return text
    raise AssertionError("unreachable: one digit fits")


def read_field(text: str) -> float:
    """Return the number of a field, as Nastran reads it."""
    return float(re.sub(r"(?<=[\d.])(?=[+-])", "e", text))


def _rounded(curve: Curve) -> Curve:
    return Curve(*(np.array([read_field(field(v)) for v in values]) for values in (curve.x, curve.y)))


def _card(line: str) -> str:
    """Write a card in large format, its fields parted by commas: sixteen characters each, four of them per line."""
    name, *texts = line.rstrip(",").split(",")
    rows = [texts[i : i + 4] for i in range(0, len(texts), 4)]
    if len(rows) % 2:
        rows.append([])  # large format comes in pairs of lines
    starts = [f"{name}*", *["*"] * (len(rows) - 1)]
    lines = [
        start.ljust(8) + "".join(text.ljust(16) for text in row)
        for start, row in zip(starts, rows, strict=True)
    ]
    return "\n".join(line.rstrip() for line in lines)


OPENSEES_WAYS = {
    BoucWen: "BoucWen",
    Maxwell: "ViscousDamper",
    Gap: "ElasticMultiLinear in series with ElasticPP, a node between",
}


def export_opensees(model: JointModel) -> Export:
    """Write ``joint_opensees.py``."""
    parts, cycles, words = Parts.of(model), Cycles.of(model), words_of(model)
    # Positive multiples of powers of the rate are what a Viscous material has.
    laws = [(term, power_law(term.expression) or (1, 0, "")) for term in parts.other_rate]
    powers = {
        t.id: (t.coefficient, q + 1)
        for t, (p, q, kind) in laws
        if (p, kind) == (0, "rate") and t.coefficient > 0
    }
    curve = elastic_curve(parts, 201)
    added, rows_of_elements = written_as(
        model, cycles, lambda kind: OPENSEES_WAYS.get(type(kind), ""), "ElasticPP"
    )
    rows = fidelity_table(
        model,
        cycles,
        {
            **elastic_rows(parts, cycles, curve.x, f"ElasticMultiLinear, table of {curve.x.size} points"),
            **exact_rows(parts.viscous, cycles, "Elastic, eta"),
            **sliding_rows(parts, parts.coulomb, cycles, "ElasticPP"),
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
    text = comment(preamble(model, "OpenSees", rows, notes), "#") + filled_in(
        "opensees.py.j2", materials=[(kind, _values(values)) for kind, values, _ in materials], parallel=parallel,
        joined=int(bool(parallel)), chains=list(zip(aside[::2], aside[1::2], strict=True)),
        direction=6 if model.joint.motion == "rotation" else 1,
    )  # fmt: skip
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
