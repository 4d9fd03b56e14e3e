"""Columns in JSON: ``{"time": [...], "force": [...]}``, a list of rows, or names and rows apart."""

from __future__ import annotations

import json
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np

from sindyjoint.documents import without_repetition
from sindyjoint.errors import InputError
from sindyjoint.files.limits import check_bytes
from sindyjoint.files.readers.stamps import is_stamp, seconds_since_first
from sindyjoint.files.readers.table import Table, foreign

# Bytes of memory that a byte of JSON may come to: "1.5," is an entry of a list and a number.
MEMORY = 8


def read_json(path: Path, data: bytes) -> Table:
    """Return the lists of numbers of a JSON file, called ``name`` or ``group.name``.

    Raises
    ------
    InputError
        For text that is not JSON, or without lists of numbers.
    """
    with foreign(path, "JSON"):
        check_bytes(path, MEMORY * len(data))
        record = json.loads(data.decode("utf-8-sig"), object_pairs_hook=without_repetition)
        found = without_repetition(list(_leaves("", _as_columns(record))))
    if not found:
        raise InputError(
            f'{path}: holds no columns; expected lists of numbers, such as {{"time": [0, 0.001, ...]}}'
        )
    columns = {}
    for name, values in found.items():
        try:
            stamped = isinstance(values[0], str) and is_stamp(values[0])
            columns[name] = seconds_since_first(values) if stamped else np.asarray(values, dtype=np.float64)
        except OverflowError:
            raise InputError(f"{path}: column {name!r:.60} holds an integer that is no number") from None
        except (TypeError, ValueError):
            continue  # lists of names or of lists of different lengths are no channels
    remarks = (
        [f"{name} {value}" for name, value in record.items() if isinstance(value, str)]
        if isinstance(record, dict)
        else []
    )
    return Table.of(path, columns, remarks=remarks)


def _as_columns(record: Any) -> Any:
    """Return rows as columns."""
    if isinstance(record, list) and record and all(isinstance(row, dict) for row in record):
        return {name: [row.get(name) for row in record] for name in record[0]}
    if (
        isinstance(record, dict)
        and {"columns", "data"} <= record.keys()
        and isinstance(record["columns"], list)
    ):
        columns = zip(*record["data"], strict=True)
        return without_repetition(list(zip(record["columns"], map(list, columns), strict=True)))
    return record


def _leaves(prefix: str, value: Any) -> Iterator[tuple[str, list[Any]]]:
    if isinstance(value, dict):
        for name, inner in value.items():
            yield from _leaves(f"{prefix}.{name}" if prefix else str(name), inner)
    elif isinstance(value, list) and value and not isinstance(value[0], dict | list):
        yield prefix or "1", value
