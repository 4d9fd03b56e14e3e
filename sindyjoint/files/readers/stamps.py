"""Time stamps written as a clock or a date: ``12:30:00.25``, ``2024-05-01T12:30:00Z``, ``5/1/2024 12:30:00.5 PM``."""

from __future__ import annotations

import re
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

DAY = 86400.0
# A date may stand before it and a zone behind it: only the time within the day is read.
_CLOCK = re.compile(
    r"(?:^|.*[T\s])(\d{1,2}):(\d{2}):(\d{2}(?:[.,]\d+)?)\s*([AaPp][Mm])?\s*(?:Z|[+-]\d{2}:?\d{2})?$"
)
_MINUTES = re.compile(r"^(\d{1,3}):(\d{2}[.,]\d+)$")


def is_stamp(field: str) -> bool:
    """Return whether a field is a clock or date time.

    Examples
    --------
    >>> is_stamp("2024-05-01T12:30:00.125+02:00"), is_stamp("12:30.5"), is_stamp("12.5"), is_stamp("12:30")
    (True, True, False, False)
    """
    return ":" in field and bool(_CLOCK.match(field) or _MINUTES.match(field))


def seconds_since_first(stamps: Sequence[str]) -> NDArray[np.float64]:
    """Return clock or date stamps as seconds since the first of them, also across midnight.

    Raises
    ------
    ValueError
        With the index of the first field that is no time stamp as its only argument.

    Examples
    --------
    >>> seconds_since_first(["23:59:59.5", "00:00:00.5"]).tolist()
    [0.0, 1.0]
    """
    seconds = np.array([_seconds(stamp, index) for index, stamp in enumerate(stamps)])
    days = np.cumsum(np.diff(seconds, prepend=seconds[:1]) < -DAY / 2)
    # Stamps have microseconds; a difference of large floats has digits beyond them that mean nothing.
    return np.round(seconds - seconds[0] + DAY * days, 9)


def _seconds(stamp: str, index: int) -> float:
    clock = _CLOCK.match(stamp)
    if clock:
        hours = int(clock[1]) % 12 + 12 * (clock[4].lower() == "pm") if clock[4] else int(clock[1])
        return 3600.0 * hours + 60.0 * int(clock[2]) + float(clock[3].replace(",", "."))
    minutes = _MINUTES.match(stamp)
    if minutes is None:
        raise ValueError(index)
    return 60.0 * int(minutes[1]) + float(minutes[2].replace(",", "."))
