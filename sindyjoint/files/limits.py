"""How much memory the content of one file may take: known before anything is allocated for it."""

from __future__ import annotations

import math
import os
import re
from collections.abc import Sequence
from pathlib import Path

from sindyjoint.errors import InputError

VARIABLE = "SINDYJOINT_LARGEST"
"""Environment variable, which worker processes have as well; ``sindyjoint --largest`` sets it."""
DEFAULT = 1 << 30
MOST_COLUMNS = 10_000
LARGEST_ITEM = 1 << 16
_SIZE = re.compile(r"\s*(\d{1,15}(?:\.\d{1,3})?)\s*([kMGT]?i?B?)\s*", re.IGNORECASE)
_FACTORS = {"": 1, "k": 10**3, "m": 10**6, "g": 10**9, "t": 10**12}


def parse_size(text: str) -> int:
    """Return a size such as "4 GB" in bytes.

    Raises
    ------
    InputError

    Examples
    --------
    >>> parse_size("4 GB"), parse_size("1.5MiB"), parse_size("2000000")
    (4000000000, 1572864, 2000000)
    """
    match = _SIZE.fullmatch(text)
    value = 0
    if match is not None:
        unit = match[2].lower()
        prefix = unit.rstrip("b").rstrip("i")
        factor = 1024 ** "kmgt".index(prefix) * 1024 if "i" in unit and prefix else _FACTORS[prefix]
        value = int(float(match[1]) * factor)
    if value < 1:
        raise InputError(f"size is {text!r:.40}; expected a number of bytes, such as '4 GB'")
    return value


def largest_bytes() -> int:
    """Return how many bytes the content of one file may take in memory."""
    given = os.environ.get(VARIABLE)
    return parse_size(given) if given else DEFAULT


def check_bytes(path: Path, size: int, what: str = "its content") -> None:
    """Refuse content beyond the limit.

    Raises
    ------
    InputError
    """
    largest = largest_bytes()
    if size > largest:
        raise InputError(
            f"{path}: {what} would take {size / 1e6:.6g} MB of memory, beyond the limit of {largest / 1e6:.6g} MB; if "
            f"it is meant, raise the limit with 'sindyjoint --largest SIZE ...'"
        )


def check_array(path: Path, shape: Sequence[int], item: int, what: str = "an array") -> int:
    """Return how many bytes an array takes; refuse one beyond the limit, or of more columns than a table has.

    Raises
    ------
    InputError
    """
    size = math.prod(shape) * item
    if (
        not 1 <= item <= LARGEST_ITEM
        or (len(shape) > 1 and min(shape) > MOST_COLUMNS)
        or any(n < 0 for n in shape)
    ):
        raise InputError(
            f"{path}: {what} of shape {tuple(shape)!s:.60} with {item} bytes an entry is no table of numbers"
        )
    # An array without a single number still has as many columns as its shape states.
    if size == 0 and len(shape) > 1 and max(shape) > MOST_COLUMNS:
        raise InputError(f"{path}: {what} of shape {tuple(shape)!s:.60} holds nothing")
    check_bytes(path, size, what)
    return size
