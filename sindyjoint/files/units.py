"""Units at the door: everything past ``files/`` is SI; which a file states, and what one is in another.

pint knows the units; it counts the radian as no dimension at all, so the comparison here is made on its
*root* units, where ``rad`` is kept: ``N*m`` and ``N*m/rad`` then differ.
"""

from __future__ import annotations

import math
import re
from functools import lru_cache
from typing import TYPE_CHECKING, Any

from sindyjoint.errors import UnitError

if TYPE_CHECKING:
    import pint

# What a message calls the expected quantity, by its SI unit.
QUANTITIES = {
    "s": "a time, such as 's' or 'ms'",
    "Hz": "a frequency, such as 'Hz' or 'kHz'",
    "N*m": "a moment, such as 'N*m' or 'lbf*inch'",
    "N": "a force, such as 'N' or 'kip'",
    "rad": "an angle, such as 'rad', 'mrad' or 'deg'",
    "m": "a length, such as 'm', 'mm' or 'inch'",
    "rad/s": "an angular rate, such as 'rad/s' or 'deg/s'",
    "m/s": "a velocity, such as 'm/s' or 'mm/s'",
    "rad/s**2": "an angular acceleration, such as 'rad/s^2'; of one in 'g' give gain = '5 rad/m', one over the radius",
    "kg*m**2": "a moment of inertia, such as 'kg*m^2'",
    "kg": "a mass, such as 'kg'",
    "N*m**2": "a bending stiffness, such as 'N*m^2'",
    "m/m": "a strain, such as 'm/m' or 'um/m'",
    "K": "a temperature, such as 'K' or 'degC'",
    "N*m/rad": "a rotational stiffness, such as 'N*m/rad'",
    "Pa": "a modulus, such as 'GPa'",
    "kg/m**3": "a density, such as 'kg/m^3'",
    "kg/m": "a mass per length, such as 'kg/m'",
    "m/s**2": "an acceleration, such as 'm/s^2' or 'g'",
}

# A quantity as a manifest writes it, by SI unit, where "5" of the unit would be no usual one.
NUMBERS = {
    "kg*m**2": "0.02",
    "Hz": "3",
    "K": "293",
    "s": "0.3",
    "rad": "0.2",
    "m": "0.06",
    "m/m": "1e-6",
    "Pa": "70e9",
}

# What laboratories write most, by SI unit: pint takes a quarter of a second to read its definitions.
USUAL = {
    "s": {"ms": 1e-3, "us": 1e-6},
    "Hz": {"kHz": 1e3},
    "N*m": {"Nm": 1.0, "mN*m": 1e-3, "N*mm": 1e-3, "kN*m": 1e3},
    "N": {"mN": 1e-3, "kN": 1e3},
    "rad": {"mrad": 1e-3, "urad": 1e-6, "deg": math.pi / 180},
    "m": {"mm": 1e-3, "um": 1e-6, "cm": 1e-2},
    "rad/s": {"mrad/s": 1e-3, "deg/s": math.pi / 180},
    "m/s": {"mm/s": 1e-3},
    "rad/s**2": {"rad/s^2": 1.0},
    "m/s**2": {"m/s^2": 1.0, "g": 9.80665},
    "kg*m**2": {"kg*m^2": 1.0},
    "N*m**2": {"N*m^2": 1.0},
}

# What an encoder gives.
COUNTS = ("count", "counts")

# What an input may be measured in, beside plain numbers.
INPUT_UNITS = ("K", "V", "A", "N", "N*m", "Pa", "m", "rad", "s", "Hz", "m/s", "rad/s", "kg", "m/m")

_EXPONENT = r"(?:\*\*|\^)\s*\(?\s*[+-]?\d{1,2}(?:\.\d{1,3})?\s*\)?"
# Of an acceleration, "g" is no gram.
_GRAVITY = re.compile(r"(?<![\w.])g(?!\w)")
ACCELERATIONS = ("rad/s**2", "m/s**2")
_NUMBER = re.compile(r"\s*([+-]?(?:\d+\.?\d*|\.\d+)(?:[eE][+-]?\d+)?)\s*\*?\s*(.*?)\s*", re.DOTALL)

# Units in the names of columns: ``force [kN]``, ``angle (mrad)``, ``angle_mrad``.
_BRACKETS = re.compile(r"[\[({]\s*([^\])}:]+?)\s*[\])}]\s*$")
_ENDING = re.compile(r"^(?P<base>.*?)(?:\s*/\s*|_|\s+)(?P<unit>[^\W\d_](?:[^\W_]|[*·^])*|°|µ\w+)$")
_QUOTIENT = re.compile(r"(?:^|[_\s])(?P<over>[^\W\d_]+)/(?P<under>[^\W\d_]+)(?P<square>\^?2|²)?$")
# What an ending must be to count as a unit; single letters only after a word.
KNOWN = {
    "rad", "mrad", "urad", "µrad", "deg", "°", "degrees", "Grad", "grad", "Nm", "mNm", "Nmm", "Ncm", "kNm", "kN", "mN",
    "kip", "lbf", "lbin", "inlb", "ozin", "mm", "um", "µm", "cm", "nm", "in", "inch", "ms", "us", "µs", "mV", "kHz",
    "Hz", "rpm",
}  # fmt: skip
LETTERS = {"N", "V", "m", "s"}
OTHERS = {
    "g", "kg", "C", "degC", "K", "A", "mA", "Pa", "MPa", "bar", "min", "h", "sec", "Sec", "volt", "Volt", "V",
}  # fmt: skip
SPELLINGS = {"Nm": "N*m", "Nmm": "N*mm", "Ncm": "N*cm", "kNm": "kN*m", "mNm": "mN*m", "°": "deg"}
# What pint takes for another thing: a German degree for a gigaradian or a gon, a thousandth of an inch for an angle.
_MEANT = {"Grad": "deg", "grad": "deg", "mil": "thou", "mils": "thou"}
# Beside a length, a pound is a force: lb-in, inlb, oz*in, ft-lbf.
_PULL, _ARM = r"(?P<pull>lb|oz)[fs]?", "(?P<arm>inch|in|ft)"
_TORQUES = [re.compile(pair) for pair in (rf"{_PULL}\s*[-*.·]?\s*{_ARM}", rf"{_ARM}\s*[-*.·]?\s*{_PULL}")]


@lru_cache(maxsize=1)
def registry() -> pint.UnitRegistry[Any]:
    """Return the one registry of this package, with the spellings that test laboratories use."""
    import pint

    units: pint.UnitRegistry[Any] = pint.UnitRegistry()
    # pint reads "Nm" as a textile unit (number metric).
    units.define("newton_meter = newton * meter = Nm")
    units.define("newton_millimeter = newton * millimeter = Nmm")
    units.define("strain = 1 = ε")
    return units


@lru_cache(maxsize=256)
def _try_parse(unit: str) -> pint.Unit | None:
    """Return pint's unit for a spelling, or None where pint knows none."""
    torque = next(filter(None, (pair.fullmatch(unit) for pair in _TORQUES)), None)
    unit = f"{torque['pull']}f*{torque['arm']}" if torque else _MEANT.get(unit, unit)
    # A hyphen or a point between two units multiplies them, as in N-m.
    unit = re.sub(r"(?<=[^\W\d_])[-.·⋅](?=[^\W\d_])", "*", unit)
    # Written out, as Newton Meter and Degrees, units begin with a small letter.
    unit = re.sub(r"\b[A-Z](?=[a-z]{3})", lambda letter: letter[0].lower(), unit)
    # pint evaluates numbers while it parses, so a tower of powers would run for ever: only small ones pass.
    bare = re.sub(_EXPONENT, " ", unit)
    chained = re.search(rf"{_EXPONENT}\s*(?:\*\*|\^)", unit)
    numbers = re.search(r"\d", bare.replace("1/", "", 1))
    if len(unit) > 80 or chained or numbers or not re.search(r"[^\W\d]|[%°]", bare):
        return None
    try:
        return registry().parse_units(unit)
    # pint fails on unknown spellings with whatever its parser meets: AssertionError, TypeError ...
    except Exception:
        return None


def _root(unit: pint.Unit, where: str, gain: pint.Unit | None = None) -> tuple[float, dict[str, object]]:
    """Return factor and powers of a unit, times that of a gain, in pint's root units, the radian among them."""
    from pint.util import to_units_container

    try:
        unit = unit if gain is None else unit * gain
        if registry().Quantity(0.0, unit).to_root_units().magnitude != 0:
            raise UnitError("nothing of it is something: a logarithm, or a scale with another zero")
        factor, root = registry().get_root_units(unit)
        return float(factor), dict(to_units_container(root))  # type: ignore[arg-type]
    # pint refuses logarithms, scales with another zero in products, huge powers: each in another way.
    except Exception:
        raise UnitError(
            f"{where}: unit {str(unit)!r:.60} has no factor to SI; write it as 'N*m', 'mrad' ..."
        ) from None


def _kelvin(value: float, unit: pint.Unit) -> float | None:
    """Return a temperature in kelvin, of a scale such as °C with its own zero; None of another kind of unit."""
    try:
        kelvin = float(registry().Quantity(value, unit).to("kelvin").magnitude)
    # pint refuses units of another kind, or in products with a decibel, each in another way.
    except Exception:
        return None
    return kelvin if math.isfinite(kelvin) else None


def conversion(unit: str, expected: str, where: str, gain: str | None = None) -> float:
    """Return the factor that turns values in ``unit`` into the expected SI unit.

    Parameters
    ----------
    unit : str
        Unit of the values as declared.
    expected : str
        Expected SI unit, one of ``QUANTITIES``.
    where : str
        File and field, for the message.
    gain : str, optional
        Number and unit by which the values are to be multiplied first, such as ``"35.15 N/V"``.

    Raises
    ------
    UnitError
        For an unknown unit or one of another dimension.
    """
    usual = {expected: 1.0, **USUAL.get(expected, {})}
    if gain is None and unit in usual:
        return usual[unit]
    if expected in ACCELERATIONS:
        unit, gain = _GRAVITY.sub("standard_gravity", unit), gain and _GRAVITY.sub("standard_gravity", gain)
    number, declared, of_gain = 1.0, _parse_unit(unit, where), None
    if gain is not None:
        number, gain_unit = split_quantity(gain, f"{where} gain", expected)
        of_gain = _parse_unit(gain_unit, f"{where} gain")
    factor, powers = _root(declared, where, of_gain)
    expected_factor, expected_powers = _root(registry().parse_units(expected), where)
    # A slope such as mm/m is an angle as it stands; a count is none.
    slope = expected == "rad" and not powers and unit not in COUNTS
    if powers != expected_powers and not slope:
        given = f"unit {unit!r}" if gain is None else f"unit {unit!r} times gain {gain!r}"
        # A voltage is what a sensor gives: it lacks no other unit but a gain.
        volts = gain is None and needs_gain(unit)
        hint = f", or gain = '5 {expected.replace('**', '^')}/{unit}'" if volts else ""
        raise UnitError(
            f"{where}: {given} is not {QUANTITIES[expected].split(',')[0]}; expected {QUANTITIES[expected]}{hint}"
        )
    result = number * (factor / expected_factor)
    if not (math.isfinite(result) and result != 0):
        raise UnitError(
            f"{where}: unit {unit!r} with gain {gain!r} gives the factor {result}; it wipes out the data"
        )
    return result


def input_unit(unit: str, where: str) -> tuple[str, float, float]:
    """Return the SI unit of an input, and factor and zero: SI value = zero + factor · value.

    Raises
    ------
    UnitError
        For a unit that is unknown or of a kind that formulas do not know.

    Examples
    --------
    >>> input_unit("degC", "temperature")
    ('K', 1.0, 273.15)
    >>> input_unit("mV", "signal")
    ('V', 0.001, 0.0)
    """
    if unit.strip() in ("", "1", *INPUT_UNITS):
        return unit.strip() or "1", 1.0, 0.0
    zero, one = (_kelvin(value, _parse_unit(unit, where)) for value in (0.0, 1.0))
    if zero is not None and one is not None:
        return "K", round(one - zero, 12), zero
    for si in INPUT_UNITS:
        ratio = unit_ratio(unit, si)
        if ratio:
            return si, ratio, 0.0
    raise UnitError(
        f"{where}: unit {unit!r} is of no kind that a law takes; expected one of {', '.join(INPUT_UNITS)}"
    )


def parse_quantity(text: str | float, expected: str, where: str) -> float:
    """Return a declared quantity such as ``"0.02 kg*m^2"`` in the expected SI unit, in which a plain number stands.

    Raises
    ------
    UnitError
        For text that is not a number with a unit, an unknown unit, or one of another dimension.
    """
    if not isinstance(text, str):
        return float(text)
    number, unit = split_quantity(text, where, expected)
    kelvin = _kelvin(number, _parse_unit(unit, where)) if expected == "K" else None
    if kelvin is not None:
        return kelvin
    value = number * conversion(unit, expected, where)
    if not math.isfinite(value):
        raise UnitError(f"{where}: {text!r:.60} is beyond what a computer counts with; check number and unit")
    return value


def parse_optional(text: str | float | None, expected: str, where: str) -> float | None:
    """Return :func:`parse_quantity` of what may have been left out: None, then."""
    return None if text is None else parse_quantity(text, expected, where)


def unit_ratio(stated: str, declared: str) -> float | None:
    """Return what one stated unit is in declared ones; zero for another dimension, None where one is unknown.

    Examples
    --------
    >>> unit_ratio("mrad", "rad"), unit_ratio("kN", "N"), unit_ratio("V", "N"), unit_ratio("raw", "N")
    (0.001, 1000.0, 0.0, None)
    """
    usual = {unit: (si, factor) for si, known in USUAL.items() for unit, factor in {si: 1.0, **known}.items()}
    if stated in usual and declared in usual:
        (one, factor), (other, per) = usual[stated], usual[declared]
        return factor / per if one == other else 0.0
    try:
        (factor, powers), (per, others) = (_root(_parse_unit(u, u), u) for u in (stated, declared))
    except UnitError:
        return None
    return factor / per if powers == others else 0.0


def needs_gain(unit: str) -> bool:
    """Return whether a unit is what an instrument gives, of which only a gain makes a quantity: volts or counts."""
    return unit in COUNTS or bool(unit_ratio(unit, "V"))


def split_quantity(text: str, where: str, expected: str) -> tuple[float, str]:
    """Return number and unit of ``"35.15 N/V"``.

    Raises
    ------
    UnitError
        For text without a finite number or without a unit.
    """
    match = _NUMBER.fullmatch(text)
    if match is None or not math.isfinite(float(match[1])):
        raise UnitError(
            f"{where}: {text!r} is not a number with a unit; expected {_example(expected, where)}"
        )
    if not match[2]:
        raise UnitError(f"{where}: {text!r} has no unit; expected {_example(expected, where)}")
    return float(match[1]), match[2]


def _example(expected: str, where: str) -> str:
    """Return what is expected, with a quantity to copy."""
    unit = expected.replace("**", "^")
    if where.endswith("gain"):
        return f"a factor with its unit, such as '5 {unit}/V'"
    return f"{QUANTITIES[expected].split(',')[0]}, such as '{NUMBERS.get(expected, '5')} {unit}'"


def _parse_unit(unit: str, where: str) -> pint.Unit:
    """Return pint's unit, or refuse the spelling."""
    parsed = _try_parse(unit)
    if parsed is None:
        raise UnitError(f"{where}: unit {unit!r} is unknown; write it as 'N*m', 'mrad', 'kg*m^2', 'um/m' ...")
    return parsed


def unit_in_name(name: str) -> tuple[str, bool] | None:
    """Return the unit in the name of a column, and whether a word of it alone states it; None where there is none.

    Examples
    --------
    >>> unit_in_name("Force [kN]"), unit_in_name("angle_upper_mrad"), unit_in_name("angle_rad_from_upright")
    (('kN', False), ('mrad', True), ('rad', True))
    >>> unit_in_name("rpm"), unit_in_name("gyro_rad_per_s"), unit_in_name("gyro_deg_s"), unit_in_name("force_in_beam")
    (('rpm', True), None, None, None)
    >>> unit_in_name("LDV_mm/s"), unit_in_name("a m/s2"), unit_in_name("torque/value")
    (('mm/s', False), ('m/s^2', False), None)
    """
    bracketed = _BRACKETS.search(name)
    if bracketed:
        return _spelled(bracketed[1]), False
    if name.strip() in KNOWN - {"in"}:
        return _spelled(name.strip()), True
    quotient = _QUOTIENT.search(name.strip())
    if quotient and is_unit(quotient["over"]) and is_unit(quotient["under"]):
        return f"{quotient['over']}/{quotient['under']}{'^2' if quotient['square'] else ''}", False
    ending = _ENDING.match(name.strip())
    if ending is None:
        return None
    base, unit = ending["base"], ending["unit"]
    last = re.split(r"[./]", base)[-1]
    # Not the last part of rad_per_s.
    whole = {"per", *KNOWN - {"in"}}.isdisjoint(base.split("_"))
    if whole and (unit in KNOWN or (unit in LETTERS and len(last) > 3 and last.isalpha())):
        return _spelled(unit), True
    # Within the name, where plain words follow: no rad_per_s, and in is a word.
    words = name.split("_")
    within = [at for at, word in enumerate(words) if at and word in KNOWN - {"in"}]
    rest = words[within[0] + 1 :] if within else []
    plain = all(len(word) > 1 and word.isalpha() and word not in KNOWN | OTHERS | {"per"} for word in rest)
    return (_spelled(words[within[0]]), True) if rest and plain else None


def is_unit(text: str) -> bool:
    """Return whether a field below a header is a unit: in brackets, or one that laboratories write.

    Examples
    --------
    >>> is_unit("[s]"), is_unit("N.m"), is_unit("m/s^2"), is_unit("force"), is_unit("-"), is_unit("force [N]")
    (True, True, True, False, True, False)
    """
    text = text.strip()
    bare = text.strip("[](){}").strip()
    if text[:1] in ("[", "(", "{") or bare in ("-", "1", "%"):
        return True
    parts = re.split(r"[*·/^ ]+\d*|(?<=[^\W\d_])[-.](?=[^\W\d_])", bare)
    return all(part in KNOWN | LETTERS | OTHERS or part.isdigit() or not part for part in parts)


def _spelled(unit: str) -> str:
    return SPELLINGS.get(unit, unit.replace("·", "*"))
