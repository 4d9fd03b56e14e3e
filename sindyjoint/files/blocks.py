"""Files that are larger than memory: the same columns as the readers give, a segment of rows at a time."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Mapping, Sequence
from functools import lru_cache
from importlib import import_module
from pathlib import Path

from numpy.typing import NDArray

from sindyjoint.documents import check_regular
from sindyjoint.errors import InputError
from sindyjoint.files.readers.table import Table

# ending -> module of readers/, what opens such a file; of NPZ, MATLAB v5 and universal files the libraries load all or
# nothing.
KINDS = {
    ".csv": ("text", "text_blocks"),
    ".tsv": ("text", "text_blocks"),
    ".txt": ("text", "text_blocks"),
    ".dat": ("text", "text_blocks"),
    ".asc": ("text", "text_blocks"),
    ".parquet": ("arrow", "ParquetBlocks"),
    ".feather": ("arrow", "FeatherBlocks"),
    ".mat": ("mat", "matlab_blocks"),
    ".h5": ("hdf5", "Hdf5Blocks"),
    ".hdf5": ("hdf5", "Hdf5Blocks"),
    ".npy": ("npz", "NpyBlocks"),
    ".tdms": ("tdms", "TdmsBlocks"),
}


class Blocks(ABC):
    """A file of columns that can be read from any row on.

    Attributes
    ----------
    path : Path
    names : tuple of str
    aliases : mapping of str to int
    remarks : sequence of str
        What the file says about itself.
    rows : int
        Of text files, lines after the header: blank and comment lines count, and give no row when they are read.
    """

    path: Path
    names: tuple[str, ...]
    aliases: Mapping[str, int] = {}
    remarks: Sequence[str] = ()
    rows: int

    @abstractmethod
    def read(self, start: int, stop: int, wanted: Sequence[int]) -> list[NDArray]:
        """Return the rows from ``start`` to before ``stop`` of some columns."""

    def largest(self, column: str | int) -> float | None:
        """Return the largest magnitude of a column, if the file states it."""
        return None

    def table(self, start: int, stop: int) -> Table:
        """Return a segment of rows as a table, with all its checks."""
        return Table(
            self.path,
            self.names,
            lambda wanted: self.read(start, stop, wanted),
            self.aliases,
            lambda index: f"row {start + index + 1}",
            remarks=tuple(self.remarks),
        )

    def whole(self) -> Table:
        """Return all rows as a table."""
        return self.table(0, self.rows)


def open_blocks(path: str | Path, skip: int | None = None) -> Blocks | None:
    """Open a file to be read in segments; None for a format that cannot be.

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
def _open(file: Path, state: tuple[int, int], skip: int | None) -> Blocks | None:
    kind = KINDS.get(file.suffix.lower())
    if kind is None:
        return None
    options = {"skip": skip} if kind[0] == "text" else {}
    blocks: Blocks | None = getattr(import_module(f"sindyjoint.files.readers.{kind[0]}"), kind[1])(
        file, **options
    )
    return blocks
