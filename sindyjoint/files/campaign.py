"""From ``campaign.toml`` and its data files to a :class:`~sindyjoint.record.Campaign` in SI units."""

from __future__ import annotations

import os
from dataclasses import dataclass, field
from pathlib import Path, PurePosixPath

import numpy as np
from numpy.typing import NDArray

from sindyjoint.errors import InputError, SindyJointError
from sindyjoint.files.manifest import (
    Channel,
    Channels,
    JointTable,
    Manifest,
    RigTable,
    RunTable,
    read_manifest,
)
from sindyjoint.files.readers import read_table
from sindyjoint.files.readers.table import Table
from sindyjoint.files.spectrum import check_frequency
from sindyjoint.files.timeaxis import advanced, check_order, margin, resampled, uniform_rate
from sindyjoint.files.units import conversion, parse_quantity
from sindyjoint.record import Campaign, Joint, Motion, Run, Source
from sindyjoint.rig import bending_moment, check_positive, full_bridge_strain, joint_angle

Array = NDArray[np.float64]

# quantity -> (key in [channels], SI unit), by motion
KEYS: dict[Motion, dict[str, tuple[str, str]]] = {
    "rotation": {
        "moment": ("moment", "N*m"),
        "angle": ("angle", "rad"),
        "rate": ("rate_of_angle", "rad/s"),
        "inertia": ("inertia", "kg*m**2"),
    },
    "translation": {
        "moment": ("force", "N"),
        "angle": ("displacement", "m"),
        "rate": ("rate_of_displacement", "m/s"),
        "inertia": ("mass", "kg"),
    },
}


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
        self._check_keys(channels, entry)
        path = self.file.parent / table.file
        opened, sha256 = read_table(path)
        signals, rate = _RunReader(
            opened, channels, self.manifest.rig, self.motion, self.file, self.notes
        ).read()
        frequency = table.frequency
        if isinstance(frequency, str):
            frequency = parse_quantity(frequency, "Hz", f"{entry} frequency")
        try:
            run = Run(
                table.name or str(PurePosixPath(table.file).with_suffix("")),
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

    def _check_keys(self, channels: Channels, entry: str) -> None:
        """Refuse channels that contradict each other, the motion or the rig."""
        where = f"{self.file}: [channels]"
        rig = self.manifest.rig
        if rig is not None and self.motion == "translation":
            raise InputError(
                f"{self.file}: [rig] is about rotation (strain and displacement to moment and angle); "
                "motion is 'translation'"
            )
        other: Motion = "translation" if self.motion == "rotation" else "rotation"
        for quantity in ("moment", "angle", "rate"):
            wrong, right = KEYS[other][quantity][0], KEYS[self.motion][quantity][0]
            if getattr(channels, wrong) is not None:
                raise InputError(
                    f"{where} {wrong}: motion is {self.motion!r}; give {right!r}, or set [joint] motion"
                )
        if (channels.time is None) == (channels.rate is None):
            given = "neither" if channels.time is None else "both"
            raise InputError(
                f"{where}: time (a column) or rate (such as '1 kHz') is wanted, not {given} ({entry})"
            )
        if channels.skew is not None and channels.skew_removed is not None:
            raise InputError(f"{where} skew: skew_removed says that it is gone already; give one of the two")
        for quantity, raw in (("moment", "strain"), ("angle", "displacement")):
            key = KEYS[self.motion][quantity][0]
            in_rig = rig is not None and getattr(rig, raw) is not None
            declared = getattr(channels, key)
            if in_rig and declared is not None:
                raise InputError(f"{where} {key}: [rig] {raw} gives it already; give one of the two")
            if not in_rig and declared is None:
                raise InputError(f"{where}: key {key!r} is missing" + (f" (or [rig] {raw})" if rig else ""))


@dataclass
class _RunReader:
    """Reads the channels of one open file."""

    table: Table
    channels: Channels
    rig: RigTable | None
    motion: Motion
    manifest: Path
    notes: list[str]

    def read(self) -> tuple[dict[str, Array], float]:
        """Return moment, angle and perhaps rate in SI units, and the sampling rate, Hz."""
        signals: dict[str, Array] = {}
        constants: dict[str, float] = {}
        for quantity in ("moment", "angle", "rate"):
            key, unit = KEYS[self.motion][quantity]
            channel: Channel | None = getattr(self.channels, key)
            if channel is None:
                continue
            if channel.constant is not None:
                constants[quantity] = parse_quantity(
                    channel.constant, unit, f"{self.manifest}: [channels] {key}.constant"
                )
            else:
                signals[quantity] = self._measured(channel, key, unit)
        if self.rig is not None:
            self._add_gauges(self.rig, signals)
        if "angle" in constants:
            raise InputError(
                f"{self.manifest}: [channels] {KEYS[self.motion]['angle'][0]}: cannot be a constant"
            )
        signals, rate = self._timed(signals)
        if signals:
            self._refuse_dead(signals)
        signals = self._without_skew(signals, rate)
        n = signals["angle"].size
        return signals | {name: np.full(n, value) for name, value in constants.items()}, rate

    def _measured(self, channel: Channel, key: str, unit: str) -> Array:
        """Return one channel in SI units."""
        assert channel.column is not None and channel.unit is not None
        where = f"{self.manifest}: [channels] {key}"
        factor = conversion(channel.unit, unit, where, channel.gain)
        offset = 0.0 if channel.offset is None else parse_quantity(channel.offset, unit, f"{where}.offset")
        (values,) = self.table.columns([channel.column])
        return values * factor + offset

    def _add_gauges(self, rig: RigTable, signals: dict[str, Array]) -> None:
        """Turn strains and displacements into moment and angle by Eqs. 1–3."""

        def constant(name: str, unit: str) -> float:
            text, where = getattr(rig, name), f"{self.manifest}: [rig]"
            value = text if isinstance(text, float) else parse_quantity(text, unit, f"{where} {name}")
            try:
                return check_positive(name, value)
            except InputError as error:
                raise InputError(f"{where} {error}") from error

        if rig.strain is not None:
            factor = conversion(
                rig.strain_unit, "m/m", f"{self.manifest}: [rig] strain_unit", rig.strain_gain
            )
            strain = full_bridge_strain(*self._equally_long(rig.strain, factor))
            signals["moment"] = bending_moment(
                strain,
                constant("bending_stiffness", "N*m**2"),
                constant("section_height", "m"),
                constant("strain_position_factor", "m/m"),
            )
        if rig.displacement is not None:
            where = f"{self.manifest}: [rig] displacement_unit"
            factor = conversion(rig.displacement_unit, "m", where, rig.displacement_gain)
            spots = self._equally_long(rig.displacement, factor)
            signals["angle"] = joint_angle(*spots, joint_length=constant("joint_length", "m"))

    def _equally_long(self, names: list[str | int], factor: float) -> list[Array]:
        columns = self.table.columns(names)
        if len({column.size for column in columns}) > 1:
            sizes = ", ".join(f"{name}: {column.size}" for name, column in zip(names, columns, strict=True))
            raise InputError(
                f"{self.table.path}: columns of different length ({sizes}); equal lengths are wanted"
            )
        return [column * factor for column in columns]

    def _timed(self, signals: dict[str, Array]) -> tuple[dict[str, Array], float]:
        """Return the channels on a uniform time axis, and its rate, Hz."""
        sizes = {KEYS[self.motion][name][0]: values.size for name, values in signals.items()}
        path = self.table.path
        if self.channels.time is None:
            self._refuse_lengths(sizes)
            rate = self.channels.rate
            where = f"{self.manifest}: [channels] rate"
            rate = parse_quantity(rate, "Hz", where) if isinstance(rate, str) else float(rate or 0)
            if not (np.isfinite(rate) and rate > 0):
                raise InputError(f"{where}: {self.channels.rate!r}; a positive rate is wanted")
            return signals, rate
        column = self.channels.time
        (time,) = self.table.columns([column.column])
        time = time * conversion(column.unit, "s", f"{self.manifest}: [channels] time")
        self._refuse_lengths({"time": time.size} | sizes)
        where = f"{path}: column {column.column!r}"
        check_order(time, where, self.table.row)
        if not self.channels.resample:
            return signals, uniform_rate(time, where, self.table.row)
        try:
            return signals, uniform_rate(time, where, self.table.row)
        except InputError:
            signals, rate = resampled(time, signals, where, self.table.row)
            self.notes.append(
                f"{path.name}: irregular samples were interpolated to {rate:g} Hz by cubic splines"
            )
            return signals, rate

    def _refuse_lengths(self, sizes: dict[str, int]) -> None:
        if len(set(sizes.values())) > 1:
            listed = ", ".join(f"{name} has {size} samples" for name, size in sizes.items())
            raise InputError(f"{self.table.path}: {listed}; equal lengths are wanted")

    def _refuse_dead(self, signals: dict[str, Array]) -> None:
        """Refuse a measured channel that never changes."""
        for quantity, values in signals.items():
            if values.size and np.ptp(values) <= 1e-13 * np.abs(values).max():
                key, unit = KEYS[self.motion][quantity]
                raise InputError(
                    f"{self.table.path}: {key} is constant ({values[0]:g} {unit}); a dead channel? "
                    + (
                        "declare it as constant if it is meant"
                        if quantity == "moment"
                        else "a moving joint is wanted"
                    )
                )

    def _without_skew(self, signals: dict[str, Array], rate: float) -> dict[str, Array]:
        """Move the moment ahead by the declared lag; every channel loses the edges that the filter needs."""
        if self.channels.skew is None or "moment" not in signals:
            return signals
        samples = parse_quantity(self.channels.skew, "s", f"{self.manifest}: [channels] skew") * rate
        if samples == 0:
            return signals
        lost = margin(samples)
        n = signals["angle"].size
        if n <= 4 * lost:
            raise InputError(
                f"{self.manifest}: [channels] skew: removing {self.channels.skew!r} takes {lost} samples "
                f"from either end of {self.table.path.name}, which has {n}"
            )
        return {
            name: advanced(values, samples) if name == "moment" else values[lost : n - lost]
            for name, values in signals.items()
        }
