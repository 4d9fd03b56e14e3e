"""Columns in files of other programs: Parquet and Feather by pyarrow, Excel workbooks by openpyxl, JSON."""

import datetime
import io
import json
import zipfile
from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from sindyjoint.documents import without_repetition
from sindyjoint.errors import InputError, refuse
from sindyjoint.files.readers import MOST_COLUMNS, Table, begins, check_array, check_bytes, foreign, library
from sindyjoint.files.readers.text import LONGEST, is_stamp, seconds_since_first, table_of_text
from sindyjoint.record import MINIMUM_SAMPLES


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
        # Rows of Parquet decoded at once.
        for batch in file.iter_batches(1 << 16, row_groups=list(range(number, len(groups))), columns=names):
            yield [batch.column(key) for key in names or wanted]

    def largest(column: str | int) -> float | None:
        name = schema.names[column - 1] if isinstance(column, int) else column
        parts = [group.column(i) for group in groups for i in range(group.num_columns)]
        found = [part.statistics for part in parts if part.path_in_schema == name and part.is_stats_set]
        if len(found) < len(groups) or not all(each.has_min_max for each in found):
            return None
        return max((abs(float(end)) for each in found for end in (each.min, each.max)), default=None)

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

    def __init__(self, path: Path, edges: NDArray[Any], begin: Callable[[int, Sequence[int]], Iterator[Any]]):
        self._path, self._edges, self._begin = path, edges, begin
        self._next, self._pending = -1, list[NDArray[Any]]()
        self._wanted: tuple[int, ...] = (-1,)
        self._batches: Iterator[Any] = iter(())

    def __call__(self, wanted: Sequence[int], start: int, stop: int) -> list[NDArray[Any]]:
        check_bytes(self._path, 8 * len(wanted) * max(stop - start, 0))
        if start != self._next or tuple(wanted) != self._wanted:
            place = int(np.searchsorted(self._edges, start, side="right")) - 1
            self._batches = self._begin(place, wanted)
            self._wanted, self._next, self._pending = tuple(wanted), int(self._edges[place]), []
            self._take(start - self._next)
        return self._take(stop - start)

    def _take(self, count: int) -> list[NDArray[Any]]:
        parts = [self._pending] if self._pending else []
        have = self._pending[0].size if self._pending else 0
        while have < count and (batch := next(self._batches, None)) is not None:
            parts.append([column.to_numpy(zero_copy_only=False) for column in batch])
            have += parts[-1][0].size
        columns = [np.concatenate(pieces) for pieces in zip(*parts, strict=True)]
        self._pending = [column[count:] for column in columns]
        self._next += count
        return [column[:count] for column in columns]


MOST_ROWS = 1 << 20  # as Excel has it


def read_xlsx(path: Path, data: bytes, skip: int | None = None) -> Table:
    """Return the columns of the first sheet with numbers, read by the rules of a text table.

    Where other sheets have the same columns, each is a run, else each holds channels: all are called ``sheet/name``,
    those of the first also by ``name`` alone. Formulas give the values that were saved with them.

    Raises
    ------
    InputError
        For bytes that are no workbook, or one without numbers.
    MissingExtraError
        Without openpyxl.
    """
    openpyxl = library(f"{path}: reading", "openpyxl", extra="excel")
    with foreign(path, "an Excel workbook"):
        with zipfile.ZipFile(io.BytesIO(data)) as archive:
            check_bytes(path, sum(member.file_size for member in archive.infolist()))
        book = openpyxl.load_workbook(io.BytesIO(data), read_only=True, data_only=True)
        sheets = {sheet.title: _read_rows(path, sheet) for sheet in book.worksheets}
        book.close()
    found: dict[str, Table] = {}
    errors = [InputError(f"{path}: holds no sheet with numbers; expected a header and rows")]
    for title, rows in sheets.items():
        if sum(any(isinstance(cell, int | float) for cell in row) for row in rows[:1000]) > 1:
            width = max(len(row) for row in rows)
            lines = [
                "\t".join(map(_cell, (*row, *[None] * (width - len(row))))) if row else "" for row in rows
            ]
            try:
                found[title] = table_of_text(path, "\n".join([*lines, ""]), skip)
            except InputError as error:
                # What is no table stops nobody who has another one.
                errors.append(error)
    if not found:
        raise errors[-1]
    # What is shorter than a run says something about it.
    long = {title: table for title, table in found.items() if table.rows >= MINIMUM_SAMPLES}
    title, first = next(iter((long or found).items()))
    said = (
        "\t".join(map(_cell, row))
        for title, rows in sheets.items()
        if title not in long
        for row in rows[:LONGEST]
    )
    first = replace(first, remarks=(*first.remarks, f"sheet {title!r} of {', '.join(sheets)}", *said))
    alike = {title: table for title, table in found.items() if table.names == first.names}
    # Sheets with other columns are channels of one run.
    together = alike if len(alike) > 1 else {title: first} | long
    return first if len(together) == 1 else _of_sheets(first, together)


def _of_sheets(first: Table, sheets: dict[str, Table]) -> Table:
    """Return the columns of sheets that are runs, or channels."""
    columns = [(table, at) for table in sheets.values() for at in range(len(table.names))]

    def load(wanted: Sequence[int], start: int, stop: int) -> list[NDArray[Any]]:
        return [table.load([at], start, stop)[0] for table, at in (columns[place] for place in wanted)]

    return replace(
        first,
        names=tuple(f"{title}/{name}" for title, table in sheets.items() for name in table.names),
        load=load,
        aliases={name: at for at, name in enumerate(first.names)},
        units=tuple((*table.units, *[""] * (at + 1))[at] for table, at in columns),
        name_row=lambda index: f"row {index + 1}",
    )


def _read_rows(path: Path, sheet: Any) -> list[tuple[object, ...]]:
    """Return the cells of a sheet up to the last one of each row; a few bytes can state rows without end."""
    # A sheet states its own size, which nobody has to believe.
    sheet.reset_dimensions()
    rows: list[tuple[object, ...]] = []
    cells = 0
    for number, row in enumerate(sheet.iter_rows(values_only=True), start=1):
        length = next((at for at in range(len(row), 0, -1) if row[at - 1] is not None), 0)
        cells += 1 + length
        if number % 1000 == 0 or length > 1000:
            # A cell takes so many bytes of memory.
            check_bytes(path, 64 * cells)
        if number > MOST_ROWS or length > MOST_COLUMNS:
            raise InputError(
                f"{path}: sheet {sheet.title!r:.40} has a cell in row {number}, column {length}; expected at most "
                f"{MOST_ROWS} rows and {MOST_COLUMNS} columns"
            )
        rows.append(row[:length])
    while rows and not rows[-1]:
        rows.pop()
    return rows


def _cell(cell: object) -> str:
    """Return a cell as it stands in a text table."""
    if cell is None:
        return ""
    if isinstance(cell, datetime.datetime | datetime.time):
        return cell.isoformat()
    return repr(cell) if isinstance(cell, float) else " ".join(str(cell).split())


def read_json(path: Path, data: bytes) -> Table:
    """Return the lists of numbers of a JSON file, called ``name`` or ``group.name``.

    They stand as ``{"time": [...], "force": [...]}``, as a list of rows, or with names and rows apart.

    Raises
    ------
    InputError
        For text that is not JSON, or without lists of numbers.
    """
    with foreign(path, "JSON"):
        # Bytes of memory that a byte of JSON may come to: "1.5," is an entry of a list and a number.
        check_bytes(path, 8 * len(data))
        record = json.loads(data.decode("utf-8-sig"), object_pairs_hook=without_repetition)
        known: dict[str, Any] = record if isinstance(record, dict) else {}
        content = record
        if isinstance(record, list) and record and all(isinstance(row, dict) for row in record):
            content = {name: [row.get(name) for row in record] for name in record[0]}
        elif isinstance(known.get("columns"), list) and "data" in known:
            columns = map(list, zip(*known["data"], strict=True))
            content = without_repetition(list(zip(known["columns"], columns, strict=True)))
        found = without_repetition(list(_leaves("", content)))
    if not found:
        raise InputError(
            f'{path}: holds no columns; expected lists of numbers, such as {{"time": [0, 0.001, ...]}}'
        )
    arrays = {}
    for name, values in found.items():
        try:
            stamped = isinstance(values[0], str) and is_stamp(values[0])
            arrays[name] = seconds_since_first(values) if stamped else np.asarray(values, dtype=np.float64)
        except OverflowError:
            raise InputError(f"{path}: column {name!r:.60} holds an integer that is no number") from None
        except (TypeError, ValueError):
            continue  # lists of names or of lists of different lengths are no channels
    remarks = tuple(f"{name} {value}" for name, value in known.items() if isinstance(value, str))
    return Table.of(path, arrays, remarks=remarks)


def _leaves(prefix: str, value: Any) -> Iterator[tuple[str, list[Any]]]:
    if isinstance(value, dict):
        for name, inner in value.items():
            yield from _leaves(f"{prefix}.{name}" if prefix else str(name), inner)
    elif isinstance(value, list) and value and not isinstance(value[0], dict | list):
        yield prefix or "1", value
