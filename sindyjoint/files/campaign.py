"""From ``campaign.toml`` and its data files to a :class:`~sindyjoint.record.Campaign` in SI units."""

import hashlib
import os
from collections.abc import Mapping
from contextlib import suppress
from dataclasses import dataclass, field, replace
from pathlib import Path, PurePosixPath
from typing import Any

import numpy as np

from sindyjoint.documents import hash_file
from sindyjoint.errors import InputError, SindyJointError, UnitError, refuse
from sindyjoint.files.channels import (
    CHANNEL_KEYS,
    INPUT,
    KEYS,
    RunReader,
    check_keys,
    declared_gains,
    declared_noise,
)
from sindyjoint.files.drafting.survey import role_of
from sindyjoint.files.manifest import (
    Channels,
    Column,
    InputTable,
    JointTable,
    Manifest,
    RunTable,
    TimeChannel,
    read_manifest,
)
from sindyjoint.files.readers import Table, open_blocks, read_table
from sindyjoint.files.timeaxis import check_frequency, on_clock
from sindyjoint.files.units import input_unit, parse_optional, parse_quantity, split_quantity, unit_ratio
from sindyjoint.inputs import Input, LongRecord, Source, lagged
from sindyjoint.measurement.runs import measured_run, travelled_run
from sindyjoint.numeric import Array
from sindyjoint.record import Campaign, Joint, Motion, Run

# Periods that it has at least, and segments that a run of a sine is cut into: their scatter gives the errors.
PERIODS, FEWEST = 16, 16
# Samples of a run above which a search does not load it as a whole: the columns of its harmonics take 2 kB for each.
LONGEST = 1 << 18


def load_campaign(path: str | os.PathLike[str], longest: int | None = None) -> Campaign:
    """Read a campaign: its manifest, its runs, units to SI, everything checked.

    Parameters
    ----------
    path : path-like
        ``campaign.toml``, or a folder that holds one.
    longest : int, optional
        Of a run with more samples only the first segment is loaded, where its format can be read in segments; its
        ``whole`` says where the remaining samples are. Default: everything is loaded.

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

    Examples
    --------
    >>> import sindyjoint
    >>> test = sindyjoint.simulate(frequencies=[4], levels=[0.5], duration=1.0, out="tests", rng=0)
    >>> sindyjoint.load_campaign("tests").runs[0].frequency
    4.0
    """
    file, manifest = read_manifest(Path(path))
    joint = _make_joint(manifest.joint, str(file))
    loader = _RunLoader(file, manifest, joint.motion, longest)
    runs = tuple(loader.run(index, table) for index, table in enumerate(manifest.run))
    notes = tuple(dict.fromkeys([*manifest.notes, *loader.notes]))
    # The time delay between the channels, whether removed now or before.
    channels = manifest.channels
    skew = channels.skew if channels.skew is not None else channels.skew_removed
    try:
        return Campaign(
            joint,
            runs,
            simulated=manifest.simulated or loader.simulated,
            skew=parse_optional(skew, "s", f"{file}: [channels] skew"),
            notes=notes,
            guessed=tuple(manifest.guessed),
            inputs=tuple(loader.inputs.inputs.values()),
            gain_uncertainty=declared_gains(channels, joint.motion, f"{file}: [channels]"),
            limits=_declared_limits(manifest.limits, joint.motion, f"{file}: [limits]"),
        )
    except InputError as error:
        raise InputError(f"{file}: {error}") from error


def _declared_limits(given: Mapping[str, str], motion: Motion, where: str) -> dict[str, float]:
    """Return how far a plan may go, by quantity, SI."""
    known = {KEYS[motion][name][0]: (name, KEYS[motion][name][1]) for name in ("moment", "angle", "rate")}
    refuse((key not in known, f"{where}: {key!r} is none; expected {', '.join(known)}") for key in given)
    return {
        known[key][0]: parse_quantity(value, known[key][1], f"{where} {key}") for key, value in given.items()
    }


def load_segment(record: LongRecord, number: int, margin: int = 0) -> Run:
    """Read one segment of a long run.

    Parameters
    ----------
    record : LongRecord
    number : int
        Of the segment.
    margin : int
        Samples to read beyond it on either side, as far as there are any.

    Raises
    ------
    InputError
        For rows that cannot be used.
    """
    file, manifest = read_manifest(Path(record.manifest))
    loader = _RunLoader(file, manifest, manifest.joint.motion)
    start = max(record.edges[0], record.edges[number] - margin)
    stop = min(record.edges[-1], record.edges[number + 1] + margin)
    return loader.run(record.index, manifest.run[record.index], (start, stop))


def _make_joint(table: JointTable, file: str) -> Joint:
    """Return the joint in SI units."""
    where = f"{file}: [joint]"
    _, unit = KEYS[table.motion]["inertia"]
    mass, key = table.mass is not None, "inertia" if table.mass is None else "mass"
    refuse(
        [
            (
                mass and table.motion == "rotation",
                f"{where} mass: belongs to motion = 'translation'; give inertia, or set motion",
            ),
            (mass and table.inertia is not None, f"{where} mass: inertia says the same; give one of the two"),
        ]
    )
    text = getattr(table, key)
    inertia = parse_optional(text, unit, f"{where} {key}")
    if inertia is not None and inertia < 0:
        raise InputError(
            f"{where} {key}: {text!r} is negative; expected zero or more, or leave it out to identify it"
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
class _RunLoader:
    """What all runs of one manifest share while they are read."""

    file: Path
    manifest: Manifest
    motion: Motion
    longest: int | None = None
    notes: list[str] = field(default_factory=list)
    simulated: bool = False
    """Whether a file that was read says so."""
    last: dict[tuple[Path, int | None], tuple[Table, str]] = field(default_factory=dict)
    """The file that was read last, and its hash: a workbook or a table may hold many runs."""

    def __post_init__(self) -> None:
        self.inputs = DeclaredInputs(self.manifest, str(self.file))

    def run(self, index: int, table: RunTable, rows: tuple[int, int] | None = None) -> Run:
        """Read one run, or some of its rows."""
        entry = f"{self.file}: [[run]] {index + 1}"
        channels = self.manifest.channels.overridden_by(table.channels)
        check_keys(channels, self.manifest.rig, self.motion, self.file)
        path = self.file.parent / table.file
        frequency = parse_optional(table.frequency, "Hz", f"{entry} frequency")
        first = rows is None
        possible = first and table.rows is None
        whole = self._cut_long_run(path, index, channels, frequency) if possible else None
        if whole is not None:
            rows = whole.edges[0], whole.edges[1]
        blocks = None if rows is None else open_blocks(path, channels.skip)
        if blocks is None or rows is None:
            if (path, channels.skip) not in self.last:
                self.last.clear()
                self.last[path, channels.skip] = read_table(path, channels.skip)
            opened, sha256 = self.last[path, channels.skip]
        else:
            # A hash where the first rows are among them.
            opened, sha256 = blocks.table(*rows), "" if rows[0] else hash_file(path)
        opened, channels, sha256 = self._join_files(opened, channels, sha256)
        if table.rows is not None:
            opened = opened.part(*table.rows)
        self.simulated |= opened.simulated
        reader = RunReader(
            opened, channels, self.manifest.rig, self.motion, self.file, self.notes,
            self.inputs.columns(table), rows is not None, frequency,
        )  # fmt: skip
        signals, rate = reader.read()
        measured = {key.removeprefix(INPUT): each for key, each in signals.items() if key.startswith(INPUT)}
        inputs = self.inputs.values(table, measured, rate, entry)
        name = str(PurePosixPath(table.file).with_suffix("")) if table.name is None else table.name
        try:
            noise = declared_noise(channels, self.motion, f"{self.file}: [channels]")
            if channels.time == "none":
                made = travelled_run(name, signals["moment"], signals["angle"], inputs, noise)
            else:
                valid = signals.get("valid")
                made = measured_run(
                    name, signals, rate, valid=valid, noise=noise, inputs=inputs, frequency=frequency
                )
            run = replace(
                made,
                frequency=frequency,
                level=None if table.level is None else str(table.level),
                use=table.use,
                source=Source(table.file, sha256, reader.file_units()),
                whole=whole,
            )
        except SindyJointError as error:
            raise InputError(f"{path}: {error}") from error
        # Of a long run the first segment has been checked; the joint may stand still in a later one.
        if first and run.frequency is not None:
            moment = None if np.ptp(run.moment) == 0 else run.moment
            check_frequency(run.angle, moment, rate, run.frequency, str(path), self.motion)
        return run

    def _join_files(self, opened: Table, channels: Channels, sha256: str) -> tuple[Table, Channels, str]:
        """Return the columns of all files of one run as one table, its channels, and a hash of all bytes."""
        for key in CHANNEL_KEYS:
            channel = getattr(channels, key)
            if channel is not None and channel.file:
                other, its_hash = read_table(self.file.parent / channel.file)
                name = f"{channel.file}: {channel.column}"
                other = _on_clock_of(opened, channels.time, other, channel.column)
                opened = opened.with_column(other, channel.column, name)
                channels = channels.model_copy(update={key: channel.model_copy(update={"column": name})})
                sha256 = hashlib.sha256(f"{sha256}{its_hash}".encode()).hexdigest()
        return opened, channels, sha256

    def _cut_long_run(
        self, path: Path, index: int, channels: Channels, frequency: float | None
    ) -> LongRecord | None:
        """Return how a file is cut that is too long to be read at once; None for one that is not."""
        # Channels of several files have to lie side by side in memory.
        apart = any(getattr(getattr(channels, key), "file", None) for key in CHANNEL_KEYS)
        # A row is eight letters at least: most files need not be opened to know.
        short = self.longest is None or not path.is_file() or path.stat().st_size < 8 * self.longest
        if self.longest is None or short or apart or channels.time == "none":
            return None
        blocks = open_blocks(path, channels.skip)
        if blocks is None or blocks.rows <= self.longest:
            return None
        head = RunReader(
            blocks.table(0, 4096), channels, self.manifest.rig, self.motion, self.file, part=True
        )
        # Without the filters that cost samples at the ends: only the sampling rate is needed.
        rate = replace(head, channels=channels.model_copy(update={"skew": None})).read()[1]
        # Samples that a segment of a long run has: of a sine enough for its harmonics to stand out of the noise, and
        # no more than the columns of all harmonics may take of memory; of any other motion, which has no such
        # columns, more.
        length = (1 << 18) if frequency is None else max(1 << 16, PERIODS * rate / frequency)
        count = max(4 if frequency is None else FEWEST, int(blocks.rows // length))
        edges = tuple(int(edge) for edge in np.linspace(0, blocks.rows, count + 1))
        return LongRecord(str(self.file), index, edges)


def _on_clock_of(opened: Table, axis: TimeChannel | str | None, other: Table, column: Column) -> Table:
    """Return another file of a run with a column at the instants of the first, where both have a time."""
    if not isinstance(axis, TimeChannel):
        return other
    # A time of the same name before others.
    for at in sorted(range(1, len(other.names) + 1), key=lambda at: other.names[at - 1] != axis.column):
        _, unit, _ = other.stated_unit(at)
        if role_of(other.names[at - 1], unit) == "time":
            own, values = other.columns([at, column], gaps=True)
            if own.size == values.size:
                break
    else:
        return other
    time, ratio = opened.columns([axis.column])[0], unit_ratio(unit or axis.unit, axis.unit) or 1.0
    moved = on_clock(time, ratio * own, values, f"{other.path}: {other.names[at - 1]}", other.row)
    return replace(other, load=lambda wanted, start, stop: [moved] * len(wanted))


def value_in(each: Input, given: str | float, where: str) -> float:
    """Return a declared value in SI: a number in the input's unit, or a text with a unit of its kind.

    Raises
    ------
    UnitError
        For a unit of another kind, or text that is no quantity.
    """
    with suppress(ValueError):
        return each.zero + each.factor * float(given)
    number, unit = split_quantity(str(given), where, each.shown_unit)
    si, factor, zero = input_unit(unit, where)
    if si != each.unit:
        raise UnitError(
            f"{where}: {given!r} is in {unit}; expected a value in {each.shown_unit}, or of its kind"
        )
    return zero + factor * number


class DeclaredInputs:
    """The inputs of a manifest.

    Parameters
    ----------
    manifest : Manifest
    file : str
        For messages.
    """

    def __init__(self, manifest: Manifest, file: str):
        self.file, self.tables = file, dict(manifest.inputs)
        refuse(
            (
                name not in self.tables,
                f"{file}: [[run]] {number} inputs: {name!r} is not declared; add it to [inputs] (declared there: "
                f"{', '.join(self.tables) or 'none'})",
            )
            for number, run in enumerate(manifest.run, start=1)
            for name in sorted(run.inputs)
        )
        self.inputs: dict[str, Input] = {}
        for name, table in self.tables.items():
            values = [table.constant, *(run.inputs.get(name) for run in manifest.run), table.reference]
            first = next((value for value in values if value is not None), None)
            self.inputs[name] = self._declared(name, table, first)

    def _declared(self, name: str, table: InputTable, value: Any) -> Input:
        where = f"{self.file}: [inputs] {name}"
        unit = table.unit
        if unit is None and isinstance(value, str):
            unit = (
                value.split(maxsplit=1)[1] if " " in value.strip() else split_quantity(value, where, "K")[1]
            )
        lag = parse_optional(table.lag, "s", f"{where}.lag") or 0.0
        return made_input(name, unit or "1", where, table.reference, label=table.name or "", lag=lag)

    def columns(self, run: RunTable) -> dict[str, InputTable]:
        """Return the inputs that a run takes from columns of its file."""
        return {
            name: table
            for name, table in self.tables.items()
            if table.column is not None and name not in run.inputs
        }

    def values(self, run: RunTable, measured: Mapping[str, Array], rate: float, where: str) -> dict[str, Any]:
        """Return the inputs of a run in SI: from its columns, its own values, or those of all runs."""
        found: dict[str, Any] = {}
        for name, table in self.tables.items():
            each, place = self.inputs[name], f"{self.file}: [inputs] {name}"
            given = run.inputs.get(name, table.constant)
            if name in run.inputs or table.column is None:
                if given is None:
                    raise InputError(
                        f"{where} inputs: {name!r} has no value; give inputs = {{ {name} = ... }} in the run, or a "
                        "column or constant in [inputs]"
                    )
                found[name] = value_in(each, given, f"{where} inputs.{name}")
                continue
            values = each.zero + each.factor * measured[name]
            if not rate and (table.delay is not None or each.lag):
                raise InputError(
                    f"{place}: samples without time have neither a delay nor a lag; leave it out"
                )
            if table.delay is not None:
                # What is shown now happened earlier: the signal is moved ahead, its last value goes on.
                samples = parse_quantity(table.delay, "s", f"{place}.delay") * rate
                grid = np.arange(values.size, dtype=float)
                values = np.interp(grid + samples, grid, values)
            found[name] = lagged(values, each.lag * rate)
        return found


def made_input(name: str, unit: str, where: str, reference: str | float | None, **known: Any) -> Input:
    """Return an input of the law whose values stand in a unit."""
    si, factor, zero = input_unit(unit, where)
    try:
        each = Input(name, si, shown_unit=unit, factor=factor, zero=zero, **known)
    except InputError as error:
        raise type(error)(f"{where}: {error}") from None
    if reference is None:
        return each
    return replace(each, reference=value_in(each, reference, f"{where}.reference"))


def inputs_of_runs(
    given: Mapping[str, Any],
    units: Mapping[str, str],
    references: Mapping[str, str | float],
    frames: Mapping[str, Any],
) -> tuple[list[Input], list[dict[str, Any]]]:
    """Return the inputs of runs that are in memory, and their values in each run.

    Parameters
    ----------
    given : mapping
        By the name of the input: the name of a column of the frames, one value for all runs, or one for each run, each
        a number, a quantity such as ``"-40 degC"``, or an array.
    units : mapping of str to str
        Of the inputs, by their names; default: that of the first quantity, or none.
    references : mapping
        Reference values.
    frames : mapping
        Of the runs.
    """
    unknown = sorted(set(references) - set(given))
    if unknown:
        raise InputError(f"references: {unknown[0]!r} is no input; inputs: {', '.join(given) or 'none'}")
    declared, runs = [], [dict[str, Any]() for _ in frames]
    for name, values in given.items():
        column = isinstance(values, str) and all(values in frame for frame in frames.values())
        if column:
            own = [np.asarray(frame[values], dtype=np.float64) for frame in frames.values()]
        else:
            one_signal = isinstance(values, np.ndarray) and values.ndim == 1 and len(frames) == 1
            single = isinstance(values, str) or np.ndim(values) == 0 or one_signal
            own = [values] * len(frames) if single else list(values)
        if len(own) != len(frames):
            raise InputError(
                f"inputs: {name!r} has {len(own)} value(s) for {len(frames)} run(s); expected one each"
            )
        texts = [value for value in (*own, references.get(name)) if isinstance(value, str)]
        unit = units.get(name) or (split_quantity(texts[0], f"inputs {name}", "K")[1] if texts else "1")
        each = made_input(name, unit, f"inputs {name}", references.get(name))
        for run, value in zip(runs, own, strict=True):
            run[name] = (
                value_in(each, value, f"inputs {name}")
                if isinstance(value, str)
                else each.zero + each.factor * np.asarray(value, dtype=np.float64)
            )
        declared.append(each)
    return declared, runs
