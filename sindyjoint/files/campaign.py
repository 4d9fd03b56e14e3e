"""From ``campaign.toml`` and its data files to a :class:`~sindyjoint.record.Campaign` in SI units."""

from __future__ import annotations

import os
from dataclasses import dataclass, field
from pathlib import Path, PurePosixPath

import numpy as np

from sindyjoint.errors import InputError, SindyJointError
from sindyjoint.files.channels import KEYS, RunReader, check_keys
from sindyjoint.files.manifest import JointTable, Manifest, RunTable, read_manifest
from sindyjoint.files.readers import read_table
from sindyjoint.files.spectrum import check_frequency
from sindyjoint.files.units import parse_quantity
from sindyjoint.record import Campaign, Joint, Motion, Run, Source


def load_campaign(path: str | os.PathLike[str]) -> Campaign:
    """Read a campaign: its manifest, its runs, units to SI, everything checked.

    Parameters
    ----------
    path : path-like
        ``campaign.toml``, or a folder that holds one.

    Returns
    -------
    Campaign

    Raises
    ------
    MissingInputError
        When the manifest or a run's file does not exist.
    UnitError
        For an unknown unit or one of the wrong dimension.
    InputError
        For anything else that cannot be used; the message names file and field or row.
    MissingExtraError
        When a file's format needs a library that is not installed.
    """
    file, manifest = read_manifest(Path(path))
    joint = _joint(manifest.joint, str(file))
    door = _Door(file, manifest, joint.motion)
    runs = tuple(door.run(index, table) for index, table in enumerate(manifest.run))
    notes = tuple(dict.fromkeys([*manifest.notes, *door.notes]))
    try:
        return Campaign(joint, runs, simulated=manifest.simulated, skew=door.declared_skew(), notes=notes)
    except InputError as error:
        raise InputError(f"{file}: {error}") from error


def _joint(table: JointTable, file: str) -> Joint:
    """Return the joint in SI units."""
    where = f"{file}: [joint]"
    _, unit = KEYS[table.motion]["inertia"]
    if table.mass is not None and table.motion == "rotation":
        raise InputError(f"{where} mass: belongs to motion = 'translation'; give inertia, or set motion")
    if table.mass is not None and table.inertia is not None:
        raise InputError(f"{where} mass: inertia says the same; give one of the two")
    key = "mass" if table.mass is not None else "inertia"
    text = getattr(table, key)
    inertia = None if text is None else parse_quantity(text, unit, f"{where} {key}")
    if inertia is not None and inertia < 0:
        raise InputError(
            f"{where} {key}: {text!r} is negative; zero or more is wanted, or leave it out to identify it"
        )
    temperature = table.temperature and parse_quantity(table.temperature, "K", f"{where} temperature")
    try:
        return Joint(
            table.name,
            table.motion,
            inertia,
            temperature or None,
            table.serial,
            {key: str(value) for key, value in table.labels.items()},
        )
    except InputError as error:
        raise InputError(f"{where} {error}") from error


@dataclass
class _Door:
    """What all runs of one manifest share while they are read."""

    file: Path
    manifest: Manifest
    motion: Motion
    notes: list[str] = field(default_factory=list)

    def declared_skew(self) -> float | None:
        """Return the campaign's skew, s, whether removed now or before."""
        channels = self.manifest.channels
        text = channels.skew if channels.skew is not None else channels.skew_removed
        return None if text is None else parse_quantity(text, "s", f"{self.file}: [channels] skew")

    def run(self, index: int, table: RunTable) -> Run:
        """Read one run."""
        entry = f"{self.file}: [[run]] {index + 1}"
        channels = self.manifest.channels.overridden_by(table.channels)
        check_keys(channels, self.manifest.rig, self.motion, self.file)
        path = self.file.parent / table.file
        opened, sha256 = read_table(path)
        reader = RunReader(opened, channels, self.manifest.rig, self.motion, self.file, self.notes)
        signals, rate = reader.read()
        frequency = table.frequency
        if isinstance(frequency, str):
            frequency = parse_quantity(frequency, "Hz", f"{entry} frequency")
        try:
            run = Run(
                str(PurePosixPath(table.file).with_suffix("")) if table.name is None else table.name,
                signals["moment"],
                signals["angle"],
                rate,
                rate=signals.get("rate"),
                frequency=frequency,
                level=None if table.level is None else str(table.level),
                use=table.use,
                source=Source(table.file, sha256),
            )
        except SindyJointError as error:
            raise InputError(f"{path}: {error}") from error
        if run.frequency is not None:
            moment = None if np.ptp(run.moment) == 0 else run.moment
            check_frequency(run.angle, moment, rate, run.frequency, str(path))
        return run
