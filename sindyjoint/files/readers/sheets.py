"""Columns in documents of other programs: Excel workbooks by openpyxl, and JSON."""

from __future__ import annotations

import datetime
import io
import json
import zipfile
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from sindyjoint.documents import without_repetition
from sindyjoint.errors import InputError
from sindyjoint.files.readers.fields import is_stamp, seconds_since_first
from sindyjoint.files.readers.table import MOST_COLUMNS, Table, check_bytes, foreign, library
from sindyjoint.files.readers.text import table_of_text

MOST_ROWS = 1 << 20  # as Excel has it
CELL = 64  # bytes of a cell in memory
# Bytes of memory that a byte of JSON may come to: "1.5," is an entry of a list and a number.
MEMORY = 8


def read_xlsx(path: Path, data: bytes, skip: int | None = None) -> Table:
    """Return the columns of the first sheet with numbers, read by the rules of a text table.

    Formulas give the values that were saved with them.

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
    for title, rows in sheets.items():
        if sum(any(isinstance(cell, int | float) for cell in row) for row in rows[:1000]) > 1:
            width = max(len(row) for row in rows)
            lines = [
                "\t".join(map(_cell, (*row, *[None] * (width - len(row))))) if row else "" for row in rows
            ]
            table = table_of_text(path, "\n".join([*lines, ""]), skip)
            return replace(table, remarks=(*table.remarks, f"sheet {title!r} of {', '.join(sheets)}"))
    raise InputError(f"{path}: holds no sheet with numbers; expected a header and rows")


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
            check_bytes(path, CELL * cells)
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
        check_bytes(path, MEMORY * len(data))
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
