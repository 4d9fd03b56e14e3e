"""MATLAB files: v4 and v5 by SciPy, v7.3 by h5py."""

from __future__ import annotations

import io
from collections.abc import Iterator, Sequence
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from sindyjoint.files.readers.table import Table, foreign, short_names, vectors


def read_mat(path: Path, data: bytes) -> Table:
    """Return the numeric variables of a MATLAB file, called ``name``, ``struct.field`` or ``name(:,1)``.

    Raises
    ------
    InputError
        For bytes that are no MATLAB file, or only the beginning of one.
    MissingExtraError
        For a v7.3 file without h5py.
    """
    if data[:10] == b"MATLAB 7.3" or data[:8] == b"\x89HDF\r\n\x1a\n":
        from sindyjoint.files.readers.hdf5 import read_mat73

        return read_mat73(path, data)
    from scipy.io import loadmat

    arrays: dict[str, NDArray] = {}
    with foreign(path, "MATLAB"):
        for name, value in loadmat(io.BytesIO(data)).items():
            if not name.startswith("__"):
                for full, array in _leaves(name, value):
                    arrays |= vectors(full, array, "(:,{})", first=1)
    columns = list(arrays.values())
    names = tuple(arrays)

    def load(wanted: Sequence[int]) -> list[NDArray]:
        return [columns[position] for position in wanted]

    return Table(path, names, load, aliases=short_names(names, "."))


def _leaves(name: str, value: NDArray) -> Iterator[tuple[str, NDArray]]:
    """Walk through structs, which SciPy shows as 1 × 1 arrays of records, down to their numbers."""
    if value.dtype.names:
        if value.size == 1:
            for field in value.dtype.names:
                yield from _leaves(f"{name}.{field}", np.asarray(value.flat[0][field]))
    elif value.dtype.kind in "fiub":
        yield name, value
