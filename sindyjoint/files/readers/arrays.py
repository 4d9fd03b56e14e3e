"""Files of arrays: NumPy's, and HDF5, which MATLAB's v7.3 files are inside.

Nothing in them is unpickled, and nothing allocated before its size is known.
"""

from __future__ import annotations

import io
import math
import zipfile
from collections.abc import Callable, Iterator, Sequence
from functools import partial
from pathlib import Path
from typing import Any, BinaryIO

import numpy as np
from numpy.typing import NDArray

from sindyjoint.errors import InputError
from sindyjoint.files.readers.table import (
    MOST_COLUMNS,
    UNIT_KEYS,
    Table,
    check_array,
    check_bytes,
    foreign,
    library,
    short_names,
    vectors,
)


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


def read_hdf5(path: Path, data: bytes | None = None, matlab: bool = False) -> Table:
    """Return the data sets of an HDF5 file, called ``group/name``, or ``name`` where that is unique.

    The columns of a matrix are ``name[:,0]`` ..., the fields of a compound ``name/field``. MATLAB's matrices are seen
    transposed, and cut along their second axis.

    Raises
    ------
    InputError
        For bytes that are no HDF5 file.
    MissingExtraError
        Without h5py.
    """
    h5py = library(f"{path}: reading", "h5py")
    kind, separator, subscript = ("MATLAB v7.3", ".", "(:,{})") if matlab else ("HDF5", "/", "[:,{}]")
    columns: dict[str, Callable[[int, int], NDArray]] = {}
    units: list[str] = []
    sizes = [0]
    with foreign(path, kind):
        # Of bytes in memory HDF5 makes a file of its own: through a file object it would ask for each number.
        file = h5py.File(path if data is None else h5py.h5f.open_file_image(data), "r")
        remark = file.attrs.get("remark")
        for found, shape, item, get, unit in _vectors(file, h5py, path):
            name = found.replace("/", separator)
            check_array(path, shape, item, f"data set {found!r:.60}")
            # Of a scalar, or a stack of matrices, no rows can be cut: it is refused when it is asked for.
            along = int(np.argmax(shape)) if 1 in shape else int(matlab and len(shape) == 2)
            if len(shape) != 2 or 1 in shape:
                columns[name] = partial(_cut, get, len(shape), along, 0)
            else:
                for position in range(shape[1 - along]):
                    columns[name + subscript.format(position + matlab)] = partial(
                        _cut, get, 2, along, position
                    )
            units += [unit] * (len(columns) - len(units))
            sizes.append(shape[along] if len(shape) in (1, 2) else 0)
    cuts = list(columns.values())

    def load(wanted: Sequence[int], start: int, stop: int) -> list[NDArray]:
        check_bytes(path, 8 * len(wanted) * max(stop - start, 0))
        with foreign(path, kind):
            return [cuts[position](start, stop) for position in wanted]

    return Table(
        path, tuple(columns), load, short_names(tuple(columns), separator), count=lambda: max(sizes),
        units=tuple(units), remarks=(remark,) if isinstance(remark, str) else (),
    )  # fmt: skip


def _vectors(
    group: Any, h5py: Any, path: Path, prefix: str = "", above: tuple[Any, ...] = ()
) -> Iterator[tuple[str, tuple[int, ...], int, Callable[[Any], NDArray], str]]:
    """Yield name, shape, bytes of a number, access and unit of numeric data sets and fields of compounds.

    Names that begin with # are reserved by MATLAB.
    """
    if group in above:
        raise InputError(f"{path}: group {prefix!r:.60} holds itself")
    for key in group:
        name, linked = f"{prefix}{key}", isinstance(group.get(key, getlink=True), h5py.ExternalLink)
        item: Any = None if linked else group.get(key)
        stored = isinstance(item, h5py.Dataset)
        # The hash of another file is not in any record, and where that is missing HDF5 gives zeros.
        elsewhere = {
            "is a link to another file": linked,
            "is virtual: its numbers lie in other files": stored and item.is_virtual,
            "keeps its numbers in another file": stored and item.external,
        }
        for why in (why for why, so in elsewhere.items() if so):
            raise InputError(
                f"{path}: data set {name!r:.60} {why}; copy the numbers into one file (h5repack does)"
            )
        if isinstance(item, h5py.Group) and not key.startswith("#"):
            yield from _vectors(item, h5py, path, f"{name}/", (*above, group))
        elif stored and (item.dtype.names or item.dtype.kind in "fiub"):
            if item.shape is None:
                raise InputError(f"{path}: data set {name!r:.60} is empty")
            check_array(path, item.chunks or (), item.dtype.itemsize, f"a chunk of {name!r:.60}")
            if not item.dtype.names:
                unit = next((item.attrs[key] for key in UNIT_KEYS if key in item.attrs), "")
                access = partial(_get, path, name, item, None)
                yield name, item.shape, item.dtype.itemsize, access, unit if isinstance(unit, str) else ""
            for field in item.dtype.names or ():
                size = item.dtype[field].itemsize
                yield f"{name}/{field}", item.shape, size, partial(_get, path, name, item, field), ""


def _get(path: Path, name: str, dataset: Any, field: str | None, index: Any) -> NDArray:
    """Return a part of a data set of which something was written: of one without, HDF5 gives zeros."""
    if dataset.size and not dataset.id.get_storage_size():
        raise InputError(f"{path}: data set {name!r:.60} has room for numbers, and none were written")
    return np.asarray((dataset if field is None else dataset.fields(field))[index])


def _cut(
    get: Callable[[Any], NDArray], axes: int, along: int, position: int, start: int, stop: int
) -> NDArray:
    """Return rows of a column of a data set whose rows lie along one of its axes."""
    rows = slice(start, stop)
    if axes != 2:
        return get(rows if axes == 1 else ())
    return get((rows, position) if along == 0 else (position, rows))
