"""Write the guide's page of every key of campaign.toml and rig.toml from the models that read them.

python docs/write_keys.py
"""

from __future__ import annotations

import typing
from collections.abc import Iterator
from pathlib import Path
from typing import Any

from pydantic import BaseModel
from pydantic.fields import FieldInfo

from sindyjoint.files.manifest import Manifest
from sindyjoint.mechanics.rig_file import RigFile

PAGE = Path(__file__).parent / "guide" / "keys.md"

HEAD = """\
# Every key of campaign.toml and rig.toml

A quantity is text with a unit, such as `"0.02 kg*m^2"`; any unit that pint knows is converted. A key without a kind
takes text; without a default it is empty, false or 0.
An unknown key is refused, and the nearest known one is named.
"""
FILES = {"campaign.toml": Manifest, "rig.toml": RigFile}
WORDS = {str: "text", int: "number", float: "number", bool: "boolean", type(None): ""}


def models(kind: Any) -> Iterator[type[BaseModel]]:
    """Yield the tables that a type is made of."""
    if isinstance(kind, type) and issubclass(kind, BaseModel):
        yield kind
    for part in typing.get_args(kind):
        yield from models(part)


def tables(root: type[BaseModel]) -> list[tuple[str, type[BaseModel]]]:
    """Return every table of a file once, with the key by which it is reached first."""
    found: list[tuple[str, type[BaseModel]]] = [("", root)]
    for name, table in found:
        for key, field in table.model_fields.items():
            for inner in models(field.annotation):
                if inner not in [known for _, known in found]:
                    found.append((f"{name}.{key}".lstrip("."), inner))
    return found


def kind_of(kind: Any) -> str:
    """Return what a key takes, in words."""
    if kind in WORDS:
        return WORDS[kind]
    if isinstance(kind, type) and issubclass(kind, BaseModel):
        return "table"
    arguments = typing.get_args(kind)
    if typing.get_origin(kind) is typing.Literal:
        return ", ".join(f'`"{value}"`' for value in arguments)
    if typing.get_origin(kind) is list:
        return f"list of {kind_of(arguments[0])}"
    if typing.get_origin(kind) is dict:
        return "table"
    return ", ".join(dict.fromkeys(filter(None, map(kind_of, arguments))))


def default_of(field: FieldInfo) -> str:
    """Return the default of a key: nothing where it may be left out without one."""
    if field.is_required():
        return "**required**"
    value = field.default
    if (
        field.default_factory
        or value is None
        or isinstance(value, BaseModel)
        or value in ("", {}, [], (), False, 0)
    ):
        return ""
    return f"`{value}`"


def row(key: str, field: FieldInfo) -> str:
    """Return the line of a key; that it takes text goes without saying."""
    kind = kind_of(field.annotation)
    return f"|`{key}`|{'' if kind == 'text' else kind}|{default_of(field)}|{field.description}|"


def section(name: str, table: type[BaseModel], named: dict[type[BaseModel], str]) -> str:
    """Return a table of keys; of one that extends another, what it adds."""
    text = " ".join((table.__doc__ or "").split("\n\n")[0].split())
    fields = table.model_fields
    for base in table.__mro__[1:]:
        if base in named:
            text += f" Keys of `[{named[base]}]`, and"
            fields = {key: field for key, field in fields.items() if key not in base.model_fields}
    title = f"### `[{name}]`\n\n" if name else ""
    rows = ["|key|takes|default|meaning|", "|-|-|-|-|", *(row(*each) for each in fields.items())]
    return f"{title}{text}\n\n" + "\n".join(rows) + "\n"


def page() -> str:
    """Return the page."""
    parts = [HEAD]
    for file, root in FILES.items():
        parts.append(f"## {file}\n")
        named: dict[type[BaseModel], str] = {}
        for name, table in tables(root):
            parts.append(section(name, table, named))
            named[table] = name
    return "\n".join(parts)


if __name__ == "__main__":
    PAGE.write_text(page(), encoding="utf-8")
