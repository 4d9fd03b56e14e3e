"""What the quantities of a joint are called, and their units, by kind of motion."""

from __future__ import annotations

import re
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


def in_words_of(motion: str, text: str) -> str:
    """Return a text about a joint that rotates in the words of a kind of motion.

    Examples
    --------
    >>> in_words_of("translation", "Moment over angle and rate")
    'Force over displacement and velocity'
    """
    rotation, other = quantities("rotation"), quantities(motion)
    named = {getattr(rotation, name): getattr(other, name) for name in ("angle", "rate", "moment")}
    named |= {was.lower(): now.lower() for was, now in named.items()}
    return re.sub(r"\b(" + "|".join(named) + r")\b", lambda found: named[found[0]], text)
