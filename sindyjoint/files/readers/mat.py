"""MATLAB files: v4 and v5 by SciPy, v7.3 by h5py."""

from __future__ import annotations

import io
from collections.abc import Iterator
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from sindyjoint.files.blocks import Blocks
from sindyjoint.files.readers.hdf5 import Hdf5Blocks
from sindyjoint.files.readers.table import Table, begins, foreign, short_names, vectors

VERSION_73 = (b"MATLAB 7.3", b"\x89HDF\r\n\x1a\n")


def read_mat(path: Path, data: bytes) -> Table:
    """Return the numeric variables of a MATLAB file, called ``name``, ``struct.field`` or ``name(:,1)``.

    Raises
    ------
    InputError
        For bytes that are no MATLAB file, or only the beginning of one.
    MissingExtraError
        For a v7.3 file without h5py.
    """
    if data.startswith(VERSION_73):
        return Hdf5Blocks(path, data, matlab=True).whole()
    from scipy.io import loadmat

    arrays: dict[str, NDArray] = {}
    with foreign(path, "MATLAB"):
        stored = {
            name: value for name, value in loadmat(io.BytesIO(data)).items() if not name.startswith("__")
        }
        for name, value in stored.items():
            for full, array in _leaves(name, value):
                arrays |= vectors(full, array, "(:,{})", first=1)
    remarks = [str(value.flat[0]) for value in stored.values() if value.dtype.kind == "U" and value.size == 1]
    return Table.of(path, arrays, short_names(tuple(arrays), "."), remarks=remarks)


def matlab_blocks(path: Path) -> Blocks | None:
    """Open a MATLAB file of version 7.3; None for an older one, which SciPy loads as a whole."""
    return Hdf5Blocks(path, matlab=True) if begins(path).startswith(VERSION_73) else None


def _leaves(name: str, value: NDArray) -> Iterator[tuple[str, NDArray]]:
    """Walk through structs, which SciPy shows as 1 × 1 arrays of records, down to their numbers."""
    if value.dtype.names:
        if value.size == 1:
            for field in value.dtype.names:
                yield from _leaves(f"{name}.{field}", np.asarray(value.flat[0][field]))
    elif value.dtype.kind in "fiub":
        yield name, value
