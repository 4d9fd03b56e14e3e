"""Parquet and Feather by pyarrow, whole or a segment of rows at a time."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from sindyjoint.errors import InputError
from sindyjoint.files.blocks import Blocks
from sindyjoint.files.limits import MOST_COLUMNS, check_array, check_bytes
from sindyjoint.files.readers.table import Table, begins, foreign, missing_extra

if TYPE_CHECKING:
    import pyarrow

# Rows of Parquet decoded at once.
BATCH = 1 << 16


def read_parquet(path: Path, data: bytes) -> Table:
    """Return the columns of a Parquet file; a null is read as NaN, and refused with its row.

    Raises
    ------
    InputError
        For bytes that are no Parquet file.
    MissingExtraError
        Without pyarrow.
    """
    try:
        import pyarrow as pa
        import pyarrow.parquet as pq
    except ImportError as error:
        raise missing_extra(path, "pyarrow", error) from error
    with foreign(path, "Parquet"):
        file = pq.ParquetFile(pa.BufferReader(data))
        _check_parquet(path, file.metadata)
        return _table(path, file.read())


def _check_parquet(path: Path, metadata: Any, rows: int | None = None) -> None:
    """Refuse rows beyond the limit, which a few bytes can stand for, and more columns than a table has."""
    columns = metadata.num_columns
    check_array(path, (0, columns) if columns > MOST_COLUMNS else (1,), 8)
    check_bytes(path, 8 * columns * max(metadata.num_rows if rows is None else rows, 0))


def read_feather(path: Path, data: bytes) -> Table:
    """Return the columns of a Feather file; see :func:`read_parquet`."""
    try:
        import pyarrow as pa
        import pyarrow.feather as feather
    except ImportError as error:
        raise missing_extra(path, "pyarrow", error) from error
    _check_version(path, data[:6])
    with foreign(path, "Feather"):
        return _table(path, feather.read_table(pa.BufferReader(data)))


def _check_version(path: Path, start: bytes) -> None:
    """Refuse Feather of the first version: its reader ends the process on many a damaged file."""
    if start[:4] == b"FEA1":
        raise InputError(
            f"{path}: is Feather of version 1, which is no longer read; write it again with "
            "pyarrow.feather.write_feather(pyarrow.feather.read_table(old), new)"
        )
    if start != b"ARROW1":
        raise InputError(f"{path}: cannot be read as Feather; it may be damaged or of another format")


def _table(path: Path, table: pyarrow.Table) -> Table:
    def load(wanted: Sequence[int]) -> list[NDArray]:
        with foreign(path, "a table of numbers"):
            return [table.column(position).to_numpy() for position in wanted]

    return Table(path, tuple(table.column_names), load, remarks=_remarks(table.schema.metadata))


def _remarks(metadata: Mapping[bytes, bytes] | None) -> tuple[str, ...]:
    """Return what the file says about itself."""
    remark = (metadata or {}).get(b"remark")
    return () if remark is None else (remark.decode("utf-8", errors="replace"),)


class ParquetBlocks(Blocks):
    """Parquet, batch by batch of the row groups."""

    def __init__(self, path: Path):
        try:
            import pyarrow.parquet as pq
        except ImportError as error:
            raise missing_extra(path, "pyarrow", error) from error
        with foreign(path, "Parquet"):
            file = pq.ParquetFile(path)
            _check_parquet(path, file.metadata, 0)
            self.rows = file.metadata.num_rows
            self.remarks = _remarks(file.schema_arrow.metadata)
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
        check_bytes(self.path, 8 * len(wanted) * max(stop - start, 0))
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


class FeatherBlocks(Blocks):
    """Feather: the record batches of an Arrow file, of which only the requested columns are decoded."""

    def __init__(self, path: Path):
        try:
            import pyarrow as pa
        except ImportError as error:
            raise missing_extra(path, "pyarrow", error) from error
        self.path = path
        _check_version(path, begins(path)[:6])
        with foreign(path, "Feather"):
            # Read, not mapped: pages of a map count as memory of the process for as long as the system likes.
            self._file = pa.OSFile(str(path))
            self.names = tuple(pa.ipc.open_file(self._file).schema.names)
            reader = self._reader([0])
            sizes = [reader.get_batch(i).num_rows for i in range(reader.num_record_batches)]
        self._edges = np.concatenate([[0], np.cumsum(sizes)]).astype(int)
        self.rows = int(self._edges[-1])
        self._last: tuple[int, tuple[int, ...], list[NDArray]] | None = None

    def read(self, start: int, stop: int, wanted: Sequence[int]) -> list[NDArray]:
        """Return rows of some columns; a batch is decoded once for the segments that follow one another."""
        first, last = np.searchsorted(self._edges, [start, stop - 1], side="right") - 1
        parts = []
        check_bytes(self.path, 8 * len(wanted) * max(stop - start, 0))
        for number in range(int(first), min(int(last), len(self._edges) - 2) + 1):
            begin = self._edges[number]
            parts.append(
                [c[max(start - begin, 0) : stop - begin] for c in self._batch(number, tuple(wanted))]
            )
        return [np.concatenate(columns) for columns in zip(*parts, strict=True)]

    def _batch(self, number: int, wanted: tuple[int, ...]) -> list[NDArray]:
        if self._last is None or self._last[:2] != (number, wanted):
            fields = sorted(set(wanted))
            with foreign(self.path, "a table of numbers"):
                batch = self._reader(fields).get_batch(number)
                columns = [
                    batch.column(fields.index(position)).to_numpy(zero_copy_only=False) for position in wanted
                ]
            self._last = number, wanted, columns
        return self._last[2]

    def _reader(self, fields: list[int]) -> Any:
        import pyarrow as pa

        return pa.ipc.open_file(self._file, options=pa.ipc.IpcReadOptions(included_fields=fields))
