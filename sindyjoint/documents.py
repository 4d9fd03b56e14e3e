"""Small text documents, TOML and JSON, from files that may be damaged or hostile: read within bounds, or refused.

Whatever comes out of here is safe to walk through, to compute with and to print: no nesting that ends the stack, no
integer that is no number, no sign that a terminal takes for a command.
"""

from __future__ import annotations

import json
import os
import re
import stat
import tomllib
from pathlib import Path
from typing import Any

from sindyjoint.errors import InputError
from sindyjoint.text import control_character

# A campaign of ten thousand runs is a megabyte of TOML; the data of a page of figures a few megabytes of JSON.
LARGEST = {"TOML": 1 << 23, "JSON": 1 << 28}
DEEPEST = 40
LARGEST_INTEGER = 1 << 63
# tomllib works through a dotted key in a time that grows with its square.
_LONG_KEY = re.compile(r"""(?<![\w-])(?:(?:[\w-]++|"[^"\n]*+"|'[^'\n]*+')[ \t]*+\.[ \t]*+){32}""")


def read_regular(path: Path, largest: int | None = None) -> bytes:
    """Return the bytes of a regular file: of a device or a pipe there may be no end.

    Raises
    ------
    InputError
        For anything else than a regular file, one of more than ``largest`` bytes, and one that cannot be read.
    """
    try:
        size = check_regular(path)
        if largest is not None and size > largest:
            raise InputError(f"{path}: has {size} bytes; expected at most {largest}")
        with open(path, "rb") as file:
            return file.read()
    except OSError as error:
        raise InputError(f"{path}: cannot be read ({error.strerror or error})") from None


def check_regular(path: Path) -> int:
    """Return the size of a regular file; refuse a device, a pipe, a socket.

    Raises
    ------
    InputError
    OSError
        Where there is no such file.
    """
    found = os.stat(path)
    if not stat.S_ISREG(found.st_mode):
        raise InputError(f"{path}: is no regular file (a device, a pipe or a folder); expected a file")
    return found.st_size


def read_toml(path: Path, name: str | None = None) -> dict[str, Any]:
    """Return the tables of a TOML file.

    Parameters
    ----------
    path : Path
    name : str, optional
        What messages call it; the path if omitted.

    Raises
    ------
    InputError
        For a file that is no TOML, or beyond the bounds of a document.
    """
    called = str(path) if name is None else name
    data = read_regular(path, LARGEST["TOML"])
    try:
        text = data.decode("utf-8-sig")
    except UnicodeDecodeError as error:
        raise InputError(f"{called}: is not UTF-8 text (byte {error.start}); save it as UTF-8") from None
    return parse_toml(text, called)


def parse_toml(text: str, called: str) -> dict[str, Any]:
    """Return the tables of a TOML text; see :func:`read_toml`."""
    if _LONG_KEY.search(text):
        raise InputError(f"{called}: is not valid TOML for this program: a key has more than 32 parts")
    try:
        content = tomllib.loads(text)
    # ValueError: of integers with thousands of digits, of dates that there are not.
    except (ValueError, RecursionError) as error:
        raise InputError(f"{called}: is not valid TOML: {_on_a_line(error)}") from None
    _check_tree(content, called)
    return content


def parse_json(text: str, called: str) -> Any:
    """Return the content of a JSON text.

    Raises
    ------
    InputError
        For a text that is no JSON, or beyond the bounds of a document.
    """
    try:
        content = json.loads(text, object_pairs_hook=without_repetition)
    except RecursionError:
        raise InputError(f"{called}: is nested too deeply") from None
    except ValueError as error:
        raise InputError(f"{called}: is not JSON ({_on_a_line(error)})") from None
    _check_tree(content, called)
    return content


def without_repetition(pairs: list[tuple[str, Any]]) -> dict[str, Any]:
    """Return a JSON object; a key that occurs twice, of which JSON would keep the last in silence, is refused."""
    found = dict(pairs)
    if len(found) < len(pairs):
        keys = [key for key, _ in pairs]
        raise ValueError(f"the key {next(key for key in keys if keys.count(key) > 1)!r:.60} is there twice")
    return found


def _on_a_line(error: Exception) -> str:
    if isinstance(error, RecursionError):
        return "nested too deeply"
    return " ".join(str(error).split())[:200]


def _check_tree(content: Any, called: str) -> None:
    """Refuse what no document of this program holds, without recursion."""
    level: list[Any] = [content]
    for _ in range(DEEPEST):
        inner: list[Any] = []
        for item in level:
            if isinstance(item, dict):
                for key in item:
                    _check_text(key, called)
                inner += item.values()
            elif isinstance(item, list):
                inner += item
            elif isinstance(item, str):
                _check_text(item, called)
            elif isinstance(item, int) and abs(item) >= LARGEST_INTEGER:
                raise InputError(f"{called}: holds an integer of {len(f'{item:x}')} hexadecimal digits; expected one "
                                 "that a computer counts with")  # fmt: skip
        if not inner:
            return
        level = inner
    raise InputError(f"{called}: is nested deeper than {DEEPEST} levels")


def _check_text(text: str, called: str) -> None:
    found = control_character(text)
    if found is not None:
        raise InputError(
            f"{called}: the text {text!r:.60} holds the control character U+{ord(found):04X}; take it out"
        )
