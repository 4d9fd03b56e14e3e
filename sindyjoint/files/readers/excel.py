"""Excel workbooks by openpyxl: the first sheet that holds numbers, read by the rules of a text table."""

from __future__ import annotations

import datetime
import io
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

from sindyjoint.errors import InputError
from sindyjoint.files.readers.table import Table, foreign, missing_extra
from sindyjoint.files.readers.text import table_of_text


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
        book = openpyxl.load_workbook(io.BytesIO(data), read_only=True, data_only=True)
        sheets = {
            sheet.title: [list(row) for row in sheet.iter_rows(values_only=True)] for sheet in book.worksheets
        }
        book.close()
    with_numbers = {title: rows for title, rows in sheets.items() if _has_numbers(rows)}
    if not with_numbers:
        raise InputError(f"{path}: holds no sheet with numbers; expected a header and rows")
    title, rows = next(iter(with_numbers.items()))
    width = max(at + 1 for row in rows for at, cell in enumerate(row) if cell is not None)
    text = "\n".join("\t".join(_cell(cell) for cell in row[:width]) for row in rows) + "\n"
    table = table_of_text(path, text, skip)
    return replace(table, remarks=(*table.remarks, f"sheet {title!r} of {', '.join(sheets)}"))


def _has_numbers(rows: Sequence[Sequence[object]]) -> bool:
    return sum(any(isinstance(cell, int | float) for cell in row) for row in rows[:1000]) > 1


def _cell(cell: object) -> str:
    """Return a cell as it stands in a text table."""
    if cell is None:
        return ""
    if isinstance(cell, datetime.datetime | datetime.time):
        return cell.isoformat()
    return repr(cell) if isinstance(cell, float) else " ".join(str(cell).split())
