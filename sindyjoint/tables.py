"""Tables of TOML files as pydantic models: unknown keys are refused, and what is wrong is one sentence."""

from collections.abc import Sequence
from typing import Any, TypeVar

from pydantic import BaseModel, ConfigDict, ValidationError, model_validator
from pydantic_core import ErrorDetails

from sindyjoint.errors import InputError, nearest
from sindyjoint.plain import Misfit, from_plain
from sindyjoint.text import expectation

T = TypeVar("T")
# What pydantic calls the two things that [channels] time may be.
WITHOUT_TIME, TIME_CHANNEL = "literal['none']", "TimeChannel"


class StrictTable(BaseModel):
    """A TOML table that refuses unknown keys and names the nearest known one."""

    model_config = ConfigDict(extra="forbid", strict=True, frozen=True, allow_inf_nan=False)

    @model_validator(mode="before")
    @classmethod
    def _refuse_unknown_keys(cls, given: Any) -> Any:
        if not isinstance(given, dict):
            return given
        known = sorted(field.alias or name for name, field in cls.model_fields.items())
        for key in given:
            if key not in known:
                raise ValueError(f"unknown key {key!r}; {nearest(key, known, 'known keys:')}")
        return given


def first_complaint(error: ValidationError, data: Any = None) -> str:
    """Turn pydantic's list into one sentence: the field, what was expected, what was given.

    Parameters
    ----------
    error : ValidationError
    data : mapping, optional
        The document, whose entries are then called by their ids or names.
    """
    # Of a key that may be a number or text, pydantic complains once per type: one per key is enough.
    complaints: dict[tuple[int | str, ...], ErrorDetails] = {}
    for complaint in error.errors(include_url=False):
        place = tuple(part for part in complaint["loc"] if part != TIME_CHANNEL)
        if WITHOUT_TIME not in place:  # what is said of the column that it is not says more
            typed = place and place[-1] in ("float", "str", "int", "bool")
            complaints.setdefault(place[:-1] if typed else place, complaint)
    # A misspelt key also makes the right one missing: say the cause first.
    place, first = min(complaints.items(), key=lambda item: "unknown key" not in item[1]["msg"])
    if first["type"] == "missing":
        place, message = place[:-1], f"key {place[-1]!r} is missing"
    else:
        told = first["type"] in ("value_error", "too_short", "too_long")
        message = expectation(first) + ("" if told else f", not {first['input']!r:.60}")
    field = heading([str(part + 1) if isinstance(part, int) else part for part in place], data)
    more = f" (and {len(complaints) - 1} more)" if len(complaints) > 1 else ""
    return f"{field}: {message}{more}" if field else f"{message}{more}"


def heading(place: Sequence[str], data: Any = None) -> str:
    """Return a place in a TOML file as a user writes it: [channels] angle.unit, [[run]] 2 frequency.

    Parameters
    ----------
    place : sequence of str
        Keys, and numbers from 1 of entries.
    data : mapping, optional
        The document, whose entries are then called by their ids or names.
    """
    table, rest = (f"[{place[0]}]" if place else ""), [*place[1:]]
    if rest and rest[0].isdigit():
        number = rest.pop(0)
        entry = data[place[0]][int(number) - 1] if data else None
        name = entry.get("id", entry.get("name")) if isinstance(entry, dict) else None
        table = f"[[{place[0]}]] {number}" + (f" ({name})" if isinstance(name, str) else "")
    return f"{table} {'.'.join(rest)}".strip()


def entries_of(kind: type[T], data: Any, called: str) -> T:
    """Return the tables of a TOML file as a record.

    Raises
    ------
    InputError
        The message names file and field.
    """
    try:
        return from_plain(kind, data)
    except Misfit as error:
        place, said = error.args
        where = heading([part for part in place.split(".") if part], data)
        raise InputError(": ".join(filter(None, (called, where, said)))) from None
