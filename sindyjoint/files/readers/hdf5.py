"""HDF5, and MATLAB's v7.3 files, which are HDF5 inside."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from sindyjoint.files.blocks import Blocks
from sindyjoint.files.readers.table import Table, foreign, missing_extra, short_names


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
    return Hdf5Blocks(path, data).whole()


class Hdf5Blocks(Blocks):
    """Slices of the data sets of a file; MATLAB's matrices are seen transposed, and cut along their second axis."""

    def __init__(self, path: Path, data: bytes | None = None, matlab: bool = False):
        try:
            import h5py
        except ImportError as error:
            raise missing_extra(path, "h5py", error) from error
        self.path = path
        self._kind, separator, subscript = (
            ("MATLAB v7.3", ".", "(:,{})") if matlab else ("HDF5", "/", "[:,{}]")
        )
        columns: dict[str, Callable[[int, int], NDArray]] = {}
        sizes = []
        with foreign(path, self._kind):
            # Of bytes in memory HDF5 makes a file of its own: through a file object it would ask for each number.
            self._file = h5py.File(path if data is None else h5py.h5f.open_file_image(data), "r")
            remark = self._file.attrs.get("remark")
            self.remarks = (remark,) if isinstance(remark, str) else ()
            for found, dataset in _vectors(self._file, h5py):
                name, shape = found.replace("/", separator), dataset.shape
                # Of a scalar, or a stack of matrices, no rows can be cut: it is refused when it is asked for.
                along = int(np.argmax(shape)) if 1 in shape else int(matlab and len(shape) == 2)
                if len(shape) != 2 or 1 in shape:
                    columns[name] = _cut(dataset, along)
                else:
                    for position in range(shape[1 - along]):
                        columns[name + subscript.format(position + matlab)] = _cut(dataset, along, position)
                sizes.append(shape[along] if len(shape) in (1, 2) else 0)
        self._columns = list(columns.values())
        self.names = tuple(columns)
        self.aliases = short_names(self.names, separator)
        self.rows = max(sizes, default=0)

    def read(self, start: int, stop: int, wanted: Sequence[int]) -> list[NDArray]:
        """Return rows of some columns."""
        with foreign(self.path, self._kind):
            return [self._columns[position](start, stop) for position in wanted]


def _vectors(group: Any, h5py: Any, prefix: str = "") -> Iterator[tuple[str, Any]]:
    """Walk through numeric data sets and fields of compounds; names that begin with # are reserved by MATLAB."""
    for key, item in group.items():
        name = f"{prefix}{key}"
        if isinstance(item, h5py.Group):
            if not key.startswith("#"):
                yield from _vectors(item, h5py, f"{name}/")
        elif isinstance(item, h5py.Dataset) and item.dtype.names:
            for field in item.dtype.names:
                yield f"{name}/{field}", _Field(item, field)
        elif isinstance(item, h5py.Dataset) and item.dtype.kind in "fiub":
            yield name, item


class _Field:
    """One field of a compound data set, cut as a data set is."""

    def __init__(self, dataset: Any, field: str):
        self.shape, self._view = dataset.shape, dataset.fields(field)

    def __getitem__(self, index: Any) -> NDArray:
        return np.asarray(self._view[index])


def _cut(dataset: Any, along: int, position: int = 0) -> Callable[[int, int], NDArray]:
    """Return what cuts a column out of a data set whose rows lie along one of its axes."""
    if len(dataset.shape) == 1:
        return lambda start, stop: dataset[start:stop]
    if len(dataset.shape) != 2:
        return lambda start, stop: dataset[()]
    if along == 0:
        return lambda start, stop: dataset[start:stop, position]
    return lambda start, stop: dataset[position, start:stop]
