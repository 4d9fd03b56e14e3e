"""One small reader per file format, chosen by the ending of the file, and what each of them returns: named columns.

How much memory the content of one file may take is known before anything is allocated for it.

Each returns a :class:`~sindyjoint.files.readers.Table` of named columns, or says in one sentence what
is wrong with the file. A new format is one function and one line in ``READERS``.
"""

from __future__ import annotations

import difflib
import gzip
import hashlib
import io
import math
import os
import re
import warnings
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager, suppress
from dataclasses import dataclass, field, replace
from functools import lru_cache
from importlib import import_module
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from sindyjoint.documents import check_regular, read_regular
from sindyjoint.errors import InputError, MissingExtraError, MissingInputError, SindyJointError, refuse
from sindyjoint.files.timeaxis import step_of
from sindyjoint.files.units import unit_in_name
from sindyjoint.inputs import FileUnit
from sindyjoint.numeric import Array

# What a file of a virtual test says about itself; its columns are in SI units.
SIMULATED = "simulated by sindyjoint"
VARIABLE = "SINDYJOINT_LARGEST"
"""Environment variable, which worker processes have as well; ``sindyjoint --largest`` sets it."""
MOST_COLUMNS = 10_000
# What programs call the unit of a column in its attributes.
UNIT_KEYS = ("unit", "units", "Unit", "Units", "unit_string", "NI_UnitDescription")
_SIZE = re.compile(r"\s*(\d{1,15}(?:\.\d{1,3})?)\s*([kMGT]?)(i?)B?\s*", re.IGNORECASE)


@dataclass(frozen=True)
class Table:
    """The columns of one file, or of some of its rows.

    Parameters
    ----------
    path : Path
    names : tuple of str
        In the order of the file; a name may occur twice, but cannot be asked for then.
    load : callable
        From positions in ``names``, first row and end to arrays of shape (n,), of lengths that may differ.
    aliases : mapping of str to int
        Further names, such as the name of a data set without its group.
    name_row : callable
        How a message names the row of an index in the file.
    units : tuple of str
        Unit of each column as the file states it apart from the name; empty where it does not.
    remarks : tuple of str
        What the file says above its columns, or about itself.
    count : callable
        Returns how many rows there are. Of text files, lines after the header: blank and comment lines count, and give
        no row when they are read.
    largest : callable
        Returns the largest magnitude of a column, if the file states it.
    first, stop : int
        Rows that are meant; all of them if omitted.
    """

    path: Path
    names: tuple[str, ...]
    load: Callable[[Sequence[int], int, int], Sequence[NDArray[Any]]]
    aliases: Mapping[str, int] = field(default_factory=dict)
    name_row: Callable[[int], str] = lambda index: f"row {index + 1}"
    units: tuple[str, ...] = ()
    remarks: tuple[str, ...] = ()
    count: Callable[[], int] = lambda: 0
    largest: Callable[[str | int], float | None] = lambda column: None
    first: int = 0
    stop: int | None = None

    @classmethod
    def of(cls, path: Path, arrays: Mapping[str, NDArray[Any]], **known: Any) -> Table:
        """Return the table of columns that are in memory."""
        columns = list(arrays.values())
        return cls(path, tuple(arrays), lambda wanted, start, stop: [columns[at] for at in wanted], **known)

    @property
    def rows(self) -> int:
        """Number of rows of the file."""
        return self.count()

    def table(self, start: int, stop: int) -> Table:
        """Return a segment of rows."""
        return replace(self, first=start, stop=stop)

    def part(self, first: int, last: int) -> Table:
        """Return the table of some rows, from 1, as if the file held no others.

        Raises
        ------
        InputError
            For rows that are not there.
        """

        def load(wanted: Sequence[int], start: int, stop: int) -> list[NDArray[Any]]:
            whole = self.load(wanted, self.first, self.rows if self.stop is None else self.stop)
            count = min(values.size for values in whole)
            if not 1 <= first < last <= count:
                raise InputError(f"{self.path}: has {count} rows; rows {first} to {last} are not there")
            return [values[first - 1 : last] for values in whole]

        return replace(
            self, load=load, name_row=lambda index: self.row(first - 1 + index), first=0, stop=None
        )

    def row(self, index: int) -> str:
        """Return how a message names a sample."""
        return self.name_row(self.first + index)

    @property
    def simulated(self) -> bool:
        """Whether the file says that it comes from a virtual test."""
        return any(SIMULATED in remark for remark in self.remarks)

    def with_column(self, other: Table, column: str | int, name: str) -> Table:
        """Return this table with a column of another one under a name."""
        at, own = other._find_column(column), len(self.names)
        units = [*self.units, *[""] * (own - len(self.units)), other.stated_unit(column)[1]]

        def load(wanted: Sequence[int], start: int, stop: int) -> list[NDArray[Any]]:
            mine = iter(self.load([position for position in wanted if position < own], start, stop))
            return [
                next(mine) if position < own else other.load([at], 0, other.rows)[0] for position in wanted
            ]

        remarks = (*self.remarks, *other.remarks)
        return replace(self, names=(*self.names, name), load=load, units=tuple(units), remarks=remarks)

    def columns(self, wanted: Sequence[str | int], gaps: bool = False) -> list[Array]:
        """Return the requested columns as float64 arrays.

        Parameters
        ----------
        wanted : sequence of str or int
            Names, or positions counted from 1.
        gaps : bool
            Whether samples may be missing, which are NaN or infinite then, as long as most are there, or every second.

        Raises
        ------
        InputError
            For a column that is missing, named twice, not numeric, or not finite.
        """
        positions = [self._find_column(name) for name in wanted]
        distinct = sorted(set(positions))
        with foreign(self.path, self.path.suffix[1:]):
            arrays = self.load(distinct, self.first, self.rows if self.stop is None else self.stop)
        if len(arrays) != len(distinct):
            raise InputError(f"{self.path}: holds no rows; it may be damaged")
        loaded = dict(zip(distinct, arrays, strict=True))
        return [
            self._check_column(name, loaded[at], gaps) for name, at in zip(wanted, positions, strict=True)
        ]

    def stated_unit(self, name: str | int) -> tuple[str, str, bool]:
        """Return a column's name, the unit that the file states for it, and whether only the name's ending does.

        An empty one where the file states no unit. See :func:`sindyjoint.files.units.unit_in_name`.
        """
        at = self._find_column(name)
        title = self.names[at]
        if at < len(self.units) and self.units[at].strip():
            return title, self.units[at].strip().strip("[](){}").strip(), False
        return (title, *(unit_in_name(title) or ("", False)))

    def unit(self, channel: str, column: str | int, declared: str, factor: float = 1.0) -> FileUnit:
        """Return the unit of a column that is a channel, as it was declared, and as the file states it."""
        title, stated, named = self.stated_unit(column)
        asked = column if isinstance(column, str) else ""
        return FileUnit(channel, declared, factor, title if stated else asked, stated, named)

    def _find_column(self, name: str | int) -> int:
        if isinstance(name, int):
            if not 1 <= name <= len(self.names):
                raise InputError(
                    f"{self.path}: there is no column {name}; columns 1 to {len(self.names)} are there"
                )
            return name - 1
        count = self.names.count(name)
        if count > 1:
            raise InputError(
                f"{self.path}: column {name!r} is there {count} times; give each column another name"
            )
        if count == 1:
            return self.names.index(name)
        if name in self.aliases:
            return self.aliases[name]
        near = difflib.get_close_matches(name, self.names, n=1, cutoff=0.5)
        hint = f"did you mean {near[0]!r}? " if near else ""
        shown = ", ".join(
            [*(f"{known!r:.40}" for known in self.names[:20]), *["..."] * (len(self.names) > 20)]
        )
        raise InputError(f"{self.path}: column {name!r} is missing; {hint}columns there: {shown or 'none'}")

    def _check_column(self, name: str | int, values: NDArray[Any], gaps: bool) -> Array:
        array = np.asarray(values)
        if array.dtype.kind not in "fiub":
            raise InputError(f"{self.path}: column {name!r} holds {array.dtype}; expected real numbers")
        array = np.ascontiguousarray(array, dtype=np.float64)
        if array.ndim != 1:
            raise InputError(f"{self.path}: column {name!r} has shape {array.shape}; expected one dimension")
        bad = np.flatnonzero(~np.isfinite(array))
        if bad.size and not (gaps and (2 * bad.size < array.size or step_of(np.isfinite(array)) > 1)):
            raise InputError(
                f"{self.path}: column {name!r} holds {array[bad[0]]} in {self.row(int(bad[0]))}"
                + (f" and {bad.size - 1} more value(s) that are not finite" if bad.size > 1 else "")
                + "; remove or repair them"
            )
        return array


@contextmanager
def foreign(path: Path, kind: str) -> Iterator[None]:
    """Turn whatever a library throws at bad bytes into one sentence, and keep its warnings to itself."""
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            yield
    except (SindyJointError, ImportError):
        raise
    # Parsers of binary formats fail on rubbish with any class there is, MemoryError among them.
    except Exception as error:
        reason = " ".join(str(error).split())[:120] or type(error).__name__
        raise InputError(
            f"{path}: cannot be read as {kind} ({reason}); it may be truncated, damaged or of another format"
        ) from error


def library(doing: str, name: str, package: str = "", extra: str = "formats") -> Any:
    """Return a module that a format needs, or say which extra of this package brings it."""
    try:
        return import_module(name)
    except ImportError as error:
        raise MissingExtraError(
            f'{doing} this format needs {package or name}; run: pip install "sindyjoint[{extra}]"'
        ) from error


def begins(path: Path) -> bytes:
    """Return the first bytes of a file, which hold the version of its format."""
    with path.open("rb") as file:
        return file.read(16)


def vectors(name: str, array: NDArray[Any], subscript: str, first: int) -> dict[str, NDArray[Any]]:
    """Return a data set as named vectors: itself, or the columns of a matrix, or the rows of one that lies.

    Parameters
    ----------
    name : str
    array : ndarray
    subscript : str
        What follows the name of a column, such as ``"[:,{}]"``.
    first : int
        How the language of the file counts the first column.
    """
    if array.ndim == 2 and 1 not in array.shape:
        lies = array.shape[0] < array.shape[1]
        lines = array if lies else array.T
        return {name + numbered(subscript, lies, first + at): line for at, line in enumerate(lines)}
    return {name: array.ravel() if array.ndim == 2 else array}


def numbered(subscript: str, lies: bool, number: int) -> str:
    """Return the subscript of a column of a matrix, or of a row of one whose samples lie side by side.

    Examples
    --------
    >>> numbered("[:,{}]", False, 2), numbered("(:,{})", True, 1)
    ('[:,2]', '(1,:)')
    """
    return (subscript.replace(":,{}", "{},:") if lies else subscript).format(number)


def short_names(names: Sequence[str], separator: str) -> dict[str, int]:
    """Return the last parts of grouped names that stand for one data set only, with its position."""
    last = [name.rsplit(separator, 1)[-1] for name in names]
    return {name: position for position, name in enumerate(last) if last.count(name) == 1}


def parse_size(text: str) -> int:
    """Return a size such as "4 GB" in bytes.

    Raises
    ------
    InputError

    Examples
    --------
    >>> parse_size("4 GB"), parse_size("1.5MiB"), parse_size("2000000")
    (4000000000, 1572864, 2000000)
    """
    match = _SIZE.fullmatch(text)
    factor = (1024 if match[3] else 1000) ** " kmgt".index(match[2].lower() or " ") if match else 0
    value = int(float(match[1]) * factor) if match else 0
    if value < 1:
        raise InputError(f"size is {text!r:.40}; expected a number of bytes, such as '4 GB'")
    return value


def largest_bytes() -> int:
    """Return how many bytes the content of one file may take in memory."""
    given = os.environ.get(VARIABLE)
    return parse_size(given) if given else 1 << 30


def check_bytes(path: Path, size: int, what: str = "its content") -> None:
    """Refuse content beyond the limit.

    Raises
    ------
    InputError
    """
    largest = largest_bytes()
    if size > largest:
        raise InputError(
            f"{path}: {what} would take {size / 1e6:.6g} MB of memory, beyond the limit of {largest / 1e6:.6g} MB; if "
            f"it is meant, raise the limit: sindyjoint --largest {math.ceil(size / 1e6)}MB before the verb"
        )


def check_array(path: Path, shape: Sequence[int], item: int, what: str = "an array") -> int:
    """Return how many bytes an array takes; refuse one beyond the limit, or of more columns than a table has.

    Raises
    ------
    InputError
    """
    size = math.prod(shape) * item
    wide = len(shape) > 1 and min(shape) > MOST_COLUMNS
    no_table = wide or not 1 <= item <= (1 << 16) or any(n < 0 for n in shape)
    # An array without a single number still has as many columns as its shape states.
    empty = size == 0 and len(shape) > 1 and max(shape) > MOST_COLUMNS
    shown = f"{path}: {what} of shape {tuple(shape)!s:.60}"
    refuse(
        [
            (no_table, f"{shown} with {item} bytes an entry is no table of numbers"),
            (empty, f"{shown} holds nothing"),
        ]
    )
    check_bytes(path, size, what)
    return size


# ending -> module, function; the modules import their libraries when a file of that kind is met.
READERS = {
    **dict.fromkeys((".csv", ".tsv", ".txt", ".dat", ".asc"), ("text", "read_text")),
    ".lvm": ("recorders", "read_lvm"),
    ".xlsx": ("sheets", "read_xlsx"),
    ".json": ("sheets", "read_json"),
    ".parquet": ("sheets", "read_parquet"),
    ".feather": ("sheets", "read_feather"),
    ".mat": ("arrays", "read_mat"),
    **dict.fromkeys((".h5", ".hdf5"), ("arrays", "read_hdf5")),
    ".npz": ("arrays", "read_npz"),
    ".npy": ("arrays", "read_npy"),
    **dict.fromkeys((".uff", ".unv"), ("recorders", "read_uff")),
    ".tdms": ("recorders", "read_tdms"),
}
PACKED = ".gz"
# What reads segments of rows as well; of NPZ, MATLAB v5 and universal files the libraries load all or nothing.
IN_SEGMENTS = ("read_text", "read_parquet", "read_feather", "read_mat", "read_hdf5", "read_npy", "read_tdms")
# Readers of files that may have lines above their table.
WITH_PREAMBLE = ("read_text", "read_xlsx")


def read_table(path: str | Path, skip: int | None = None) -> tuple[Table, str]:
    """Open one data file.

    Parameters
    ----------
    path : path-like
    skip : int, optional
        Lines above the header, of a text table or a sheet. Default: found.

    Returns
    -------
    table : Table
        Its named columns.
    sha256 : str
        Hash of the bytes that were read.

    Raises
    ------
    MissingInputError
        When there is no such file.
    InputError
        For a folder, an unknown ending, or content that cannot be read.
    MissingExtraError
        When the library for this format is not installed.
    """
    file = Path(path)
    # os.path says no where pathlib raises: names too long, folders that may not be entered.
    if os.path.isdir(file):
        raise InputError(f"{file}: is a folder; expected a data file")
    if not os.path.exists(file):
        there = os.listdir(file.parent) if os.path.isdir(file.parent) else []
        near = difflib.get_close_matches(file.name, there, n=1)
        hint = f"; did you mean {near[0]!r}?" if near else ""
        raise MissingInputError(f"{file}: there is no such file{hint}")
    ending = ending_of(file)
    if ending not in READERS:
        known = ", ".join(ending.removeprefix(".") for ending in READERS)
        raise InputError(
            f"{file}: ending {file.suffix!r} is unknown; expected one of {known}, also with {PACKED}"
        )
    with suppress(OSError):
        check_bytes(file, check_regular(file))
    data = read_regular(file)
    skipped = skip is not None and READERS[ending][1] not in WITH_PREAMBLE
    refuse(
        [
            (not data, f"{file}: is empty"),
            (skipped, f"{file}: skip = {skip} was given; only text tables and sheets have lines to skip"),
        ]
    )
    content = _unpacked(file, data) if file.suffix.lower() == PACKED else data
    return _read(file, content, skip), hashlib.sha256(data).hexdigest()


def ending_of(path: Path) -> str:
    """Return the ending that tells the format of a file: of run.csv.gz it is .csv.

    Examples
    --------
    >>> ending_of(Path("run.CSV")), ending_of(Path("run.csv.gz"))
    ('.csv', '.csv')
    """
    ending = path.suffix.lower()
    return Path(path.stem).suffix.lower() if ending == PACKED else ending


def _unpacked(path: Path, data: bytes) -> bytes:
    """Return what is packed in the bytes of a gzip file, no more of it than a file may take in memory."""
    with foreign(path, "gzip"):
        try:
            content = gzip.GzipFile(fileobj=io.BytesIO(data)).read(largest_bytes() + 1)
        except EOFError:
            raise InputError(f"{path}: ends early: it was cut off; copy it again") from None
    check_bytes(path, len(content))
    return content


def open_blocks(path: str | Path, skip: int | None = None) -> Table | None:
    """Open a file that may be larger than memory, to be read in segments of rows; None for a format that cannot be.

    Of a text table, ``skip`` lines stand above the header; without it they are found.

    A file that has not changed stays open: the line offsets of a text are then indexed once per process.

    Raises
    ------
    InputError
        For a file that is not what its ending says.
    MissingExtraError
        When the library for this format is not installed.
    """
    file = Path(path)
    try:
        check_regular(file)
        found = file.stat()
        return _open(file, (found.st_mtime_ns, found.st_size), skip)
    except OSError as error:
        raise InputError(f"{file}: cannot be read ({error.strerror or error})") from error


@lru_cache(maxsize=4)
def _open(file: Path, state: tuple[int, int], skip: int | None) -> Table | None:
    _, function = READERS.get(file.suffix.lower(), ("", ""))  # not of what is packed
    own = skip if function in WITH_PREAMBLE else None
    return _read(file, None, own) if function in IN_SEGMENTS else None


def _read(file: Path, data: bytes | None, skip: int | None) -> Any:
    """Call the reader of a file, of all its bytes or, without them, of the parts that are asked for."""
    module, function = READERS[ending_of(file)]
    options = {} if skip is None else {"skip": skip}
    # A library may read bad bytes and fail where what it has read is asked for.
    with foreign(file, file.suffix[1:]):
        return getattr(import_module(f"{__name__}.{module}"), function)(file, data, **options)
