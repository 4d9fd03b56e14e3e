"""Plain data of files as records, and back: JSON by the description of a record, TOML tables by it or by pydantic.

A record is a frozen dataclass; each of its fields is an entry of its dictionary. Where the two differ, ``WRITTEN`` says
which attribute stands under which key, or which keys of its own a key holds::

    WRITTEN = {**same("equation"), "tested": {"angle": "tested_angle"}, "rig": "rig.name", "inputs?": "inputs"}

A key with a question mark is left out where there is nothing under it, or what is there anyhow; an attribute with a
layout beside it is a list of records that are written so. ``FILED`` are entries of the result's file that ``--json``
does not print, ``SCHEMA`` is the version, ``KIND`` the name of what has a file of its own, ``FORMERLY`` what such files
may hold besides. Types are those of the annotations, words, units and shapes those of the docstrings.
"""

import math
import re
from collections.abc import Mapping, Sequence
from dataclasses import MISSING, fields, is_dataclass
from functools import reduce
from pathlib import Path
from types import NoneType, UnionType
from typing import Annotated, Any, Literal, TypeVar, Union, get_args, get_origin, get_type_hints

from pydantic import BaseModel, ConfigDict, ValidationError, model_validator
from pydantic_core import ErrorDetails

from sindyjoint.errors import InputError, nearest
from sindyjoint.text import expectation

UNKNOWN, POSITIVE, SOME = "null where it is not known", "zero or more", "at least one"
ONE_LINE, NAME = "one line of text", "small letters, digits and _ behind a letter"
# A number that need not be known: NaN in a record, null in its dictionary; one that is not negative; both.
Maybe = Annotated[float, UNKNOWN]
Size = Annotated[float, POSITIVE]
MaybeSize = Annotated[float, UNKNOWN, POSITIVE]
Count = Annotated[int, POSITIVE]
Line = Annotated[str, ONE_LINE]
Identifier = Annotated[str, NAME]

_WORDS = {str: "text in quotes", bool: "true or false", int: "a whole number", float: "a number"}
PATTERNS = {ONE_LINE: re.compile(r"[^\n\r]+"), NAME: re.compile("[a-z][a-z0-9_]*")}


class Misfit(InputError):
    """Data that are not of their type: the place, with dots between its parts, and what is wrong there."""

    def __str__(self) -> str:
        return ": ".join(filter(None, map(str, self.args)))


def same(*names: str) -> dict[str, str]:
    """Return entries that stand under the names of their attributes."""
    return {name: name for name in names}


def scalar_of_array(hint: Any) -> type | None:
    """Return of which scalars an array is, by its type; None where that is no array's."""
    if getattr(get_origin(hint), "__name__", "") not in ("ndarray", "NDArray"):
        return None
    # From numpy 2.5 on NDArray[scalar] is a name of its own; before, it is ndarray[shape, dtype[scalar]].
    last = get_args(hint)[-1]
    return (get_args(last) or (last,))[0]


def to_plain(value: Any, full: bool = False, digits: int = 0) -> Any:
    """Return data as JSON holds them: records by their description, numbers that are not finite as null.

    To so many ``digits``, as pictures need them, a record without a file of its own is written field by field.
    """
    if isinstance(value, float):  # first: a picture's data are some 100 000 of them
        if not math.isfinite(value):
            return None
        return float(f"{value:.{digits}g}") if digits else float(value)
    if is_dataclass(value) and not isinstance(value, type):
        if digits and not hasattr(value, "KIND"):
            return {each.name: to_plain(getattr(value, each.name), digits=digits) for each in fields(value)}
        # A result within another is written as --json prints it.
        return record_of(value, full and not hasattr(value, "SCHEMA"))
    if hasattr(value, "tolist"):  # an array, or a number of NumPy, which is not imported to ask
        return to_plain(value.tolist(), full, digits)
    if isinstance(value, Mapping):
        return {str(key): to_plain(item, full, digits) for key, item in value.items()}
    if isinstance(value, tuple | list):
        return [to_plain(item, full, digits) for item in value]
    return str(value) if isinstance(value, Path) else value


def record_of(record: Any, full: bool) -> dict[str, Any]:
    """Return a record by its description; in ``full`` with what its file alone holds."""
    filed = getattr(record, "FILED", {}) if full else {}
    return {
        **marks_of(type(record)),
        **_entries(record, written(type(record)), full),
        **_entries(record, filed, full),
    }


def marks_of(kind: type) -> dict[str, Any]:
    """Return version and name of what has them."""
    known = {"schema": getattr(kind, "SCHEMA", None), "kind": getattr(kind, "KIND", None)}
    return {key: value for key, value in known.items() if value is not None}


def written(kind: type) -> Mapping[str, Any]:
    """Return which attribute of a record stands under which key."""
    return getattr(kind, "WRITTEN", None) or same(*(field.name for field in fields(kind)))


def _entries(record: Any, layout: Mapping[str, Any], full: bool) -> dict[str, Any]:
    entries = {}
    for key, place in layout.items():
        if isinstance(place, str):
            value = to_plain(reduce(_get, place.split("."), record), full)
        elif isinstance(place, tuple):
            value = [_entries(item, place[1], full) for item in getattr(record, place[0])]
        else:
            value = _entries(record, place, full)
        empty = value in (None, {}, [], "") or value is getattr(type(record), str(place), MISSING)
        if not (key.endswith("?") and empty):
            entries[key.removesuffix("?")] = value
    return entries


def _get(record: Any, name: str) -> Any:
    return None if record is None else getattr(record, name)


def from_plain(
    hint: Any, data: Any, place: str = "", exact: bool = True, layout: Mapping[str, Any] | None = None
) -> Any:
    """Return a value of a type from what :func:`to_plain` made of it.

    Parameters
    ----------
    hint : type
        Of a record, or of one of its fields.
    data : object
        As JSON holds them.
    place : str
        For messages.
    exact : bool
        Whether it is of a file by its description, where any number has to be known; else of one by its fields.
    layout : mapping, optional
        Of a record, or of each of a list; default: its own.

    Raises
    ------
    Misfit
    """
    marks = getattr(hint, "__metadata__", ())
    hint = get_args(hint)[0] if marks else hint
    origin, args = get_origin(hint), get_args(hint)
    if origin in (Union, UnionType):
        if data is None and NoneType in args:
            return None
        others = [each for each in args if each not in (NoneType, str)]
        text = (str in args and isinstance(data, str)) or not others
        return from_plain(str if text else others[0], data, place, exact)
    if is_dataclass(hint) and isinstance(hint, type):
        exact = exact or hasattr(hint, "KIND")
        own = written(hint) if exact else same(*(field.name for field in fields(hint)))
        found = fields_of(hint, data, layout or own, f"{place}." if place else "", exact)
        try:
            made: Any = hint(**found)
            return made.checked() if hasattr(hint, "checked") else made
        except Misfit:
            raise
        except ValueError as error:
            raise Misfit(place, str(error)) from None
    if (scalar := scalar_of_array(hint)) is not None:
        import numpy

        try:
            return numpy.array(data, dtype=scalar)
        except (TypeError, ValueError, OverflowError) as error:
            raise Misfit(place, str(error)) from None
    if origin is tuple:
        full = bool(data) or SOME not in marks
        _expect(place, isinstance(data, list) and full, data, "a list" + f", {SOME}" * (SOME in marks))
        hints = args[:1] * len(data) if args[-1] is Ellipsis else args
        _expect(place, len(data) == len(hints), data, f"{len(hints)} values")
        pairs = enumerate(zip(hints, data, strict=True), start=1)
        return tuple(from_plain(each, item, f"{place}.{n}", exact, layout) for n, (each, item) in pairs)
    if origin in (dict, Mapping):
        _expect(place, isinstance(data, Mapping), data, "a table")
        return {str(key): from_plain(args[1], item, f"{place}.{key}", exact) for key, item in data.items()}
    if origin is Literal:
        *first, last = map(repr, args)
        _expect(place, data in args, data, f"{', '.join(first)} or {last}" if first else last)
    elif hint is float and data is None and (UNKNOWN in marks or not exact):
        return math.nan
    elif hint in _WORDS:
        kinds = (float, int) if hint is float else hint
        known = isinstance(data, kinds) and (hint is bool or not isinstance(data, bool))
        if known and exact:
            # No number of a file is larger, and no text longer.
            small = len(data) <= 2000 if hint is str else abs(data) <= 1e200
            fits = all(PATTERNS[mark].fullmatch(data) for mark in marks if mark in PATTERNS)
            _expect(place, small, data, "a shorter text" if hint is str else "a finite number")
            _expect(place, fits and not (POSITIVE in marks and data < 0), data, ", ".join(marks))
        _expect(place, known, data, _WORDS[hint])
        return hint(data)
    return data


def _expect(place: str, known: bool, data: Any, words: str) -> None:
    if not known:
        raise Misfit(place, f"expected {words}, not {data!r:.60}")


def fields_of(
    kind: type, data: Any, layout: Mapping[str, Any], within: str = "", exact: bool = False
) -> dict[str, Any]:
    """Return the fields of a record that some entries hold, by their names; see :func:`from_plain`."""
    _expect(within[:-1], isinstance(data, Mapping), data, "a table")
    version, newest = data.get("schema", 1), getattr(kind, "SCHEMA", 1)
    _expect(f"{within}schema", not exact or version in range(1, newest + 1), version, f"{newest} at most")
    known = {key.removesuffix("?") for key in (*layout, *marks_of(kind), *getattr(kind, "FORMERLY", ()))}
    for key in data:
        if exact and key not in known:
            raise Misfit(within[:-1], f"unknown key {key!r}; {nearest(key, sorted(known), 'known keys:')}")
    hints = get_type_hints(kind, include_extras=True)
    optional = {f.name for f in fields(kind) if f.default is not MISSING or f.default_factory is not MISSING}
    found: dict[str, Any] = {}
    parts: dict[str, dict[str, Any]] = {}
    for key, where in ((key.removesuffix("?"), where) for key, where in layout.items()):
        name, own = where if isinstance(where, tuple) else (where, None)
        if key not in data:
            if isinstance(name, Mapping) or name not in optional:
                raise Misfit(within[:-1], f"key {key!r} is missing")
        elif isinstance(name, Mapping):
            found |= fields_of(kind, data[key], name, f"{within}{key}.", exact)
        elif "." in name:
            whole, _, part = name.partition(".")
            parts.setdefault(whole, {})[part] = data[key]
        else:
            found[name] = from_plain(hints[name], data[key], f"{within}{key}", exact, own)
    return found | {
        name: from_plain(hints[name], own, f"{within}{name}", exact) for name, own in parts.items()
    }


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


def first_complaint(error: ValidationError) -> str:
    """Turn pydantic's list into one sentence: the field, what was expected, what was given."""
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
    field = heading([str(part + 1) if isinstance(part, int) else part for part in place])
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
