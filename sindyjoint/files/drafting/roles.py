"""What a column measures, by its unit and by the words in its name."""

from __future__ import annotations

import re

from sindyjoint.files.units import unit_in_name, unit_ratio

# What a unit can only be the unit of, by SI unit.
BY_UNIT = {
    "s": "time",
    "rad": "angle",
    "m": "displacement",
    "N*m": "moment",
    "N": "force",
    "rad/s": "angular rate",
    "m/s": "velocity",
    "rad/s**2": "acceleration",
    "m/s**2": "acceleration",
}
SI_UNITS = {role: unit for unit, role in BY_UNIT.items()}
# Words in names of columns and files, in the order in which they decide: "angle rate" is a rate.
WORDS = {
    "velocity": {"velocity", "vel", "speed", "v", "xdot", "geschwindigkeit", "vitesse"},
    "angular rate": {"rate", "omega", "gyro", "thetadot", "phidot", "drehzahl", "winkelgeschwindigkeit"},
    "acceleration": {"acceleration", "acc", "accel", "beschleunigung"},
    "temperature": {"temperature", "temp", "temperatur"},
    "time": {"time", "t", "zeit", "temps", "stamp", "timestamp", "clock", "sec", "seconds", "when", "uhrzeit"},
    "moment": {"moment", "torque", "trq", "tau", "drehmoment", "couple", "m", "mz", "my", "mx"},
    "force": {"force", "kraft", "load", "loadcell", "f", "fx", "fy", "fz", "effort"},
    "angle": {"angle", "theta", "phi", "rotation", "rot", "winkel", "alpha", "ang", "θ", "φ", "ϕ", "encoder"},
    "displacement": {
        "displacement", "disp", "displ", "travel", "stroke", "weg", "lvdt", "deflection", "extension", "x", "laser",
        "elongation", "hub", "crosshead",
    },
    "position": {"position", "pos", "q", "qm"},
    "counter": {"pulse", "pulses", "count", "counts", "counter", "ticks", "index", "idx", "number", "scan", "cycle"},
}  # fmt: skip
_WORD = re.compile(r"[A-Z]+(?![a-z])|[A-Z]?[a-z]+|[^\W\d_A-Za-z]+")
_PER = re.compile(r"_([a-z]+)_per_([a-z]+)$", re.IGNORECASE)


def role_of(title: str, unit: str) -> str | None:
    """Return what a column measures, or None where neither unit nor name shows it.

    Examples
    --------
    >>> role_of("ch1", "mm"), role_of("Drehmoment", ""), role_of("theta_dot", ""), role_of("ch2", "")
    ('displacement', 'moment', 'angular rate', None)
    >>> role_of("force_N", "N"), role_of("pulses_N", "N"), role_of("pulses [N]", "N")
    ('force', 'counter', 'force')
    """
    words = role_of_words(title)
    # The ending of a name is a unit only where the name can be that of a quantity: pulses_N is a number of pulses.
    if words == "counter" and unit_in_name(title) == (unit, True):
        return words
    return role_of_unit(unit) or words


def role_of_unit(unit: str) -> str | None:
    """Return what a unit is the unit of, where that is one thing only."""
    if not unit:
        return None
    return next((role for si, role in BY_UNIT.items() if unit_ratio(unit, si)), None)


def role_of_words(text: str) -> str | None:
    """Return what the words of a name speak of.

    Examples
    --------
    >>> role_of_words("3Hz-Kraft"), role_of_words("jointAngle"), role_of_words("velocity_in_per_s")
    ('force', 'angle', 'velocity')
    """
    words = [word.lower() for word in _WORD.findall(re.sub(r"[\[({].*$", "", text))]
    if "dot" in words:
        words.append("xdot" if {"x", "disp", "displacement"} & set(words) else "thetadot")
    return next((role for role, known in WORDS.items() if known & set(words)), None)


def unit_in_words(title: str) -> str:
    """Return a unit written in words at the end of a name, such as ``velocity_in_per_s``; empty where there is none."""
    found = _PER.search(title)
    return f"{found[1]}/{found[2]}" if found else ""
