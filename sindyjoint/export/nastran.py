"""Nastran: CBUSH with PBUSH and PBUSHT for a rotational joint, CBUSH1D with PBUSH1D for a translational one.

A CBUSH has no tabulated force of the rate. What depends on the rate beyond viscous damping is, for a rotational joint,
a CBUSH1D between two additional grid points, whose distance is tied to the relative rotation (MPC). Springs in series
with sliders are rods of an elastic-plastic material, tied in the same way; a Maxwell branch is a spring and a damper
with a scalar point between (CELAS2, CDAMP2).
"""

import re

import numpy as np

from sindyjoint.equation.model import JointModel
from sindyjoint.export import Export
from sindyjoint.export.elements import Gap, Maxwell, Slider, written_as
from sindyjoint.export.fidelity import (
    Cycles,
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
    viscous_rows,
    words_of,
)
from sindyjoint.export.parts import GIVE, POINTS, RARE, Curve, Parts, total

# The notes say to change these numbers where they are taken.
NUMBERS = "element damper table_elastic table_rate still relative set far first".split()
AT = dict(zip(NUMBERS, range(RARE, RARE + len(NUMBERS)), strict=True))
WAYS = {
    Maxwell: "CELAS2 and CDAMP2, a scalar point between",
    Gap: "CROD without hardening and CBUSH1D, a grid point between",
}


def export(model: JointModel) -> Export:
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
        model, cycles, lambda kind: WAYS.get(type(kind), ""), "CROD, MATS1 without hardening"
    )
    carried = {
        **rows_of_elements,
        **elastic_rows(parts, cycles, curve.x, spring),
        **viscous_rows(parts, cycles, "PBUSH B" if rotation else "PBUSH1D B"),
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
    text += "".join(f"{_card(*line.split(','))}\n" for line in deck.splitlines())
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


def _card(name: str, *fields: str) -> str:
    """Write a card in large format: sixteen characters per field, four fields per line."""
    texts = list(fields)
    while texts and not texts[-1]:
        texts.pop()
    rows = [texts[i : i + 4] for i in range(0, len(texts), 4)]
    if len(rows) % 2:
        rows.append([])  # large format comes in pairs of lines
    starts = [f"{name}*", *["*"] * (len(rows) - 1)]
    lines = [
        start.ljust(8) + "".join(text.ljust(16) for text in row)
        for start, row in zip(starts, rows, strict=True)
    ]
    return "\n".join(line.rstrip() for line in lines)
