"""What the quantities of a joint are called, and their units, by kind of motion."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class Quantities:
    """Names, symbols and SI units for one kind of motion; symbols are mathtext for axes."""

    angle: str
    angle_symbol: str
    angle_unit: str
    rate: str
    rate_symbol: str
    rate_unit: str
    moment: str
    transfer: str
    transfer_symbol: str
    moment_unit: str


_ROTATION = Quantities(
    "Angle",
    r"$\theta$",
    "rad",
    "Rate",
    r"$\dot{\theta}$",
    "rad/s",
    "Moment",
    "Transfer moment",
    "$M_T$",
    "N*m",
)
_TRANSLATION = Quantities(
    "Displacement",
    "$x$",
    "m",
    "Velocity",
    r"$\dot{x}$",
    "m/s",
    "Force",
    "Transfer force",
    "$F_T$",
    "N",
)


def quantities(motion: str) -> Quantities:
    """Return the names for ``"rotation"`` or ``"translation"``."""
    return _TRANSLATION if motion == "translation" else _ROTATION
