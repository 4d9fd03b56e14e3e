"""``SHA256SUMS`` of a folder of results: which files belong together, for every reader and for ``sha256sum --check``.

It is written last. While new files take the place of old ones its first line says so, and a reader refuses the folder:
what an interrupted run left, old and new files mixed, is never taken for a result.

Files of one kind of result stand below a line that names it, so that the next result of that kind replaces them all,
and nothing else. A file that is not listed, or is not as it was written, belongs to the user.
"""

from __future__ import annotations

import hashlib
import os
import re
from collections.abc import Iterable, Mapping
from pathlib import Path
from types import MappingProxyType
from typing import Any

from sindyjoint.documents import LARGEST, check_regular, parse_json, read_regular
from sindyjoint.errors import InputError, OutputError

SUMS = "SHA256SUMS"
UNFINISHED = "# unfinished: results are being written, or their writing was interrupted"
KIND = "# results: "
# The folder of pictures has no list of its own.
INNER = "figures"
_LINE = re.compile(r"([0-9a-f]{64})  ([^\x00-\x1f]+)")
_LARGEST = 1 << 24
# What every figure and export says of its origin, in its first bytes.
_MARK, _MARKED = b"sindyjoint", 1 << 20


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


def read_sums(folder: Path) -> tuple[dict[str, str], bool] | None:
    """Return the hashes that a folder lists and whether its writing was finished; None where it has no list.

    Raises
    ------
    InputError
        For a list that cannot be read.
    """
    lines = _read_lines(folder)
    if not lines:
        return None
    finished = lines[0] != UNFINISHED
    found = [
        _LINE.fullmatch(line) for line in lines if line not in ("", UNFINISHED) and not line.startswith(KIND)
    ]
    if None in found:
        raise InputError(
            f"{folder / SUMS}: is no list of hashes; it was changed or damaged: run the command again with --force, or "
            "in another folder"
        )
    return {match[2]: match[1] for match in found if match}, finished


def _read_lines(folder: Path) -> list[str]:
    """Return the lines of a list; none where there is no list."""
    path = folder / SUMS
    return (
        read_regular(path, _LARGEST).decode("utf-8", errors="replace").split("\n") if path.is_file() else []
    )


def list_kinds(folder: Path) -> dict[str, str]:
    """Return of which kind of result each file is that a folder lists; empty for a file of no kind."""
    kinds, kind = {}, ""
    for line in _read_lines(folder):
        if line.startswith(KIND):
            kind = line.removeprefix(KIND)
        elif match := _LINE.fullmatch(line):
            kinds[match[2]] = kind
    return kinds


def kind_of_results(folder: Path) -> str:
    """Return which kind of result with a page stands in a folder itself; empty where none does."""
    return list_kinds(folder).get("report.html", "")


def find_foreign(folder: Path, names: Iterable[str], kind: str = "") -> list[str]:
    """Return which of some files are there and are not a result of this kind as it was written."""
    try:
        known = read_sums(folder)
    except InputError:
        known = None
    sums, finished = known or ({}, True)
    kinds = list_kinds(folder)

    def is_own(name: str) -> bool:
        # Of what was interrupted, no hash is known that a file must have.
        return (
            kinds.get(name) == kind
            and name in sums
            and not (finished and hash_file(folder / name) != sums[name])
        )

    return [name for name in names if (folder / name).is_file() and not is_own(name)]


def check_finished(folder: Path) -> dict[str, str]:
    """Return the hashes that a folder lists; refuse one whose writing was interrupted.

    Raises
    ------
    InputError
    """
    known = read_sums(folder)
    if known is None:
        return {}
    if not known[1]:
        raise InputError(
            f"{folder}: writing these results was interrupted, old and new files are mixed; run the command again"
        )
    return known[0]


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


def read_json(path: Path) -> Any:
    """Return what a JSON file of results holds; see :func:`read_checked`.

    Raises
    ------
    InputError
    """
    try:
        text = read_checked(path, LARGEST["JSON"]).decode("utf-8-sig")
    except UnicodeDecodeError as error:
        raise InputError(f"{path}: is not UTF-8 text (byte {error.start})") from None
    return parse_json(text, str(path))


def changed_files(folder: Path) -> list[str]:
    """Return what of a folder is not as it was written, a sentence each.

    Raises
    ------
    InputError
        For a list that cannot be read.
    """
    known = read_sums(folder)
    if known is None:
        return [f"{SUMS} is missing"]
    if not known[1]:
        return ["its writing was interrupted"]
    states = {name: hash_file(folder / name) for name in known[0]}
    return [
        f"{name} is missing" if states[name] == "missing" else f"{name} was changed"
        for name, digest in known[0].items()
        if states[name] != digest
    ]


def refuse_foreign_file(path: str | os.PathLike[str], force: bool) -> None:
    """Raise OutputError where a file is there that no command of this package wrote, as its text does not name it."""
    target = Path(path)
    if force or not target.is_file():
        return
    with target.open("rb") as file:
        known = _MARK in file.read(_MARKED)
    if not known:
        raise OutputError(
            f"cannot write {str(target)!r}: a file that sindyjoint did not write is there; choose another name, or "
            "replace it with --force (force=True)"
        )
