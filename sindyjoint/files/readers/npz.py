"""NumPy archives and arrays; nothing in them is unpickled."""

from __future__ import annotations

import io
from collections.abc import Sequence
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from sindyjoint.errors import InputError
from sindyjoint.files.blocks import Blocks
from sindyjoint.files.readers.table import Table, foreign, vectors


def read_npz(path: Path, data: bytes) -> Table:
    """Return the arrays of an archive; the columns of a matrix are called ``name[:,0]``, ``name[:,1]`` ...

    Raises
    ------
    InputError
        For bytes that are no archive, or an array of Python objects.
    """
    arrays: dict[str, NDArray] = {}
    with foreign(path, "NPZ"), np.load(io.BytesIO(data), allow_pickle=False) as archive:
        stored = {name: archive[name] for name in archive.files}
        for name, array in stored.items():
            arrays |= vectors(name, array, "[:,{}]", first=0) if array.dtype.kind != "U" or array.ndim else {}
    remarks = [str(array) for array in stored.values() if array.dtype.kind == "U" and not array.ndim]
    return Table.of(path, arrays, remarks=remarks)


def read_npy(path: Path, data: bytes) -> Table:
    """Return the columns of one array: called by their numbers from 1, or by the fields of a structured array.

    Raises
    ------
    InputError
        For bytes that are no array, or an array of Python objects.
    """
    with foreign(path, "NPY"):
        array = np.load(io.BytesIO(data), allow_pickle=False)
    if array.dtype.names:
        return Table.of(path, {name: array[name] for name in array.dtype.names})
    return Table.of(
        path, {str(number): column for number, column in enumerate(np.atleast_2d(array.T), start=1)}
    )


class NpyBlocks(Blocks):
    """One NumPy array: a column for each of its columns, named by its number from 1, or by its field.

    Read, not mapped: pages of a map count as memory of the process for as long as the system likes.
    """

    def __init__(self, path: Path):
        self.path = path
        with foreign(path, "NPY"), path.open("rb") as file:
            version = np.lib.format.read_magic(file)
            read = (
                np.lib.format.read_array_header_1_0
                if version == (1, 0)
                else np.lib.format.read_array_header_2_0
            )
            shape, self._fortran, self._dtype = read(file)
            if self._dtype.hasobject or len(shape) not in (1, 2):
                raise InputError(
                    f"{path}: an array of {self._dtype} and shape {shape}; expected a table of numbers"
                )
            self._at = file.tell()
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
