"""What the quantities of a joint are called, and their units, by kind of motion."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class Quantities:
    """Names, symbols and SI units for one kind of motion.

    The dot over a letter is a combining character: setting it as mathematics costs a hundred times as much.
    """

    angle: str
    angle_symbol: str
    angle_unit: str
    rate: str
    rate_symbol: str
    rate_unit: str
    moment: str
    transfer: str
    moment_unit: str


_ROTATION = Quantities(
    "Angle",
    "θ",
    "rad",
    "Rate",
    "θ\u0307",
    "rad/s",
    "Moment",
    "Transfer moment",
    "N*m",
)
_TRANSLATION = Quantities(
    "Displacement",
    "x",
    "m",
    "Velocity",
    "x\u0307",
    "m/s",
    "Force",
    "Transfer force",
    "N",
)


def quantities(motion: str) -> Quantities:
    """Return the names for ``"rotation"`` or ``"translation"``."""
    return _TRANSLATION if motion == "translation" else _ROTATION
