"""Excel workbooks by openpyxl: the first sheet that holds numbers, read by the rules of a text table."""

from __future__ import annotations

import datetime
import io
import zipfile
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

from sindyjoint.errors import InputError
from sindyjoint.files.limits import MOST_COLUMNS, check_bytes
from sindyjoint.files.readers.table import Table, foreign, missing_extra
from sindyjoint.files.readers.text import table_of_text

MOST_ROWS = 1 << 20  # as Excel has it
CELL = 64  # bytes of a cell in memory


def read_xlsx(path: Path, data: bytes, skip: int | None = None) -> Table:
    """Return the columns of the first sheet with numbers; formulas give the values that were saved with them.

    Raises
    ------
    InputError
        For bytes that are no workbook, or one without numbers.
    MissingExtraError
        Without openpyxl.
    """
    try:
        import openpyxl
    except ImportError as error:
        raise missing_extra(path, "openpyxl", error, "excel") from error
    with foreign(path, "an Excel workbook"):
        with zipfile.ZipFile(io.BytesIO(data)) as archive:
            check_bytes(path, sum(member.file_size for member in archive.infolist()))
        book = openpyxl.load_workbook(io.BytesIO(data), read_only=True, data_only=True)
        sheets = {sheet.title: _read_rows(path, sheet) for sheet in book.worksheets}
        book.close()
    with_numbers = {title: rows for title, rows in sheets.items() if _has_numbers(rows)}
    if not with_numbers:
        raise InputError(f"{path}: holds no sheet with numbers; expected a header and rows")
    title, rows = next(iter(with_numbers.items()))
    width = max(len(row) for row in rows)
    lines = ("\t".join(map(_cell, (*row, *[None] * (width - len(row))))) if row else "" for row in rows)
    text = "\n".join(lines) + "\n"
    table = table_of_text(path, text, skip)
    return replace(table, remarks=(*table.remarks, f"sheet {title!r} of {', '.join(sheets)}"))


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


def _has_numbers(rows: Sequence[Sequence[object]]) -> bool:
    return sum(any(isinstance(cell, int | float) for cell in row) for row in rows[:1000]) > 1


def _cell(cell: object) -> str:
    """Return a cell as it stands in a text table."""
    if cell is None:
        return ""
    if isinstance(cell, datetime.datetime | datetime.time):
        return cell.isoformat()
    return repr(cell) if isinstance(cell, float) else " ".join(str(cell).split())
