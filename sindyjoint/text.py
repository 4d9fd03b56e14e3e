"""Identifiers as people write them, and numbers as a physicist does."""

from __future__ import annotations

import math
import re
from collections.abc import Sequence

# People keep their capital letters; an id that another name is usual for has that name.
_NAMES = {
    "coulomb": "Coulomb",
    "stribeck": "Stribeck",
    "dahl": "Dahl",
    "lugre": "LuGre",
    "bouc wen": "Bouc–Wen",
    "jenkins": "Jenkins",
    "iwan": "Iwan",
    "maxwell": "Maxwell",
    "rayleigh": "Rayleigh",
    "linear damping": "viscous damping",
}
_PATTERN = re.compile(r"\b(" + "|".join(_NAMES) + r")\b")


def spelled(identifier: str) -> str:
    """Return an id in the usual words, names of people with capital letters.

    Examples
    --------
    >>> spelled("bouc_wen_hysteresis"), spelled("lugre_friction"), spelled("linear_damping")
    ('Bouc–Wen hysteresis', 'LuGre friction', 'viscous damping')
    """
    return _PATTERN.sub(lambda found: _NAMES[found[0]], identifier.replace("_", " "))


def list_some(names: Sequence[str], what: str = "runs") -> str:
    """Return a few names, and how many more there are.

    Examples
    --------
    >>> list_some(["a", "b", "c", "d", "e"])
    'a, b, c and 2 more runs'
    """
    shown = ", ".join(names[:3])
    return shown if len(names) <= 3 else f"{shown} and {len(names) - 3} more {what}"


def rounded(value: float, error: float) -> str:
    """Return ``value ± error``, the error to one digit (two if it begins with 1), the value to the same digit.

    Examples
    --------
    >>> rounded(5912.3, 41.7)
    '5910 ± 40'
    >>> rounded(-2.684e9, 1.2e7)
    '(-2.684 ± 0.012)e9'
    >>> rounded(48.1312, 0.0874)
    '48.13 ± 0.09'
    """
    if not (math.isfinite(value) and math.isfinite(error)):
        return f"{value:.6g} ± {error:.2g}"
    if error <= 0:
        return f"{value:.6g} ± 0"
    exponent = math.floor(math.log10(error))
    leading = error / 10.0**exponent
    digits = exponent - 1 if round(leading, 1) < 2 else exponent
    largest = max(abs(value), error)
    power = math.floor(math.log10(largest)) if largest > 0 else 0
    if -3 <= power < 6 and digits < 4:
        decimals = max(0, -digits)
        return f"{_to(value, digits):.{decimals}f} ± {_to(error, digits):.{decimals}f}"
    decimals = max(0, power - digits)
    scale = 10.0**power
    return f"({value / scale:.{decimals}f} ± {error / scale:.{decimals}f})e{power}"


LEAST_SHARE = 1e-4


def percent(value: float | None) -> str:
    """Return a share in per cent to three digits; less than a hundredth of a per cent is only stated as less than that.

    Examples
    --------
    >>> percent(0.0216), percent(2.09e-7), percent(0.0), percent(12.34), percent(None)
    ('2.16 %', '< 0.01 %', '0 %', '1234 %', '–')
    """
    if value is None or not math.isfinite(value):
        return "–"
    if 0 < abs(value) < LEAST_SHARE:
        return f"< {100 * LEAST_SHARE:g} %"
    return f"{100 * value:.0f} %" if abs(value) >= 9.995 else f"{100 * value:.3g} %"


def _to(value: float, digits: int) -> float:
    """Round to a power of ten."""
    return round(value, -digits)
