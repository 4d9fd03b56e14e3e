"""Words and numbers for people: identifiers, what is measured by kind of motion, rounded values."""

import math
import re
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

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
# What a terminal obeys or hides: control characters other than tab and line ends, marks that turn the direction of
# writing, halves of characters.
_CONTROL = re.compile("[\x00-\x08\x0b-\x0c\x0e-\x1f\x7f-\x9f\u061c\u202a-\u202e\u2066-\u2069\ud800-\udfff]")
_RAISED = str.maketrans("-0123456789", "⁻⁰¹²³⁴⁵⁶⁷⁸⁹")
_PATTERN = re.compile(r"\b(" + "|".join(_NAMES) + r")\b")


@dataclass(frozen=True)
class Quantities:
    """What is measured at a joint with one kind of motion: names, symbols and SI units.

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
    inertia: str
    inertia_unit: str


_ROTATION = Quantities(
    "Angle", "θ", "rad", "Rate", "θ\u0307", "rad/s", "Moment", "Transfer moment", "N*m", "Inertia", "kg*m^2"
)
_TRANSLATION = Quantities(
    "Displacement", "x", "m", "Velocity", "x\u0307", "m/s", "Force", "Transfer force", "N", "Mass", "kg"
)
# What a text about a joint that rotates says of one that slides.
_SLIDING = {"angle": "displacement", "rate": "velocity", "moment": "force", "inertia": "mass"}
_SLIDING |= {"angles": "displacements", "rates": "velocities", "moments": "forces"}
_SLIDING |= {"an angle": "a displacement", "an inertia": "a mass", "N·m": "N"}
_SLIDING |= {f"{was[0].upper()}{was[1:]}": f"{now[0].upper()}{now[1:]}" for was, now in _SLIDING.items()}
_ROTATING = re.compile(r"\b(" + "|".join(sorted(_SLIDING, key=len, reverse=True)) + r")\b")


def quantities(motion: str) -> Quantities:
    """Return the names for ``"rotation"`` or ``"translation"``."""
    return _TRANSLATION if motion == "translation" else _ROTATION


def in_words_of(motion: str, text: str) -> str:
    """Return a text about a joint that rotates in the words of a kind of motion.

    Examples
    --------
    >>> in_words_of("translation", "Moment over angle and rate")
    'Force over displacement and velocity'
    >>> in_words_of("rotation", "an angle")
    'an angle'
    """
    return _ROTATING.sub(lambda found: _SLIDING[found[0]], text) if motion == "translation" else text


def in_words_of_origin(simulated: bool, text: str) -> str:
    """Return a text about measured runs as it reads where they come from a virtual test: nothing there was measured.

    Examples
    --------
    >>> in_words_of_origin(True, "The measured response")
    "The virtual test's response"
    >>> in_words_of_origin(True, "Mean residual, measured less model"), in_words_of_origin(False, "measured")
    ('Mean residual, virtual test less model', 'measured')
    """
    if not simulated:
        return text
    text = re.sub(r"\b(the|The) measured (?!and|less)", r"\1 virtual test's ", text)
    text = re.sub(r"\bwhat was measured\b", "the virtual test", text)
    return re.sub(
        r"(?<!not )\b([Mm])easured\b",
        lambda found: "Virtual test" if found[1] == "M" else "virtual test",
        text,
    )


def spelled(identifier: str, motion: str = "rotation") -> str:
    """Return an id in the usual words, names of people with capital letters, for a kind of motion.

    Examples
    --------
    >>> spelled("bouc_wen_hysteresis"), spelled("lugre_friction"), spelled("linear_damping")
    ('Bouc–Wen hysteresis', 'LuGre friction', 'viscous damping')
    >>> spelled("constant_moment", "translation")
    'constant force'
    """
    return in_words_of(motion, _PATTERN.sub(lambda found: _NAMES[found[0]], identifier.replace("_", " ")))


# What a value had to be, by the kind of complaint of the validation library: its words mean nothing to a user.
_EXPECTED = {
    "string_type": "expected text in quotes",
    "bool_type": "expected true or false",
    "bool_parsing": "expected true or false",
    "int_type": "expected a whole number",
    "int_from_float": "expected a whole number",
    "float_type": "expected a number",
    "finite_number": "expected a finite number",
    "list_type": "expected a list",
    "tuple_type": "expected a list",
    "dict_type": "expected a table",
    "model_type": "expected a table",
    "literal_error": "expected {expected}",
    "greater_than": "expected more than {gt}",
    "greater_than_equal": "expected {ge} or more",
    "less_than": "expected less than {lt}",
    "less_than_equal": "expected {le} or less",
    "too_short": "expected at least {min_length}, not {actual_length}",
    "too_long": "expected at most {max_length}, not {actual_length}",
}


def expectation(complaint: Mapping[str, Any]) -> str:
    """Return what a complaint of the validation library wants, in plain words.

    Examples
    --------
    >>> expectation({"type": "greater_than", "ctx": {"gt": 0}, "msg": "Input should be greater than 0"})
    'expected more than 0'
    >>> expectation({"type": "value_error", "msg": "Value error, key 'unit' is missing"})
    "key 'unit' is missing"
    """
    known = _EXPECTED.get(complaint["type"])
    if known is None:
        return re.sub(r"^[Ii]nput should be", "expected", str(complaint["msg"]).removeprefix("Value error, "))
    return known.format(**complaint.get("ctx", {}))


def list_some(names: Sequence[str], what: str = "runs") -> str:
    """Return a few names, and how many more there are.

    Examples
    --------
    >>> list_some(["a", "b", "c", "d", "e"])
    'a, b, c and 2 more runs'
    """
    shown = ", ".join(names[:3])
    return shown if len(names) <= 3 else f"{shown} and {len(names) - 3} more {what}"


def list_all(names: Sequence[str]) -> str:
    """Return all names, the last one after *and*.

    Examples
    --------
    >>> list_all(["a", "b", "c"])
    'a, b and c'
    """
    return " and ".join([", ".join(names[:-1]), *names[-1:]]).removeprefix(" and ")


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


def control_character(text: str) -> str | None:
    r"""Return the first sign of a text that a terminal would obey, not show; None where there is none.

    Examples
    --------
    >>> control_character("red \x1b[31m joint"), control_character("joint 1\n")
    ('\x1b', None)
    """
    found = _CONTROL.search(text)
    return found[0] if found else None


def printable(text: str) -> str:
    r"""Return a text with its control characters spelled out.

    Examples
    --------
    >>> printable("red \x1b[31m joint")
    'red \\x1b[31m joint'
    """
    return _CONTROL.sub(lambda found: found[0].encode("unicode_escape", "surrogatepass").decode(), text)


def in_columns(
    rows: Sequence[Sequence[str]], justify: Callable[[str, int], str] = str.ljust
) -> Iterator[str]:
    """Yield rows with their columns under each other: the first begins at the left, the others as is said.

    Examples
    --------
    >>> list(in_columns([("term", "n"), ("k", "12")], str.rjust))
    ['term   n', 'k     12']
    """
    first, *others = (max(map(len, column)) for column in zip(*rows, strict=True))
    for row in rows:
        yield "  ".join([row[0].ljust(first), *map(justify, row[1:], others)]).rstrip()


def superscript(digits: object) -> str:
    """Return an integer as a power is written.

    Examples
    --------
    >>> superscript(-12)
    '⁻¹²'
    """
    return str(digits).translate(_RAISED)


def power_of_ten(value: float) -> str:
    """Return a round number as it stands at an axis; far from 1 with its power of ten.

    Examples
    --------
    >>> power_of_ten(0.02), power_of_ten(1e-6), power_of_ten(2e5)
    ('0.02', '10⁻⁶', '2·10⁵')
    """
    if 1e-3 <= abs(value) < 1e4:
        return f"{value:g}"
    digit, _, power = f"{value:.0e}".partition("e")
    return ("" if digit == "1" else f"{digit}·") + f"10{superscript(int(power))}"


def percent(value: float | None) -> str:
    """Return a share in per cent to three digits; less than a hundredth of a per cent is only stated as less than that.

    Examples
    --------
    >>> percent(0.0216), percent(2.09e-7), percent(0.0), percent(12.34), percent(None)
    ('2.16 %', '< 0.01 %', '0 %', '1234 %', '–')
    """
    if value is None or not math.isfinite(value):
        return "–"
    if 0 < abs(value) < 1e-4:
        return "< 0.01 %"
    return f"{100 * value:.0f} %" if abs(value) >= 9.995 else f"{100 * value:.3g} %"


def _to(value: float, digits: int) -> float:
    """Round to a power of ten."""
    return round(value, -digits)
