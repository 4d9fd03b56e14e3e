"""NumPy archives and arrays; nothing in them is unpickled."""

from __future__ import annotations

import io
from collections.abc import Sequence
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

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
        for name in archive.files:
            arrays |= vectors(name, archive[name], "[:,{}]", first=0)
    columns = list(arrays.values())

    def load(wanted: Sequence[int]) -> list[NDArray]:
        return [columns[position] for position in wanted]

    return Table(path, tuple(arrays), load)


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
        columns = {name: array[name] for name in array.dtype.names}
    else:
        table = np.atleast_2d(array.T)
        columns = {str(position + 1): column for position, column in enumerate(table)}

    def load(wanted: Sequence[int]) -> list[NDArray]:
        return [list(columns.values())[position] for position in wanted]

    return Table(path, tuple(columns), load)
