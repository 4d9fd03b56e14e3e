"""Parquet and Feather by pyarrow."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from numpy.typing import NDArray

from sindyjoint.files.readers.table import Table, foreign, missing_extra

if TYPE_CHECKING:
    import pyarrow


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
        return _table(path, pq.ParquetFile(pa.BufferReader(data)).read())


def read_feather(path: Path, data: bytes) -> Table:
    """Return the columns of a Feather file; see :func:`read_parquet`."""
    try:
        import pyarrow as pa
        import pyarrow.feather as feather
    except ImportError as error:
        raise missing_extra(path, "pyarrow", error) from error
    with foreign(path, "Feather"):
        return _table(path, feather.read_table(pa.BufferReader(data)))


def _table(path: Path, table: pyarrow.Table) -> Table:
    def load(wanted: Sequence[int]) -> list[NDArray]:
        with foreign(path, "a table of numbers"):
            return [table.column(position).to_numpy() for position in wanted]

    return Table(path, tuple(table.column_names), load)
