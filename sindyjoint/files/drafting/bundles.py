"""Runs as files make them: one file each, or several with the channels of one run on one time base."""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import PurePosixPath

import numpy as np

from sindyjoint.files.drafting.roles import SI_UNITS, WORDS, role_of, role_of_words, unit_in_words
from sindyjoint.files.drafting.survey import DataFile
from sindyjoint.numeric import Array

LOADS = {"moment", "force"}
MOTIONS = {"angle", "displacement", "position"}
_CHANNEL_WORDS = frozenset().union(*WORDS.values()) | {"data", "channel", "ch", "signal"}


@dataclass(frozen=True, eq=False)
class Column:
    """One column of numbers of a run.

    Parameters
    ----------
    file : str or None
        The file that holds it, where that is not the run's first one.
    key : str or int
        What the manifest calls it.
    title, unit : str
        As the file states them.
    role : str or None
        What it measures, as far as unit and names show.
    values : ndarray, shape (n,)
    """

    file: str | None
    key: str | int
    title: str
    unit: str
    role: str | None
    values: Array


@dataclass(frozen=True, eq=False)
class Bundle:
    """The files and columns of one run."""

    files: tuple[DataFile, ...]
    columns: tuple[Column, ...]

    @property
    def name(self) -> str:
        """Path of the first file."""
        return self.files[0].name

    @property
    def simulated(self) -> bool:
        """Whether one of its files says that it comes from a virtual test."""
        return any(file.simulated for file in self.files)

    @property
    def remarks(self) -> tuple[str, ...]:
        """What its files say about themselves."""
        return tuple(remark for file in self.files for remark in file.remarks)

    def find(self, name: str) -> Column | None:
        """Return the column of a name or number."""
        return next((column for column in self.columns if name in (str(column.key), column.title)), None)


def bundle_files(files: Sequence[DataFile]) -> tuple[Bundle, ...]:
    """Return one bundle for each run.

    Where no file has both a load and a motion, files whose names differ only in the word for their channel belong
    together, if they are equally long.
    """
    roles = [{column.role for column in _columns(file, None)} for file in files]
    apart = any(LOADS & found for found in roles) and any(MOTIONS & found for found in roles)
    if not apart or any(LOADS & found and MOTIONS & found for found in roles):
        return tuple(Bundle((file,), tuple(_columns(file, None))) for file in files)
    groups: dict[tuple[object, ...], list[DataFile]] = {}
    for file in files:
        groups.setdefault((*_tokens(file.name), file.rows), []).append(file)
    return tuple(
        Bundle(
            tuple(group),
            tuple(
                column
                for number, file in enumerate(group)
                for column in _columns(file, file.name if number else None)
            ),
        )
        for group in groups.values()
    )


def _columns(file: DataFile, source: str | None) -> list[Column]:
    """Return the columns of a file; a single one that is not the time may be named by the file."""
    found = []
    for position, values in file.columns.items():
        title = file.titles[position]
        unit = file.units[position] or unit_in_words(title)
        role = role_of(title, unit)
        if file.simulated and role in SI_UNITS:
            unit = SI_UNITS[role]
        found.append(Column(source, file.key(position), title, unit, role, values))
    if len(found) == 1 or (len(found) == 2 and (found[0].role == "time" or is_clock(found[0].values))):
        last = found[-1]
        role = last.role or role_of_words(PurePosixPath(file.name).stem)
        found[-1] = Column(last.file, last.key, last.title, last.unit, role, last.values)
    return found


def is_clock(values: Array) -> bool:
    """Return whether a column counts evenly upwards."""
    steps = np.diff(values)
    return bool(np.all(steps > 0) and steps.max() < 3 * np.median(steps))


def _tokens(name: str) -> tuple[str, ...]:
    """Return what is left of a file's name without words for channels."""
    path = PurePosixPath(name)
    parts = re.split(r"[^\w.]+|_", path.with_suffix("").as_posix())
    return tuple(part for part in parts if part and not ({part.lower()} | set(_words(part))) & _CHANNEL_WORDS)


def _words(part: str) -> list[str]:
    return [word.lower() for word in re.findall(r"[A-Z]?[a-z]+|[A-Z]+", part)]
