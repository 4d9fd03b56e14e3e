"""What a folder holds: every data file that can be read, with its columns of numbers."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path

from sindyjoint.errors import InputError, MissingInputError, SindyJointError
from sindyjoint.files.manifest import natural_order
from sindyjoint.files.readers import READERS, open_blocks, read_table
from sindyjoint.files.readers.table import Table
from sindyjoint.numeric import Array
from sindyjoint.record import MINIMUM_SAMPLES
from sindyjoint.text import control_character

# Of a larger file only so many rows are looked at.
LARGE, ROWS = 1 << 26, 1 << 18


@dataclass(frozen=True)
class DataFile:
    """A data file as it was found.

    Parameters
    ----------
    name : str
        Path from the folder.
    titles : tuple of str
        Names of all columns.
    units : tuple of str
        Unit that the file states for each; empty where it states none.
    columns : dict of int to ndarray, shape (n,)
        By position from 0: those that hold finite numbers, as many as the longest of them.
    remarks : tuple of str
    simulated : bool
    scalars : dict of str to float
        Single numbers beside the columns, by their titles, such as a sampling rate.
    """

    name: str
    titles: tuple[str, ...]
    units: tuple[str, ...]
    columns: dict[int, Array]
    remarks: tuple[str, ...]
    simulated: bool
    scalars: dict[str, float] = field(default_factory=dict)

    @property
    def rows(self) -> int:
        """Number of samples."""
        return next(iter(self.columns.values())).size

    def key(self, position: int) -> str | int:
        """Return what a manifest calls a column: its name, or its number where the name does not do."""
        title = self.titles[position]
        unnamed = self.titles.count(title) > 1 or not title.strip() or control_character(title)
        return position + 1 if unnamed else title


def survey_folder(folder: Path) -> tuple[tuple[DataFile, ...], tuple[tuple[str, str], ...]]:
    """Return the data files of a folder, or of the folders in it if it has none, and those left out with the reason.

    Raises
    ------
    MissingInputError
        When there is no such folder, or no file in it that could hold runs.
    """
    if not folder.is_dir():
        raise MissingInputError(f"{str(folder)!r} is no folder; expected a folder with data files")
    paths = _data_paths(folder, "*") or _data_paths(folder, "*/*")
    if not paths:
        endings = ", ".join(ending.removeprefix(".") for ending in READERS)
        raise MissingInputError(
            f"folder {str(folder)!r} holds no data file; expected files that end in {endings}"
        )
    files, left_out = [], []
    for path in paths:
        name = path.relative_to(folder).as_posix()
        found = control_character(name)
        if found is not None:
            left_out.append((name, f"its name holds the control character U+{ord(found):04X}; rename it"))
            continue
        try:
            files.append(_read(path, name))
        except SindyJointError as error:
            left_out.append((name, str(error).removeprefix(f"{path}: ")))
    return tuple(files), tuple(left_out)


def _data_paths(folder: Path, pattern: str) -> list[Path]:
    found = [
        path
        for path in folder.glob(pattern)
        if path.is_file() and path.suffix.lower() in READERS and not path.name.startswith(".")
    ]
    return sorted(found, key=lambda path: natural_order(path.relative_to(folder).as_posix()))


def _read(path: Path, name: str) -> DataFile:
    table = _open(path)
    columns: dict[int, Array] = {}
    scalars: dict[str, float] = {}
    for position in range(len(table.names)):
        try:
            column = table.columns([position + 1])[0]
        except InputError:
            continue  # a column of words, or with blanks, is no channel
        if column.size == 1:
            scalars[table.names[position]] = float(column[0])
        elif column.size >= MINIMUM_SAMPLES:
            columns[position] = column
    longest = max((column.size for column in columns.values()), default=0)
    columns = {position: column for position, column in columns.items() if column.size == longest}
    if not columns:
        raise InputError(f"holds no column of {MINIMUM_SAMPLES} numbers or more")
    stated = [table.stated_unit(position + 1) for position in range(len(table.names))]
    units = tuple("" if unit is None else unit[1] for unit in stated)
    return DataFile(name, table.names, units, columns, table.remarks, table.simulated, scalars)


def share_units(files: Sequence[DataFile]) -> tuple[DataFile, ...]:
    """Return the files with the unit that some of one header state for a column, and none denies, in all of them.

    A column of one name is one sensor of the test: what one file says of it holds for the others.
    """
    stated: dict[tuple[tuple[str, ...], str], set[str]] = {}
    for file in files:
        for title, unit in zip(file.titles, file.units, strict=True):
            if title.strip() and unit:
                stated.setdefault((file.titles, title), set()).add(unit)
    known = {column: next(iter(units)) for column, units in stated.items() if len(units) == 1}
    return tuple(
        replace(
            file,
            units=tuple(
                unit or known.get((file.titles, title), "")
                for title, unit in zip(file.titles, file.units, strict=True)
            ),
        )
        for file in files
    )


def _open(path: Path) -> Table:
    blocks = open_blocks(path) if path.stat().st_size > LARGE else None
    return read_table(path)[0] if blocks is None else blocks.table(0, min(ROWS, blocks.rows))
