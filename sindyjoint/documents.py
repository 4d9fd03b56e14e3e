"""Small text documents, TOML and JSON, from files that may be damaged or hostile: read within bounds, or refused.

Whatever comes out of here is safe to walk through, to compute with and to print: no nesting that ends the stack, no
integer that is no number, no sign that a terminal takes for a command.

``SHA256SUMS`` of a folder of results says which files belong together, for every reader and for ``sha256sum --check``.
It is written last. While new files take the place of old ones its first line says so, and a reader refuses the folder:
what an interrupted run left, old and new files mixed, is never taken for a result.

Files of one kind of result stand below a line that names it, so that the next result of that kind replaces them all,
and nothing else. A file that is not listed, or is not as it was written, belongs to the user.
"""

import hashlib
import json
import os
import re
import stat
import tomllib
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from types import MappingProxyType
from typing import Any

from sindyjoint.errors import InputError, OutputError
from sindyjoint.text import control_character

# A campaign of ten thousand runs is a megabyte of TOML; the data of a page of figures a few megabytes of JSON.
LARGEST = {"TOML": 1 << 23, "JSON": 1 << 28}
DEEPEST = 40
# tomllib works through a dotted key in a time that grows with its square.
_LONG_KEY = re.compile(r"""(?<![\w-])(?:(?:[\w-]++|"[^"\n]*+"|'[^'\n]*+')[ \t]*+\.[ \t]*+){32}""")
SUMS = "SHA256SUMS"
UNFINISHED = "# unfinished: results are being written, or their writing was interrupted"
KIND = "# results: "
# The folder of pictures has no list of its own.
INNER = "figures"
_LINE = re.compile(r"([0-9a-f]{64})  ([^\x00-\x1f]+)")


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
    return parse_toml(_decoded(read_regular(path, LARGEST["TOML"]), called, "; save it as UTF-8"), called)


def _decoded(data: bytes, called: str, remedy: str = "") -> str:
    try:
        return data.decode("utf-8-sig")
    except UnicodeDecodeError as error:
        raise InputError(f"{called}: is not UTF-8 text (byte {error.start}){remedy}") from None


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


def _check_tree(content: Any, called: str, deeper: int = DEEPEST - 1) -> None:
    """Refuse what no document of this program holds; so many levels may be ``deeper``."""
    if isinstance(content, str):
        found = control_character(content)
        if found is not None:
            raise InputError(
                f"{called}: the text {content!r:.60} holds the control character U+{ord(found):04X}; take it out"
            )
    elif isinstance(content, dict | list):
        if content and not deeper:
            raise InputError(f"{called}: is nested deeper than {DEEPEST} levels")
        for item in (*content, *content.values()) if isinstance(content, dict) else content:
            if not isinstance(item, float):  # of which the data of a page are full
                _check_tree(item, called, deeper - 1)
    elif isinstance(content, int) and abs(content) >= 1 << 63:
        raise InputError(
            f"{called}: holds an integer of {len(f'{content:x}')} hexadecimal digits; expected one that a computer "
            "counts with"
        )


@dataclass(frozen=True)
class Listed:
    """What a folder of results lists.

    Parameters
    ----------
    sums, kinds : dict of str to str
        Hash of each file, and of which kind of result it is; empty for a file of no kind.
    finished : bool
        Whether their writing was.
    """

    sums: dict[str, str] = field(default_factory=dict)
    kinds: dict[str, str] = field(default_factory=dict)
    finished: bool = True


def read_list(folder: Path, damaged: bool = False) -> Listed:
    """Return what a folder lists; of a ``damaged`` list, what of it can be read.

    Raises
    ------
    InputError
        For a list that cannot be read.
    """
    path, kind = folder / SUMS, ""
    if not path.is_file():
        return Listed()
    lines = read_regular(path, 1 << 24).decode("utf-8", errors="replace").split("\n")
    found = Listed(finished=lines[0] != UNFINISHED)
    for line in lines:
        match = _LINE.fullmatch(line)
        if match:
            found.sums[match[2]], found.kinds[match[2]] = match[1], kind
        elif line.startswith(KIND):
            kind = line.removeprefix(KIND)
        elif line not in ("", UNFINISHED) and not damaged:
            raise InputError(
                f"{path}: is no list of hashes; it was changed or damaged: run the command again with --force, or in "
                "another folder"
            )
    return found


def sums_of(folder: Path) -> dict[str, str]:
    """Return the SHA-256 of every file in a folder, by its path within; without the list itself."""
    files = sorted(path for path in folder.rglob("*") if path.is_file() and path != folder / SUMS)
    return {path.relative_to(folder).as_posix(): hash_file(path) for path in files}


def hash_file(path: Path) -> str:
    """Return the SHA-256 of a regular file, read in pieces; "missing" where there is none."""
    try:
        check_regular(path)
        with path.open("rb") as file:
            return hashlib.file_digest(file, "sha256").hexdigest()
    except (OSError, InputError):
        return "missing"


def sums_text(
    sums: Mapping[str, str], finished: bool = True, kinds: Mapping[str, str] = MappingProxyType({})
) -> str:
    """Return the text of the list; ``kinds`` says of which kind of result a file is."""
    lines = [] if finished else [UNFINISHED]
    for kind in sorted({kinds.get(name, "") for name in sums}):
        lines += [f"{KIND}{kind}"] * bool(kind)
        lines += [f"{digest}  {name}" for name, digest in sorted(sums.items()) if kinds.get(name, "") == kind]
    return "\n".join([*lines, ""])


def kind_of_results(folder: Path) -> str:
    """Return which kind of result with a page stands in a folder itself; empty where none does."""
    return read_list(folder, damaged=True).kinds.get("report.html", "")


def find_foreign(folder: Path, names: Iterable[str], kind: str = "") -> list[str]:
    """Return which of some files are there and are not a result of this kind as it was written."""
    try:
        known = read_list(folder)
    except InputError:
        known = Listed()

    def is_own(name: str) -> bool:
        # Of what was interrupted, no hash is known that a file must have.
        written = not known.finished or hash_file(folder / name) == known.sums[name]
        return known.kinds[name] == kind and written

    present = [name for name in names if (folder / name).is_file()]
    return [name for name in present if not (name in known.sums and is_own(name))]


def read_checked(path: Path, largest: int | None = None) -> bytes:
    """Return the bytes of a file of results; where its folder lists hashes it must be the file that was written.

    Raises
    ------
    InputError
        For a file that was changed since, a folder whose writing was interrupted, or what is no regular file.
    """
    folder = path.parent.parent if path.parent.name == INNER else path.parent
    known = check_finished(folder)
    data = read_regular(path, largest)
    expected = known.get(path.relative_to(folder).as_posix())
    if expected is not None and hashlib.sha256(data).hexdigest() != expected:
        raise InputError(
            f"{path}: is not the file that was written (its hash is not that of {SUMS}); run the command again with "
            f"--force, or, if the change is meant, put the file into another folder"
        )
    return data


def check_finished(folder: Path) -> dict[str, str]:
    """Return the hashes that a folder lists; refuse one whose writing was interrupted.

    Raises
    ------
    InputError
    """
    known = read_list(folder)
    if not known.finished:
        raise InputError(
            f"{folder}: writing these results was interrupted, old and new files are mixed; run the command again"
        )
    return known.sums


def read_json(path: Path) -> Any:
    """Return what a JSON file of results holds; see :func:`read_checked`.

    Raises
    ------
    InputError
    """
    return parse_json(_decoded(read_checked(path, LARGEST["JSON"]), str(path)), str(path))


def changed_files(folder: Path) -> list[str]:
    """Return what of a folder is not as it was written, a sentence each.

    Raises
    ------
    InputError
        For a list that cannot be read.
    """
    known = read_list(folder)
    if not (folder / SUMS).is_file():
        return [f"{SUMS} is missing"]
    return list_changes(folder, known.sums) if known.finished else ["its writing was interrupted"]


def list_changes(folder: Path, sums: Mapping[str, str]) -> list[str]:
    """Return which files are missing or have another hash, a sentence each."""
    states = {name: hash_file(folder / name) for name in sums}
    return [
        f"{name} is missing" if states[name] == "missing" else f"{name} was changed"
        for name, digest in sums.items()
        if states[name] != digest
    ]


def refuse_foreign_file(path: str | os.PathLike[str], force: bool) -> None:
    """Raise OutputError where a file is there that no command of this package wrote, as its text does not name it."""
    target = Path(path)
    if force or not target.is_file():
        return
    with target.open("rb") as file:
        # Every figure and export says of its origin in its first bytes.
        known = b"sindyjoint" in file.read(1 << 20)
    if not known:
        raise OutputError(
            f"cannot write {str(target)!r}: a file that sindyjoint did not write is there; choose another name, or "
            "replace it with --force (force=True)"
        )
