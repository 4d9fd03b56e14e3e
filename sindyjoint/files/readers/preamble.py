"""Lines above the header of a text table that belong to no table: who measured, when, with what."""

from __future__ import annotations

from collections.abc import Sequence

from sindyjoint.files.readers.fields import find_delimiter, is_number, split_fields
from sindyjoint.files.readers.stamps import is_stamp
from sindyjoint.files.stated_units import is_unit

# Lines in a row that look like the rest of the table: its data have begun.
ALIKE = 3
# A preamble is longer than this in no file that anybody writes.
LONGEST = 400


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
    rows = [split_fields(line, delimiter) for line in lines[: LONGEST + ALIKE]]
    alike = [_is_like(row, pattern) for row in rows]
    first = next((i for i in range(len(rows)) if all(alike[i : i + ALIKE])), 0)
    headings = 0
    while headings < min(2, first) and _is_heading(rows[first - headings - 1], len(pattern)):
        headings += 1
    if headings == 2 and first > 2 and not all(is_unit(field) for field in rows[first - 1] if field):
        headings = 1
    if not headings and first and len(rows[first - 1]) > 1 and not any(map(is_number, rows[first - 1])):
        return 0  # a header of another width than its columns: to be reported, not passed over
    above = first - headings
    return 0 if any(_is_broken_row(row, pattern) for row in rows[:above]) else above


def _kind(field: str) -> str:
    if is_number(field):
        return "number"
    return "stamp" if is_stamp(field) else "text" if field else "blank"


def _is_like(row: Sequence[str], pattern: Sequence[str]) -> bool:
    return len(row) == len(pattern) and all(
        "blank" in (kind, known) or kind == known
        for kind, known in zip(map(_kind, row), pattern, strict=True)
    )


def _is_heading(row: Sequence[str], width: int) -> bool:
    return len(row) == width and any(row) and not any(map(is_number, row))


def _is_broken_row(row: Sequence[str], pattern: Sequence[str]) -> bool:
    """Return whether a line looks like a damaged row of data, which no one may pass over in silence."""
    numbers = sum(map(is_number, row))
    if numbers == len(row):
        return len(row) > 1
    return len(row) == len(pattern) > 2 and 2 * numbers >= pattern.count("number")
