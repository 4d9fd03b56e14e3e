"""HDF5, and MATLAB's v7.3 files, which are HDF5 inside."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from sindyjoint.errors import InputError
from sindyjoint.files.blocks import Blocks
from sindyjoint.files.limits import check_array, check_bytes
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
            for found, dataset in _vectors(self._file, h5py, path):
                name, shape = found.replace("/", separator), dataset.shape
                check_array(path, shape, dataset.dtype.itemsize, f"data set {found!r:.60}")
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
        check_bytes(self.path, 8 * len(wanted) * max(stop - start, 0))
        with foreign(self.path, self._kind):
            return [self._columns[position](start, stop) for position in wanted]


def _vectors(
    group: Any, h5py: Any, path: Path, prefix: str = "", above: tuple[Any, ...] = ()
) -> Iterator[tuple[str, Any]]:
    """Walk through numeric data sets and fields of compounds; names that begin with # are reserved by MATLAB."""
    if group in above:
        raise InputError(f"{path}: group {prefix!r:.60} holds itself")
    for key in group:
        name = f"{prefix}{key}"
        if isinstance(group.get(key, getlink=True), h5py.ExternalLink):
            raise _not_here(path, name, "is a link to another file")
        item = group.get(key)
        if isinstance(item, h5py.Group):
            if not key.startswith("#"):
                yield from _vectors(item, h5py, path, f"{name}/", (*above, group))
        elif isinstance(item, h5py.Dataset):
            if item.is_virtual:
                raise _not_here(path, name, "is virtual: its numbers lie in other files")
            if item.external:
                raise _not_here(path, name, "keeps its numbers in another file")
            if item.dtype.names:
                for field in item.dtype.names:
                    yield f"{name}/{field}", _Field(_Stored(item, path, name), field)
            elif item.dtype.kind in "fiub":
                yield name, _Stored(item, path, name)


def _not_here(path: Path, name: str, why: str) -> InputError:
    """Refuse numbers of other files: their hash is not in any record, and where they are missing HDF5 gives zeros."""
    return InputError(f"{path}: data set {name!r:.60} {why}; copy the numbers into one file (h5repack does)")


class _Stored:
    """A data set of which something was written: of one without, HDF5 gives zeros."""

    def __init__(self, dataset: Any, path: Path, name: str):
        self.shape, self.dtype, self._dataset, self._path, self._name = (
            dataset.shape, dataset.dtype, dataset, path, name,
        )  # fmt: skip
        if self.shape is None:
            raise InputError(f"{path}: data set {name!r:.60} is empty")
        check_array(path, dataset.chunks or (), dataset.dtype.itemsize, f"a chunk of {name!r:.60}")

    def fields(self, field: str) -> Any:
        return self._stored().fields(field)

    def __getitem__(self, index: Any) -> NDArray:
        return np.asarray(self._stored()[index])

    def _stored(self) -> Any:
        if self._dataset.size and not self._dataset.id.get_storage_size():
            raise InputError(
                f"{self._path}: data set {self._name!r:.60} has room for numbers, and none were written"
            )
        return self._dataset


class _Field:
    """One field of a compound data set, cut as a data set is."""

    def __init__(self, dataset: _Stored, field: str):
        self.shape, self.dtype, self._dataset, self._field = (
            dataset.shape, dataset.dtype[field], dataset, field,
        )  # fmt: skip

    def __getitem__(self, index: Any) -> NDArray:
        return np.asarray(self._dataset.fields(self._field)[index])


def _cut(dataset: Any, along: int, position: int = 0) -> Callable[[int, int], NDArray]:
    """Return what cuts a column out of a data set whose rows lie along one of its axes."""
    if len(dataset.shape) == 1:
        return lambda start, stop: dataset[start:stop]
    if len(dataset.shape) != 2:
        return lambda start, stop: dataset[()]
    if along == 0:
        return lambda start, stop: dataset[start:stop, position]
    return lambda start, stop: dataset[position, start:stop]
