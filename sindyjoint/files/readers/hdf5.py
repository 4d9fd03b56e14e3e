"""HDF5, and MATLAB's v7.3 files, which are HDF5 inside."""

from __future__ import annotations

import io
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path
from typing import Any

from numpy.typing import NDArray

from sindyjoint.files.readers.table import Table, foreign, missing_extra, short_names, vectors


def read_hdf5(path: Path, data: bytes) -> Table:
    """Return the data sets of an HDF5 file, called ``group/name``, or ``name`` where that is unique.

    The columns of a matrix are ``name[:,0]`` ..., the fields of a compound ``name/field``.

    Raises
    ------
    InputError
        For bytes that are no HDF5 file.
    MissingExtraError
        Without h5py.
    """
    return _read(path, data, "HDF5", "/", lambda name, array: vectors(name, array, "[:,{}]", first=0))


def read_mat73(path: Path, data: bytes) -> Table:
    """Return the variables of a MATLAB v7.3 file, called ``name``, ``struct.field`` or ``name(:,1)``."""
    # MATLAB stores by columns: HDF5 shows every matrix transposed.
    return _read(
        path, data, "MATLAB v7.3", ".", lambda name, array: vectors(name, array.T, "(:,{})", first=1)
    )


def _read(
    path: Path, data: bytes, kind: str, separator: str, split: Callable[[str, NDArray], dict[str, NDArray]]
) -> Table:
    try:
        import h5py
    except ImportError as error:
        raise missing_extra(path, "h5py", error) from error
    arrays: dict[str, NDArray] = {}
    with foreign(path, kind), h5py.File(io.BytesIO(data), "r") as file:
        for name, dataset in datasets(file, h5py):
            if dataset.dtype.names:
                for field in dataset.dtype.names:
                    arrays |= split(f"{name}/{field}".replace("/", separator), dataset[field])
            elif dataset.dtype.kind in "fiub":
                arrays |= split(name.replace("/", separator), dataset[()])
    columns = list(arrays.values())
    names = tuple(arrays)

    def load(wanted: Sequence[int]) -> list[NDArray]:
        return [columns[position] for position in wanted]

    return Table(path, names, load, aliases=short_names(names, separator))


def datasets(group: Any, h5py: Any, prefix: str = "") -> Iterator[tuple[str, Any]]:
    """Walk through groups in the order of the file; names that begin with # are reserved by MATLAB."""
    for key, item in group.items():
        name = f"{prefix}{key}"
        if isinstance(item, h5py.Dataset):
            yield name, item
        elif isinstance(item, h5py.Group) and not key.startswith("#"):
            yield from datasets(item, h5py, f"{name}/")
