"""CSV, TSV and other text tables: preamble, comment lines, delimiter, a header, perhaps a row of units."""

from __future__ import annotations

import codecs
import re
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from sindyjoint.errors import InputError
from sindyjoint.files.blocks import Blocks
from sindyjoint.files.readers.fields import find_delimiter, has_decimal_comma, is_number, split_fields
from sindyjoint.files.readers.preamble import preamble_length
from sindyjoint.files.readers.stamps import is_stamp, seconds_since_first
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
_DATE = re.compile(r"\d[-/.]\d{1,2}[-/.]\d|\d:\d")
_BLANKS = ("\n", " ", "\t", "\f")


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
    remarks: tuple[str, ...] = ()
    """Comments and other lines above the header."""


def read_text(path: Path, data: bytes, skip: int | None = None) -> Table:
    """Return the columns of a text table.

    Parameters
    ----------
    path : Path
    data : bytes
    skip : int, optional
        Lines at the top of the file that belong to no table. Default: found.

    Raises
    ------
    InputError
        For an empty file, binary rubbish, a header without data, rows of different lengths, or one that is cut off.
    """
    return table_of_text(path, decode_text(path, data), skip)


def table_of_text(path: Path, text: str, skip: int | None = None) -> Table:
    """Return the columns of a text table that is in memory; see :func:`read_text`."""
    layout = _layout(path, text, skip)
    if not text.endswith("\n"):
        _check_end(layout)
    return Table(
        path,
        layout.names,
        lambda wanted: _parse(layout, wanted),
        row=lambda i: f"line {layout.numbers[i]}",
        units=layout.units,
        remarks=layout.remarks,
    )


def _check_end(layout: Layout) -> None:
    """Refuse a file without a last line end whose last number is shorter than all above: 6.2 may be of 6.2e-05."""
    *above, last = (split_fields(line, layout.delimiter)[-1] for line in layout.lines[-COMPARED - 1 :])
    if len(above) == COMPARED and len(last) < min(map(len, above)):
        raise InputError(
            f"{layout.path}: ends within line {layout.numbers[-1]}: its last number, {last!r:.40}, is shorter than the "
            f"{COMPARED} above it; copy the file again, or end that line if the file is whole"
        )


def decode_text(path: Path, data: bytes) -> str:
    """Return the text of a file in UTF-8, UTF-16 or Latin-1, with one kind of line end."""
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


def _layout(path: Path, text: str, skip: int | None = None) -> Layout:
    """Find delimiter, header and first row of data."""
    above, text = _cut_top(text, skip)
    lines, numbers, below = _rows_of(text, len(above) + 1)
    comments = [line.strip() for line in above if line.strip()] + below
    if not lines:
        raise InputError(f"{path}: holds comment lines only; expected a table with a header and rows")
    skipped = 0 if skip is not None else preamble_length(lines)
    remarks = (*comments, *(line.strip() for line in lines[:skipped]))
    lines, numbers = lines[skipped:], numbers[skipped:]
    delimiter = find_delimiter(lines)
    # numpy.savetxt writes the header as the last comment before the data.
    comment = comments[-1].lstrip("#%/ \t") if comments and not skipped else ""
    names, units, rows = _header(lines, delimiter, comment)
    head, lines, numbers = numbers[0], lines[rows:], numbers[rows:]
    if not lines:
        raise InputError(f"{path}: has a header ({', '.join(names):.200}) and no rows of data")
    lines = _with_points(lines, delimiter)
    _check_lengths(path, lines, numbers, delimiter, len(names), head)
    return Layout(path, names, delimiter, lines, numbers, units, remarks)


def _cut_top(text: str, skip: int | None) -> tuple[list[str], str]:
    """Return the first lines of a text, so many or as many as are comments, and the text below them."""
    at = 0
    count = 0
    while at < len(text) and (count < skip if skip is not None else text.startswith(COMMENTS, at)):
        end = text.find("\n", at)
        at = len(text) if end < 0 else end + 1
        count += 1
    return text[:at].split("\n")[:count], text[at:] if at else text


def _header(
    lines: list[str], delimiter: str | None, comment: str
) -> tuple[tuple[str, ...], tuple[str, ...], int]:
    """Return names and units of the columns, and how many lines hold them; a column without a name has its number."""
    first = split_fields(lines[0], delimiter)
    if all(is_number(field) or is_stamp(field) for field in first):
        above = split_fields(comment, delimiter) if comment else []
        numbered = tuple(str(position) for position in range(1, len(first) + 1))
        return tuple(above) if len(above) == len(first) else numbered, (), 0
    names = tuple(field or str(position) for position, field in enumerate(first, start=1))
    units = split_fields(lines[1], delimiter) if len(lines) > 1 else []
    if (
        len(units) == len(names)
        and any(units)
        and not any(is_number(unit) or is_stamp(unit) for unit in units)
    ):
        return names, tuple(units), 2
    return names, (), 1


def _rows_of(text: str, first: int = 1) -> tuple[list[str], list[int], list[str]]:
    """Return the lines that are neither blank nor a comment, their numbers, and the comments before them."""
    all_lines = text.split("\n")
    if text and not _irregular(text):
        lines = all_lines if all_lines[-1] else all_lines[:-1]
        return lines, list(range(first, first + len(lines))), []
    comments: list[str] = []
    lines, numbers = [], []
    for number, line in enumerate(all_lines, start=first):
        stripped = line.strip()
        if stripped.startswith(COMMENTS):
            comments += [] if lines else [stripped]
        elif stripped:
            lines.append(line)
            numbers.append(number)
    return lines, numbers, comments


def _irregular(text: str) -> bool:
    """Return whether a text may hold comments or blank lines; most hold none, and need no look at every line."""
    # The search takes long, and can only find something where a line begins with a blank.
    indented = text[0] in _BLANKS or any("\n" + blank in text for blank in _BLANKS)
    return (
        any(mark in text for mark in COMMENTS) or (indented and bool(_BLANK.search(text))) or not text.strip()
    )


def _with_points(lines: list[str], delimiter: str | None) -> list[str]:
    """Turn decimal commas into points where the comma does not part the fields."""
    if delimiter == "," or not any(has_decimal_comma(field) for field in split_fields(lines[0], delimiter)):
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
        if quick != width and len(split_fields(line, delimiter)) != width:
            found = len(split_fields(line, delimiter))
            raise InputError(
                f"{path}: line {number} has {found} fields and line {top} has {width}; expected equal "
                "numbers (put # before lines that belong to no table)"
            )


def _parse(layout: Layout, wanted: Sequence[int]) -> list[NDArray[np.float64]]:
    """Return columns as numbers; the fast way first, the careful one to explain a failure."""
    if not wanted:
        return []
    first = split_fields(layout.lines[0], layout.delimiter)
    stamped = [position for position in wanted if position < len(first) and is_stamp(first[position])]
    numeric = [position for position in wanted if position not in stamped]
    quote = '"' if any('"' in line for line in layout.lines[:3]) else None
    try:
        values = np.loadtxt(
            layout.lines, delimiter=layout.delimiter, usecols=numeric, ndmin=2, comments=None, quotechar=quote
        )
    except ValueError as error:
        raise _explain_error(layout, numeric, error) from error
    columns = dict(zip(numeric, np.ascontiguousarray(values.T), strict=True)) if numeric else {}
    columns |= {position: _read_stamps(layout, position) for position in stamped}
    return [columns[position] for position in wanted]


def _read_stamps(layout: Layout, position: int) -> NDArray[np.float64]:
    """Return a column of clock or date stamps in seconds since the first row."""
    stamps = [split_fields(line, layout.delimiter)[position] for line in layout.lines]
    try:
        return seconds_since_first(stamps)
    except ValueError as error:
        at = error.args[0]
        raise InputError(
            f"{layout.path}: line {layout.numbers[at]}: column {layout.names[position]!r} holds {stamps[at]!r:.40}; "
            "expected a time stamp, such as 12:30:00.25"
        ) from error


def _explain_error(layout: Layout, wanted: Sequence[int], error: ValueError) -> InputError:
    """Find the first field that is not a number."""
    for line, number in zip(layout.lines, layout.numbers, strict=True):
        fields = split_fields(line, layout.delimiter)
        for position in wanted:
            field = fields[position] if position < len(fields) else ""
            if not is_number(field):
                given = f"holds {field!r:.40}" if field else "is blank"
                name = layout.names[position]
                hint = ", or [channels] rate instead of these dates" if _DATE.search(field) else ""
                return InputError(
                    f"{layout.path}: line {number}: column {name!r} {given}; expected a number{hint}"
                )
    return InputError(f"{layout.path}: cannot be read as a table of numbers ({error})")


def text_blocks(path: Path, skip: int | None = None) -> Blocks | None:
    """Open a text table to be read in segments; None for one whose letters take two bytes each."""
    head = begins(path)
    return None if head.startswith((codecs.BOM_UTF16_LE, codecs.BOM_UTF16_BE)) else TextBlocks(path, skip)


class TextBlocks(Blocks):
    """CSV and other text, by the byte offset of every so many lines."""

    def __init__(self, path: Path, skip: int | None = None):
        self.path = path
        self._size = path.stat().st_size
        head = self._bytes(0, min(self._size, 1 << 16))
        cut = head.rfind(b"\n") + 1 or len(head)
        self._layout = _layout(path, decode_text(path, head[:cut]), skip)
        self.names, self.remarks = self._layout.names, self._layout.remarks
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
            self.path,
            self.names,
            load,
            row=lambda i: f"line {numbers[i]}",
            units=self._layout.units,
            remarks=tuple(self.remarks),
        )

    def _segment(self, start: int, stop: int) -> Layout:
        """Return lines of data, read by the rules of the file's beginning: no line is a header again."""
        offsets, _ = self._index
        first, last = start // STRIDE, -(-stop // STRIDE)
        data = self._bytes(offsets[first], offsets[last] if last < len(offsets) else self._size)
        lines = data.split(b"\n")[start - first * STRIDE : stop - first * STRIDE]
        text = decode_text(self.path, b"\n".join(lines))
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
