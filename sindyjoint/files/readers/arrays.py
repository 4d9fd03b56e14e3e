"""Files of arrays: the formats of NumPy, HDF5, and MATLAB: v7.3 is HDF5, v4 and v5 are read byte by byte in Python.

Nothing in them is unpickled, and nothing allocated before its size is known.

Compiled readers end the process on some damaged files, which no ``except`` can catch, SciPy's of version 5 among them;
here a wrong length is a wrong length. Version 4 SciPy reads in Python, too. Only what tables need is read: real numeric
arrays, structs and cells of them, and lines of text. Objects, sparse and complex arrays are passed over.

MathWorks, "MAT-File Format", describes both versions.
"""

import io
import math
import re
import struct
import zipfile
import zlib
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from functools import partial
from pathlib import Path
from typing import Any, BinaryIO

import numpy as np
import scipy
from numpy.typing import NDArray

from sindyjoint.errors import InputError, refuse
from sindyjoint.files.readers import (
    MOST_COLUMNS,
    UNIT_KEYS,
    Table,
    begins,
    check_array,
    check_bytes,
    foreign,
    largest_bytes,
    library,
    numbered,
    short_names,
    vectors,
)


def read_npz(path: Path, data: bytes) -> Table:
    """Return the arrays of an archive; the columns of a matrix are called ``name[:,0]``, ``name[:,1]`` ...

    Raises
    ------
    InputError
        For bytes that are no archive, an array of Python objects, or content beyond the limit of memory.
    """
    arrays: dict[str, NDArray[Any]] = {}
    remarks: tuple[str, ...] = ()
    with foreign(path, "NPZ"), zipfile.ZipFile(io.BytesIO(data)) as archive:
        members = [member for member in archive.infolist() if member.filename.endswith(".npy")]
        check_bytes(path, sum(member.file_size for member in members))
        for member in members:
            name = member.filename.removesuffix(".npy")
            with archive.open(member) as file:
                content = file.read(member.file_size + 1)
            shape, fortran, dtype, at = _head(path, io.BytesIO(content), len(content), f"array {name!r}")
            array = np.frombuffer(content, dtype, math.prod(shape), at).reshape(
                shape, order="F" if fortran else "C"
            )
            if dtype.kind == "U" and not shape:
                remarks += (str(array),)
            elif dtype.names is None:
                arrays |= vectors(name, array, "[:,{}]", first=0)
    return Table.of(path, arrays, remarks=remarks)


def read_npy(path: Path, data: bytes | None = None) -> Table:
    """Return the columns of one array: called by their numbers from 1, or by the fields of a structured array.

    Of a file that is read in segments each is read, not mapped: pages of a map count as memory of the process for as
    long as the system likes.

    Raises
    ------
    InputError
        For bytes that are no array, or an array of Python objects.
    """
    size = path.stat().st_size if data is None else len(data)
    with foreign(path, "NPY"), path.open("rb") if data is None else io.BytesIO(data) as file:
        shape, fortran, dtype, at = _head(path, file, size, "an array", whole=data is not None)
    if len(shape) not in (1, 2):
        raise InputError(f"{path}: an array of {dtype} and shape {shape}; expected a table of numbers")
    if len(shape) == 2 and shape[0] < shape[1]:  # samples lie along the longer side
        shape, fortran = shape[::-1], not fortran
    rows, width = shape[0], shape[1] if len(shape) == 2 else 1
    if width > MOST_COLUMNS:
        raise InputError(f"{path}: has {width} columns; expected at most {MOST_COLUMNS}")
    names = dtype.names or tuple(str(position + 1) for position in range(width))

    def piece(first: int, count: int) -> NDArray[Any]:
        offset = at + first * dtype.itemsize
        if data is None:
            return np.fromfile(path, dtype, count, offset=offset)
        return np.frombuffer(data, dtype, count, offset) if count else np.empty(0, dtype)

    def load(wanted: Sequence[int], start: int, stop: int) -> list[NDArray[Any]]:
        count = min(stop, rows) - start
        if fortran and width > 1:
            return [piece(position * rows + start, count) for position in wanted]
        table = piece(start * width, count * width)
        if dtype.names:
            return [np.ascontiguousarray(table[names[position]]) for position in wanted]
        return [np.ascontiguousarray(table.reshape(count, width)[:, position]) for position in wanted]

    return Table(path, names, load, count=lambda: rows)


def _head(
    path: Path, file: BinaryIO, size: int, what: str, whole: bool = True
) -> tuple[tuple[int, ...], bool, np.dtype, int]:
    """Return shape, order and type of the array of an NPY file of so many bytes, and where its numbers begin.

    An array of which only rows are read may be larger than the limit of memory.
    """
    version = np.lib.format.read_magic(file)
    read = np.lib.format.read_array_header_1_0 if version == (1, 0) else np.lib.format.read_array_header_2_0
    shape, fortran, dtype = read(file)
    if dtype.hasobject:
        raise InputError(
            f"{path}: {what} of {str(dtype)!s:.60} and shape {shape}; expected a table of numbers"
        )
    check_array(path, shape if whole else shape[1:], dtype.itemsize, what)
    announced, held = math.prod(shape) * dtype.itemsize, size - file.tell()
    if announced != held:
        raise InputError(
            f"{path}: {what} announces {announced} bytes and holds {held}; it is truncated or damaged"
        )
    return shape, bool(fortran), dtype, file.tell()


def read_hdf5(path: Path, data: bytes | None = None, matlab: bool = False) -> Table:
    """Return the data sets of an HDF5 file, called ``group/name``, or ``name`` where that is unique.

    The columns of a matrix are ``name[:,0]`` ..., or called as a list of as many texts beside it has them, and the
    fields of a compound ``name/field``. MATLAB's matrices are seen transposed. Single numbers among the attributes are
    columns of one.

    Raises
    ------
    InputError
        For bytes that are no HDF5 file.
    MissingExtraError
        Without h5py.
    """
    h5py = library(f"{path}: reading", "h5py")
    kind, separator, subscript = ("MATLAB v7.3", ".", "(:,{})") if matlab else ("HDF5", "/", "[:,{}]")
    columns: dict[str, Callable[[int, int], NDArray[Any]]] = {}
    units: dict[str, str] = {}
    sizes: dict[str, int] = {}
    words: dict[str, str] = {}
    with foreign(path, kind):
        # Of bytes in memory HDF5 makes a file of its own: through a file object it would ask for each number.
        file = h5py.File(path if data is None else h5py.h5f.open_file_image(data), "r")
        remark = file.attrs.get("remark")
        for found, shape, item, get, texts in _vectors(file, h5py, path):
            name = found.replace("/", separator)
            if texts.get("MATLAB_class") == ["char"]:
                words[name] = "".join(map(chr, np.ravel(get(()))))
                continue
            check_array(path, shape, item, f"data set {found!r:.60}")
            # Samples lie along the longer side. Of a scalar, or a stack of matrices, no rows can be cut: it is refused
            # when it is asked for.
            along = int(shape[0] < shape[1] + matlab) if len(shape) == 2 else 0
            width, titles = shape[1 - along] if len(shape) == 2 else 1, [name]
            if width > 1:
                titles = [name + numbered(subscript, along != matlab, at + matlab) for at in range(width)]
                for key, own in texts.items():
                    if key not in UNIT_KEYS and len(own) == len(set(own)) == width:
                        titles = [f"{name}{separator}{title}" for title in own]
            columns |= {title: partial(_cut, get, len(shape), along, at) for at, title in enumerate(titles)}
            listed = [texts[key] for key in UNIT_KEYS if len(texts.get(key, ())) == width]
            units |= dict(zip(titles, [*listed, [""] * width][0], strict=True))
            sizes |= dict.fromkeys(titles, shape[along] if len(shape) in (1, 2) else 0)
    cuts = list(columns.values())
    beside, names = _told_beside(sizes, words)
    stated = tuple(own or its for own, its in zip(units.values(), beside, strict=True))

    def load(wanted: Sequence[int], start: int, stop: int) -> list[NDArray[Any]]:
        check_bytes(path, 8 * len(wanted) * max(stop - start, 0))
        return [cuts[position](start, stop) for position in wanted]

    return Table(
        path, tuple(names), load, short_names(names, separator), count=lambda: max(sizes.values(), default=0),
        units=stated, remarks=(remark,) if isinstance(remark, str) else (),
    )  # fmt: skip


def _vectors(
    group: Any, h5py: Any, path: Path, prefix: str = "", above: tuple[Any, ...] = ()
) -> Iterator[tuple[str, tuple[int, ...], int, Callable[[Any], NDArray[Any]], dict[str, list[str]]]]:
    """Yield name, shape, bytes of a number, access and texts beside of numeric data sets and fields of compounds.

    Names that begin with # are reserved by MATLAB.
    """
    if group in above:
        raise InputError(f"{path}: group {prefix!r:.60} holds itself")
    yield from _single_numbers(prefix, group)
    for key in group:
        name, linked = f"{prefix}{key}", isinstance(group.get(key, getlink=True), h5py.ExternalLink)
        item: Any = None if linked else group.get(key)
        stored = isinstance(item, h5py.Dataset)
        # The hash of another file is not in any record, and where that is missing HDF5 gives zeros.
        elsewhere = {
            "is a link to another file": linked,
            "is virtual: its numbers lie in other files": stored and item.is_virtual,
            "keeps its numbers in another file": stored and item.external,
        }
        said = f"{path}: data set {name!r:.60}"
        refuse(
            (so, f"{said} {why}; copy the numbers into one file (h5repack does)")
            for why, so in elsewhere.items()
        )
        if isinstance(item, h5py.Group) and not key.startswith("#"):
            yield from _vectors(item, h5py, path, f"{name}/", (*above, group))
        elif stored and (item.dtype.names or item.dtype.kind in "fiub"):
            if item.shape is None:
                raise InputError(f"{path}: data set {name!r:.60} is empty")
            check_array(path, item.chunks or (), item.dtype.itemsize, f"a chunk of {name!r:.60}")
            if not item.dtype.names:
                stated = (group, item)[item.ndim != 2 :]
                texts = {key: _texts(value) for each in stated for key, value in each.attrs.items()}
                yield name, item.shape, item.dtype.itemsize, partial(_get, path, name, item, None), texts
                yield from _single_numbers(f"{name}/", item)
            for field in item.dtype.names or ():
                size = item.dtype[field].itemsize
                yield f"{name}/{field}", item.shape, size, partial(_get, path, name, item, field), {}
        elif stored and h5py.check_ref_dtype(item.dtype) and item.shape is not None:
            cells = [group.file[reference] if reference else None for reference in np.ravel(item[()])]
            kinds = {
                f"{name}{{{at}}}": cell for at, cell in enumerate(cells, 1) if isinstance(cell, h5py.Dataset)
            }
            for cell_name, cell in kinds.items():
                if cell.dtype.kind in "fiub" and cell.shape and not (cell.is_virtual or cell.external):
                    told = {key: _texts(value) for key, value in cell.attrs.items()}
                    get = partial(_get, path, cell_name, cell, None)
                    yield cell_name, cell.shape, cell.dtype.itemsize, get, told


def _check_sum(said: str, chunk: Any) -> None:
    """Refuse a chunk that is too short for its checksum: HDF5 reads beyond its end, and the process dies."""
    if chunk.size < 4:
        raise InputError(f"{said} has a chunk of {chunk.size} bytes, too few for its checksum: it is damaged")


def _single_numbers(
    prefix: str, item: Any
) -> Iterator[tuple[str, tuple[int, ...], int, Callable[[Any], NDArray[Any]], dict[str, list[str]]]]:
    """Yield the attributes that are one number each, such as a sampling rate, as data sets; but not those of MATLAB."""
    for key, value in item.attrs.items():
        number = np.ravel(value)
        if number.size == 1 and number.dtype.kind in "fiu" and not key.startswith(("_", "MATLAB")):
            yield f"{prefix}{key}", number.shape, number.itemsize, number.__getitem__, {}


def _texts(value: Any) -> list[str]:
    """Return the texts of an attribute, or the parts of one with commas."""
    found = [each.decode("utf-8", "replace") if isinstance(each, bytes) else each for each in np.ravel(value)]
    texts = [str(each) for each in found if isinstance(each, str)]
    return [part.strip() for part in (re.split("[,;]", texts[0]) if len(texts) == 1 else texts)]


def _get(path: Path, name: str, dataset: Any, field: str | None, index: Any) -> NDArray[Any]:
    """Return a part of a data set of which something was written: of one without, HDF5 gives zeros."""
    if dataset.size and not dataset.id.get_storage_size():
        raise InputError(f"{path}: data set {name!r:.60} has room for numbers, and none were written")
    if dataset.fletcher32:
        dataset.id.chunk_iter(partial(_check_sum, f"{path}: data set {name!r:.60}"))
    return np.asarray((dataset if field is None else dataset.fields(field))[index])


def _cut(
    get: Callable[[Any], NDArray[Any]], axes: int, along: int, position: int, start: int, stop: int
) -> NDArray[Any]:
    """Return rows of a column of a data set whose rows lie along one of its axes."""
    rows = slice(start, stop)
    if axes != 2:
        return get(rows if axes == 1 else ())
    return get((rows, position) if along == 0 else (position, rows))


VERSION_73 = (b"MATLAB 7.3", b"\x89HDF\r\n\x1a\n")
# Codes of data elements, and of the classes of arrays, with the types of their numbers.
NUMBERS = {1: "i1", 2: "u1", 3: "i2", 4: "u2", 5: "i4", 6: "u4", 7: "f4", 9: "f8", 12: "i8", 13: "u8"}
CLASSES = {6: "f8", 7: "f4", 8: "i1", 9: "u1", 10: "i2", 11: "u2", 12: "i4", 13: "u4", 14: "i8", 15: "u8"}
ENCODINGS = {1: "latin-1", 2: "latin-1", 4: "utf-16", 16: "utf-8", 17: "utf-16"}
MATRIX, COMPRESSED, CELL, STRUCT, TEXT = 14, 15, 1, 2, 4
COMPLEX, LOGICAL = 0x0800, 0x0200
HEADER = 128
DEEPEST = 20
V4_HEADER = 20
# What programs call the name of a vector that stands beside it.
LABELS = ("label", "name", "Label", "Name")
# Columns, or rows, of one matrix, and the cells of one variable.
MEMBER = re.compile(r"(.+)(?:\(:,\d+\)|\(\d+,:\)|\{\d+\})")


def read_mat(path: Path, data: bytes | None = None) -> Table | None:
    """Return the numeric variables of a MATLAB file, called ``name``, ``struct.field``, ``name(:,1)`` or ``name{1}``.

    Columns of a matrix, and cells, are called as a list of as many texts beside them has them.

    Of a file that is to be read in segments, None for one older than version 7.3, which is loaded as a whole.

    Raises
    ------
    InputError
        For bytes that are no MATLAB file, or only the beginning of one.
    MissingExtraError
        For a v7.3 file without h5py.
    """
    if (begins(path) if data is None else data).startswith(VERSION_73):
        return read_hdf5(path, data, matlab=True)
    if data is None:
        return None
    arrays: dict[str, NDArray[Any]] = {}
    with foreign(path, "MATLAB"):
        stored = list(read_arrays(path, data))
        for name, array in stored:
            if array.dtype.kind != "U":
                arrays |= vectors(name, array, "(:,{})", first=1)
    texts = {name: str(array) for name, array in stored if array.dtype.kind == "U"}
    units, named = _told_beside({name: array.size for name, array in arrays.items()}, texts)
    arrays = dict(zip(named, arrays.values(), strict=True))
    return Table.of(
        path, arrays, aliases=short_names(tuple(arrays), "."), remarks=tuple(texts.values()), units=units
    )


def _told_beside(sizes: Mapping[str, int], texts: Mapping[str, str]) -> tuple[tuple[str, ...], list[str]]:
    """Return units and names of vectors, as the texts beside state them in a struct that holds one vector.

    Those of the columns of a matrix, and of cells, are what cells of as many texts beside it state.
    """
    parents = {name: name.rpartition(".")[0] for name in sizes}
    long = [parents[name] for name, size in sizes.items() if size > 1]

    def beside(name: str, keys: Sequence[str]) -> str:
        parent = parents[name]
        found = (texts[f"{parent}.{key}"] for key in keys if f"{parent}.{key}" in texts)
        return next(found, "") if long.count(parent) == 1 else ""

    labels = {name: beside(name, LABELS) if size > 1 else "" for name, size in sizes.items()}
    names = {name: f"{parents[name]}.{label}" if label else name for name, label in labels.items()}
    units = {name: beside(name, UNIT_KEYS) for name in sizes}
    lists = _members(texts)
    for whole, own in _members(sizes).items():
        for other, cells in lists.items():
            told = [texts[cell] for cell in cells]
            (above, _, _), (parent, _, key) = whole.rpartition("."), other.rpartition(".")
            if above != parent or len(told) != len(own):
                continue
            if key in UNIT_KEYS:
                units |= dict(zip(own, told, strict=True))
            elif len(set(told)) == len(own):
                names |= {name: f"{whole}.{title}" for name, title in zip(own, told, strict=True)}
    named = list(names.values())
    return tuple(units.values()), named if len(set(named)) == len(sizes) else list(sizes)


def _members(names: Iterable[str]) -> dict[str, list[str]]:
    """Return by matrix, or variable of cells, the names of its columns or cells."""
    found: dict[str, list[str]] = {}
    for name in names:
        if part := MEMBER.fullmatch(name):
            found.setdefault(part[1], []).append(name)
    return found


def read_arrays(path: Path, data: bytes) -> Iterator[tuple[str, NDArray[Any]]]:
    """Yield the real numeric arrays of a file and, as arrays of one, texts.

    Those of structs are called ``struct.field``, those of cells, and the lines of a matrix of letters, ``name{1}``.

    Raises
    ------
    InputError
        For bytes that are no MATLAB file, or not all of one.
    """
    if len(data) < V4_HEADER:
        raise InputError(f"{path}: cannot be read as MATLAB: it has {len(data)} bytes")
    # In version 4 the first number is small; in version 5 the file begins with four letters.
    if 0 in data[:4]:
        for name, array in scipy.io.loadmat(io.BytesIO(data), chars_as_strings=False).items():
            if isinstance(array, np.ndarray) and array.dtype.kind in "fiu":
                check_array(path, array.shape, array.itemsize)
                yield name, array
        return
    if len(data) < HEADER or data[126:128] not in (b"IM", b"MI"):
        raise InputError(
            f"{path}: cannot be read as MATLAB: its header is damaged, or it is of another format"
        )
    yield from _Elements(path, data, "<" if data[126:128] == b"IM" else ">", HEADER).variables()


class _Elements:
    """The data elements of version 5 that follow one another in some bytes."""

    def __init__(self, path: Path, data: bytes, order: str, at: int = 0, depth: int = 0):
        self.path, self.data, self.order, self.at, self.depth = path, data, order, at, depth
        self.check(depth <= DEEPEST, f"structs are nested deeper than {DEEPEST} levels")

    def check(self, sound: object, why: str) -> None:
        """Refuse the file where something of it is not as it must be."""
        if not sound:
            raise InputError(f"{self.path}: cannot be read as MATLAB: {why}; it may be truncated or damaged")

    def variables(self) -> Iterator[tuple[str, NDArray[Any]]]:
        total = 0
        while self.at < len(self.data):
            code, data = self.next()
            if code == COMPRESSED:
                unpacked = self.unpack(data)
                total += len(unpacked)
                check_bytes(self.path, total)
                code, data = _Elements(self.path, unpacked, self.order).next()
            if code == MATRIX and data:
                yield from self.matrix(data)

    def unpack(self, data: bytes) -> bytes:
        decompressor, unpacked = zlib.decompressobj(), b""
        try:
            unpacked = decompressor.decompress(data, largest_bytes() + 1)
        except zlib.error as error:
            self.check(False, str(error))
        check_bytes(self.path, len(unpacked))
        self.check(decompressor.eof, "a compressed part ends too early")
        return unpacked

    def next(self) -> tuple[int, bytes]:
        """Return code and bytes of the next element, and go on behind it."""
        self.check(self.at + 8 <= len(self.data), "it ends within the head of a part")
        code, size = struct.unpack_from(self.order + "II", self.data, self.at)
        start, small = self.at + 8, code >> 16
        if small:  # four bytes at most stand in the head itself
            code, size, start = code & 0xFFFF, small, self.at + 4
            self.check(size <= 4, f"a short part has {size} bytes")
        there = len(self.data) - start
        self.check(size <= there, f"a part announces {size} bytes and {there} are there")
        padding = 0 if code == COMPRESSED else -(start + size - self.at) % 8
        self.at = start + size + padding
        return code, self.data[start : start + size]

    def numbers(self) -> NDArray[Any]:
        """Return the next element as numbers."""
        code, data = self.next()
        self.check(code in NUMBERS, f"numbers of type {code} are unknown")
        kind = np.dtype(self.order + NUMBERS[code])
        self.check(len(data) % kind.itemsize == 0, f"{len(data)} bytes are no whole number of {kind.name}")
        return np.frombuffer(data, kind)

    def matrix(self, data: bytes, prefix: str = "") -> Iterator[tuple[str, NDArray[Any]]]:
        """Yield the arrays of a matrix that stands in an element, or of the fields of a struct."""
        inner = _Elements(self.path, data, self.order, depth=self.depth + 1)
        flags, shape = inner.numbers(), tuple(inner.numbers().tolist())
        name = prefix or inner.next()[1].decode("latin-1")
        if prefix:
            inner.next()
        possible = flags.size and 2 <= len(shape) <= 32 and min(shape) >= 0
        self.check(possible, f"an array has the shape {shape!s:.60}")
        kind, marks = int(flags[0]) & 0xFF, int(flags[0])
        if kind == STRUCT and name:
            lengths, names = inner.numbers(), inner.next()[1]
            count = math.prod(shape) if names else 0
            for number in range(1, count + 1):
                yield from inner.fields(f"{name}({number})" if count > 1 else name, lengths, names)
        elif kind == CELL and name:
            for number in range(1, math.prod(shape) + 1):
                if cell := inner.next()[1]:
                    yield from inner.matrix(cell, f"{name}{{{number}}}")
        elif kind == TEXT and name:
            code, letters = inner.next()
            ending = ("-le" if self.order == "<" else "-be") if code in (4, 17) else ""
            text = letters.decode(ENCODINGS.get(code, "latin-1") + ending, "replace")
            rows = shape[0] if text else 1  # which stand side by side
            enough = rows <= max(len(text), 1)
            self.check(enough, f"a matrix of letters of shape {shape!s:.60} has {len(text)} letters")
            for row in range(rows):
                yield f"{name}{{{row + 1}}}" if rows > 1 else name, np.array(text[row::rows].rstrip())
        elif kind in CLASSES and not marks & COMPLEX and name:
            check_array(self.path, shape, np.dtype(CLASSES[kind]).itemsize)
            values = inner.numbers()
            whole = values.size == math.prod(shape)
            self.check(whole, f"an array of shape {shape!s:.60} has {values.size} numbers")
            with np.errstate(all="ignore"):
                yield name, values.astype("?" if marks & LOGICAL else CLASSES[kind]).reshape(shape, order="F")

    def fields(self, name: str, lengths: NDArray[Any], names: bytes) -> Iterator[tuple[str, NDArray[Any]]]:
        """Yield the arrays of the fields of one struct, whose names have a length each."""
        length = int(lengths[0]) if lengths.size else 0
        whole = length >= 1 and len(names) % length == 0
        self.check(whole, f"the names of the fields of {name!r:.40} are damaged")
        for at in range(0, len(names), length):
            field = names[at : at + length].split(b"\0")[0].decode("latin-1")
            code, data = self.next()
            self.check(code == MATRIX, f"field {field!r:.40} is of type {code}")
            if data:
                yield from self.matrix(data, f"{name}.{field}")
