"""Nastran: CBUSH with PBUSH and PBUSHT for a rotational joint, CBUSH1D with PBUSH1D for a translational one.

A CBUSH has no tabulated force of the rate. What depends on the rate beyond viscous damping is, for a rotational joint,
a CBUSH1D between two additional grid points, whose distance is tied to the relative rotation (MPC). Springs in series
with sliders are rods of an elastic-plastic material, tied in the same way; a Maxwell branch is a spring and a damper
with a scalar point between (CELAS2, CDAMP2).
"""

from __future__ import annotations

import re

import numpy as np

from sindyjoint.equation.model import JointModel
from sindyjoint.export import Export
from sindyjoint.export import fidelity as lumped
from sindyjoint.export.elements import Gap, Kind, Maxwell, Slider, written_as
from sindyjoint.export.fidelity import Cycles, comment, fidelity_table, preamble, words_of
from sindyjoint.export.parts import GIVE, Curve, Parts, total

POINTS = 41
# Numbers that a model rarely uses; the notes say to change them where they are taken.
ELEMENT, DAMPER, TABLE_ELASTIC, TABLE_RATE, STILL, RELATIVE, SET, FAR, FIRST = range(900001, 900010)
NODES = (1, 2)
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
    curve = _rounded(lumped.elastic_curve(parts, POINTS))
    rates = _rounded(lumped.rate_curve(parts, tabulated))
    words = words_of(model)
    spring = f"{'PBUSHT KN' if rotation else 'PBUSH1D SPRING'} table of {POINTS} points"
    damper = f"PBUSH1D DAMPER table of {rates.x.size} points"
    added, rows_of_elements = written_as(
        model, cycles, lambda kind: WAYS.get(type(kind), ""), "CROD, MATS1 without hardening"
    )
    carried = {
        **rows_of_elements,
        **lumped.elastic_rows(parts, cycles, curve.x, spring),
        **lumped.viscous_rows(parts, cycles, "PBUSH B" if rotation else "PBUSH1D B"),
        **lumped.rate_rows(parts, tabulated, cycles, rates.x, damper),
        **lumped.left_out(
            parts.coupled,
            f"the bushings of Nastran have no {words.moment} of {words.angle} and {words.rate} together",
        ),
        **lumped.inertial_rows(parts),
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
        f"replace grid points {NODES[0]} and {NODES[1]} and, where taken, the numbers from {ELEMENT} on; the joint's "
        f"axis is the basic {'z' if rotation else 'x'} axis (CID 0)",
        "tables act in nonlinear solutions only (SOL 129, 400); linear ones see the stiffness at "
        "standstill and the damping",
        *(
            (
                f"case control: MPC = {SET}; it makes the x displacement of grid point {RELATIVE} the relative "
                + ("rotation, 1 m for 1 rad" if rotation else "displacement"),
            )
            if tied
            else ()
        ),
        lumped.range_note(model, "they go on with the last slope"),
        *lumped.inertia_note(model),
    )
    text = comment(preamble(model, "Nastran", rows, notes), "$", width=72)
    cards = _deck(rotation, parts, curve, rates if tabulated else None, tied)
    cards += _hysteresis([kind for _, kind in added], 6 if rotation else 1, GIVE * model.fitted.angle)
    return Export("nastran", {"joint.bdf": text + "".join(f"{card}\n" for card in cards)}, rows, notes)


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


def _card(name: str, *fields: object) -> str:
    """Write a card in large format: sixteen characters per field, four fields per line."""
    texts = ["" if f is None else field(f) if isinstance(f, float) else str(f) for f in fields]
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


def _table(number: int, curve: Curve) -> str:
    return _card("TABLED1", number, *[None] * 7, *curve.flat, "ENDT")


def _hysteresis(kinds: list[Kind], component: int, stick: float) -> list[str]:
    """Return pairs of spring and slider, gaps in series with sliders, and Maxwell branches."""
    count = iter(range(FIRST, 10**8))
    cards = []
    if any(not isinstance(kind, Maxwell) for kind in kinds):
        cards.append(_card("GRID", FAR, None, -1.0, 0.0, 0.0, None, 123456))
    for kind in kinds:
        if isinstance(kind, Slider):
            cards += _rod(next(count), RELATIVE, kind.stiffness, kind.stiffness * kind.deflection)
    for kind in kinds:
        if isinstance(kind, Gap):
            point, spring = next(count), next(count)
            cards.append(_card("GRID", point, None, 0.0, 0.0, 0.0, None, 23456))
            cards += _rod(next(count), point, kind.moment / stick, kind.moment)
            cards += [
                _card("CBUSH1D", spring, spring, point, RELATIVE, 0),
                _card("PBUSH1D", spring, kind.moment / kind.ramp, *[None] * 6, "SPRING", "TABLE", spring),
                _table(spring, _rounded(kind.curve())),
            ]
    for kind in kinds:
        if isinstance(kind, Maxwell):
            point, spring, damper = next(count), next(count), next(count)
            cards += [
                _card("SPOINT", point),
                _card("CELAS2", spring, kind.stiffness, NODES[0], component, point),
                _card("CDAMP2", damper, kind.stiffness * kind.time, point, None, NODES[1], component),
            ]
    return cards


def _rod(number: int, point: int, stiffness: float, limit: float) -> list[str]:
    """Return a rod of length and area 1: its strain is the motion of its end, its stress the moment."""
    return [
        _card("CROD", number, number, FAR, point),
        _card("PROD", number, number, 1.0),
        _card("MAT1", number, stiffness, None, 0.3),
        _card("MATS1", number, None, "PLASTIC", 0.0, 1, 1, limit),
    ]


def _deck(rotation: bool, parts: Parts, curve: Curve, rates: Curve | None, tied: bool) -> list[str]:
    step, none = 1e-6 * parts.model.fitted.angle, [None] * 5
    low, high = total(parts.elastic, np.array([-step, step]), 0.0)
    stiffness = float(high - low) / (2 * step)
    damper = [] if rates is None else ["DAMPER", "TABLE", TABLE_RATE]
    if rotation:
        cards = [
            _card("CBUSH", ELEMENT, ELEMENT, *NODES, None, None, None, 0),
            _card("PBUSH", ELEMENT, "K", *none, stiffness, None, "B", *none, parts.damping),
            _card("PBUSHT", ELEMENT, "KN", *none, TABLE_ELASTIC),
        ]
        if rates is not None:
            cards += [
                _card("GRID", STILL, None, 0.0, 0.0, 0.0, None, 123456),
                _card("CBUSH1D", DAMPER, DAMPER, STILL, RELATIVE, 0),
                _card("PBUSH1D", DAMPER, 0.0, *none, None, *damper),
            ]
    else:
        linear, spring = parts.damping if rates is None else None, ["SPRING", "TABLE", TABLE_ELASTIC]
        cards = [
            _card("CBUSH1D", ELEMENT, ELEMENT, *NODES, 0),
            _card("PBUSH1D", ELEMENT, stiffness, linear, *none, *spring, *none, *damper),
        ]
    if tied:
        dof = 6 if rotation else 1
        # Far side minus base's side: a force on it is a pair of moments on the two sides.
        cards += [
            _card("GRID", RELATIVE, None, 0.0, 0.0, 0.0, None, 23456),
            _card("MPC", SET, RELATIVE, 1, 1.0, NODES[1], dof, -1.0, None, None, NODES[0], dof, 1.0),
        ]
    tables = [(TABLE_ELASTIC, curve), *([] if rates is None else [(TABLE_RATE, rates)])]
    return cards + [_table(number, own) for number, own in tables]
