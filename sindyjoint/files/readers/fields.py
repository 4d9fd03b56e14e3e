"""The fields of a line of text: what parts them, and which are numbers."""

from __future__ import annotations

import csv
import re
from collections.abc import Sequence

_DECIMAL_COMMA = re.compile(r"\s*[+-]?\d+,\d+([eE][+-]?\d+)?\s*")


def find_delimiter(lines: Sequence[str], sample: str | None = None) -> str | None:
    """Return what parts the fields of a line, by default of the third; None for blanks."""
    sample = lines[min(len(lines) - 1, 2)] if sample is None else sample
    for delimiter in ("\t", ";", ","):
        if delimiter in sample and (delimiter != "," or "," in lines[0] or not _DECIMAL_COMMA.match(sample)):
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


def has_decimal_comma(field: str) -> bool:
    """Return whether a field is a number with a decimal comma."""
    return bool(_DECIMAL_COMMA.fullmatch(field))
