"""NumPy archives and arrays; nothing in them is unpickled, and nothing allocated before its size is known."""

from __future__ import annotations

import io
import math
import zipfile
from collections.abc import Sequence
from pathlib import Path
from typing import BinaryIO

import numpy as np
from numpy.typing import NDArray

from sindyjoint.errors import InputError
from sindyjoint.files.blocks import Blocks
from sindyjoint.files.limits import MOST_COLUMNS, check_array, check_bytes
from sindyjoint.files.readers.table import Table, foreign, vectors


def read_npz(path: Path, data: bytes) -> Table:
    """Return the arrays of an archive; the columns of a matrix are called ``name[:,0]``, ``name[:,1]`` ...

    Raises
    ------
    InputError
        For bytes that are no archive, an array of Python objects, or content beyond the limit of memory.
    """
    arrays: dict[str, NDArray] = {}
    remarks = []
    with foreign(path, "NPZ"), zipfile.ZipFile(io.BytesIO(data)) as archive:
        members = [member for member in archive.infolist() if member.filename.endswith(".npy")]
        check_bytes(path, sum(member.file_size for member in members))
        for member in members:
            name = member.filename.removesuffix(".npy")
            with archive.open(member) as file:
                array = _array(path, file.read(member.file_size + 1), f"array {name!r}")
            if array.dtype.kind == "U" and not array.ndim:
                remarks.append(str(array))
            elif array.dtype.names is None:
                arrays |= vectors(name, array, "[:,{}]", first=0)
    return Table.of(path, arrays, remarks=remarks)


def read_npy(path: Path, data: bytes) -> Table:
    """Return the columns of one array: called by their numbers from 1, or by the fields of a structured array.

    Raises
    ------
    InputError
        For bytes that are no array, or an array of Python objects.
    """
    with foreign(path, "NPY"):
        array = _array(path, data, "an array")
    if array.dtype.names:
        return Table.of(path, {name: array[name] for name in array.dtype.names})
    if array.ndim == 2 and array.shape[1] > MOST_COLUMNS:
        raise InputError(f"{path}: has {array.shape[1]} columns; expected at most {MOST_COLUMNS}")
    return Table.of(
        path, {str(number): column for number, column in enumerate(np.atleast_2d(array.T), start=1)}
    )


def _array(path: Path, data: bytes, what: str) -> NDArray:
    """Return the array of the bytes of an NPY file."""
    file = io.BytesIO(data)
    shape, fortran, dtype = _read_header(file)
    size = _check_header(path, shape, dtype, what)
    if size != len(data) - file.tell():
        raise InputError(
            f"{path}: {what} announces {size} bytes and holds {len(data) - file.tell()}; it is truncated or damaged"
        )
    return np.frombuffer(data, dtype, math.prod(shape), file.tell()).reshape(
        shape, order="F" if fortran else "C"
    )


def _read_header(file: BinaryIO) -> tuple[tuple[int, ...], bool, np.dtype]:
    """Return shape, order and type of the array of an NPY file, which is then read up to its numbers."""
    version = np.lib.format.read_magic(file)
    read = np.lib.format.read_array_header_1_0 if version == (1, 0) else np.lib.format.read_array_header_2_0
    shape, fortran, dtype = read(file)
    return shape, bool(fortran), dtype


def _check_header(path: Path, shape: tuple[int, ...], dtype: np.dtype, what: str) -> int:
    """Return the bytes of an array; refuse what is no table of numbers."""
    if dtype.hasobject:
        raise InputError(
            f"{path}: {what} of {str(dtype)!s:.60} and shape {shape}; expected a table of numbers"
        )
    return check_array(path, shape, dtype.itemsize, what)


class NpyBlocks(Blocks):
    """One NumPy array: a column for each of its columns, named by its number from 1, or by its field.

    Read, not mapped: pages of a map count as memory of the process for as long as the system likes.
    """

    def __init__(self, path: Path):
        self.path = path
        with foreign(path, "NPY"), path.open("rb") as file:
            shape, self._fortran, self._dtype = _read_header(file)
            if self._dtype.hasobject or len(shape) not in (1, 2):
                raise InputError(
                    f"{path}: an array of {self._dtype} and shape {shape}; expected a table of numbers"
                )
            self._at = file.tell()
            check_array(path, shape[1:], self._dtype.itemsize, "a row")
            size, held = math.prod(shape) * self._dtype.itemsize, path.stat().st_size - self._at
            if size != held:
                raise InputError(
                    f"{path}: announces {size} bytes and holds {held}; it is truncated or damaged"
                )
        self.rows = shape[0]
        self._width = shape[1] if len(shape) == 2 else 1
        self.names = self._dtype.names or tuple(str(position + 1) for position in range(self._width))

    def read(self, start: int, stop: int, wanted: Sequence[int]) -> list[NDArray]:
        """Return rows of some columns."""
        count = min(stop, self.rows) - start
        if self._fortran and self._width > 1:
            return [self._piece(position * self.rows + start, count) for position in wanted]
        if self._dtype.names:
            table = self._piece(start, count)
            return [np.ascontiguousarray(table[self.names[position]]) for position in wanted]
        table = self._piece(start * self._width, count * self._width).reshape(count, self._width)
        return [np.ascontiguousarray(table[:, position]) for position in wanted]

    def _piece(self, first: int, count: int) -> NDArray:
        return np.fromfile(self.path, self._dtype, count, offset=self._at + first * self._dtype.itemsize)
