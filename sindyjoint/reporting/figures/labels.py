"""How coefficients are named and scaled on axes."""

from __future__ import annotations

import numpy as np

from sindyjoint.equation.model import JointModel
from sindyjoint.reporting.equation import split_symbol
from sindyjoint.reporting.style import plain, pretty_unit
from sindyjoint.text import quantities, superscript

SUBSCRIPTS = str.maketrans("0123456789", "₀₁₂₃₄₅₆₇₈₉")


def time_label(without_time: bool, motion: str) -> str:
    """Return what an axis of time is called; of samples without time it is the path that they travel."""
    return f"Travelled path ({quantities(motion).angle_unit})" if without_time else "Time (s)"


def rate_label(model: JointModel, unit: str) -> str:
    """Return what an axis of the rate is called; along a path it is the direction of motion."""
    q = quantities(model.joint.motion)
    symbol = q.angle_symbol
    return f"Direction d{symbol}/ds" if model.fitted.quasi_static else f"{q.rate} {q.rate_symbol} ({unit})"


def scale_of(value: float, unit: str) -> tuple[float, str]:
    """Return a power of ten for large coefficients; a prefix would hide the powers of the unit."""
    power = int(np.floor(np.log10(abs(value)))) if value else 0
    if -1 <= power < 5:
        return 1.0, pretty_unit(unit)
    power = 3 * (power // 3)
    return 10.0**-power, f"10{superscript(power)} {pretty_unit(unit)}"


def math_symbol(symbol: str) -> str:
    """Return a term's symbol with its index lowered; text that is not such a symbol stays as it is."""
    head, tail = split_symbol(symbol)
    if tail.isdigit() or not tail:
        return plain(head + tail.translate(SUBSCRIPTS))
    return f"${head}_{{{tail}}}$" if head.isalpha() and tail.isalnum() else plain(symbol)
