"""Formats of instruments and programs read a segment of rows at a time: HDF5, MATLAB v7.3, Feather, TDMS.

Of NPZ, MATLAB v5 and universal files the libraries load all or nothing.
"""

from __future__ import annotations

import weakref
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from sindyjoint.errors import InputError
from sindyjoint.files.long_file import Blocks
from sindyjoint.files.readers.table import foreign, missing_extra, short_names

FEATHER = b"ARROW1"
MATLAB_73 = (b"MATLAB 7.3", b"\x89HDF\r\n\x1a\n")


class Hdf5(Blocks):
    """HDF5: slices of its data sets; of MATLAB's, whose matrices are seen transposed, along their second axis."""

    def __init__(self, path: Path, matlab: bool = False):
        try:
            import h5py
        except ImportError as error:
            raise missing_extra(path, "h5py", error) from error
        from sindyjoint.files.readers.hdf5 import datasets

        self.path = path
        separator, subscript = (".", "(:,{})") if matlab else ("/", "[:,{}]")
        columns: dict[str, Callable[[int, int], NDArray]] = {}
        sizes = []
        with foreign(path, "MATLAB v7.3" if matlab else "HDF5"):
            self._file = h5py.File(path, "r")
            for found, dataset in datasets(self._file, h5py):
                name = found.replace("/", separator)
                along = 0
                if dataset.dtype.names and dataset.ndim == 1:
                    for field in dataset.dtype.names:
                        columns[f"{name}{separator}{field}"] = _field(dataset, field)
                elif dataset.dtype.kind not in "fiub" or dataset.ndim not in (1, 2):
                    continue
                elif dataset.ndim == 1:
                    columns[name] = _row(dataset, 0)
                elif 1 in dataset.shape:
                    along = int(np.argmax(dataset.shape))
                    columns[name] = _row(dataset, along)
                else:
                    along = int(matlab)
                    for position in range(dataset.shape[1 - along]):
                        columns[name + subscript.format(position + matlab)] = _row(dataset, along, position)
                sizes.append(dataset.shape[along])
        self._columns = list(columns.values())
        self.names = tuple(columns)
        self.aliases = short_names(self.names, separator)
        self.rows = max(sizes, default=0)

    def read(self, start: int, stop: int, wanted: Sequence[int]) -> list[NDArray]:
        """Return rows of some columns."""
        return [self._columns[position](start, stop) for position in wanted]


def _field(dataset: Any, field: str) -> Callable[[int, int], NDArray]:
    return lambda start, stop: dataset.fields(field)[start:stop]


def _row(dataset: Any, along: int, position: int = 0) -> Callable[[int, int], NDArray]:
    """Return what cuts a column out of a data set whose rows lie along one of its axes."""
    if dataset.ndim == 1:
        return lambda start, stop: dataset[start:stop]
    if along == 0:
        return lambda start, stop: dataset[start:stop, position]
    return lambda start, stop: dataset[position, start:stop]


def matlab(path: Path) -> Blocks | None:
    """Open a MATLAB file of version 7.3; None for an older one, which SciPy loads as a whole."""
    return Hdf5(path, matlab=True) if _begins(path).startswith(MATLAB_73) else None


def feather(path: Path) -> Blocks | None:
    """Open a Feather file; None for one of the first version, which is no Arrow file."""
    return Feather(path) if _begins(path).startswith(FEATHER) else None


def _begins(path: Path) -> bytes:
    with path.open("rb") as file:
        return file.read(16)


class Feather(Blocks):
    """Feather: the record batches of an Arrow file, of which only the requested columns are decoded."""

    def __init__(self, path: Path):
        try:
            import pyarrow as pa
        except ImportError as error:
            raise missing_extra(path, "pyarrow", error) from error
        self.path = path
        with foreign(path, "Feather"):
            # Read, not mapped: pages of a map count as memory of the process for as long as the system likes.
            self._file = pa.OSFile(str(path))
            self.names = tuple(pa.ipc.open_file(self._file).schema.names)
            reader = self._reader([0])
            sizes = [reader.get_batch(i).num_rows for i in range(reader.num_record_batches)]
        self._edges = np.concatenate([[0], np.cumsum(sizes)]).astype(int)
        self.rows = int(self._edges[-1])
        self._last: tuple[int, tuple[int, ...], list[NDArray]] | None = None

    def read(self, start: int, stop: int, wanted: Sequence[int]) -> list[NDArray]:
        """Return rows of some columns; a batch is decoded once for the segments that follow one another."""
        first, last = np.searchsorted(self._edges, [start, stop - 1], side="right") - 1
        parts = []
        for number in range(int(first), min(int(last), len(self._edges) - 2) + 1):
            begin = self._edges[number]
            parts.append(
                [c[max(start - begin, 0) : stop - begin] for c in self._batch(number, tuple(wanted))]
            )
        return [np.concatenate(columns) for columns in zip(*parts, strict=True)]

    def _batch(self, number: int, wanted: tuple[int, ...]) -> list[NDArray]:
        if self._last is None or self._last[:2] != (number, wanted):
            fields = sorted(set(wanted))
            with foreign(self.path, "a table of numbers"):
                batch = self._reader(fields).get_batch(number)
                columns = [
                    batch.column(fields.index(position)).to_numpy(zero_copy_only=False) for position in wanted
                ]
            self._last = number, wanted, columns
        return self._last[2]

    def _reader(self, fields: list[int]) -> Any:
        import pyarrow as pa

        return pa.ipc.open_file(self._file, options=pa.ipc.IpcReadOptions(included_fields=fields))


class Tdms(Blocks):
    """TDMS: segments of its channels."""

    def __init__(self, path: Path):
        try:
            import nptdms
        except ImportError as error:
            raise missing_extra(path, "npTDMS", error) from error
        self.path = path
        with foreign(path, "TDMS"):
            self._file = nptdms.TdmsFile.open(path)
            weakref.finalize(self, self._file.close)
            if self._file.file_status.incomplete_final_segment:
                raise InputError(f"{path}: its last segment is incomplete; the file is truncated")
            channels = [(f"{g.name}/{c.name}", c) for g in self._file.groups() for c in g.channels()]
        self._channels = [channel for _, channel in channels]
        self._steps = [float(c.properties.get("wf_increment", 0.0)) for c in self._channels]
        names = tuple(name for name, _ in channels)
        self.aliases = short_names(names, "/")
        clocked = any(self._steps) and "time" not in names and "time" not in self.aliases
        self.names = (*names, "time") if clocked else names
        self.rows = max((len(channel) for channel in self._channels), default=0)

    def read(self, start: int, stop: int, wanted: Sequence[int]) -> list[NDArray]:
        """Return rows of some columns; ``time`` is made from the sampling interval."""
        steps = {self._steps[position] for position in wanted if position < len(self._channels)} or set(
            self._steps
        )
        if any(position >= len(self._channels) for position in wanted) and (len(steps) != 1 or 0.0 in steps):
            raise InputError(
                f"{self.path}: its channels have no common sampling interval; declare [channels] rate"
            )
        with foreign(self.path, "TDMS"):
            return [
                np.asarray(self._channels[position].read_data(start, stop - start))
                if position < len(self._channels)
                else np.arange(start, min(stop, self.rows)) * next(iter(steps))
                for position in wanted
            ]


KINDS: dict[str, Callable[[Path], Blocks | None]] = {
    ".h5": Hdf5,
    ".hdf5": Hdf5,
    ".mat": matlab,
    ".feather": feather,
    ".tdms": Tdms,
}
