"""Parquet and Feather by pyarrow, whole or a segment of rows at a time."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from sindyjoint.errors import refuse
from sindyjoint.files.readers.table import (
    MOST_COLUMNS,
    Table,
    begins,
    check_array,
    check_bytes,
    foreign,
    library,
)

# Rows of Parquet decoded at once.
BATCH = 1 << 16


def read_parquet(path: Path, data: bytes | None = None) -> Table:
    """Return the columns of a Parquet file; a null is read as NaN, and refused with its row.

    Raises
    ------
    InputError
        For bytes that are no Parquet file.
    MissingExtraError
        Without pyarrow.
    """
    parquet = library(f"{path}: reading", "pyarrow.parquet", "pyarrow")
    with foreign(path, "Parquet"):
        file = parquet.ParquetFile(path if data is None else library("", "pyarrow").BufferReader(data))
        metadata = file.metadata
        columns, schema = metadata.num_columns, file.schema_arrow
        # A few bytes can stand for rows and columns without end.
        check_array(path, (0, columns) if columns > MOST_COLUMNS else (1,), 8)
        check_bytes(path, 0 if data is None else 8 * columns * max(metadata.num_rows, 0))
        groups = [metadata.row_group(i) for i in range(metadata.num_row_groups)]
        sizes = [group.num_rows for group in groups]

    def batches(number: int, wanted: Sequence[int]) -> Iterator[Any]:
        unique = len(set(schema.names)) == len(schema.names)
        names = [schema.names[position] for position in wanted] if unique else None
        for batch in file.iter_batches(BATCH, row_groups=list(range(number, len(groups))), columns=names):
            yield [batch.column(key) for key in names or wanted]

    def largest(column: str | int) -> float | None:
        name = schema.names[column - 1] if isinstance(column, int) else column
        ends = []
        for group in groups:
            found = [c for c in map(group.column, range(group.num_columns)) if c.path_in_schema == name]
            if not found or not found[0].is_stats_set or not found[0].statistics.has_min_max:
                return None
            ends += [found[0].statistics.min, found[0].statistics.max]
        return max((abs(float(end)) for end in ends), default=None)

    return _table(path, schema, sizes, batches, largest=largest)


def read_feather(path: Path, data: bytes | None = None) -> Table:
    """Return the columns of a Feather file; see :func:`read_parquet`."""
    arrow = library(f"{path}: reading", "pyarrow")
    start = (begins(path) if data is None else data)[:6]
    # Of the first version the reader ends the process on many a damaged file.
    again = "pyarrow.feather.write_feather(pyarrow.feather.read_table(old), new)"
    of_version_1 = f"{path}: is Feather of version 1, which is no longer read; write it again with {again}"
    damaged = f"{path}: cannot be read as Feather; it may be damaged or of another format"
    refuse([(start[:4] == b"FEA1", of_version_1), (start != b"ARROW1", damaged)])

    def reader(fields: list[int]) -> Any:
        return arrow.ipc.open_file(file, options=arrow.ipc.IpcReadOptions(included_fields=fields))

    def batches(number: int, wanted: Sequence[int]) -> Iterator[Any]:
        fields = sorted(set(wanted))
        opened = reader(fields)
        for place in range(number, opened.num_record_batches):
            batch = opened.get_batch(place)
            yield [batch.column(fields.index(position)) for position in wanted]

    with foreign(path, "Feather"):
        # Read, not mapped: pages of a map count as memory of the process for as long as the system likes.
        file = arrow.OSFile(str(path)) if data is None else arrow.BufferReader(data)
        schema, first = arrow.ipc.open_file(file).schema, reader([0])
        sizes = [first.get_batch(i).num_rows for i in range(first.num_record_batches)]
    return _table(path, schema, sizes, batches)


def _table(
    path: Path,
    schema: Any,
    sizes: Sequence[int],
    batches: Callable[[int, Sequence[int]], Iterator[Any]],
    **known: Any,
) -> Table:
    remark = (schema.metadata or {}).get(b"remark")
    remarks = () if remark is None else (remark.decode("utf-8", errors="replace"),)
    load = _Batches(path, np.concatenate([[0], np.cumsum(sizes)]).astype(int), batches)
    return Table(path, tuple(schema.names), load, remarks=remarks, count=lambda: sum(sizes), **known)


class _Batches:
    """Rows of record batches, read from one of several places on; segments that follow one another are decoded once."""

    def __init__(self, path: Path, edges: NDArray, begin: Callable[[int, Sequence[int]], Iterator[Any]]):
        self._path, self._edges, self._begin = path, edges, begin
        self._next, self._pending = -1, list[NDArray]()
        self._wanted: tuple[int, ...] = (-1,)
        self._batches: Iterator[Any] = iter(())

    def __call__(self, wanted: Sequence[int], start: int, stop: int) -> list[NDArray]:
        check_bytes(self._path, 8 * len(wanted) * max(stop - start, 0))
        if start != self._next or tuple(wanted) != self._wanted:
            place = int(np.searchsorted(self._edges, start, side="right")) - 1
            self._batches = self._begin(place, wanted)
            self._wanted, self._next, self._pending = tuple(wanted), int(self._edges[place]), []
            self._take(start - self._next)
        return self._take(stop - start)

    def _take(self, count: int) -> list[NDArray]:
        parts = [self._pending] if self._pending else []
        have = self._pending[0].size if self._pending else 0
        with foreign(self._path, "a table of numbers"):
            while have < count and (batch := next(self._batches, None)) is not None:
                parts.append([column.to_numpy(zero_copy_only=False) for column in batch])
                have += parts[-1][0].size
        columns = [np.concatenate(pieces) for pieces in zip(*parts, strict=True)]
        self._pending = [column[count:] for column in columns]
        self._next += count
        return [column[:count] for column in columns]
