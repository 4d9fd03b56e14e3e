"""Nastran: CBUSH with PBUSH and PBUSHT for a rotational joint, CBUSH1D with PBUSH1D for a translational one.

A CBUSH has no tabulated force of the rate. What depends on the rate beyond viscous damping is, for a rotational joint,
a CBUSH1D between two additional grid points, whose distance is tied to the relative rotation (MPC). Springs in series
with sliders are rods of an elastic-plastic material, tied in the same way; a Maxwell branch is a spring and a damper
with a scalar point between (CELAS2, CDAMP2).
"""

from __future__ import annotations

import numpy as np

from sindyjoint.equation.model import JointModel
from sindyjoint.export import lumped
from sindyjoint.export.base import Cycles, Export, Represented, fidelity_table
from sindyjoint.export.elements import Gap, Maxwell, Slider, kind_of
from sindyjoint.export.parts import GIVE, Curve, Parts, total
from sindyjoint.export.sliders import pairs_of, represented
from sindyjoint.export.text import comment, preamble, words_of
from sindyjoint.numeric import Array

POINTS = 41
# Numbers that a model rarely uses; the notes say to change them where they are taken.
ELEMENT, DAMPER, TABLE_ELASTIC, TABLE_RATE, STILL, RELATIVE, SET, FAR, FIRST = range(900001, 900010)
NODES = (1, 2)


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
    added = _Hysteresis(model, cycles)
    carried: dict[str, Represented] = {
        **added.rows,
        **lumped.elastic_rows(parts, cycles, curve.x, spring),
        **lumped.viscous_rows(parts, cycles, "PBUSH B" if rotation else "PBUSH1D B"),
        **lumped.rate_rows(parts, tabulated, cycles, rates.x, damper),
        **lumped.left_out(
            parts.coupled,
            f"the bushings of Nastran have no {words.moment} of {words.angle} and {words.rate} together",
        ),
        **lumped.inertial_rows(parts),
    }
    total = _total(parts, cycles, curve, rates if tabulated else None)
    total = total + sum(r.moment for r in added.rows.values() if r.moment is not None)
    tied = rotation and bool(tabulated) or added.tied
    rows = fidelity_table(model, cycles, carried, total)
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
    text += _deck(rotation, parts, curve, rates if tabulated else None, tied)
    text += "".join(f"{card}\n" for card in added.cards(rotation))
    return Export("nastran", {"joint.bdf": text}, rows, notes)


def _total(parts: Parts, cycles: Cycles, curve: Curve, rates: Curve | None) -> Array:
    """Moment of the deck as written, its numbers rounded to 16 characters."""
    total = curve(cycles.angle)
    if rates is None or parts.model.joint.motion == "rotation":
        total = total + float(field(parts.damping)) * cycles.rate
    return total if rates is None else total + rates(cycles.rate)


def field(value: float) -> str:
    """Return a number in at most 16 characters, as Nastran reads it.

    Examples
    --------
    >>> field(-2684000000.123456789), field(6066.0), field(1.23456789012345e-10)
    ('-2684000000.1235', '6066.', '1.23456789012-10')
    """
    for digits in range(17, 0, -1):
        text = f"{float(value):.{digits}g}"
        mantissa, _, exponent = text.partition("e")
        if "." not in mantissa:
            mantissa += "."
        if exponent:
            text = f"{mantissa}{int(exponent):+d}"
        else:
            text = mantissa
        if len(text) <= 16:
            return text
    raise AssertionError("unreachable: one digit fits")


def _read(text: str) -> float:
    mantissa, sign, exponent = text[0] + text[1:].replace("-", "|-").replace("+", "|+"), "|", ""
    if sign in mantissa:
        mantissa, exponent = mantissa.split(sign, 1)
    return float(f"{mantissa}e{exponent}" if exponent else mantissa)


def _rounded(curve: Curve) -> Curve:
    return Curve(*(np.array([_read(field(v)) for v in values]) for values in (curve.x, curve.y)))


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
    pairs = [value for point in zip(curve.x.tolist(), curve.y.tolist(), strict=True) for value in point]
    return _card("TABLED1", number, *[None] * 7, *pairs, "ENDT")


class _Hysteresis:
    """Elements with internal states: pairs of spring and slider, gaps in series with sliders, and Maxwell branches."""

    def __init__(self, model: JointModel, cycles: Cycles):
        self.stick = GIVE * model.fitted.angle
        self.rows: dict[str, Represented] = {}
        self.pairs: list[Slider] = []
        self.gaps: list[Gap] = []
        self.branches: list[Maxwell] = []
        for element in model.elements:
            kind = kind_of(element, cycles)
            if isinstance(kind, Maxwell) and kind.stiffness > 0:
                self.branches.append(kind)
                how = "CELAS2 and CDAMP2, a scalar point between"
            elif isinstance(kind, Gap) and kind.moment > 0:
                self.gaps.append(kind)
                how = "CROD without hardening and CBUSH1D, a grid point between"
            else:
                pairs = pairs_of(element, kind, cycles)
                self.pairs += pairs.sliders if pairs else ()
                self.rows[element.id] = represented(pairs, "CROD, MATS1 without hardening")
                continue
            self.rows[element.id] = Represented(how, cycles.element(element))

    @property
    def tied(self) -> bool:
        """Whether they act on the relative motion, which grid point RELATIVE has."""
        return bool(self.pairs or self.gaps)

    def cards(self, rotation: bool) -> list[str]:
        component = 6 if rotation else 1
        count = iter(range(FIRST, 10**8))
        cards = [_card("GRID", FAR, None, -1.0, 0.0, 0.0, None, 123456)] if self.tied else []
        for slider in self.pairs:
            cards += _rod(next(count), RELATIVE, slider.stiffness, slider.stiffness * slider.deflection)
        for gap in self.gaps:
            point, spring = next(count), next(count)
            cards.append(_card("GRID", point, None, 0.0, 0.0, 0.0, None, 23456))
            cards += _rod(next(count), point, gap.moment / self.stick, gap.moment)
            cards += [
                _card("CBUSH1D", spring, spring, point, RELATIVE, 0),
                _card("PBUSH1D", spring, gap.moment / gap.ramp, *[None] * 6, "SPRING", "TABLE", spring),
                _table(spring, _rounded(Curve(*gap.curve()))),
            ]
        for branch in self.branches:
            point, spring, damper = next(count), next(count), next(count)
            cards += [
                _card("SPOINT", point),
                _card("CELAS2", spring, branch.stiffness, NODES[0], component, point),
                _card("CDAMP2", damper, branch.stiffness * branch.time, point, None, NODES[1], component),
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


def _deck(rotation: bool, parts: Parts, curve: Curve, rates: Curve | None, tied: bool) -> str:
    step = 1e-6 * parts.model.fitted.angle
    low, high = total(parts.elastic, np.array([-step, step]), 0.0)
    stiffness = float(high - low) / (2 * step)
    cards = []
    if rotation:
        cards.append(_card("CBUSH", ELEMENT, ELEMENT, *NODES, None, None, None, 0))
        cards.append(
            _card("PBUSH", ELEMENT, "K", *[None] * 5, stiffness, None, "B", *[None] * 5, parts.damping)
        )
        cards.append(_card("PBUSHT", ELEMENT, "KN", *[None] * 5, TABLE_ELASTIC))
        if rates is not None:
            cards.append(_card("GRID", STILL, None, 0.0, 0.0, 0.0, None, 123456))
            cards.append(_card("CBUSH1D", DAMPER, DAMPER, STILL, RELATIVE, 0))
            cards.append(_card("PBUSH1D", DAMPER, 0.0, *[None] * 6, "DAMPER", "TABLE", TABLE_RATE))
    else:
        cards.append(_card("CBUSH1D", ELEMENT, ELEMENT, *NODES, 0))
        linear = parts.damping if rates is None else None
        tail = ["DAMPER", "TABLE", TABLE_RATE] if rates is not None else []
        cards.append(
            _card(
                "PBUSH1D", ELEMENT, stiffness, linear, *[None] * 5, "SPRING", "TABLE", TABLE_ELASTIC,
                *[None] * 5, *tail,
            )
        )  # fmt: skip
    if tied:
        dof = 6 if rotation else 1
        cards.append(_card("GRID", RELATIVE, None, 0.0, 0.0, 0.0, None, 23456))
        # Far side minus base's side: a force on it is a pair of moments on the two sides.
        cards.append(_card("MPC", SET, RELATIVE, 1, 1.0, NODES[1], dof, -1.0, None, None, NODES[0], dof, 1.0))
    cards.append(_table(TABLE_ELASTIC, curve))
    if rates is not None:
        cards.append(_table(TABLE_RATE, rates))
    return "\n".join(cards) + "\n"
