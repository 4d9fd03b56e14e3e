"""A result is described once, by its record: dictionary, JSON, JSON Schema and what it shows are made from that.

A record is a frozen dataclass; each of its fields is an entry of its dictionary. Where the two differ, ``WRITTEN`` says
which attribute stands under which key, or which keys of its own a key holds::

    WRITTEN = {**same("equation"), "tested": {"angle": "tested_angle"}, "rig": "rig.name", "inputs?": "inputs"}

A key with a question mark is left out where there is nothing under it. ``FILED`` are entries of the result's file that
``--json`` does not print, ``SCHEMA`` is the version. Types are those of the annotations, words, units and shapes those
of the docstrings.
"""

from __future__ import annotations

import math
import os
import re
import sys
from collections.abc import Mapping
from dataclasses import fields, is_dataclass
from functools import cache, reduce
from inspect import cleandoc
from pathlib import Path
from types import NoneType, SimpleNamespace, UnionType
from typing import TYPE_CHECKING, Annotated, Any, Literal, Union, get_args, get_origin, get_type_hints

from sindyjoint.hooks import supplied

if TYPE_CHECKING:
    from matplotlib.axes import Axes

# A number that need not be known: NaN in a record, null in its dictionary.
Maybe = Annotated[float, "null where it is not known"]

_TYPES = {str: "string", Path: "string", bool: "boolean", int: "integer", float: "number", NoneType: "null"}
_UNKNOWN = {"type": ["number", "null"]}
_ITEMS: dict[str, dict[str, Any]] = {"bool": {"type": "boolean"}, "float64": _UNKNOWN}


def same(*names: str) -> dict[str, str]:
    """Return entries that stand under the names of their attributes."""
    return {name: name for name in names}


class Described:
    """A result with a dictionary and a JSON Schema, both of its description."""

    def to_dict(self, full: bool = False) -> dict[str, Any]:
        """Return what ``--json`` prints; in ``full`` what the file holds, too."""
        return _record(self, full)


def to_plain(value: Any, full: bool = False) -> Any:
    """Return data as JSON holds them: records by their description, numbers that are not finite as null."""
    if is_dataclass(value) and not isinstance(value, type):
        # A result within another is written as --json prints it.
        return _record(value, full and not hasattr(value, "SCHEMA"))
    if hasattr(value, "tolist"):  # an array, or a number of NumPy, which is not imported to ask
        return to_plain(value.tolist())
    if isinstance(value, Mapping):
        return {str(key): to_plain(item, full) for key, item in value.items()}
    if isinstance(value, tuple | list):
        return [to_plain(item, full) for item in value]
    if isinstance(value, float):
        return value if math.isfinite(value) else None
    return str(value) if isinstance(value, Path) else value


def _record(record: Any, full: bool) -> dict[str, Any]:
    version = {"schema": record.SCHEMA} if hasattr(record, "SCHEMA") else {}
    filed = getattr(record, "FILED", {}) if full else {}
    return {**version, **_entries(record, _written(type(record)), full), **_entries(record, filed, full)}


def _written(kind: type) -> Mapping[str, Any]:
    return getattr(kind, "WRITTEN", None) or same(*(field.name for field in fields(kind)))


def _entries(record: Any, layout: Mapping[str, Any], full: bool) -> dict[str, Any]:
    entries = {}
    for key, place in layout.items():
        if isinstance(place, str):
            value = to_plain(reduce(_get, place.split("."), record), full)
        else:
            value = _entries(record, place, full)
        if not (key.endswith("?") and value in (None, {}, [], "")):
            entries[key.removesuffix("?")] = value
    return entries


def _get(record: Any, name: str) -> Any:
    return None if record is None else getattr(record, name)


def json_schema(kind: type) -> dict[str, Any]:
    """Return the JSON Schema of a result: of what ``--json`` prints of it, and of its file."""
    definitions: dict[str, Any] = {}
    _schema_of(kind, definitions)
    return definitions.pop(kind.__name__) | {"$defs": definitions}


def scalar_of_array(hint: Any) -> type | None:
    """Return of which scalars an array is, by its type; None where that is no array's."""
    if getattr(get_origin(hint), "__name__", "") not in ("ndarray", "NDArray"):
        return None
    # From numpy 2.5 on NDArray[scalar] is a name of its own; before, it is ndarray[shape, dtype[scalar]].
    last = get_args(hint)[-1]
    return (get_args(last) or (last,))[0]


def _schema_of(hint: Any, definitions: dict[str, Any], more: str = "") -> dict[str, Any]:
    """Return the schema of a type, of which a docstring may say more; a record is defined once and referred to."""
    origin, args = get_origin(hint), get_args(hint)
    if hint == Maybe:
        return _UNKNOWN
    if origin is Literal:
        return {"enum": list(args)}
    if origin in (Union, UnionType):
        return {"anyOf": [_schema_of(each, definitions, more) for each in args]}
    if (scalar := scalar_of_array(hint)) is not None:
        schema: dict[str, Any] = _ITEMS[scalar.__name__.rstrip("_")]
        shape = re.search(r"shape \(([^)]*)\)", more)
        for _ in filter(str.strip, shape[1].split(",") if shape else "n"):
            schema = {"type": "array", "items": schema}
        return schema
    if origin is tuple and args[-1] is not Ellipsis:
        items = [_schema_of(each, definitions) for each in args]
        return {"type": "array", "prefixItems": items, "minItems": len(items), "maxItems": len(items)}
    if origin in (tuple, list):
        return {"type": "array", "items": _schema_of(args[0], definitions)}
    if origin in (dict, Mapping):
        return {"type": "object", "additionalProperties": _schema_of(args[1], definitions)}
    if is_dataclass(hint) and isinstance(hint, type):
        if hint.__name__ not in definitions:
            definitions[hint.__name__] = {}  # it may hold others of its kind
            definitions[hint.__name__] = _object_of(hint, definitions)
        return {"$ref": f"#/$defs/{hint.__name__}"}
    if hint is str and more.startswith("{"):
        return {"enum": re.findall(r'"([^"]*)"', more)}
    return {"type": _TYPES[hint]} if hint in _TYPES else {}


def _object_of(kind: type, definitions: dict[str, Any]) -> dict[str, Any]:
    known = _group_of(kind, _written(kind), definitions)
    filed = _group_of(kind, getattr(kind, "FILED", {}), definitions)
    version = {"schema": {"const": kind.SCHEMA}} if hasattr(kind, "SCHEMA") else {}
    return {
        "title": kind.__name__,
        "description": cleandoc(kind.__doc__ or "").split("\n")[0],
        **known,
        "properties": version | known["properties"] | filed["properties"],
        "required": [*version, *known["required"]],
    }


def _group_of(kind: type, layout: Mapping[str, Any], definitions: dict[str, Any]) -> dict[str, Any]:
    properties = {}
    for key, place in layout.items():
        if isinstance(place, str):
            hint, more, words = _type_at(kind, place)
            schema = _schema_of(hint, definitions, more) | ({"description": words} if words else {})
        else:
            schema = _group_of(kind, place, definitions)
        properties[key.removesuffix("?")] = schema
    return {
        "type": "object",
        "properties": properties,
        "required": [key for key in layout if not key.endswith("?")],
        "additionalProperties": False,
    }


def _type_at(kind: Any, place: str) -> tuple[Any, str, str]:
    """Return the type of an attribute, or an attribute's attribute, what its docstring adds to that, and its words."""
    optional = False
    for name in place.split("."):
        hint, more, words = _attribute(kind, name)
        present = [each for each in get_args(hint) if each is not NoneType]
        if get_origin(hint) in (Union, UnionType) and len(present) == 1:
            optional, hint = True, present[0]
        kind = hint
    return (hint | None if optional else hint), more, words


def _attribute(kind: type, name: str) -> tuple[Any, str, str]:
    owner = next(
        o for o in kind.__mro__ if name in o.__dict__ or name in o.__dict__.get("__annotations__", {})
    )
    found = owner.__dict__.get(name)
    getter = getattr(found, "fget", None) or getattr(found, "func", None)
    if getter is None:
        annotation = owner.__annotations__[name]
        more, words = _words(owner).get(name, ("", ""))
    else:
        annotation = getter.__annotations__["return"]
        more = words = cleandoc(getter.__doc__ or "").split("\n\n")[0]
    named = SimpleNamespace(__annotations__={name: annotation})
    hints = get_type_hints(named, vars(sys.modules[owner.__module__]), include_extras=True)
    return hints[name], more, " ".join(words.split())


@cache
def _words(kind: type) -> dict[str, tuple[str, str]]:
    """Return what a docstring says of each field: its type, with shape or choices, and its unit and meaning."""
    text = cleandoc(kind.__doc__ or "").partition("Parameters\n----------\n")[2]
    entry = re.compile(r"^(\w[\w, ]*?)(?: : (.*))?$((?:\n(?: .*)?)*)", re.MULTILINE)
    return {name: (type, words) for names, type, words in entry.findall(text) for name in names.split(", ")}


class Shown(Described):
    """A result that shows itself.

    ``str`` gives what the command line prints, a notebook shows the equation and the main table, and ``figures`` lists
    what :meth:`plot` draws.
    """

    def __str__(self) -> str:
        return str(supplied("display").text_of(self))

    def __repr__(self) -> str:
        return str(supplied("display").line_of(self))

    def _repr_html_(self) -> str:
        return str(supplied("display").html_of(self))

    def _repr_latex_(self) -> str | None:
        found: str | None = supplied("display").latex_of(self)
        return found

    @property
    def figures(self) -> tuple[str, ...]:
        """Names of the figures that :meth:`plot` draws of this result."""
        return tuple(supplied("display").figures_of(self))

    def plot(self, kind: str | None = None, ax: Axes | None = None) -> Any:
        """Draw a figure of the result.

        Parameters
        ----------
        kind : str, optional
            One of ``figures``. Default: the first of them.
        ax : matplotlib Axes, optional
            Draw into these axes, for kinds that have one panel.

        Returns
        -------
        matplotlib Figure, or the axes that were given

        Raises
        ------
        UnknownNameError
            For an unknown kind, or one that the result cannot show.
        InputError
            For axes and a kind with several panels.
        """
        return supplied("display").plot(self, kind, ax)

    def to_frame(self) -> Any:
        """Return the main table as a pandas data frame, numbers in SI units.

        Raises
        ------
        MissingExtraError
            Without pandas.
        """
        return supplied("display").frame_of(self)

    def report(self, folder: str | os.PathLike[str], force: bool = False) -> Path:
        """Write page, record, tables and figures into a folder, as the command line does with ``--out``.

        Parameters
        ----------
        folder : path
        force : bool
            Replace files of the same names that were not written so, or were changed since.

        Returns
        -------
        Path
            The folder that they stand in: one within, where results of another kind came first.

        Raises
        ------
        OutputError
            If the folder cannot be written, or holds other files of these names.
        """
        path: Path = supplied("display").report(self, folder, force)
        return path
