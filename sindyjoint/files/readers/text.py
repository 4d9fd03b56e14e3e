"""CSV, TSV and other text tables: preamble, comment lines, delimiter, a header, perhaps a row of units."""

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
from sindyjoint.files.readers import Table, begins
from sindyjoint.files.units import is_unit
from sindyjoint.record import MINIMUM_SAMPLES

_DECIMAL_COMMA = re.compile(r"\s*[+-]?(\d+|\d{1,3}(\.\d{3})+),\d+([eE][+-]?\d+)?\s*")
# Points between thousands, where a comma stands before decimals.
_GROUPING = re.compile(r"(?<=\d)\.(?=\d{3}(\.\d{3})*,\d)")
# A date may stand before it and a zone behind it: only the time within the day is read. Or minutes and seconds.
_CLOCK = re.compile(
    r"(?:^|.*[T\s])(\d{1,2}):(\d{2}):(\d{2}(?:[.,]\d+)?)\s*([AaPp][Mm])?\s*(?:Z|[+-]\d{2}:?\d{2})?$"
    r"|^(\d{1,3}):(\d{2}[.,]\d+)$"
)
DAY = 86400.0
# Lines in a row that look like the rest of the table: its data have begun.
ALIKE = 3
# A preamble is longer than this in no file that anybody writes.
LONGEST = 400
# What programs write where there is no number.
MISSING = {"", "na", "n/a", "#n/a", "null", "none", "-", "--"}
# What rows without a text for a label begin with.
COUNTED = (["0", "1", "2"], ["1", "2", "3"])
_THOUSANDS = re.compile(r"[+-]?\d{1,3}(,\d{3})+\.\d*")


def find_delimiter(lines: Sequence[str], sample: str | None = None) -> str | None:
    """Return what parts the fields of a line, by default of the third; None for blanks."""
    sample = lines[min(len(lines) - 1, 2)] if sample is None else sample
    # A comma may stand before decimals. A single column has no delimiter at all, and its header may hold blanks.
    parts = "," in lines[0] or not has_decimal_comma(sample, False)
    found = next((each for each in ("\t", ";", *"," * parts) if each in sample), None)
    return "," if found is None and len(sample.split()) < 2 else found


def split_fields(line: str, delimiter: str | None) -> list[str]:
    """Return the fields of one line, without blanks around them; a delimiter at its end opens no field."""
    text = " ".join(line.split()) if delimiter is None else line
    try:
        fields = next(csv.reader([text], delimiter=delimiter or " ", skipinitialspace=True))
    except csv.Error:  # a field beyond csv's limit of 131 072 letters
        fields = text.split(delimiter)
    fields = [field.strip() for field in fields]
    return fields[:-1] if len(fields) > 1 and not fields[-1] else fields


def is_number(field: str) -> bool:
    """Return whether a field is a number, with a point or a decimal comma.

    Examples
    --------
    >>> is_number("1.5e-3"), is_number("1,5"), is_number("1_000"), is_number("kN")
    (True, True, False, False)
    """
    try:
        float(field)
    except ValueError:
        return has_decimal_comma(field)
    return "_" not in field  # Python's float takes 1_000, tables do not


def has_decimal_comma(field: str, whole: bool = True) -> bool:
    """Return whether a field is, or begins with, a number with a decimal comma."""
    return bool((_DECIMAL_COMMA.fullmatch if whole else _DECIMAL_COMMA.match)(field))


def is_stamp(field: str) -> bool:
    """Return whether a field is a clock or date time.

    Examples
    --------
    >>> is_stamp("2024-05-01T12:30:00.125+02:00"), is_stamp("12:30.5"), is_stamp("12.5"), is_stamp("12:30")
    (True, True, False, False)
    """
    return ":" in field and bool(_CLOCK.match(field))


def seconds_since_first(stamps: Sequence[str]) -> NDArray[np.float64]:
    """Return clock or date stamps as seconds since the first of them, also across midnight.

    Raises
    ------
    ValueError
        With the index of the first field that is no time stamp as its only argument.

    Examples
    --------
    >>> seconds_since_first(["23:59:59.5", "00:00:00.5"]).tolist()
    [0.0, 1.0]
    """
    seconds = np.empty(len(stamps))
    for index, stamp in enumerate(stamps):
        clock = _CLOCK.match(stamp)
        if clock is None:
            raise ValueError(index)
        hours = int(clock[1] or 0)
        hours = hours % 12 + 12 * (clock[4].lower() == "pm") if clock[4] else hours
        seconds[index] = (
            3600 * hours + 60 * int(clock[2] or clock[5]) + float((clock[3] or clock[6]).replace(",", "."))
        )
    days = np.cumsum(np.diff(seconds, prepend=seconds[:1]) < -DAY / 2)
    # Stamps have microseconds; a difference of large floats has digits beyond them that mean nothing.
    return np.round(seconds - seconds[0] + DAY * days, 9)


def find_table(lines: Sequence[str]) -> tuple[list[int], int]:
    """Return which lines hold names and units, and where the data begin; none, and 0, where no table is to be seen.

    The middle line shows what a row looks like: how many fields, and which of them are numbers. The data begin with the
    first three rows like it. The line above, if it has as many fields and no number, is the header, and a row of units
    may stand between them. Of more such lines the last of units is taken, and the next above it whose fields differ:
    the others, of groups or numbers of channels, name no column.
    """
    sample = lines[len(lines) // 2]
    delimiter = find_delimiter(lines, sample)
    pattern = [_kind(field) for field in split_fields(sample, delimiter)]
    if "number" not in pattern:
        return [], 0
    width = len(pattern)
    rows = [split_fields(line, delimiter) for line in lines[: LONGEST + ALIKE]]
    kinds = [[_kind(field) for field in row] for row in rows]
    alike = [
        len(row) == width
        and all("blank" in pair or len(set(pair)) == 1 for pair in zip(row, pattern, strict=True))
        for row in kinds
    ]
    first = next((i for i in range(len(rows)) if all(alike[i : i + ALIKE])), 0)
    headings = [len(row) == width and set(row) != {"blank"} and "number" not in row for row in kinds[:first]]
    top = next((at + 1 for at in range(first - 1, -1, -1) if not headings[at]), 0)
    units = [at for at in range(top, first) if all(is_unit(field) for field in rows[at] if field)]
    named = [at for at in range(top, units[-1]) if len(set(rows[at])) == width] if units else []
    heads = list(range(max(top, first - 2), first))
    if len(heads) == 2 and (first > 2 or width == 1):
        heads = [named[-1], units[-1]] if named else heads[first - 1 not in units :]
    if not heads and first and len(rows[first - 1]) > 1 and "number" not in kinds[first - 1]:
        return [], 0  # a header of another width than its columns: to be reported, not passed over
    return ([], 0) if any(_is_broken_row(row, pattern) for row in kinds[:top]) else (heads, first)


def _kind(field: str) -> str:
    if is_number(field):
        return "number"
    return "stamp" if is_stamp(field) else "blank" if field.lower() in MISSING else "text"


def _is_broken_row(kinds: Sequence[str], pattern: Sequence[str]) -> bool:
    """Return whether a line looks like a damaged row of data, which no one may pass over in silence."""
    numbers = kinds.count("number")
    if numbers == len(kinds):
        return len(kinds) > 1
    return len(kinds) == len(pattern) > 2 and 2 * numbers >= pattern.count("number")


COMMENTS = ("#", "%", "//")
# Bytes of text scanned at once, and lines between two line offsets that are kept.
STRIDE = 1 << 15
COMPARED = 20  # lines that the last one of a file is compared with
# What no text table holds: control characters other than tab, line ends, form feed and DOS's end of file.
_CONTROL = re.compile(r"[\x00-\x08\x0b\x0e-\x19\x1b-\x1f]")
_HARMLESS = bytes(set(range(256)) - set(range(0x20)) | {0x09, 0x0A, 0x0C, 0x0D, 0x1A})
_BLANK = re.compile(r"\A[ \t\f]*\n|\n[ \t\f]*\n|\n[ \t\f]+\Z")
_DATE = re.compile(r"\d[-/.]\d{1,2}[-/.]\d|\d:\d")


def read_text(path: Path, data: bytes | None = None, skip: int | None = None) -> Table | None:
    """Return the columns of a text table; None in place of segments of two-byte letters, or of rows of a channel each.

    Parameters
    ----------
    path : Path
    data : bytes, optional
        Of the file; without them it is read in segments.
    skip : int, optional
        Lines at the top of the file that belong to no table. Default: found.

    Raises
    ------
    InputError
        For an empty file, binary rubbish, a header without data, rows of different lengths, or one that is cut off.
    """
    if data is not None:
        return table_of_text(path, decode_text(path, data), skip)
    if begins(path).startswith((codecs.BOM_UTF16_LE, codecs.BOM_UTF16_BE)):
        return None
    segments = _Segments(path, skip)
    return segments.table() if segments.layout.wide() is segments.layout else None


def table_of_text(path: Path, text: str, skip: int | None = None) -> Table:
    """Return the columns of a text table that is in memory; see :func:`read_text`."""
    layout = _layout(path, text, skip)
    if not text.endswith("\n"):
        layout.check_end()
    layout = layout.wide()
    return Table(
        path, layout.names, lambda wanted, start, stop: layout.parse(wanted), count=lambda: len(layout.lines),
        name_row=lambda index: f"line {layout.numbers[index]}", units=layout.units, remarks=layout.remarks,
    )  # fmt: skip


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


@dataclass(frozen=True)
class _Layout:
    """Lines of one file, and how they are to be read."""

    path: Path
    names: tuple[str, ...]
    delimiter: str | None
    lines: list[str]
    numbers: list[int]
    """Line number in the file, from 1, of each entry of ``lines``."""
    units: tuple[str, ...]
    """Unit of each column, where there is a row of units."""
    remarks: tuple[str, ...]
    """Comments and other lines above the header."""
    top: int
    """Line number of the header."""

    def of(self, lines: list[str], numbers: list[int]) -> "_Layout":
        """Return rows to be read by the same rules: decimal commas made points, all rows of one length."""
        delimiter, width = self.delimiter, len(self.names)
        if delimiter != "," and any(map(has_decimal_comma, split_fields(lines[0], delimiter))):
            lines = [_GROUPING.sub("", line).replace(",", ".") for line in lines]
        if delimiter is None or {line.count(delimiter) for line in lines} != {width - 1}:
            for line, number in zip(lines, numbers, strict=True):
                # Counting delimiters is fast and nearly always enough; quoted or trailing ones need the careful way.
                quick = len(line.split()) if delimiter is None else line.count(delimiter) + 1
                if quick != width and (found := len(split_fields(line, delimiter))) != width:
                    unequal = f"{self.path}: line {number} has {found} fields and line {self.top} has {width}"
                    if number == numbers[-1] and found < width:
                        raise InputError(
                            f"{unequal}: the file ends there, cut off; copy it again, or remove that line"
                        )
                    raise InputError(
                        f"{unequal}; expected equal numbers (put # before lines that belong to no table)"
                    )
        return replace(self, lines=lines, numbers=numbers)

    def wide(self) -> "_Layout":
        """Return a table of which each row holds the name and one value of a channel with a column for each channel."""
        # A blank at the end of a line is no field.
        head = [[*split_fields(line, self.delimiter), ""] for line in self.lines[:LONGEST]]
        kinds = [set(map(_kind, column)) for column in zip(*head, strict=False)]
        words = [at for at, kind in enumerate(kinds) if kind == {"text"}]
        numbers = [at for at, kind in enumerate(kinds) if "number" in kind and kind <= {"number", "blank"}]
        if not words or not numbers:
            return self
        rows = [[*split_fields(line, self.delimiter), ""] for line in self.lines]
        for named in words[::-1]:
            channels = list(dict.fromkeys(row[named] for row in rows))
            if len(channels) * MINIMUM_SAMPLES > len(rows):
                continue
            pairs = {at: {(row[named], row[at]) for row in rows} for at in words if at != named}
            told = [
                at for at, of in pairs.items() if len(of) == len(channels) and all(is_unit(u) for _, u in of)
            ]
            keys = [at for at in range(len(self.names)) if at not in (named, numbers[-1], *told)]
            table: dict[tuple[str, ...], dict[str, str]] = {}
            for row in rows:
                table.setdefault(tuple(row[at] for at in keys), {})[row[named]] = row[numbers[-1]]
            if sum(map(len, table.values())) == len(rows) > len(table):
                units = {row[named]: row[told[0]] for row in rows[::-1]} if told else {}
                return replace(
                    self, names=(*(self.names[at] for at in keys), *channels), delimiter="\t",
                    lines=["\t".join((*key, *(of.get(c, "") for c in channels))) for key, of in table.items()],
                    numbers=self.numbers[: len(table)],
                    units=(*[""] * len(keys), *(units.get(c, "") for c in channels)),
                )  # fmt: skip
        return self

    def check_end(self) -> None:
        """Refuse a file without a last line end whose last number is shorter than all above: 6.2 may be of 6.2e-05."""
        *above, last = (split_fields(line, self.delimiter)[-1] for line in self.lines[-COMPARED - 1 :])
        if len(above) == COMPARED and len(last) < min(map(len, above)):
            raise InputError(
                f"{self.path}: ends within line {self.numbers[-1]}: its last number, {last!r:.40}, is shorter than "
                f"the {COMPARED} above it; copy the file again, or end that line if the file is whole"
            )

    def parse(self, wanted: Sequence[int]) -> list[NDArray[np.float64]]:
        """Return columns as numbers, those of clock or date stamps in seconds since the first row."""
        first = split_fields(self.lines[0], self.delimiter)
        columns = {at: self._stamps(at) for at in wanted if at < len(first) and is_stamp(first[at])}
        numeric = [position for position in wanted if position not in columns]
        if numeric:
            quote = '"' if any('"' in line for line in self.lines[:3]) else None
            try:
                values = np.loadtxt(
                    self.lines,
                    delimiter=self.delimiter,
                    usecols=numeric,
                    ndmin=2,
                    comments=None,
                    quotechar=quote,
                )
            except ValueError:
                values = self._field_by_field(numeric)
            columns |= dict(zip(numeric, np.ascontiguousarray(values.T), strict=True))
        return [columns[position] for position in wanted]

    def _stamps(self, position: int) -> NDArray[np.float64]:
        stamps = [split_fields(line, self.delimiter)[position] for line in self.lines]
        try:
            return seconds_since_first(stamps)
        except ValueError as error:
            at = error.args[0]
            raise InputError(
                f"{self.path}: line {self.numbers[at]}: column {self.names[position]!r} holds {stamps[at]!r:.40}; "
                "expected a time stamp, such as 12:30:00.25"
            ) from error

    def _field_by_field(self, wanted: Sequence[int]) -> NDArray[np.float64]:
        """Return columns as numbers, NaN where there is none, or refuse the first field that is something else."""
        values = np.full((len(self.lines), len(wanted)), np.nan)
        for row, (line, number) in enumerate(zip(self.lines, self.numbers, strict=True)):
            fields = split_fields(line, self.delimiter)
            for place, position in enumerate(wanted):
                field = fields[position] if position < len(fields) else ""
                if _THOUSANDS.fullmatch(field):
                    field = field.replace(",", "")
                if is_number(field) and "," not in field:
                    values[row, place] = float(field)
                elif field.lower() not in MISSING:
                    hint = ", or [channels] rate instead of these dates" if _DATE.search(field) else ""
                    raise InputError(
                        f"{self.path}: line {number}: column {self.names[position]!r} holds {field!r:.40}; expected a "
                        f"number{hint}"
                    )
        return values


def _layout(path: Path, text: str, skip: int | None) -> _Layout:
    """Find delimiter, header and first row of data."""
    at = count = 0
    while at < len(text) and (count < skip if skip is not None else text.startswith(COMMENTS, at)):
        end = text.find("\n", at)
        at, count = len(text) if end < 0 else end + 1, count + 1
    above = text[:at].split("\n")[:count]
    lines, numbers, below = _rows_of(text[at:] if at else text, len(above) + 1)
    comments = [line.strip() for line in above if line.strip()] + below
    if not lines:
        raise InputError(f"{path}: holds comment lines only; expected a table with a header and rows")
    heads, begin = ([], 0) if skip is not None else find_table(lines)
    passed = [line.strip() for at, line in enumerate(lines[:begin]) if at not in heads]
    remarks = (*comments, *passed)
    lines = [lines[at] for at in heads] + lines[begin:]
    numbers = [numbers[at] for at in heads] + numbers[begin:]
    delimiter = find_delimiter(lines)
    rows = [split_fields(line, delimiter) for line in lines] if len(lines) < MINIMUM_SAMPLES else [[""]]
    if len(rows[0]) >= MINIMUM_SAMPLES and len({len(row) - is_number(row[0]) for row in rows}) == 1:
        # A channel in each row, with its name at the left.
        delimiter = "\t"
        lines = [delimiter.join(fields) for fields in zip(*rows, strict=True)]
        numbers = list(range(1, len(lines) + 1))
    # numpy.savetxt writes the header as the last comment before the data.
    comment = comments[-1].lstrip("#%/ \t") if comments and not passed else ""
    names, units, head = _header(lines, delimiter, comment)
    if not lines[head:]:
        raise InputError(f"{path}: has a header ({', '.join(names):.200}) and no rows of data")
    layout = _Layout(path, names, delimiter, [], [], units, remarks, numbers[0])
    return layout.of(lines[head:], numbers[head:])


def _header(
    lines: list[str], delimiter: str | None, comment: str
) -> tuple[tuple[str, ...], tuple[str, ...], int]:
    """Return names and units of the columns, and how many lines hold them; a column without a name has its number."""
    first, second = (split_fields(line, delimiter) for line in (lines[0], *lines[1:2], "")[:2])
    if all(is_number(field) or is_stamp(field) for field in first):
        above = split_fields(comment, delimiter) if comment else []
        numbered = tuple(str(position) for position in range(1, len(first) + 1))
        return tuple(above) if len(above) == len(first) else numbered, (), 0
    labels = [split_fields(line, delimiter)[0] for line in lines[1 : 1 + ALIKE]]
    if len(second) == len(first) + 1 and (labels in COUNTED or not any(map(is_number, labels))):
        # Programs that label rows leave the name of that column out.
        first = ["", *first]
    names = tuple(field or str(position) for position, field in enumerate(first, start=1))
    numbers = any(is_number(field) or is_stamp(field) for field in second)
    if len(lines) > 1 and len(second) == len(names) and any(second) and not numbers:
        return names, tuple(second), 2
    return names, (), 1


def _rows_of(text: str, first: int) -> tuple[list[str], list[int], list[str]]:
    """Return the lines that are neither blank nor a comment, their numbers, and the comments before them."""
    all_lines = text.split("\n")
    # Most texts hold neither, and need no look at every line; the search for blank ones takes long, and can only find
    # something where a line begins with a blank.
    indented = text[:1] in ("\n", " ", "\t", "\f") or any("\n" + blank in text for blank in "\n \t\f")
    if text.strip() and not any(mark in text for mark in COMMENTS) and not (indented and _BLANK.search(text)):
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


class _Segments:
    """Rows of a text table by the byte offset of every so many lines, read by the rules of the file's beginning."""

    def __init__(self, path: Path, skip: int | None):
        self.path, self.size = path, path.stat().st_size
        head = self._bytes(0, 1 << 16)
        cut = head.rfind(b"\n") + 1 or len(head)
        self.layout = _layout(path, decode_text(path, head[:cut]), skip)
        # Lines above the first row of data, and where that begins.
        self.above = self.layout.numbers[0] - 1
        self.start = sum(len(line) + 1 for line in head[:cut].split(b"\n")[: self.above])
        self.read, self.first = self.layout, 0

    def table(self) -> Table:
        """Return the table; messages name the lines of the file."""
        return Table(
            self.path, self.layout.names, self._load, count=lambda: self._index[1], units=self.layout.units,
            name_row=lambda index: f"line {self.read.numbers[index - self.first]}", remarks=self.layout.remarks,
        )  # fmt: skip

    @cached_property
    def _index(self) -> tuple[list[int], int]:
        """Where every so many lines begin, and how many lines there are after the header."""
        offsets, lines, at, last = [self.start], 0, self.start, b"\n"
        while at < self.size:
            chunk = self._bytes(at, at + (1 << 24))
            ends = np.flatnonzero(np.frombuffer(chunk, dtype=np.uint8) == 10)
            first = -(-(lines + 1) // STRIDE) * STRIDE - lines - 1
            offsets += (at + ends[first::STRIDE] + 1).tolist()
            lines, at, last = lines + ends.size, at + len(chunk), chunk[-1:]
        return offsets, lines + (last != b"\n")

    def _load(self, wanted: Sequence[int], start: int, stop: int) -> list[NDArray[np.float64]]:
        offsets, rows = self._index
        first, last = start // STRIDE, -(-stop // STRIDE)
        data = self._bytes(offsets[first], offsets[last] if last < len(offsets) else self.size)
        lines = data.split(b"\n")[start - first * STRIDE : stop - first * STRIDE]
        text = decode_text(self.path, b"\n".join(lines))
        kept, numbers, _ = _rows_of(text, self.above + start + 1)
        if not kept:
            raise InputError(f"{self.path}: holds no row of data from line {self.above + start + 1} on")
        self.read, self.first = self.layout.of(kept, numbers), start
        # Only the last line of the file may lack its end.
        if stop >= rows and self._bytes(self.size - 1, self.size) not in (b"\n", b"\r"):
            self.read.check_end()
        return self.read.parse(wanted)

    def _bytes(self, start: int, stop: int) -> bytes:
        with self.path.open("rb") as file:
            file.seek(start)
            return file.read(stop - start)
