"""Files that are larger than memory: the same columns as the readers give, a segment of rows at a time.

Text, Parquet and NPY files are read here, further formats in :mod:`sindyjoint.files.long_formats`.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from sindyjoint.errors import InputError
from sindyjoint.files.long_file import Blocks
from sindyjoint.files.long_formats import KINDS as OTHERS
from sindyjoint.files.readers.table import foreign, missing_extra

Array = NDArray[np.float64]

# Bytes of text scanned at once, and lines between two line offsets that are kept.
CHUNK = 1 << 24
STRIDE = 1 << 15
# Rows of Parquet decoded at once.
BATCH = 1 << 16


def open_blocks(path: str | Path) -> Blocks | None:
    """Open a file to be read in segments; None for a format that cannot be.

    Raises
    ------
    InputError
        For a file that is not what its ending says.
    MissingExtraError
        When the library for this format is not installed.
    """
    file = Path(path)
    kind = (KINDS | OTHERS).get(file.suffix.lower())
    if kind is None:
        return None
    try:
        return kind(file)
    except OSError as error:
        raise InputError(f"{file}: cannot be read ({error.strerror or error})") from error


class _Text(Blocks):
    """CSV and other text, by the byte offset of every so many lines."""

    def __init__(self, path: Path):
        from sindyjoint.files.readers.text import layout_of

        self.path = path
        self._size = path.stat().st_size
        head = self._bytes(0, min(self._size, 1 << 16))
        cut = head.rfind(b"\n") + 1 or len(head)
        layout = layout_of(path, head[:cut])
        self.names = layout.names
        # What stands above the first row of data goes before every segment, so that each is read by the same rules.
        self._head = b"".join(line + b"\n" for line in head[:cut].split(b"\n")[: layout.numbers[0] - 1])

    @cached_property
    def rows(self) -> int:  # type: ignore[override]
        """Lines after the header."""
        return self._index[1]

    @cached_property
    def _index(self) -> tuple[list[int], int]:
        """Return where every so many lines begin, and how many lines there are."""
        offsets, lines, at, last = [len(self._head)], 0, len(self._head), b"\n"
        while at < self._size:
            chunk = self._bytes(at, min(at + CHUNK, self._size))
            ends = np.flatnonzero(np.frombuffer(chunk, dtype=np.uint8) == 10)
            first = -(-(lines + 1) // STRIDE) * STRIDE - lines - 1
            offsets += (at + ends[first::STRIDE] + 1).tolist()
            lines, at, last = lines + ends.size, at + len(chunk), chunk[-1:]
        return offsets, lines + (last != b"\n")

    def read(self, start: int, stop: int, wanted: Sequence[int]) -> list[NDArray]:
        """Return rows of some columns."""
        from sindyjoint.files.readers.text import read_text

        offsets, _ = self._index
        first, last = start // STRIDE, -(-stop // STRIDE)
        data = self._bytes(offsets[first], offsets[last] if last < len(offsets) else self._size)
        lines = data.split(b"\n")[start - first * STRIDE : stop - first * STRIDE]
        # Only the last line of the file may lack its end.
        cut = stop >= self.rows and self._bytes(self._size - 1, self._size) not in (b"\n", b"\r")
        text = self._head + b"\n".join(lines) + (b"" if cut else b"\n")
        return list(read_text(self.path, text).load(wanted))

    def _bytes(self, start: int, stop: int) -> bytes:
        with self.path.open("rb") as file:
            file.seek(start)
            return file.read(stop - start)


class _Parquet(Blocks):
    """Parquet, batch by batch of the row groups."""

    def __init__(self, path: Path):
        try:
            import pyarrow.parquet as pq
        except ImportError as error:
            raise missing_extra(path, "pyarrow", error) from error
        with foreign(path, "Parquet"):
            file = pq.ParquetFile(path)
            self.rows = file.metadata.num_rows
            self.names = tuple(file.schema_arrow.names)
            sizes = [file.metadata.row_group(i).num_rows for i in range(file.metadata.num_row_groups)]
        self.path, self._file = path, file
        self._edges = np.concatenate([[0], np.cumsum(sizes)])
        self._next = -1
        self._wanted: tuple[int, ...] = ()
        self._batches: Iterator[Any] = iter(())
        self._pending: list[NDArray] = []

    def read(self, start: int, stop: int, wanted: Sequence[int]) -> list[NDArray]:
        """Return rows of some columns; segments that follow one another are decoded once."""
        if start != self._next or tuple(wanted) != self._wanted:
            group = int(np.searchsorted(self._edges, start, side="right")) - 1
            names = [self.names[position] for position in wanted]
            self._batches = self._file.iter_batches(
                BATCH, row_groups=list(range(group, len(self._edges) - 1)), columns=names
            )
            self._wanted, self._next, self._pending = tuple(wanted), int(self._edges[group]), []
            self._take(start - self._next, names)
        return self._take(stop - start, [self.names[position] for position in wanted])

    def largest(self, column: str | int) -> float | None:
        """Return the largest magnitude of a column by the statistics of the row groups."""
        name = self.names[column - 1] if isinstance(column, int) else column
        ends = []
        for group in (self._file.metadata.row_group(i) for i in range(self._file.metadata.num_row_groups)):
            found = [c for c in map(group.column, range(group.num_columns)) if c.path_in_schema == name]
            if not found or not found[0].is_stats_set or not found[0].statistics.has_min_max:
                return None
            ends += [found[0].statistics.min, found[0].statistics.max]
        return max((abs(float(end)) for end in ends), default=None)

    def _take(self, count: int, names: Sequence[str]) -> list[NDArray]:
        parts = [self._pending] if self._pending else []
        have = self._pending[0].size if self._pending else 0
        with foreign(self.path, "a table of numbers"):
            while have < count:
                batch = next(self._batches, None)
                if batch is None:
                    break
                parts.append([batch.column(name).to_numpy(zero_copy_only=False) for name in names])
                have += batch.num_rows
        columns = [np.concatenate([part[i] for part in parts]) for i in range(len(names))] if parts else []
        self._pending = [column[count:] for column in columns]
        self._next += count
        return [column[:count] for column in columns]


class _Npy(Blocks):
    """One NumPy array: a column for each of its columns, named by its number from 1, or by its field.

    Read, not mapped: pages of a map count as memory of the process for as long as the system likes.
    """

    def __init__(self, path: Path):
        self.path = path
        with foreign(path, "NPY"), path.open("rb") as file:
            version = np.lib.format.read_magic(file)
            read = (
                np.lib.format.read_array_header_1_0
                if version == (1, 0)
                else np.lib.format.read_array_header_2_0
            )
            shape, self._fortran, self._dtype = read(file)
            if self._dtype.hasobject or len(shape) not in (1, 2):
                raise InputError(
                    f"{path}: an array of {self._dtype} and shape {shape}; expected a table of numbers"
                )
            self._at = file.tell()
        self.rows = shape[0]
        self._width = shape[1] if len(shape) == 2 else 1
        self.names = self._dtype.names or tuple(str(position + 1) for position in range(self._width))

    def read(self, start: int, stop: int, wanted: Sequence[int]) -> list[NDArray]:
        """Return rows of some columns."""
        count = min(stop, self.rows) - start
        if self._fortran and self._width > 1:
            return [self._piece(position * self.rows + start, count) for position in wanted]
        if self._dtype.names:
            table = self._piece(start, count)
            return [np.ascontiguousarray(table[self.names[position]]) for position in wanted]
        table = self._piece(start * self._width, count * self._width).reshape(count, self._width)
        return [np.ascontiguousarray(table[:, position]) for position in wanted]

    def _piece(self, first: int, count: int) -> NDArray:
        return np.fromfile(self.path, self._dtype, count, offset=self._at + first * self._dtype.itemsize)


KINDS: dict[str, Callable[[Path], Blocks | None]] = {
    ".csv": _Text,
    ".tsv": _Text,
    ".txt": _Text,
    ".dat": _Text,
    ".parquet": _Parquet,
    ".npy": _Npy,
}
