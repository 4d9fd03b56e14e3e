"""From the columns of a run file to moment and motion, SI, on a uniform time axis, and their declared errors."""

from collections.abc import Mapping
from contextlib import suppress
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from sindyjoint.errors import InputError, UnitError, refuse
from sindyjoint.files.drafting.survey import LOADS, MOTIONS, ROLES, marks_of, moves_otherwise, role_of
from sindyjoint.files.manifest import Channel, Channels, Column, InputTable, RigTable, TimeChannel
from sindyjoint.files.readers import Table
from sindyjoint.files.timeaxis import (
    advanced,
    bridged,
    check_order,
    longest_part,
    margin,
    resampled,
    step_of,
    uniform_rate,
    unwound,
    with_lost_samples,
)
from sindyjoint.files.units import conversion, parse_optional, parse_quantity, split_quantity, unit_ratio
from sindyjoint.inputs import FileUnit
from sindyjoint.numeric import Array, main_frequency
from sindyjoint.policy import SHARED
from sindyjoint.record import Motion
from sindyjoint.rig import SensorNoise, bending_moment, check_positive, full_bridge_strain, joint_angle

# quantity -> (key in [channels], SI unit), by motion
KEYS: dict[Motion, dict[str, tuple[str, str]]] = {
    "rotation": {
        "moment": ("moment", "N*m"),
        "angle": ("angle", "rad"),
        "rate": ("rate_of_angle", "rad/s"),
        "inertia": ("inertia", "kg*m**2"),
        "acceleration": ("acceleration", "rad/s**2"),
    },
    "translation": {
        "moment": ("force", "N"),
        "angle": ("displacement", "m"),
        "rate": ("rate_of_displacement", "m/s"),
        "inertia": ("mass", "kg"),
        "acceleration": ("acceleration", "m/s**2"),
    },
}


# What sensors measure, in the order of their messages.
MEASURED = ("moment", "angle", "rate", "acceleration")
CHANNEL_KEYS = tuple(dict.fromkeys(keys[quantity][0] for keys in KEYS.values() for quantity in MEASURED))
# Among the channels that were read: False at samples that the recorder lost.
VALID = "valid"
# Of a mark that was interpolated between 0 (missing) and 1, from which a sample is there.
MOST = 0.99
# Begins the names of inputs of the law among them.
INPUT = "input "


def declared(channels: Channels, motion: Motion) -> list[tuple[str, str, str, Channel]]:
    """Return quantity, key, SI unit and declaration of each channel of a manifest."""
    known = [(quantity, *KEYS[motion][quantity]) for quantity in MEASURED]
    return [
        (quantity, key, unit, channel)
        for quantity, key, unit in known
        if (channel := getattr(channels, key)) is not None
    ]


def check_keys(channels: Channels, rig: RigTable | None, motion: Motion, manifest: Path) -> None:
    """Refuse channels that contradict each other, the motion or the rig.

    Raises
    ------
    InputError
        Naming the key at fault.
    """
    where = f"{manifest}: [channels]"
    other: Motion = "translation" if motion == "rotation" else "rotation"
    given = "neither" if channels.time is None else "both"
    untimed, accelerated = channels.time == "none", channels.acceleration is not None
    keys = [(KEYS[other][each][0], KEYS[motion][each][0]) for each in ("moment", "angle", "rate")]
    both = channels.skew is not None and channels.skew_removed is not None
    faults: list[tuple[object, str]] = [
        (
            rig is not None and motion == "translation",
            f"{manifest}: [rig] is about rotation (strain and displacement to moment and angle); motion is "
            "'translation'",
        ),
        *(
            (
                getattr(channels, wrong) is not None,
                f"{where} {wrong}: motion is {motion!r}; give {right!r}, or set [joint] motion",
            )
            for wrong, right in keys
        ),
        (
            (channels.time is None) == (channels.rate is None),
            f"{where}: expected time (a column, or 'none' for quasi-static samples) or rate (such as '1 kHz'), not "
            f"{given}",
        ),
        *(
            (
                untimed and getattr(channels, key),
                f"{where} {key}: time = 'none' says that the samples have no time; leave it out",
            )
            for key in (KEYS[motion]["rate"][0], "skew", "skew_removed", "resample")
        ),
        (both, f"{where} skew: skew_removed states that it is removed already; give one of the two"),
    ]
    for quantity, raw in (("moment", "strain"), ("angle", "displacement")):
        key = KEYS[motion][quantity][0]
        channel: Channel | None = getattr(channels, key)
        # Of one without column and constant only the noise is declared.
        here = channel is not None and (channel.column is not None or channel.constant is not None)
        in_rig = rig is not None and getattr(rig, raw) is not None
        needed = quantity == "moment" or not accelerated
        instead = f" (or [rig] {raw})" if rig else ""
        instead += ", or acceleration in its place" if quantity == "angle" else ""
        still = quantity == "angle" and channel is not None and channel.constant is not None
        faults += [
            (in_rig and here, f"{where} {key}: [rig] {raw} gives it already; give one of the two"),
            (needed and not in_rig and not here, f"{where}: key {key!r} is missing{instead}"),
            (still, f"{where} {key}: cannot be a constant; expected a joint that moves"),
        ]
    column = channels.acceleration is not None and channels.acceleration.column is not None
    faults += [
        (accelerated and untimed, f"{where} acceleration: samples without time have none; leave it out"),
        (accelerated and not column, f"{where} acceleration: expected a column with its unit"),
    ]
    refuse(faults)


@dataclass(frozen=True)
class RunReader:
    """Reads the channels of one open file.

    Parameters
    ----------
    table : Table
    channels : Channels
        As they hold for this run, checked by :func:`check_keys`.
    rig : RigTable or None
    motion : {"rotation", "translation"}
    manifest : Path
        For messages.
    """

    table: Table
    channels: Channels
    rig: RigTable | None
    motion: Motion
    manifest: Path
    notes: list[str] = field(default_factory=list)
    """What had to be decided; filled by :meth:`read`."""
    inputs: Mapping[str, InputTable] = field(default_factory=dict)
    """Inputs of the law that are columns of the file."""
    part: bool = False
    """Whether the table is a part of a longer one, of which no sample may be missing."""
    frequency: float | None = None
    """Of the excitation, as declared."""

    def read(self) -> tuple[dict[str, Any], float]:
        """Return moment, angle, rate and acceleration, as far as measured, SI, shape (n,), and the sampling rate, Hz.

        Without time that is zero. Where the recorder lost samples, ``"valid"`` is False and the channels are
        interpolated.

        Raises
        ------
        InputError
            For columns that are missing or unusable, an irregular time axis, or a dead channel.
        """
        columns, present, missing = self._columns()
        signals: dict[str, Array] = {}
        constants: dict[str, float] = {}
        for quantity, key, unit, channel in declared(self.channels, self.motion):
            where = f"{self.manifest}: [channels] {key}"
            if channel.constant is not None:
                constants[quantity] = parse_quantity(channel.constant, unit, f"{where}.constant")
            elif channel.column is not None:
                factor = conversion(channel.unit or "", unit, where, channel.gain)
                offset = parse_optional(channel.offset, unit, f"{where}.offset") or 0.0
                found = [columns[column] for column in channel.columns]
                if quantity == "angle":
                    found = [self._unwound(x, channel.unit or "", factor) for x in found]
                signals[quantity] = _scaled(found[0] - sum(found[1:]), factor, offset, where)
        if self.rig is not None:
            self._add_gauges(self.rig, columns, signals)
        # As they stand in the file; files/inputs.py knows their units.
        signals |= {
            f"{INPUT}{name}": columns[each.column] for name, each in self.inputs.items() if each.column
        }
        if present is not None:
            signals[VALID] = present.astype(float)
        signals, rate = self._timed(signals, columns)
        if present is not None:
            signals = self._longest_part(signals, rate, missing)
        self._refuse_dead(signals)
        signals = self._remove_delays(signals, rate)
        n = next(iter(signals.values())).size
        return signals | {name: np.full(n, value) for name, value in constants.items()}, rate

    def file_units(self) -> tuple[FileUnit, ...]:
        """Return the units in which the columns stand in the file."""
        axis = self.channels.time
        found = [self.table.unit("time", axis.column, axis.unit)] if isinstance(axis, TimeChannel) else []
        for quantity, key, unit, channel in declared(self.channels, self.motion):
            if channel.column is not None and channel.unit is not None:
                factor = conversion(channel.unit, unit, f"{self.manifest}: [channels] {key}", channel.gain)
                own = [self.table.unit(quantity, column, channel.unit, factor) for column in channel.columns]
                beside = () if channel.minus else self._list_beside(quantity, channel.column, channel.unit)
                found += [replace(own[0], beside=beside), *own[1:]]
        return tuple(found)

    def _list_beside(self, quantity: str, column: Column, unit: str) -> tuple[str, ...]:
        """Return the columns that measure the same as a channel, move otherwise, and are not used."""
        role, names = ROLES[self.motion].get(quantity), self.table.names
        used = {names[each - 1] if isinstance(each, int) else each for each in self._wanted()}
        stated = [self.table.stated_unit(at)[1] for at in range(1, len(names) + 1)]
        groups: dict[tuple[str, ...], set[str | None]] = {}
        for name, its in zip(names, stated, strict=True):
            groups.setdefault(marks_of(name), set()).add(role_of(name, its))
        own_marks = marks_of(names[column - 1] if isinstance(column, int) else column)
        found, pairs = [], zip(names, stated, strict=True)
        others = [each for each in pairs if role and each[0] not in used and role_of(*each) == role]
        for name, its in others:
            # With a load and a motion of its own name it is of another run, or of another joint.
            if marks_of(name) != own_marks and all(
                groups[marks_of(name)] & kind for kind in (LOADS, MOTIONS)
            ):
                continue
            # What cannot be read is no channel.
            with suppress(InputError):
                own, other = map(bridged, self.table.columns([column, name], gaps=True))
                ratio = unit_ratio(its, unit) or 1.0
                if own.size == other.size and moves_otherwise(own, ratio * other):
                    found.append(name)
        return tuple(found)

    def _columns(self) -> tuple[dict[Column, Array], NDArray[np.bool_] | None, str]:
        """Return all columns that this run needs, read in one go, and which samples all of them have; None for all.

        Straight lines run across what is missing; the text says in which columns, and in how many samples.
        """
        columns = self._wanted()
        read = self.table.columns(columns, gaps=not self.part)
        size = max(values.size for values in read)
        # A single number holds for all samples.
        whole = [np.resize(values, size) if values.size == 1 else values for values in read]
        found = dict(zip(columns, whole, strict=True))
        if all(np.isfinite(values).all() for values in found.values()):
            return found, None, ""
        self._refuse_lengths({str(name): values.size for name, values in found.items()})
        finite = {name: np.isfinite(values) for name, values in found.items()}
        present = np.logical_and.reduce(list(finite.values()))
        blank = ", ".join(f"{n} in {np.sum(~each)}" for n, each in finite.items() if not each.all())
        missing = f"{self.table.path.name}: of {size} samples no number in column {blank}"
        step = step_of(present) if isinstance(self.channels.time, TimeChannel) else 1
        if step > 1 or self.channels.time == "none":
            # No sample is made up; the faster channel has few above half of the slower one's rate.
            seldom = f"one row of {step} is used: nothing faster than half of its rate is seen"
            self.notes.append(f"{missing}; {seldom if step > 1 else 'these rows are left out'}")
            return {name: values[present] for name, values in found.items()}, None, missing
        return {name: bridged(values) for name, values in found.items()}, present, missing

    def _unwound(self, values: Array, unit: str, factor: float) -> Array:
        """Return the values of an angle or displacement without leaps by whole turns, and take note of it."""
        found = unwound(values, unit, factor if self.motion == "rotation" else 0.0)
        if found is not values:
            self.notes.append(f"the {KEYS[self.motion]['angle'][0]} leaps by whole turns: it was unwound")
        return found

    def _wanted(self) -> list[Column]:
        axis, gauges = self.channels.time, [self.rig.strain, self.rig.displacement] if self.rig else []
        wanted = [
            axis.column if isinstance(axis, TimeChannel) else None,
            *(column for *_, each in declared(self.channels, self.motion) for column in each.columns),
            *(each.column for each in self.inputs.values()),
            *(column for columns in gauges for column in columns or ()),
        ]
        return [column for column in wanted if column is not None]

    def _add_gauges(self, rig: RigTable, columns: dict[Column, Array], signals: dict[str, Array]) -> None:
        """Turn strains and displacements into moment and angle by Eqs. 1–3."""

        def constant(name: str, unit: str) -> float:
            where = f"{self.manifest}: [rig] {name}"
            return check_positive(where, parse_quantity(getattr(rig, name), unit, where))

        if rig.strain is not None:
            factor = conversion(
                rig.strain_unit, "m/m", f"{self.manifest}: [rig] strain_unit", rig.strain_gain
            )
            strain = full_bridge_strain(*self._equally_long(rig.strain, columns, factor))
            signals["moment"] = bending_moment(
                strain,
                constant("bending_stiffness", "N*m**2"),
                constant("section_height", "m"),
                constant("strain_position_factor", "m/m"),
            )
        if rig.displacement is not None:
            where = f"{self.manifest}: [rig] displacement_unit"
            factor = conversion(rig.displacement_unit, "m", where, rig.displacement_gain)
            spots = self._equally_long(rig.displacement, columns, factor)
            signals["angle"] = joint_angle(*spots, joint_length=constant("joint_length", "m"))

    def _equally_long(self, names: list[Column], columns: dict[Column, Array], factor: float) -> list[Array]:
        self._refuse_lengths({str(name): columns[name].size for name in names})
        return [_scaled(columns[name], factor, 0.0, f"{self.table.path}: column {name!r}") for name in names]

    def _timed(self, signals: dict[str, Array], columns: dict[Column, Array]) -> tuple[dict[str, Any], float]:
        """Return the channels on a uniform time axis, and its rate, Hz."""
        known = KEYS[self.motion]
        sizes = {
            known[name][0] if name in known else name: x.size for name, x in signals.items() if name != VALID
        }
        axis = self.channels.time
        if not isinstance(axis, TimeChannel):
            self._refuse_lengths(sizes)
            return signals, 0.0 if axis == "none" else self._declared_rate()
        where = f"{self.table.path}: column {axis.column!r}"
        factor = conversion(axis.unit, "s", f"{self.manifest}: [channels] time")
        time = _scaled(columns[axis.column], factor, 0.0, where)
        self._refuse_lengths({"time": time.size} | sizes)
        check_order(time, where, self.table.row)
        try:
            return signals, uniform_rate(time, where, self.table.row)
        except InputError:
            lost = None if self.part else with_lost_samples(time, signals)
            if lost is not None:
                filled, rate, present = lost
                return filled | {VALID: present & (filled.get(VALID, 1.0) > MOST)}, rate
            if not self.channels.resample:
                raise
        signals, rate = resampled(time, signals, where, self.table.row)
        self.notes.append(f"{self.table.path.name}: irregular samples were interpolated to {rate:g} Hz")
        return signals, rate

    def _longest_part(self, signals: dict[str, Any], rate: float, missing: str) -> dict[str, Any]:
        """Return the longest part of a run in which nothing is missing that other samples do not show, and say so.

        These are the other periods of a steady run, and the neighbours of a gap that is short against the motion.
        """
        present = np.asarray(signals.pop(VALID)) > MOST
        if not rate:
            return {name: values[present] for name, values in signals.items()}
        gap = present.size
        if self.frequency is None or np.mean(~present) > SHARED.large_part:
            fastest = max(main_frequency(values, rate) for values in signals.values() if np.ptp(values) > 0)
            gap = int(SHARED.minor_share * rate / fastest)
        kept = longest_part(present, gap)
        used = f"used from {kept.start / rate:.3g} s to {kept.stop / rate:.3g} s: the rest counts for nothing"
        if kept == slice(0, present.size):
            used = "these samples are left out"
        self.notes.append(f"{missing}; {used}; look at its cable")
        return {name: values[kept] for name, values in signals.items()} | {VALID: present[kept]}

    def _declared_rate(self) -> float:
        given, where = self.channels.rate, f"{self.manifest}: [channels] rate"
        rate = parse_quantity(0.0 if given is None else given, "Hz", where)
        if not (np.isfinite(rate) and rate > 0):
            raise InputError(f"{where}: {given!r}; expected a positive rate")
        return rate

    def _refuse_lengths(self, sizes: dict[str, int]) -> None:
        if len(set(sizes.values())) > 1:
            listed = ", ".join(f"{name} has {size} samples" for name, size in sizes.items())
            raise InputError(f"{self.table.path}: {listed}; expected equal lengths")

    def _refuse_dead(self, signals: dict[str, Array]) -> None:
        """Refuse a measured channel that never changes."""
        for quantity, values in signals.items():
            known = quantity in KEYS[self.motion] and values.size
            if known and np.ptp(values) <= 1e-13 * np.abs(values).max():
                key, unit = KEYS[self.motion][quantity]
                moment = "declare it as constant if it is meant"
                raise InputError(
                    f"{self.table.path}: {key} is constant ({values[0]:g} {unit}); a dead channel? "
                    + (moment if quantity == "moment" else "expected a moving joint")
                )

    def _remove_delays(self, signals: dict[str, Array], rate: float) -> dict[str, Array]:
        """Move moment and acceleration ahead by their declared lags; all channels lose the edges that filters need."""
        own = self.channels.acceleration
        lags = {
            "moment": ("skew", self.channels.skew),
            "acceleration": ("acceleration.delay", None if own is None else own.delay),
        }
        for late, (key, given) in lags.items():
            samples = rate * (parse_optional(given, "s", f"{self.manifest}: [channels] {key}") or 0.0)
            if samples == 0 or late not in signals:
                continue
            lost, n = margin(samples), signals[late].size
            if n <= 4 * lost:
                raise InputError(
                    f"{self.manifest}: [channels] {key}: removing {given!r} takes {float(lost):.6g} "
                    f"samples from either end of {self.table.path.name}, which has {n}"
                )
            signals = {
                name: advanced(values, samples) if name == late else values[lost : n - lost]
                for name, values in signals.items()
            }
        return signals


def _scaled(values: Array, factor: float, offset: float, where: str) -> Array:
    """Return values in SI units, or refuse those that grow beyond what a float64 holds."""
    with np.errstate(over="ignore"):
        scaled = values * factor + offset
    if not np.all(np.isfinite(scaled)):
        raise InputError(
            f"{where}: values up to {np.max(np.abs(values)):g} are too large in SI; check the unit"
        )
    return scaled


def declared_noise(channels: Channels, motion: Motion, where: str) -> SensorNoise:
    """Return the noise that the channels declare, in SI units.

    Raises
    ------
    UnitError
        For text that is no quantity of the channel's kind, or of its file's unit.
    InputError
        For noise that is not above zero.
    """
    values = {}
    for quantity, key, unit, channel in declared(channels, motion):
        if channel.noise is not None:
            # Of the quantity itself or, multiplied by the gain, of what the file holds.
            place = f"{where} {key}.noise"
            number, own = split_quantity(channel.noise, place, unit)
            factor = 0.0
            with suppress(UnitError):  # not in volts, then in the quantity's own unit
                factor = abs(conversion(own, unit, place, channel.gain)) if channel.gain else 0.0
            values[quantity] = number * (factor or conversion(own, unit, place))
    try:
        return SensorNoise(**values)
    except InputError as error:
        raise InputError(f"{where}: {error}") from error


def declared_gains(channels: Channels, motion: Motion, where: str) -> dict[str, float]:
    """Return the relative uncertainty of the gains of moment, angle and rate that channels declare.

    Raises
    ------
    InputError, UnitError
        For what is no share between 0 and 1.
    """
    values = {}
    for quantity, key, _, channel in declared(channels, motion):
        given = channel.gain_uncertainty
        if given is not None:
            place = f"{where} {key}.gain_uncertainty"
            share = parse_quantity(given, "m/m", place)
            if not 0 < share < 1:
                raise InputError(f"{place}: {given!r}; expected a share such as '1 %'")
            values[quantity] = share
    if "acceleration" in values:
        # The angle is that of the accelerometer, or of both: no more wrong than the worse of them.
        values["angle"] = max(values.pop("acceleration"), values.get("angle", 0.0))
    return values
