"""One small reader per file format, chosen by the file's ending.

Each returns a :class:`~sindyjoint.files.readers.table.Table` of named columns, or says in one sentence what
is wrong with the file. A new format is one function and one line in ``READERS``.
"""

from __future__ import annotations

import difflib
import hashlib
import os
from contextlib import suppress
from functools import lru_cache
from importlib import import_module
from pathlib import Path
from typing import Any

from sindyjoint.documents import check_regular, read_regular
from sindyjoint.errors import InputError, MissingInputError
from sindyjoint.files.readers.table import Table, check_bytes

# ending -> module, function; the modules import their libraries when a file of that kind is met.
READERS = {
    **dict.fromkeys((".csv", ".tsv", ".txt", ".dat", ".asc"), ("text", "read_text")),
    ".lvm": ("recorders", "read_lvm"),
    ".xlsx": ("sheets", "read_xlsx"),
    ".json": ("sheets", "read_json"),
    ".parquet": ("arrow", "read_parquet"),
    ".feather": ("arrow", "read_feather"),
    ".mat": ("mat", "read_mat"),
    **dict.fromkeys((".h5", ".hdf5"), ("arrays", "read_hdf5")),
    ".npz": ("arrays", "read_npz"),
    ".npy": ("arrays", "read_npy"),
    **dict.fromkeys((".uff", ".unv"), ("recorders", "read_uff")),
    ".tdms": ("recorders", "read_tdms"),
}
# What reads segments of rows as well; of NPZ, MATLAB v5 and universal files the libraries load all or nothing.
IN_SEGMENTS = ("read_text", "read_parquet", "read_feather", "read_mat", "read_hdf5", "read_npy", "read_tdms")
# Readers of files that may have lines above their table.
WITH_PREAMBLE = ("read_text", "read_xlsx")


def read_table(path: str | Path, skip: int | None = None) -> tuple[Table, str]:
    """Open one data file.

    Parameters
    ----------
    path : path-like
    skip : int, optional
        Lines above the header, of a text table or a sheet. Default: found.

    Returns
    -------
    table : Table
        Its named columns.
    sha256 : str
        Hash of the bytes that were read.

    Raises
    ------
    MissingInputError
        When there is no such file.
    InputError
        For a folder, an unknown ending, or content that cannot be read.
    MissingExtraError
        When the library for this format is not installed.
    """
    file = Path(path)
    # os.path says no where pathlib raises: names too long, folders that may not be entered.
    if os.path.isdir(file):
        raise InputError(f"{file}: is a folder; expected a data file")
    if not os.path.exists(file):
        there = os.listdir(file.parent) if os.path.isdir(file.parent) else []
        near = difflib.get_close_matches(file.name, there, n=1)
        hint = f"; did you mean {near[0]!r}?" if near else ""
        raise MissingInputError(f"{file}: there is no such file{hint}")
    if file.suffix.lower() not in READERS:
        known = ", ".join(ending.removeprefix(".") for ending in READERS)
        raise InputError(f"{file}: ending {file.suffix!r} is unknown; expected one of {known}")
    with suppress(OSError):
        check_bytes(file, check_regular(file))
    data = read_regular(file)
    if not data:
        raise InputError(f"{file}: is empty")
    if skip is not None and READERS[file.suffix.lower()][1] not in WITH_PREAMBLE:
        raise InputError(f"{file}: skip = {skip} was given; only text tables and sheets have lines to skip")
    return _read(file, data, skip), hashlib.sha256(data).hexdigest()


def open_blocks(path: str | Path, skip: int | None = None) -> Table | None:
    """Open a file that may be larger than memory, to be read in segments of rows; None for a format that cannot be.

    Of a text table, ``skip`` lines stand above the header; without it they are found.

    A file that has not changed stays open: the line offsets of a text are then indexed once per process.

    Raises
    ------
    InputError
        For a file that is not what its ending says.
    MissingExtraError
        When the library for this format is not installed.
    """
    file = Path(path)
    try:
        check_regular(file)
        found = file.stat()
        return _open(file, (found.st_mtime_ns, found.st_size), skip)
    except OSError as error:
        raise InputError(f"{file}: cannot be read ({error.strerror or error})") from error


@lru_cache(maxsize=4)
def _open(file: Path, state: tuple[int, int], skip: int | None) -> Table | None:
    _, function = READERS.get(file.suffix.lower(), ("", ""))
    own = skip if function in WITH_PREAMBLE else None
    return _read(file, None, own) if function in IN_SEGMENTS else None


def _read(file: Path, data: bytes | None, skip: int | None) -> Any:
    """Call the reader of a file, of all its bytes or, without them, of the parts that are asked for."""
    module, function = READERS[file.suffix.lower()]
    options = {} if skip is None else {"skip": skip}
    return getattr(import_module(f"{__name__}.{module}"), function)(file, data, **options)


def sha256_of(path: Path) -> str:
    """Return the hash of a file that is read in pieces."""
    with path.open("rb") as file:
        return hashlib.file_digest(file, "sha256").hexdigest()
