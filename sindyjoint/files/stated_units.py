"""Units that a file states in the names of its columns: ``force [kN]``, ``angle (mrad)``, ``angle_mrad``."""

from __future__ import annotations

import re

_BRACKETS = re.compile(r"[\[({]\s*([^\])}]+?)\s*[\])}]\s*$")
_ENDING = re.compile(r"^(?P<base>.*?)(?:\s*/\s*|_|\s+)(?P<unit>[^\W\d_][\w*·^]*|°|µ\w+)$")
# What an ending must be to count as a unit; single letters only after a word.
KNOWN = {
    "rad", "mrad", "urad", "µrad", "deg", "°", "Nm", "mNm", "Nmm", "kNm", "kN", "mN", "kip", "lbf", "mm", "um", "µm",
    "cm", "nm", "in", "inch", "ms", "us", "µs", "mV", "kHz", "Hz",
}  # fmt: skip
LETTERS = {"N", "V", "m", "s"}
OTHERS = {
    "g",
    "kg",
    "C",
    "degC",
    "K",
    "A",
    "mA",
    "Pa",
    "MPa",
    "bar",
    "min",
    "h",
    "sec",
    "Sec",
    "volt",
    "Volt",
    "V",
}
SPELLINGS = {"Nm": "N*m", "Nmm": "N*mm", "kNm": "kN*m", "mNm": "mN*m", "°": "deg", "·": "*"}


def unit_in_name(name: str) -> tuple[str, bool] | None:
    """Return the unit in the name of a column, and whether its ending alone states it; None where there is none.

    Examples
    --------
    >>> unit_in_name("Force [kN]"), unit_in_name("angle_mrad"), unit_in_name("angle_rad_from_upright")
    (('kN', False), ('mrad', True), None)
    """
    bracketed = _BRACKETS.search(name)
    if bracketed:
        return _spelled(bracketed[1]), False
    ending = _ENDING.match(name.strip())
    if ending is None:
        return None
    base, unit = ending["base"], ending["unit"]
    if unit in KNOWN or (unit in LETTERS and len(base) > 3 and base.isalpha()):
        return _spelled(unit), True
    return None


def is_unit(text: str) -> bool:
    """Return whether a field below a header is a unit: in brackets, or one that laboratories write.

    Examples
    --------
    >>> is_unit("[s]"), is_unit("kN"), is_unit("m/s^2"), is_unit("force"), is_unit("-")
    (True, True, True, False, True)
    """
    text = text.strip()
    bare = text.strip("[](){}").strip()
    if text != bare or bare in ("-", "1", "%"):
        return True
    parts = re.split(r"[*·/^ ]+\d*", bare)
    return all(part in KNOWN | LETTERS | OTHERS or part.isdigit() or not part for part in parts)


def _spelled(unit: str) -> str:
    return SPELLINGS.get(unit, unit.replace("·", "*"))
