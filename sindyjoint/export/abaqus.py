"""Abaqus: a connector with nonlinear elasticity, damping and friction (CONN3D2, HINGE or TRANSLATOR).

Elements with internal states are connectors beside it that constrain nothing (CARDAN or CARTESIAN): one with friction
and its stick stiffness is a spring in series with a slider; two with a node between are a Maxwell branch, or a gap and
a slider.
"""

import numpy as np

from sindyjoint.equation.model import JointModel, ModelTerm
from sindyjoint.export import Export
from sindyjoint.export.elements import Gap, Maxwell, Slider, written_as
from sindyjoint.export.fidelity import (
    Cycles,
    Represented,
    Rows,
    comment,
    elastic_curve,
    elastic_rows,
    fidelity_table,
    filled_in,
    inertia_note,
    inertial_rows,
    left_out,
    preamble,
    range_note,
    rate_curve,
    rate_rows,
    sliding_note,
    viscous_rows,
    words_of,
)
from sindyjoint.export.parts import GIVE, POINTS, RARE, Parts, contribution, power_law, total

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
    curve = elastic_curve(parts, POINTS)
    rates = rate_curve(parts, damping)
    pair = "connector friction with its stick stiffness"
    added, rows_of_elements = written_as(model, cycles, lambda kind: WAYS.get(type(kind), ""), pair)
    rows = fidelity_table(
        model,
        cycles,
        {
            **rows_of_elements,
            **elastic_rows(parts, cycles, curve.x, f"connector elasticity, table of {POINTS} points"),
            **viscous_rows(parts, cycles, "connector damping, linear"),
            **rate_rows(parts, damping, cycles, rates.x, f"connector damping, table of {rates.x.size} points"),
            **friction.rows(cycles),
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
        *sliding_note(model, friction.stiffness, raised),
        *((between,) if last >= RARE else ()),
        *inertia_note(model),
    )
    rotation = model.joint.motion == "rotation"
    lines = filled_in(
        "abaqus.inp.j2",
        element=RARE,
        node=RARE,
        component=4 if rotation else 1,
        held="HINGE" if rotation else "TRANSLATOR",
        free="CARDAN" if rotation else "CARTESIAN",
        curve=curve if parts.elastic else None,
        damping=parts.damping if parts.viscous else None,
        rates=rates if damping else None,
        friction=(friction.stiffness, friction.limits) if friction.stiffness else None,
        sliders=[kind for _, kind in added if isinstance(kind, Slider)],
        chains=[kind for _, kind in added if not isinstance(kind, Slider)],
        stick=GIVE * model.fitted.angle,
    )
    text = comment(preamble(model, "Abaqus", rows, notes), "**") + lines
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
            return left_out(self.terms, "friction must not be negative anywhere in the tested range")
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

    @property
    def limits(self) -> list[tuple[float, float]]:
        """Positions and limits."""
        return list(zip(self.nodes.tolist(), self.limit.tolist(), strict=True))
