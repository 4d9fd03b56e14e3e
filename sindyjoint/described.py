"""A result is described once, by its record: dictionary, JSON, JSON Schema and what it shows are made from that.

How it is described says :mod:`sindyjoint.plain`.
"""

from __future__ import annotations

import os
import re
import sys
from collections.abc import Mapping
from dataclasses import is_dataclass
from functools import cache, reduce
from inspect import cleandoc
from operator import or_
from pathlib import Path
from types import NoneType, SimpleNamespace, UnionType
from typing import TYPE_CHECKING, Any, Literal, Union, get_args, get_origin, get_type_hints

from sindyjoint.hooks import supplied
from sindyjoint.plain import (
    PATTERNS,
    POSITIVE,
    SOME,
    UNKNOWN,
    Maybe,
    marks_of,
    record_of,
    same,
    scalar_of_array,
    to_plain,
    written,
)

if TYPE_CHECKING:
    from matplotlib.axes import Axes

__all__ = ["Described", "Maybe", "Shown", "json_schema", "same", "to_plain"]

_TYPES = {str: "string", Path: "string", bool: "boolean", int: "integer", float: "number", NoneType: "null"}
_UNKNOWN = {"type": ["number", "null"]}
_ITEMS: dict[str, dict[str, Any]] = {"bool": {"type": "boolean"}, "float64": _UNKNOWN}
_MARKED: dict[str, dict[str, Any]] = {UNKNOWN: _UNKNOWN, POSITIVE: {"minimum": 0}, SOME: {"minItems": 1}}
_MARKED |= {mark: {"pattern": f"^{known.pattern}$"} for mark, known in PATTERNS.items()}


class Described:
    """A result with a dictionary and a JSON Schema, both of its description."""

    def to_dict(self, full: bool = False) -> dict[str, Any]:
        """Return what ``--json`` prints; in ``full`` what the file holds, too."""
        return record_of(self, full)


def json_schema(kind: type) -> dict[str, Any]:
    """Return the JSON Schema of a result: of what ``--json`` prints of it, and of its file."""
    definitions: dict[str, Any] = {}
    _schema_of(kind, definitions)
    return definitions.pop(kind.__name__) | {"$defs": definitions}


def _schema_of(hint: Any, definitions: dict[str, Any], more: str = "", layout: Any = None) -> dict[str, Any]:
    """Return the schema of a type, of which a docstring may say more; a record is defined once and referred to."""
    origin, args = get_origin(hint), get_args(hint)
    if hasattr(hint, "__metadata__"):
        marks = (_MARKED[mark] for mark in hint.__metadata__)
        return reduce(or_, marks, _schema_of(args[0], definitions, more, layout))
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
        return {"type": "array", "items": _schema_of(args[0], definitions, "", layout)}
    if origin in (dict, Mapping):
        return {"type": "object", "additionalProperties": _schema_of(args[1], definitions)}
    if is_dataclass(hint) and isinstance(hint, type):
        if layout:
            return _group_of(hint, layout, definitions)
        if hint.__name__ not in definitions:
            definitions[hint.__name__] = {}  # it may hold others of its kind
            definitions[hint.__name__] = _object_of(hint, definitions)
        return {"$ref": f"#/$defs/{hint.__name__}"}
    if hint is str and more.startswith("{"):
        return {"enum": re.findall(r'"([^"]*)"', more)}
    return {"type": _TYPES[hint]} if hint in _TYPES else {}


def _object_of(kind: type, definitions: dict[str, Any]) -> dict[str, Any]:
    known = _group_of(kind, written(kind), definitions)
    filed = _group_of(kind, getattr(kind, "FILED", {}), definitions)
    version: dict[str, Any] = {key: {"const": value} for key, value in marks_of(kind).items()}
    formerly: dict[str, Any] = {key: {} for key in getattr(kind, "FORMERLY", ())}
    return {
        "title": kind.__name__,
        "description": cleandoc(kind.__doc__ or "").split("\n")[0],
        **known,
        "properties": version | known["properties"] | filed["properties"] | formerly,
        "required": [*version, *known["required"]],
    }


def _group_of(kind: type, layout: Mapping[str, Any], definitions: dict[str, Any]) -> dict[str, Any]:
    properties = {}
    for key, place in layout.items():
        name, own = place if isinstance(place, tuple) else (place, None)
        if isinstance(name, str):
            hint, more, words = _type_at(kind, name)
            schema = _schema_of(hint, definitions, more, own) | ({"description": words} if words else {})
        else:
            schema = _group_of(kind, name, definitions)
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
    hints = get_type_hints(
        SimpleNamespace(__annotations__={name: annotation}),
        vars(sys.modules[owner.__module__]),
        include_extras=True,
    )
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
        return supplied("display").latex_of(self)

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
        return supplied("display").report(self, folder, force)
