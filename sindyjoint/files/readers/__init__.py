"""One small reader per file format, chosen by the file's ending.

Each returns a :class:`~sindyjoint.files.readers.table.Table` of named columns, or says in one sentence what
is wrong with the file. A new format is one small module and one line in ``READERS``.
"""

from __future__ import annotations

import difflib
import hashlib
import os
from contextlib import suppress
from importlib import import_module
from pathlib import Path

from sindyjoint.documents import check_regular, read_regular
from sindyjoint.errors import InputError, MissingInputError
from sindyjoint.files.limits import check_bytes
from sindyjoint.files.readers.table import Table

# ending -> module, function; the modules import their libraries when a file of that kind is met.
READERS = {
    ".csv": ("text", "read_text"),
    ".tsv": ("text", "read_text"),
    ".txt": ("text", "read_text"),
    ".dat": ("text", "read_text"),
    ".asc": ("text", "read_text"),
    ".lvm": ("lvm", "read_lvm"),
    ".xlsx": ("excel", "read_xlsx"),
    ".json": ("json_columns", "read_json"),
    ".parquet": ("arrow", "read_parquet"),
    ".feather": ("arrow", "read_feather"),
    ".mat": ("mat", "read_mat"),
    ".h5": ("hdf5", "read_hdf5"),
    ".hdf5": ("hdf5", "read_hdf5"),
    ".npz": ("npz", "read_npz"),
    ".npy": ("npz", "read_npy"),
    ".uff": ("uff", "read_uff"),
    ".unv": ("uff", "read_uff"),
    ".tdms": ("tdms", "read_tdms"),
}


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
        near = difflib.get_close_matches(file.name, _neighbours(file), n=1)
        hint = f"; did you mean {near[0]!r}?" if near else ""
        raise MissingInputError(f"{file}: there is no such file{hint}")
    kind = READERS.get(file.suffix.lower())
    if kind is None:
        known = ", ".join(ending.removeprefix(".") for ending in READERS)
        raise InputError(f"{file}: ending {file.suffix!r} is unknown; expected one of {known}")
    with suppress(OSError):
        check_bytes(file, check_regular(file))
    data = read_regular(file)
    if not data:
        raise InputError(f"{file}: is empty")
    module = import_module(f"{__name__}.{kind[0]}")
    options = {} if skip is None else {"skip": skip}
    if options and kind[1] not in WITH_PREAMBLE:
        raise InputError(f"{file}: skip = {skip} was given; only text tables and sheets have lines to skip")
    table: Table = getattr(module, kind[1])(file, data, **options)
    return table, hashlib.sha256(data).hexdigest()


def _neighbours(file: Path) -> list[str]:
    """Return the names of the files in the folder of a missing one."""
    return os.listdir(file.parent) if os.path.isdir(file.parent) else []


def sha256_of(path: Path) -> str:
    """Return the hash of a file that is read in pieces."""
    with path.open("rb") as file:
        return hashlib.file_digest(file, "sha256").hexdigest()
