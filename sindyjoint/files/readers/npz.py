"""NumPy archives; nothing in them is unpickled."""

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
        return [columns[place] for place in wanted]

    return Table(path, tuple(arrays), load)
