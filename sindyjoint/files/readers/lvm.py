"""LabVIEW's measurement files (``.lvm``): text with one header for the file and one above each segment of data."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from sindyjoint.errors import InputError
from sindyjoint.files.readers.table import Table, foreign
from sindyjoint.files.readers.text import decode_text

END = "***End_of_Header***"
TIME = "X_Value"


@dataclass(frozen=True)
class _Segment:
    """One header of a segment, the names below it, and its rows."""

    header: dict[str, list[str]]
    names: list[str]
    rows: list[list[str]]


def read_lvm(path: Path, data: bytes) -> Table:
    """Return the channels of a LabVIEW measurement file; ``X_Value`` is made from the step where it is not written.

    Raises
    ------
    InputError
        For text that is no such file, or whose segments have different channels.
    """
    lines = decode_text(path, data).split("\n")
    if not lines[0].startswith("LabVIEW Measurement"):
        raise InputError(
            f"{path}: is no LabVIEW measurement file; expected 'LabVIEW Measurement' in its first line"
        )
    with foreign(path, "LabVIEW measurement"):
        return _read_segments(path, lines)


def _read_segments(path: Path, lines: Sequence[str]) -> Table:
    separator = "," if any(line.startswith("Separator,") for line in lines[:30]) else "\t"
    table = [[field.strip() for field in line.split(separator)] for line in lines]
    ends = [number for number, row in enumerate(table) if row[0] == END]
    if len(ends) < 2:
        raise InputError(
            f"{path}: has {len(ends)} line(s) {END}; expected one below the header, one above the data"
        )
    header = _pairs(table[: ends[0]])
    segments = [_segment(path, table, end, before) for before, end in zip(ends, ends[1:], strict=False)]
    if len({tuple(segment.names) for segment in segments}) > 1:
        raise InputError(
            f"{path}: its {len(segments)} segments have different channels; save them as single files"
        )
    comma = header.get("Decimal_Separator", ["."])[0] == ","
    columns = _columns(segments, header.get("X_Columns", ["One"])[0], comma)
    positions = _channels(segments[0])
    units = segments[0].header.get("Y_Unit_Label", [])
    return Table(
        path,
        (TIME, *(segments[0].names[at] for at in positions)),
        lambda wanted: [columns[at] for at in wanted],
        units=("s", *units[: len(positions)], *[""] * (len(positions) - len(units))),
        remarks=tuple(f"{name} {' '.join(values)}" for name, values in header.items()),
    )


def _pairs(rows: Sequence[Sequence[str]]) -> dict[str, list[str]]:
    return {row[0]: list(row[1:]) for row in rows if row[0]}


def _segment(path: Path, table: list[list[str]], end: int, before: int) -> _Segment:
    """Return the segment whose header ends in one line and began after another, or after the rows above it."""
    start = end
    while start > before + 1 and table[start - 1][0] and not _is_float(table[start - 1][0]):
        start -= 1
    names = table[end + 1] if end + 1 < len(table) else []
    rows = []
    for row in table[end + 2 :]:
        if not any(row) or row[0] in (END, "Channels"):
            break
        rows.append(row)
    header = _pairs(table[start:end])
    # More rows than the header states are of later writes below the same header.
    stated = [int(count) for count in header.get("Samples", []) if count]
    if stated and len(rows) < max(stated):
        raise InputError(
            f"{path}: a segment announces {max(stated)} samples and holds {len(rows)}; the file is truncated or damaged"
        )
    return _Segment(header, names, rows)


def _is_float(field: str) -> bool:
    try:
        float(field.replace(",", "."))
    except ValueError:
        return False
    return True


def _channels(segment: _Segment) -> list[int]:
    """Return the positions of the channels in a row; two may have the same name."""
    return [at for at, name in enumerate(segment.names) if name not in (TIME, "Comment", "")]


def _columns(segments: Sequence[_Segment], x_columns: str, comma: bool) -> list[NDArray[np.float64]]:
    """Return the time and the channels, those of all segments one below the other."""
    names, times, done = segments[0].names, [], 0
    for segment in segments:
        if TIME in names and x_columns != "No":
            times.append(_numbers(segment.rows, names.index(TIME), comma))
        else:
            step = np.float64(segment.header["Delta_X"][0].replace(",", "."))
            times.append(np.arange(done, done + len(segment.rows), dtype=np.float64) * step)
        done += len(segment.rows)
    channels = [[_numbers(s.rows, at, comma) for s in segments] for at in _channels(segments[0])]
    return [np.concatenate(parts) for parts in (times, *channels)]


def _numbers(rows: Sequence[Sequence[str]], at: int, comma: bool) -> NDArray[np.float64]:
    fields = [row[at] for row in rows]
    return np.array([field.replace(",", ".") for field in fields] if comma else fields, dtype=np.float64)
