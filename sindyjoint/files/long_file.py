"""What a file that is larger than memory offers: its columns, a segment of rows at a time."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Mapping, Sequence
from pathlib import Path

from numpy.typing import NDArray

from sindyjoint.files.readers.table import Table


class Blocks(ABC):
    """A file of columns that can be read from any row on.

    Attributes
    ----------
    path : Path
    names : tuple of str
    aliases : mapping of str to int
    rows : int
        Of text files, lines after the header: blank and comment lines count, and give no row when they are read.
    """

    path: Path
    names: tuple[str, ...]
    aliases: Mapping[str, int] = {}
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
        )
