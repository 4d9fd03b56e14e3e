"""MATLAB files: v4 and v5 in Python, v7.3 by h5py."""

from __future__ import annotations

from pathlib import Path

from numpy.typing import NDArray

from sindyjoint.files.blocks import Blocks
from sindyjoint.files.readers.hdf5 import Hdf5Blocks
from sindyjoint.files.readers.mat5 import read_arrays
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
    arrays: dict[str, NDArray] = {}
    with foreign(path, "MATLAB"):
        stored = list(read_arrays(path, data))
        for name, array in stored:
            if array.dtype.kind != "U":
                arrays |= vectors(name, array, "(:,{})", first=1)
    remarks = [str(array) for _, array in stored if array.dtype.kind == "U"]
    return Table.of(path, arrays, short_names(tuple(arrays), "."), remarks=remarks)


def matlab_blocks(path: Path) -> Blocks | None:
    """Open a MATLAB file of version 7.3; None for an older one, which is loaded as a whole."""
    return Hdf5Blocks(path, matlab=True) if begins(path).startswith(VERSION_73) else None
