"""CSV, TSV and other text tables: delimiter, comment lines, a header, perhaps a row of units."""

from __future__ import annotations

import codecs
import csv
import re
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from sindyjoint.errors import InputError
from sindyjoint.files.blocks import Blocks
from sindyjoint.files.readers.table import Table, begins

COMMENTS = ("#", "%", "//")
# Bytes of text scanned at once, and lines between two line offsets that are kept.
CHUNK = 1 << 24
STRIDE = 1 << 15
COMPARED = 20  # lines that the last one of a file is compared with
# What no text table holds: control characters other than tab, line ends, form feed and DOS's end of file.
_CONTROL = re.compile(r"[\x00-\x08\x0b\x0e-\x19\x1b-\x1f]")
_HARMLESS = bytes(set(range(256)) - set(range(0x20)) | {0x09, 0x0A, 0x0C, 0x0D, 0x1A})
_BLANK = re.compile(r"\A[ \t\f]*\n|\n[ \t\f]*\n|\n[ \t\f]+\Z")
_BLANKS = ("\n", " ", "\t", "\f")
_DECIMAL_COMMA = re.compile(r"\s*[+-]?\d+,\d+([eE][+-]?\d+)?\s*")


@dataclass(frozen=True)
class Layout:
    """How the lines of one file are to be read."""

    path: Path
    names: tuple[str, ...]
    delimiter: str | None
    lines: list[str]
    numbers: list[int]
    """Line number in the file, from 1, of each entry of ``lines``."""
    units: tuple[str, ...] = ()
    """Unit of each column, where there is a row of units."""


def read_text(path: Path, data: bytes) -> Table:
    """Return the columns of a text table.

    Raises
    ------
    InputError
        For an empty file, binary rubbish, a header without data, rows of different lengths, or one that is cut off.
    """
    text = _decode(path, data)
    layout = _layout(path, text)
    if not text.endswith("\n"):
        _check_end(layout)
    return Table(
        path,
        layout.names,
        lambda wanted: _parse(layout, wanted),
        row=lambda i: f"line {layout.numbers[i]}",
        units=layout.units,
    )


def _check_end(layout: Layout) -> None:
    """Refuse a file without a last line end whose last number is shorter than all above: 6.2 may be of 6.2e-05."""
    *above, last = (_fields(line, layout.delimiter)[-1] for line in layout.lines[-COMPARED - 1 :])
    if len(above) == COMPARED and len(last) < min(map(len, above)):
        raise InputError(
            f"{layout.path}: ends within line {layout.numbers[-1]}: its last number, {last!r:.40}, is shorter than the "
            f"{COMPARED} above it; copy the file again, or end that line if the file is whole"
        )


def _decode(path: Path, data: bytes) -> str:
    if not data.strip():
        raise InputError(f"{path}: is empty; expected a table with a header and rows")
    if data.startswith((codecs.BOM_UTF16_LE, codecs.BOM_UTF16_BE)):
        text = data.decode("utf-16", errors="replace")
    else:
        try:
            text = data.decode("utf-8-sig")
        except UnicodeDecodeError:
            # Instruments write µ and ° in the code page of their country; its letters occur in headers only.
            text = data.decode("latin-1")
    # In UTF-8 and its kin a control character is one byte; picking bytes is ten times as fast as a search.
    rubbish = _CONTROL.search(text) if b"\0" in data or data.translate(None, _HARMLESS) else None
    if rubbish:
        raise InputError(
            f"{path}: is not a text table (byte {ord(rubbish[0])} at position {rubbish.start()}); "
            "it may be of another format, with the wrong ending"
        )
    return text.replace("\r\n", "\n").replace("\r", "\n").rstrip("\x1a")


def _layout(path: Path, text: str) -> Layout:
    """Find delimiter, header and first row of data."""
    lines, numbers, comment = _rows_of(text)
    if not lines:
        raise InputError(f"{path}: holds comment lines only; expected a table with a header and rows")
    delimiter = _delimiter(lines)
    stated: tuple[str, ...] = ()
    first = _fields(lines[0], delimiter)
    if all(_is_number(field) for field in first):
        above = _fields(comment, delimiter) if comment else []
        names = (
            above if len(above) == len(first) else [str(position) for position in range(1, len(first) + 1)]
        )
        skip = 0
    else:
        names, skip = first, 1
        units = _fields(lines[1], delimiter) if len(lines) > 1 else []
        if len(units) == len(names) and any(units) and not any(map(_is_number, units)):
            skip, stated = 2, tuple(units)
    top, lines, numbers = numbers[0], lines[skip:], numbers[skip:]
    if not lines:
        raise InputError(f"{path}: has a header ({', '.join(names):.200}) and no rows of data")
    lines = _with_points(lines, delimiter)
    _check_lengths(path, lines, numbers, delimiter, len(names), top)
    return Layout(path, tuple(names), delimiter, lines, numbers, stated)


def _rows_of(text: str, first: int = 1) -> tuple[list[str], list[int], str]:
    """Return the lines that are neither blank nor a comment, their numbers, and the last comment before them.

    The header may stand in that comment: ``numpy.savetxt`` writes it there.
    """
    all_lines = text.split("\n")
    if not _irregular(text):
        lines = all_lines if all_lines[-1] else all_lines[:-1]
        return lines, list(range(first, first + len(lines))), ""
    comment = ""
    lines, numbers = [], []
    for number, line in enumerate(all_lines, start=first):
        stripped = line.strip()
        if stripped.startswith(COMMENTS):
            comment = comment if lines else stripped.lstrip("#%/ \t")
        elif stripped:
            lines.append(line)
            numbers.append(number)
    return lines, numbers, comment


def _irregular(text: str) -> bool:
    """Return whether a text may hold comments or blank lines; most hold none, and need no look at every line."""
    # The search takes long, and can only find something where a line begins with a blank.
    indented = text[0] in _BLANKS or any("\n" + blank in text for blank in _BLANKS)
    return (
        any(mark in text for mark in COMMENTS) or (indented and bool(_BLANK.search(text))) or not text.strip()
    )


def _delimiter(lines: list[str]) -> str | None:
    """Return what parts the fields of the last complete line; None for blanks."""
    sample = lines[min(len(lines) - 1, 2)]
    for delimiter in ("\t", ";", ","):
        if delimiter in sample and (delimiter != "," or "," in lines[0] or not _DECIMAL_COMMA.match(sample)):
            return delimiter
    # A single column has no delimiter at all, and its header may hold blanks.
    return None if len(sample.split()) > 1 else ","


def _fields(line: str, delimiter: str | None) -> list[str]:
    """Return the fields of one line, without blanks around them; a delimiter at its end opens no field."""
    text = " ".join(line.split()) if delimiter is None else line
    try:
        fields = next(csv.reader([text], delimiter=delimiter or " ", skipinitialspace=True))
    except csv.Error:  # a field beyond csv's limit of 131 072 letters
        fields = text.split(delimiter)
    fields = [field.strip() for field in fields]
    return fields[:-1] if len(fields) > 1 and not fields[-1] else fields


def _is_number(field: str) -> bool:
    try:
        float(field)
    except ValueError:
        return bool(_DECIMAL_COMMA.fullmatch(field))
    return "_" not in field  # Python's float takes 1_000, tables do not


def _with_points(lines: list[str], delimiter: str | None) -> list[str]:
    """Turn decimal commas into points where the comma does not part the fields."""
    if delimiter == "," or not any(_DECIMAL_COMMA.fullmatch(field) for field in _fields(lines[0], delimiter)):
        return lines
    return [line.replace(",", ".") for line in lines]


def _check_lengths(
    path: Path, lines: list[str], numbers: list[int], delimiter: str | None, width: int, top: int
) -> None:
    """Refuse rows that are longer or shorter than the table's top line."""
    if delimiter is not None and {line.count(delimiter) for line in lines} == {width - 1}:
        return
    for line, number in zip(lines, numbers, strict=True):
        # Counting delimiters is fast and nearly always enough; quoted or trailing ones need the careful way.
        quick = len(line.split()) if delimiter is None else line.count(delimiter) + 1
        if quick != width and len(_fields(line, delimiter)) != width:
            found = len(_fields(line, delimiter))
            raise InputError(
                f"{path}: line {number} has {found} fields and line {top} has {width}; expected equal "
                "numbers (put # before lines that belong to no table)"
            )


def _parse(layout: Layout, wanted: Sequence[int]) -> list[NDArray[np.float64]]:
    """Return columns as numbers; the fast way first, the careful one to explain a failure."""
    if not wanted:
        return []
    quote = '"' if any('"' in line for line in layout.lines[:3]) else None
    try:
        values = np.loadtxt(
            layout.lines, delimiter=layout.delimiter, usecols=wanted, ndmin=2, comments=None, quotechar=quote
        )
    except ValueError as error:
        raise _explain_error(layout, wanted, error) from error
    return list(np.ascontiguousarray(values.T))


def _explain_error(layout: Layout, wanted: Sequence[int], error: ValueError) -> InputError:
    """Find the first field that is not a number."""
    for line, number in zip(layout.lines, layout.numbers, strict=True):
        fields = _fields(line, layout.delimiter)
        for position in wanted:
            field = fields[position] if position < len(fields) else ""
            if not _is_number(field):
                given = f"holds {field!r:.40}" if field else "is blank"
                name = layout.names[position]
                return InputError(f"{layout.path}: line {number}: column {name!r} {given}; expected a number")
    return InputError(f"{layout.path}: cannot be read as a table of numbers ({error})")


def text_blocks(path: Path) -> Blocks | None:
    """Open a text table to be read in segments; None for one whose letters take two bytes each."""
    head = begins(path)
    return None if head.startswith((codecs.BOM_UTF16_LE, codecs.BOM_UTF16_BE)) else TextBlocks(path)


class TextBlocks(Blocks):
    """CSV and other text, by the byte offset of every so many lines."""

    def __init__(self, path: Path):
        self.path = path
        self._size = path.stat().st_size
        head = self._bytes(0, min(self._size, 1 << 16))
        cut = head.rfind(b"\n") + 1 or len(head)
        self._layout = _layout(path, _decode(path, head[:cut]))
        self.names = self._layout.names
        # Lines above the first row of data, and where that begins.
        self._above = self._layout.numbers[0] - 1
        self._start = sum(len(line) + 1 for line in head[:cut].split(b"\n")[: self._above])

    @cached_property
    def rows(self) -> int:  # type: ignore[override]
        """Lines after the header."""
        return self._index[1]

    @cached_property
    def _index(self) -> tuple[list[int], int]:
        """Return where every so many lines begin, and how many lines there are."""
        offsets, lines, at, last = [self._start], 0, self._start, b"\n"
        while at < self._size:
            chunk = self._bytes(at, min(at + CHUNK, self._size))
            ends = np.flatnonzero(np.frombuffer(chunk, dtype=np.uint8) == 10)
            first = -(-(lines + 1) // STRIDE) * STRIDE - lines - 1
            offsets += (at + ends[first::STRIDE] + 1).tolist()
            lines, at, last = lines + ends.size, at + len(chunk), chunk[-1:]
        return offsets, lines + (last != b"\n")

    def read(self, start: int, stop: int, wanted: Sequence[int]) -> list[NDArray]:
        """Return rows of some columns."""
        return _parse(self._segment(start, stop), wanted)

    def table(self, start: int, stop: int) -> Table:
        """Return a segment of rows as a table; messages name the lines of the file."""
        numbers: list[int] = []

        def load(wanted: Sequence[int]) -> list[NDArray]:
            segment = self._segment(start, stop)
            numbers[:] = segment.numbers
            return _parse(segment, wanted)

        return Table(
            self.path, self.names, load, row=lambda i: f"line {numbers[i]}", units=self._layout.units
        )

    def _segment(self, start: int, stop: int) -> Layout:
        """Return lines of data, read by the rules of the file's beginning: no line is a header again."""
        offsets, _ = self._index
        first, last = start // STRIDE, -(-stop // STRIDE)
        data = self._bytes(offsets[first], offsets[last] if last < len(offsets) else self._size)
        lines = data.split(b"\n")[start - first * STRIDE : stop - first * STRIDE]
        text = _decode(self.path, b"\n".join(lines))
        kept, numbers, _ = _rows_of(text, self._above + start + 1)
        if not kept:
            raise InputError(f"{self.path}: holds no row of data from line {self._above + start + 1} on")
        rules = self._layout
        kept = _with_points(kept, rules.delimiter)
        top = self._layout.numbers[0]
        _check_lengths(self.path, kept, numbers, rules.delimiter, len(rules.names), top)
        segment = replace(rules, lines=kept, numbers=numbers)
        # Only the last line of the file may lack its end.
        if stop >= self.rows and self._bytes(self._size - 1, self._size) not in (b"\n", b"\r"):
            _check_end(segment)
        return segment

    def _bytes(self, start: int, stop: int) -> bytes:
        with self.path.open("rb") as file:
            file.seek(start)
            return file.read(stop - start)
