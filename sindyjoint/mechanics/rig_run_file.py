"""One measured run of a ``rig.toml``: read from its file, in SI."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from sindyjoint.errors import InputError
from sindyjoint.files.readers import read_table
from sindyjoint.files.readers.table import Table
from sindyjoint.files.units import conversion, parse_quantity
from sindyjoint.mechanics.rig_file import ColumnTable, DriveTable, RigFile, RunTable, SensorTable
from sindyjoint.mechanics.rig_test import DRIVE, RigRun
from sindyjoint.source import ColumnUnit, Source

UNITS = {
    "acceleration": "m/s**2",
    "velocity": "m/s",
    "displacement": "m",
    "force": "N",
    "base acceleration": "m/s**2",
}


def read_run(table: RunTable, given: RigFile, path: Path) -> RigRun:
    """Read one measured run of a rig, in SI, with the units that its file states otherwise than they are declared."""
    file = path.parent / str(table.file)
    channels: list[DriveTable | SensorTable] = [given.drive, *given.sensor]
    factors = [conversion(c.unit, UNITS[c.quantity], f"{file}: {c.column}") for c in channels]
    seconds = conversion(given.time.unit, "s", f"{file}: time")
    read, sha256 = read_table(file)
    stamps, *signals = read.columns([given.time.column, *(channel.column for channel in channels)])
    steps = np.diff(stamps * seconds)
    if not steps.size or not (
        steps.mean() > 0 and np.all(np.abs(steps - steps.mean()) <= 0.01 * steps.mean())
    ):
        raise InputError(f"{file}: time does not rise in equal steps within 1 %; resample the file")
    drive, *responses = (signal * factor for signal, factor in zip(signals, factors, strict=True))
    frequency = (
        None if table.frequency is None else parse_quantity(table.frequency, "Hz", f"{file}: frequency")
    )
    return RigRun(
        table.name or Path(str(table.file)).stem, drive, np.array(responses), 1 / float(steps.mean()), frequency,
        table.level, table.use, Source(str(table.file), sha256, _stated_units(read, given)),
    )  # fmt: skip


def _stated_units(read: Table, given: RigFile) -> tuple[ColumnUnit, ...]:
    """Return the units that a file states for its columns otherwise than they are declared."""
    channels: list[tuple[str, ColumnTable | DriveTable | SensorTable]] = [("time", given.time)]
    channels.append((DRIVE, given.drive))
    channels += [(str(each.column), each) for each in given.sensor]
    known = [(name, table.unit, read.stated_unit(table.column)) for name, table in channels]
    return tuple(
        ColumnUnit(name, found[0], declared, found[1], found[2])
        for name, declared, found in known
        if found is not None and found[1] != declared
    )
