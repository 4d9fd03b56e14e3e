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
from sindyjoint.files.readers.table import MOST_COLUMNS, Table, check_array, check_bytes, foreign, vectors


def read_npz(path: Path, data: bytes) -> Table:
    """Return the arrays of an archive; the columns of a matrix are called ``name[:,0]``, ``name[:,1]`` ...

    Raises
    ------
    InputError
        For bytes that are no archive, an array of Python objects, or content beyond the limit of memory.
    """
    arrays: dict[str, NDArray] = {}
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
    rows, width = shape[0], shape[1] if len(shape) == 2 else 1
    if width > MOST_COLUMNS:
        raise InputError(f"{path}: has {width} columns; expected at most {MOST_COLUMNS}")
    names = dtype.names or tuple(str(position + 1) for position in range(width))

    def piece(first: int, count: int) -> NDArray:
        offset = at + first * dtype.itemsize
        if data is None:
            return np.fromfile(path, dtype, count, offset=offset)
        return np.frombuffer(data, dtype, count, offset) if count else np.empty(0, dtype)

    def load(wanted: Sequence[int], start: int, stop: int) -> list[NDArray]:
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
