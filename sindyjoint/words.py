"""Identifiers as people write them."""

from __future__ import annotations

import re

# People keep their capital letters.
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
}
_PATTERN = re.compile(r"\b(" + "|".join(_NAMES) + r")\b")


def spelled(identifier: str) -> str:
    """Return an id as words, names of people with capital letters.

    Examples
    --------
    >>> spelled("bouc_wen_hysteresis"), spelled("lugre_friction"), spelled("linear_stiffness")
    ('Bouc–Wen hysteresis', 'LuGre friction', 'linear stiffness')
    """
    return _PATTERN.sub(lambda found: _NAMES[found[0]], identifier.replace("_", " "))
