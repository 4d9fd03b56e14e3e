"""Bounds of formulas: enough interval arithmetic to know that a root is taken of what cannot be negative.

An interval is a pair (low, high). ``TINY`` as low end stands for "positive, however small". Bounds are rounded to
nearest, which is all that telling signs apart needs here.
"""

from __future__ import annotations

import math
from collections.abc import Callable

Interval = tuple[float, float]

TINY = 5e-324
EVERYTHING: Interval = (-math.inf, math.inf)
POSITIVE: Interval = (TINY, math.inf)


def add(one: Interval, other: Interval) -> Interval:
    """Return the bounds of a sum."""
    return one[0] + other[0], one[1] + other[1]


def negate(one: Interval) -> Interval:
    """Return the bounds of −x."""
    return -one[1], -one[0]


def multiply(one: Interval, other: Interval) -> Interval:
    """Return the bounds of a product."""
    # 0 times infinity is 0 here: an infinite end is a bound of finite values.
    ends = [0.0 if 0.0 in (x, y) else x * y for x in one for y in other]
    low, high = min(ends), max(ends)
    if (one[0] > 0 and other[0] > 0) or (one[1] < 0 and other[1] < 0):
        low = max(low, TINY)  # the product of two small positive numbers may round to 0
    return low, high


def divide(one: Interval, other: Interval) -> Interval:
    """Return the bounds of a quotient; everything where the divisor may be zero."""
    if other[0] > 0:
        return multiply(one, (max(1 / other[1], TINY), _reciprocal(other[0])))
    if other[1] < 0:
        return negate(divide(one, negate(other)))
    return EVERYTHING


def power(base: Interval, exponent: float | None) -> Interval:
    """Return the bounds of a power; ``None`` is an exponent that is not known, or not whole: base not negative."""
    if exponent is None or not float(exponent).is_integer():
        return POSITIVE if base[0] > 0 else (0.0, math.inf)
    if exponent < 0:
        return divide((1.0, 1.0), power(base, -exponent))
    ends = sorted(_power(end, int(exponent)) for end in base)
    if exponent % 2 == 0 and base[0] < 0 < base[1]:
        ends[0] = 0.0
    return (max(ends[0], TINY) if base[0] > 0 else ends[0]), ends[1]


def _reciprocal(x: float) -> float:
    return 1 / x if x > 1e-300 else math.inf


def _power(x: float, n: int) -> float:
    try:
        return x**n
    except OverflowError:
        return math.inf if x > 0 or n % 2 == 0 else -math.inf


def _rising(function: Callable[[float], float]) -> Callable[[Interval], Interval]:
    def bounds(one: Interval) -> Interval:
        low, high = (_safely(function, end) for end in one)
        return (max(low, TINY) if function is math.exp else low), high

    return bounds


def _safely(function: Callable[[float], float], x: float) -> float:
    try:
        return function(x)
    except OverflowError:
        return math.inf


def sign(x: float) -> float:
    """Return −1, 0 or 1."""
    return float((x > 0) - (x < 0))


def heaviside(x: float) -> float:
    """Return 0, 1/2 or 1."""
    return 0.5 * (1 + sign(x))


def _absolute(one: Interval) -> Interval:
    if one[0] >= 0:
        return one
    return (0.0, max(-one[0], one[1])) if one[1] > 0 else negate(one)


def _logarithm(one: Interval) -> Interval:
    return (-math.inf if one[0] <= 1e-300 else math.log(one[0])), math.log(one[1])


_BOUNDS: dict[str, Callable[[Interval], Interval]] = {
    "abs": _absolute,
    "log": _logarithm,
    "sign": _rising(sign),
    "sqrt": _rising(math.sqrt),
    "exp": _rising(math.exp),
    "tanh": _rising(math.tanh),
    "atan": _rising(math.atan),
    "heaviside": _rising(heaviside),
    "sin": lambda one: (-1.0, 1.0),
    "cos": lambda one: (-1.0, 1.0),
    "tan": lambda one: EVERYTHING,
}


def of_function(name: str, arguments: list[Interval]) -> Interval:
    """Return the bounds of a function's value; the arguments of sqrt and log are taken to be in order."""
    if name in ("min", "max"):
        choose = min if name == "min" else max
        return choose(one[0] for one in arguments), choose(one[1] for one in arguments)
    return _BOUNDS[name](arguments[0])
