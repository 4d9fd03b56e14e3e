"""MATLAB files of versions 4 and 5, read byte by byte in Python.

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
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from sindyjoint.errors import InputError
from sindyjoint.files.limits import check_array, check_bytes, largest_bytes

# Codes of data elements, and of the classes of arrays, with the types of their numbers.
NUMBERS = {1: "i1", 2: "u1", 3: "i2", 4: "u2", 5: "i4", 6: "u4", 7: "f4", 9: "f8", 12: "i8", 13: "u8"}
CLASSES = {6: "f8", 7: "f4", 8: "i1", 9: "u1", 10: "i2", 11: "u2", 12: "i4", 13: "u4", 14: "i8", 15: "u8"}
MATRIX, COMPRESSED, STRUCT, TEXT = 14, 15, 2, 4
COMPLEX, LOGICAL = 0x0800, 0x0200
HEADER = 128
DEEPEST = 20
V4_NUMBERS = ("f8", "f4", "i4", "i2", "u2", "u1")
V4_HEADER = 20


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
    order = "<" if data[126:128] == b"IM" else ">"
    yield from _Elements(path, data, order, HEADER).variables()


class _Element(NamedTuple):
    code: int
    data: bytes


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
            element = self.next()
            if element.code == COMPRESSED:
                unpacked = self.unpack(element.data)
                total += len(unpacked)
                check_bytes(self.path, total)
                element = _Elements(self.path, unpacked, self.order).next()
            if element.code == MATRIX and element.data:
                yield from self.inner(element.data).matrix()

    def inner(self, data: bytes) -> _Elements:
        return _Elements(self.path, data, self.order, depth=self.depth + 1)

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

    def next(self) -> _Element:
        """Return the next element, and go on behind it."""
        if self.at + 8 > len(self.data):
            raise self.damaged("it ends within the head of a part")
        code, size = struct.unpack_from(self.order + "II", self.data, self.at)
        start = self.at + 8
        if code >> 16:  # four bytes at most stand in the head itself
            code, size, start = code & 0xFFFF, code >> 16, self.at + 4
            if size > 4:
                raise self.damaged(f"a short part has {size} bytes")
        if size > len(self.data) - start:
            raise self.damaged(f"a part announces {size} bytes and {len(self.data) - start} are there")
        end = start + size
        self.at = self.at + 8 if start == self.at + 4 else end if code == COMPRESSED else end + (-size % 8)
        return _Element(code, self.data[start:end])

    def numbers(self) -> NDArray:
        """Return the next element as numbers."""
        code, data = self.next()
        if code not in NUMBERS:
            raise self.damaged(f"numbers of type {code} are unknown")
        kind = np.dtype(self.order + NUMBERS[code])
        if len(data) % kind.itemsize:
            raise self.damaged(f"{len(data)} bytes are no whole number of {kind.name}")
        return np.frombuffer(data, kind)

    def matrix(self, prefix: str = "") -> Iterator[tuple[str, NDArray]]:
        """Yield the arrays of a matrix, or of the fields of a struct."""
        flags = self.numbers()
        shape = tuple(self.numbers().tolist())
        name = prefix or self.next().data.decode("latin-1")
        if prefix:
            self.next()
        if not flags.size or not 2 <= len(shape) <= 32 or min(shape) < 0:
            raise self.damaged(f"an array has the shape {shape!s:.60}")
        kind, marks = int(flags[0]) & 0xFF, int(flags[0])
        if not name:
            return
        if kind == STRUCT and math.prod(shape) == 1:
            yield from self.fields(name)
        elif kind == TEXT and shape[0] == 1:
            yield name, np.array(self.text())
        elif kind in CLASSES and not marks & COMPLEX:
            yield name, self.array(CLASSES[kind], shape, bool(marks & LOGICAL))

    def fields(self, name: str) -> Iterator[tuple[str, NDArray]]:
        lengths = self.numbers()
        length = int(lengths[0]) if lengths.size else 0
        names = self.next().data
        if length < 1 or len(names) % length:
            raise self.damaged(f"the names of the fields of {name!r:.40} are damaged")
        for at in range(0, len(names), length):
            field = names[at : at + length].split(b"\0")[0].decode("latin-1")
            code, data = self.next()
            if code != MATRIX:
                raise self.damaged(f"field {field!r:.40} is of type {code}")
            if data:
                yield from self.inner(data).matrix(f"{name}.{field}")

    def text(self) -> str:
        """Return the next element as letters."""
        code, data = self.next()
        encodings = {1: "latin-1", 2: "latin-1", 4: "utf-16", 16: "utf-8", 17: "utf-16"}
        ending = ("-le" if self.order == "<" else "-be") if code in (4, 17) else ""
        return data.decode(encodings.get(code, "latin-1") + ending, "replace")

    def array(self, kind: str, shape: tuple[int, ...], logical: bool) -> NDArray:
        check_array(self.path, shape, np.dtype(kind).itemsize)
        values = self.numbers()
        if values.size != math.prod(shape):
            raise self.damaged(f"an array of shape {shape!s:.60} has {values.size} numbers")
        with np.errstate(all="ignore"):
            return values.astype("?" if logical else kind).reshape(shape, order="F")


def _read_version_4(path: Path, data: bytes) -> Iterator[tuple[str, NDArray]]:
    at = 0
    while at < len(data):
        found = _matrix_of_version_4(path, data, at)
        if found is None:
            raise InputError(
                f"{path}: cannot be read as MATLAB: what stands at byte {at} is no array; it may be truncated, damaged "
                "or of another format"
            )
        at, name, array = found
        if array is not None:
            yield name, array


def _matrix_of_version_4(path: Path, data: bytes, at: int) -> tuple[int, str, NDArray | None] | None:
    """Return where the array ends that begins at a byte, its name, and its numbers; None where there is none."""
    if at + V4_HEADER > len(data):
        return None
    order = "<" if struct.unpack_from("<i", data, at)[0] in range(5000) else ">"
    kind, rows, columns, imaginary, length = struct.unpack_from(order + "5i", data, at)
    number, text = kind // 10 % 10, kind % 10
    if not (
        0 <= kind < 5000 and number < 6 and text < 3 and rows >= 0 and columns >= 0 and 1 <= length <= 1024
    ):
        return None
    dtype = np.dtype(order + V4_NUMBERS[number])
    start = at + V4_HEADER + length
    end = start + rows * columns * dtype.itemsize * (2 if imaginary else 1)
    if end > len(data):
        return None
    name = data[at + V4_HEADER : start].split(b"\0")[0].decode("latin-1")
    if text or imaginary or not name:
        return end, name, None
    check_array(path, (rows, columns), dtype.itemsize)
    values = np.frombuffer(data, dtype, rows * columns, start)
    return end, name, values.reshape((rows, columns), order="F")
