"""MATLAB files: v7.3 by h5py, v4 and v5 byte by byte in Python.

Compiled readers end the process on some damaged files, which no ``except`` can catch; here a wrong length is a wrong
length. Only what tables need is read: real numeric arrays, structs of them, and lines of text. Cells, objects, sparse
and complex arrays are passed over.

MathWorks, "MAT-File Format", describes both versions.
"""

from __future__ import annotations

import math
import struct
import zlib
from collections.abc import Iterator
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from sindyjoint.errors import InputError
from sindyjoint.files.readers.arrays import read_hdf5
from sindyjoint.files.readers.table import (
    Table,
    begins,
    check_array,
    check_bytes,
    foreign,
    largest_bytes,
    short_names,
    vectors,
)

VERSION_73 = (b"MATLAB 7.3", b"\x89HDF\r\n\x1a\n")
# Codes of data elements, and of the classes of arrays, with the types of their numbers.
NUMBERS = {1: "i1", 2: "u1", 3: "i2", 4: "u2", 5: "i4", 6: "u4", 7: "f4", 9: "f8", 12: "i8", 13: "u8"}
CLASSES = {6: "f8", 7: "f4", 8: "i1", 9: "u1", 10: "i2", 11: "u2", 12: "i4", 13: "u4", 14: "i8", 15: "u8"}
ENCODINGS = {1: "latin-1", 2: "latin-1", 4: "utf-16", 16: "utf-8", 17: "utf-16"}
MATRIX, COMPRESSED, STRUCT, TEXT = 14, 15, 2, 4
COMPLEX, LOGICAL = 0x0800, 0x0200
HEADER = 128
DEEPEST = 20
V4_NUMBERS = ("f8", "f4", "i4", "i2", "u2", "u1")
V4_HEADER = 20


def read_mat(path: Path, data: bytes | None = None) -> Table | None:
    """Return the numeric variables of a MATLAB file, called ``name``, ``struct.field`` or ``name(:,1)``.

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
    arrays: dict[str, NDArray] = {}
    with foreign(path, "MATLAB"):
        stored = list(read_arrays(path, data))
        for name, array in stored:
            if array.dtype.kind != "U":
                arrays |= vectors(name, array, "(:,{})", first=1)
    remarks = tuple(str(array) for _, array in stored if array.dtype.kind == "U")
    return Table.of(path, arrays, aliases=short_names(tuple(arrays), "."), remarks=remarks)


def read_arrays(path: Path, data: bytes) -> Iterator[tuple[str, NDArray]]:
    """Yield the real numeric arrays of a file, those of structs as ``struct.field``, and texts as arrays of one.

    Raises
    ------
    InputError
        For bytes that are no MATLAB file, or not all of one.
    """
    if len(data) < V4_HEADER:
        raise InputError(f"{path}: cannot be read as MATLAB: it has {len(data)} bytes")
    # In version 4 the first number is small; in version 5 the file begins with four letters.
    if 0 in data[:4]:
        yield from _read_version_4(path, data)
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
        if depth > DEEPEST:
            raise self.damaged(f"structs are nested deeper than {DEEPEST} levels")

    def damaged(self, why: str) -> InputError:
        return InputError(f"{self.path}: cannot be read as MATLAB: {why}; it may be truncated or damaged")

    def variables(self) -> Iterator[tuple[str, NDArray]]:
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
        decompressor = zlib.decompressobj()
        try:
            unpacked = decompressor.decompress(data, largest_bytes() + 1)
        except zlib.error as error:
            raise self.damaged(str(error)) from None
        check_bytes(self.path, len(unpacked))
        if not decompressor.eof:
            raise self.damaged("a compressed part ends too early")
        return unpacked

    def next(self) -> tuple[int, bytes]:
        """Return code and bytes of the next element, and go on behind it."""
        if self.at + 8 > len(self.data):
            raise self.damaged("it ends within the head of a part")
        code, size = struct.unpack_from(self.order + "II", self.data, self.at)
        start, small = self.at + 8, code >> 16
        if small:  # four bytes at most stand in the head itself
            code, size, start = code & 0xFFFF, small, self.at + 4
            if size > 4:
                raise self.damaged(f"a short part has {size} bytes")
        if size > len(self.data) - start:
            raise self.damaged(f"a part announces {size} bytes and {len(self.data) - start} are there")
        padding = 0 if code == COMPRESSED else -(start + size - self.at) % 8
        self.at = start + size + padding
        return code, self.data[start : start + size]

    def numbers(self) -> NDArray:
        """Return the next element as numbers."""
        code, data = self.next()
        if code not in NUMBERS:
            raise self.damaged(f"numbers of type {code} are unknown")
        kind = np.dtype(self.order + NUMBERS[code])
        if len(data) % kind.itemsize:
            raise self.damaged(f"{len(data)} bytes are no whole number of {kind.name}")
        return np.frombuffer(data, kind)

    def matrix(self, data: bytes, prefix: str = "") -> Iterator[tuple[str, NDArray]]:
        """Yield the arrays of a matrix that stands in an element, or of the fields of a struct."""
        inner = _Elements(self.path, data, self.order, depth=self.depth + 1)
        flags, shape = inner.numbers(), tuple(inner.numbers().tolist())
        name = prefix or inner.next()[1].decode("latin-1")
        if prefix:
            inner.next()
        if not flags.size or not 2 <= len(shape) <= 32 or min(shape) < 0:
            raise self.damaged(f"an array has the shape {shape!s:.60}")
        kind, marks = int(flags[0]) & 0xFF, int(flags[0])
        if kind == STRUCT and math.prod(shape) == 1 and name:
            yield from inner.fields(name)
        elif kind == TEXT and shape[0] == 1 and name:
            code, letters = inner.next()
            ending = ("-le" if self.order == "<" else "-be") if code in (4, 17) else ""
            yield name, np.array(letters.decode(ENCODINGS.get(code, "latin-1") + ending, "replace"))
        elif kind in CLASSES and not marks & COMPLEX and name:
            check_array(self.path, shape, np.dtype(CLASSES[kind]).itemsize)
            values = inner.numbers()
            if values.size != math.prod(shape):
                raise self.damaged(f"an array of shape {shape!s:.60} has {values.size} numbers")
            with np.errstate(all="ignore"):
                yield name, values.astype("?" if marks & LOGICAL else CLASSES[kind]).reshape(shape, order="F")

    def fields(self, name: str) -> Iterator[tuple[str, NDArray]]:
        lengths, names = self.numbers(), self.next()[1]
        length = int(lengths[0]) if lengths.size else 0
        if length < 1 or len(names) % length:
            raise self.damaged(f"the names of the fields of {name!r:.40} are damaged")
        for at in range(0, len(names), length):
            field = names[at : at + length].split(b"\0")[0].decode("latin-1")
            code, data = self.next()
            if code != MATRIX:
                raise self.damaged(f"field {field!r:.40} is of type {code}")
            if data:
                yield from self.matrix(data, f"{name}.{field}")


def _read_version_4(path: Path, data: bytes) -> Iterator[tuple[str, NDArray]]:
    at = 0
    while at < len(data):
        kind = number = text = rows = columns = imaginary = length = -1
        order = ">"
        if at + V4_HEADER <= len(data):
            order = "<" if struct.unpack_from("<i", data, at)[0] in range(5000) else ">"
            kind, rows, columns, imaginary, length = struct.unpack_from(order + "5i", data, at)
            number, text = kind // 10 % 10, kind % 10
        fits = (
            0 <= kind < 5000 and number < 6 and text < 3 and min(rows, columns) >= 0 and 1 <= length <= 1024
        )
        dtype = np.dtype(order + V4_NUMBERS[number if fits else 0])
        start = at + V4_HEADER + length
        end = start + rows * columns * dtype.itemsize * (2 if imaginary else 1)
        if not fits or end > len(data):
            raise InputError(
                f"{path}: cannot be read as MATLAB: what stands at byte {at} is no array; it may be truncated, damaged "
                "or of another format"
            )
        name = data[at + V4_HEADER : start].split(b"\0")[0].decode("latin-1")
        if name and not text and not imaginary:
            check_array(path, (rows, columns), dtype.itemsize)
            yield name, np.frombuffer(data, dtype, rows * columns, start).reshape((rows, columns), order="F")
        at = end
