"""What every reader returns: named columns that are loaded when they are asked for."""

from __future__ import annotations

import difflib
import warnings
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field, replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from sindyjoint.errors import InputError, MissingExtraError, SindyJointError
from sindyjoint.files.stated_units import unit_in_name
from sindyjoint.numeric import Array

# What a file of a virtual test says about itself; its columns are in SI units.
SIMULATED = "simulated by sindyjoint"


def _row(index: int) -> str:
    """Name a sample of a binary file."""
    return f"row {index + 1}"


@dataclass(frozen=True)
class Table:
    """The columns of one file.

    Parameters
    ----------
    path : Path
    names : tuple of str
        In the order of the file; a name may occur twice, but cannot be asked for then.
    load : callable
        From positions in ``names`` to arrays of shape (n,), of lengths that may differ.
    aliases : mapping of str to int
        Further names, such as the name of a data set without its group.
    row : callable
        How a message names the sample of an index.
    units : tuple of str
        Unit of each column as the file states it apart from the name; empty where it does not.
    remarks : tuple of str
        What the file says above its columns, or about itself.
    """

    path: Path
    names: tuple[str, ...]
    load: Callable[[Sequence[int]], Sequence[NDArray]]
    aliases: Mapping[str, int] = field(default_factory=dict)
    row: Callable[[int], str] = _row
    units: tuple[str, ...] = ()
    remarks: tuple[str, ...] = ()

    @classmethod
    def of(
        cls,
        path: Path,
        arrays: Mapping[str, NDArray],
        aliases: Mapping[str, int] | None = None,
        units: Sequence[str] = (),
        remarks: Sequence[str] = (),
    ) -> Table:
        """Return the table of columns that are in memory."""
        columns = list(arrays.values())
        return cls(
            path,
            tuple(arrays),
            lambda wanted: [columns[at] for at in wanted],
            aliases or {},
            units=tuple(units),
            remarks=tuple(remarks),
        )

    @property
    def simulated(self) -> bool:
        """Whether the file says that it comes from a virtual test."""
        return any(SIMULATED in remark for remark in self.remarks)

    def with_column(self, other: Table, column: str | int, name: str) -> tuple[Table, str]:
        """Return this table with a column of another one under a name, and that name."""
        at = other._find_column(column)
        units = [*self.units, *[""] * (len(self.names) - len(self.units))]
        stated = other.stated_unit(column)
        own = len(self.names)

        def load(wanted: Sequence[int]) -> list[NDArray]:
            mine = iter(self.load([position for position in wanted if position < own]))
            return [next(mine) if position < own else other.load([at])[0] for position in wanted]

        units.append("" if stated is None else stated[1])
        return replace(
            self,
            names=(*self.names, name),
            load=load,
            units=tuple(units),
            remarks=(*self.remarks, *other.remarks),
        ), name

    def columns(self, wanted: Sequence[str | int]) -> list[Array]:
        """Return the requested columns as finite float64 arrays.

        Parameters
        ----------
        wanted : sequence of str or int
            Names, or positions counted from 1.

        Raises
        ------
        InputError
            For a column that is missing, named twice, not numeric, or not finite.
        """
        positions = [self._find_column(name) for name in wanted]
        distinct = sorted(set(positions))
        arrays = self.load(distinct)
        if len(arrays) != len(distinct):
            raise InputError(f"{self.path}: holds no rows; it may be damaged")
        loaded = dict(zip(distinct, arrays, strict=True))
        return [self._check_column(name, loaded[at]) for name, at in zip(wanted, positions, strict=True)]

    def stated_unit(self, name: str | int) -> tuple[str, str, bool] | None:
        """Return a column's name, the unit that the file states for it, and whether only the name's ending does.

        None where the file states no unit. See :func:`sindyjoint.files.stated_units.unit_in_name`.
        """
        at = self._find_column(name)
        title = self.names[at]
        if at < len(self.units) and self.units[at].strip():
            return title, self.units[at].strip().strip("[](){}").strip(), False
        found = unit_in_name(title)
        return None if found is None else (title, *found)

    def _find_column(self, name: str | int) -> int:
        if isinstance(name, int):
            if not 1 <= name <= len(self.names):
                raise InputError(
                    f"{self.path}: there is no column {name}; columns 1 to {len(self.names)} are there"
                )
            return name - 1
        count = self.names.count(name)
        if count > 1:
            raise InputError(
                f"{self.path}: column {name!r} is there {count} times; give each column another name"
            )
        if count == 1:
            return self.names.index(name)
        if name in self.aliases:
            return self.aliases[name]
        near = difflib.get_close_matches(name, self.names, n=1, cutoff=0.5)
        hint = f"did you mean {near[0]!r}? " if near else ""
        shown = ", ".join(f"{known!r:.40}" for known in self.names[:20]) + (
            ", ..." if len(self.names) > 20 else ""
        )
        raise InputError(f"{self.path}: column {name!r} is missing; {hint}columns there: {shown or 'none'}")

    def _check_column(self, name: str | int, values: NDArray) -> Array:
        array = np.asarray(values)
        if array.dtype.kind not in "fiub":
            raise InputError(f"{self.path}: column {name!r} holds {array.dtype}; expected real numbers")
        array = np.ascontiguousarray(array, dtype=np.float64)
        if array.ndim != 1:
            raise InputError(f"{self.path}: column {name!r} has shape {array.shape}; expected one dimension")
        bad = np.flatnonzero(~np.isfinite(array))
        if bad.size:
            raise InputError(
                f"{self.path}: column {name!r} holds {array[bad[0]]} in {self.row(int(bad[0]))}"
                + (f" and {bad.size - 1} more value(s) that are not finite" if bad.size > 1 else "")
                + "; remove or repair them"
            )
        return array


@contextmanager
def foreign(path: Path, kind: str) -> Iterator[None]:
    """Turn whatever a library throws at bad bytes into one sentence, and keep its warnings to itself."""
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            yield
    except (SindyJointError, ImportError):
        raise
    # Parsers of binary formats fail on rubbish with any class there is, MemoryError among them.
    except Exception as error:
        reason = " ".join(str(error).split())[:120] or type(error).__name__
        raise InputError(
            f"{path}: cannot be read as {kind} ({reason}); it may be truncated, damaged or of another format"
        ) from error


def missing_extra(path: Path, package: str, error: ImportError, extra: str = "formats") -> MissingExtraError:
    """Say which extra reads this file."""
    message = f'{path}: reading this format needs {package}; run: pip install "sindyjoint[{extra}]"'
    missing = MissingExtraError(message)
    missing.__cause__ = error
    return missing


def begins(path: Path) -> bytes:
    """Return the first bytes of a file, which hold the version of its format."""
    with path.open("rb") as file:
        return file.read(16)


def vectors(name: str, array: NDArray, subscript: str, first: int) -> dict[str, NDArray]:
    """Return a data set as named vectors: itself, or the columns of a matrix.

    Parameters
    ----------
    name : str
    array : ndarray
    subscript : str
        What follows the name of a column, such as ``"[:,{}]"``.
    first : int
        How the language of the file counts the first column.
    """
    if array.ndim == 2 and 1 not in array.shape:
        return {name + subscript.format(first + position): column for position, column in enumerate(array.T)}
    return {name: array.ravel() if array.ndim == 2 else array}


def short_names(names: Sequence[str], separator: str) -> dict[str, int]:
    """Return the last parts of grouped names that stand for one data set only, with its position."""
    last = [name.rsplit(separator, 1)[-1] for name in names]
    return {name: position for position, name in enumerate(last) if last.count(name) == 1}
