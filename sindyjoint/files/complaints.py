"""What is wrong with a file of keys, in one sentence as its writer would say it."""

from __future__ import annotations

from pydantic import ValidationError
from pydantic_core import ErrorDetails

from sindyjoint.text import expectation

# What pydantic calls the two things that [channels] time may be.
WITHOUT_TIME, TIME_CHANNEL = "literal['none']", "TimeChannel"


def first_complaint(error: ValidationError) -> str:
    """Turn pydantic's list into one sentence: the field, what was expected, what was given."""
    # Of a key that may be a number or text, pydantic complains once per type: one per key is enough.
    by_location: dict[tuple[int | str, ...], ErrorDetails] = {}
    for complaint in error.errors(include_url=False):
        if WITHOUT_TIME in complaint["loc"]:
            continue  # what is said of the column that it is not says more
        by_location.setdefault(_location(complaint), complaint)
    complaints = list(by_location.values())
    # A misspelt key also makes the right one missing: say the cause first.
    complaints.sort(key=lambda item: "unknown key" not in item["msg"])
    first = complaints[0]
    field = field_name(_location(first))
    if first["type"] == "missing":
        message = f"key {first['loc'][-1]!r} is missing"
        field = field_name(_location(first)[:-1])
    else:
        message = expectation(first)
        given = f", not {first['input']!r:.60}"
        message += "" if first["type"] in ("value_error", "too_short", "too_long") else given
    more = f" (and {len(complaints) - 1} more)" if len(complaints) > 1 else ""
    return f"{field}: {message}{more}" if field else f"{message}{more}"


def _location(complaint: ErrorDetails) -> tuple[int | str, ...]:
    """Return where a complaint points, without the name of the type that was tried."""
    location = tuple(part for part in complaint["loc"] if part != TIME_CHANNEL)
    return location[:-1] if location and location[-1] in ("float", "str", "int", "bool") else location


def field_name(location: tuple[int | str, ...]) -> str:
    """Return a position in the manifest as a user writes it: ``[channels] angle.unit``."""
    parts = [str(part) for part in location]
    if not parts:
        return ""
    if parts[0] == "run" and len(location) > 1 and isinstance(location[1], int):
        return " ".join([f"[[run]] {location[1] + 1}", ".".join(parts[2:])]).strip()
    return " ".join([f"[{parts[0]}]", ".".join(parts[1:])]).strip()
