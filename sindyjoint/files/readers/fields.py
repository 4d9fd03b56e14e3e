"""What a line of a text table holds: its fields, numbers, time stamps, and where above it the table begins."""

from __future__ import annotations

import csv
import re
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from sindyjoint.files.units import is_unit

_DECIMAL_COMMA = re.compile(r"\s*[+-]?\d+,\d+([eE][+-]?\d+)?\s*")
# A date may stand before it and a zone behind it: only the time within the day is read. Or minutes and seconds.
_CLOCK = re.compile(
    r"(?:^|.*[T\s])(\d{1,2}):(\d{2}):(\d{2}(?:[.,]\d+)?)\s*([AaPp][Mm])?\s*(?:Z|[+-]\d{2}:?\d{2})?$"
    r"|^(\d{1,3}):(\d{2}[.,]\d+)$"
)
DAY = 86400.0
# Lines in a row that look like the rest of the table: its data have begun.
ALIKE = 3
# A preamble is longer than this in no file that anybody writes.
LONGEST = 400


def find_delimiter(lines: Sequence[str], sample: str | None = None) -> str | None:
    """Return what parts the fields of a line, by default of the third; None for blanks."""
    sample = lines[min(len(lines) - 1, 2)] if sample is None else sample
    for delimiter in ("\t", ";", ","):
        if delimiter in sample and (
            delimiter != "," or "," in lines[0] or not has_decimal_comma(sample, False)
        ):
            return delimiter
    # A single column has no delimiter at all, and its header may hold blanks.
    return None if len(sample.split()) > 1 else ","


def split_fields(line: str, delimiter: str | None) -> list[str]:
    """Return the fields of one line, without blanks around them; a delimiter at its end opens no field."""
    text = " ".join(line.split()) if delimiter is None else line
    try:
        fields = next(csv.reader([text], delimiter=delimiter or " ", skipinitialspace=True))
    except csv.Error:  # a field beyond csv's limit of 131 072 letters
        fields = text.split(delimiter)
    fields = [field.strip() for field in fields]
    return fields[:-1] if len(fields) > 1 and not fields[-1] else fields


def is_number(field: str) -> bool:
    """Return whether a field is a number, with a point or a decimal comma.

    Examples
    --------
    >>> is_number("1.5e-3"), is_number("1,5"), is_number("1_000"), is_number("kN")
    (True, True, False, False)
    """
    try:
        float(field)
    except ValueError:
        return has_decimal_comma(field)
    return "_" not in field  # Python's float takes 1_000, tables do not


def has_decimal_comma(field: str, whole: bool = True) -> bool:
    """Return whether a field is, or begins with, a number with a decimal comma."""
    return bool((_DECIMAL_COMMA.fullmatch if whole else _DECIMAL_COMMA.match)(field))


def is_stamp(field: str) -> bool:
    """Return whether a field is a clock or date time.

    Examples
    --------
    >>> is_stamp("2024-05-01T12:30:00.125+02:00"), is_stamp("12:30.5"), is_stamp("12.5"), is_stamp("12:30")
    (True, True, False, False)
    """
    return ":" in field and bool(_CLOCK.match(field))


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
    seconds = np.empty(len(stamps))
    for index, stamp in enumerate(stamps):
        clock = _CLOCK.match(stamp)
        if clock is None:
            raise ValueError(index)
        hours = int(clock[1] or 0)
        hours = hours % 12 + 12 * (clock[4].lower() == "pm") if clock[4] else hours
        seconds[index] = (
            3600 * hours + 60 * int(clock[2] or clock[5]) + float((clock[3] or clock[6]).replace(",", "."))
        )
    days = np.cumsum(np.diff(seconds, prepend=seconds[:1]) < -DAY / 2)
    # Stamps have microseconds; a difference of large floats has digits beyond them that mean nothing.
    return np.round(seconds - seconds[0] + DAY * days, 9)


def preamble_length(lines: Sequence[str]) -> int:
    """Return how many lines stand above the header; zero where there is no table to be seen.

    The middle line shows what a row looks like: how many fields, and which of them are numbers. The data begin with the
    first three rows like it. The line above, if it has as many fields and no number, is the header, and a row of units
    may stand between them.
    """
    sample = lines[len(lines) // 2]
    delimiter = find_delimiter(lines, sample)
    pattern = [_kind(field) for field in split_fields(sample, delimiter)]
    if "number" not in pattern:
        return 0
    width = len(pattern)
    rows = [split_fields(line, delimiter) for line in lines[: LONGEST + ALIKE]]
    kinds = [[_kind(field) for field in row] for row in rows]
    alike = [
        len(row) == width
        and all("blank" in pair or len(set(pair)) == 1 for pair in zip(row, pattern, strict=True))
        for row in kinds
    ]
    first = next((i for i in range(len(rows)) if all(alike[i : i + ALIKE])), 0)
    headings = 0
    for row in kinds[max(first - 2, 0) : first][::-1]:
        if len(row) != width or set(row) == {"blank"} or "number" in row:
            break
        headings += 1
    if headings == 2 and first > 2 and not all(is_unit(field) for field in rows[first - 1] if field):
        headings = 1
    if not headings and first and len(rows[first - 1]) > 1 and "number" not in kinds[first - 1]:
        return 0  # a header of another width than its columns: to be reported, not passed over
    above = first - headings
    return 0 if any(_is_broken_row(row, pattern) for row in kinds[:above]) else above


def _kind(field: str) -> str:
    if is_number(field):
        return "number"
    return "stamp" if is_stamp(field) else "text" if field else "blank"


def _is_broken_row(kinds: Sequence[str], pattern: Sequence[str]) -> bool:
    """Return whether a line looks like a damaged row of data, which no one may pass over in silence."""
    numbers = kinds.count("number")
    if numbers == len(kinds):
        return len(kinds) > 1
    return len(kinds) == len(pattern) > 2 and 2 * numbers >= pattern.count("number")
