"""Files of measuring systems: LabVIEW's text (``.lvm``), its TDMS by npTDMS, and universal files by pyuff."""

import io
import logging
import weakref
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from itertools import takewhile
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from sindyjoint.errors import InputError, refuse
from sindyjoint.files.readers import UNIT_KEYS, Table, check_bytes, foreign, library, short_names
from sindyjoint.files.readers.text import decode_text, is_number

END = "***End_of_Header***"
TIME = "X_Value"
# Record 6 of data set 58: direction of the response.
DIRECTIONS = {0: "", 1: "X", 2: "Y", 3: "Z", 4: "RX", 5: "RY", 6: "RZ"}
# One header of a segment, the names below it, and its rows.
Segment = tuple[dict[str, list[str]], list[str], list[list[str]]]


def read_lvm(path: Path, data: bytes) -> Table:
    """Return the channels of a LabVIEW measurement file: one header for the file, one above each segment of data.

    ``X_Value`` is made from the step where it is not written.

    Raises
    ------
    InputError
        For text that is no such file, or whose segments have different channels.
    """
    lines = decode_text(path, data).split("\n")
    if not lines[0].startswith("LabVIEW Measurement"):
        raise InputError(
            f"{path}: is no LabVIEW measurement file; expected 'LabVIEW Measurement' in its first line"
        )
    with foreign(path, "LabVIEW measurement"):
        separator = "," if any(line.startswith("Separator,") for line in lines[:30]) else "\t"
        table = [[field.strip() for field in line.split(separator)] for line in lines]
        ends = [number for number, row in enumerate(table) if row[0] == END]
        if len(ends) < 2:
            raise InputError(
                f"{path}: has {len(ends)} line(s) {END}; expected one below the header, one above the data"
            )
        segments = [_segment(path, table, end, before) for before, end in zip(ends, ends[1:], strict=False)]
        header, names = _pairs(table[: ends[0]]), segments[0][1]
        if any(own != names for _, own, _ in segments):
            raise InputError(
                f"{path}: its {len(segments)} segments have different channels; save them as single files"
            )
        comma = header.get("Decimal_Separator", ["."])[0] == ","
        rows = [row for _, _, own in segments for row in own]

        def numbers(at: int) -> NDArray[np.float64]:
            return np.array(
                [row[at].replace(",", ".") if comma else row[at] for row in rows], dtype=np.float64
            )

        # Two channels may have the same name.
        positions = [at for at, name in enumerate(names) if name not in (TIME, "Comment", "")]
        if TIME in names and header.get("X_Columns", [""])[0] != "No":
            columns = [numbers(names.index(TIME))]
        else:
            steps = [
                np.full(len(own), float(head["Delta_X"][0].replace(",", "."))) for head, _, own in segments
            ]
            columns = [np.arange(len(rows)) * np.concatenate(steps)]
        columns += map(numbers, positions)
    units = segments[0][0].get("Y_Unit_Label", [])[: len(positions)]
    return Table(
        path, (TIME, *(names[at] for at in positions)), lambda wanted, start, stop: [columns[at] for at in wanted],
        units=("s", *units, *[""] * (len(positions) - len(units))),
        remarks=tuple(f"{name} {' '.join(values)}" for name, values in header.items()),
    )  # fmt: skip


def _pairs(rows: Sequence[Sequence[str]]) -> dict[str, list[str]]:
    return {row[0]: list(row[1:]) for row in rows if row[0]}


def _segment(path: Path, table: list[list[str]], end: int, before: int) -> Segment:
    """Return the segment whose header ends in one line and began after another, or after the rows above it."""
    above = takewhile(lambda row: row[0] and not is_number(row[0]), reversed(table[before + 1 : end]))
    header = _pairs([*above][::-1])
    rows = list(takewhile(lambda row: any(row) and row[0] not in (END, "Channels"), table[end + 2 :]))
    # More rows than the header states are of later writes below the same header.
    stated = max((int(count) for count in header.get("Samples", []) if count), default=0)
    if len(rows) < stated:
        raise InputError(
            f"{path}: a segment announces {stated} samples and holds {len(rows)}; the file is truncated or damaged"
        )
    return header, table[end + 1] if end + 1 < len(table) else [], rows


def read_tdms(path: Path, data: bytes | None = None) -> Table:
    """Return the channels of a TDMS file, called ``group/channel``, or ``channel`` where that is unique.

    Where the channels carry LabVIEW's sampling interval, ``time`` is made of it, and ``group/time`` where they differ.

    Raises
    ------
    InputError
        For bytes that are no TDMS file.
    MissingExtraError
        Without npTDMS.
    """
    nptdms = library(f"{path}: reading", "nptdms", "npTDMS")

    def load(wanted: Sequence[int], start: int, stop: int) -> list[NDArray[Any]]:
        asked = [position for position in wanted if position < len(channels)]
        clocks = {steps[position] for position in asked} or set(steps)
        if len(channels) in wanted and (len(clocks) != 1 or 0.0 in clocks):
            raise InputError(
                f"{path}: its channels have no common sampling interval; declare [channels] rate"
            )
        # The time is as long as the first of the channels.
        end = min(stop, len(channels[asked[0]][1]) if asked else rows)
        with _tdms(path):
            return [
                np.asarray(channels[position][1].read_data(start, stop - start))
                if position < len(channels)
                else np.arange(start, end) * next(iter(clocks))
                if position == len(channels)
                else np.arange(start, min(stop, own[position][2])) * own[position][0]
                + 1e-6 * (own[position][1] - begin)
                for position in wanted
            ]

    # Opened here: of a file that it refuses npTDMS would leave its own open.
    stream = path.open("rb") if data is None else io.BytesIO(data)
    weakref.finalize(load, stream.close)
    with _tdms(path):
        file = nptdms.TdmsFile.open(stream)
        # npTDMS makes do with what is there of a file whose writing was cut short.
        if file.file_status.incomplete_final_segment:
            raise InputError(f"{path}: its last segment is incomplete; the file is truncated")
        channels = [(f"{group.name}/{c.name}", c) for group in file.groups() for c in group.channels()]
        steps = [_increment(path, channel) for _, channel in channels]
        check_bytes(path, 0 if data is None else 8 * sum(len(channel) for _, channel in channels))
    names = tuple(name for name, _ in channels)
    aliases, rows = short_names(names, "/"), max((len(channel) for _, channel in channels), default=0)
    clocked = any(steps) and "time" not in names and "time" not in aliases
    # Of groups with a clock of their own each has its time as well: step, start and length.
    groups: dict[str, set[tuple[float, float, int]]] = {}
    for step, (name, channel) in zip(steps, channels, strict=True):
        groups.setdefault(name.rpartition("/")[0], set()).add((step, _start(channel), len(channel)))
    times = {
        f"{group}/time": clock
        for group, (clock, *others) in groups.items()
        if len(set(steps)) > 1 and clock[0] and not others and f"{group}/time" not in names
    }
    own = dict(enumerate(times.values(), start=len(names) + 1))
    begin = min((start for _, start, _ in own.values()), default=0.0)
    told = ((c.properties[key] for key in UNIT_KEYS if key in c.properties) for _, c in channels)
    units = tuple(str(next(own, "")) for own in told)
    return Table(
        path, (*names, "time", *times) if clocked else names, load, aliases, units=units, count=lambda: rows
    )


@contextmanager
def _tdms(path: Path) -> Iterator[None]:
    """Report bad bytes in one sentence; npTDMS would write lines of its own about them to stderr."""
    from nptdms.log import log_manager

    level = log_manager.log_level
    log_manager.set_level(logging.CRITICAL)
    try:
        with foreign(path, "TDMS"):
            yield
    finally:
        log_manager.set_level(level)


def _increment(path: Path, channel: Any) -> float:
    """Return the sampling interval of a channel, s; zero where it states none."""
    given = channel.properties.get("wf_increment", 0.0)
    if isinstance(given, str | bool) or not np.isfinite(np.float64(given)) or given < 0:
        raise InputError(
            f"{path}: the sampling interval of channel {channel.name!r:.60} is {given!r:.40}; expected seconds"
        )
    return float(given)


def _start(channel: Any) -> float:
    """Return when the first sample of a channel was taken by the clock of the computer, in whole µs."""
    since, offset = (channel.properties.get(f"wf_start_{name}") for name in ("time", "offset"))
    whole = since.astype("M8[us]").astype(float) if isinstance(since, np.datetime64) else 0.0
    return whole + float(np.round(1e6 * (offset or 0.0)))


def read_uff(path: Path, data: bytes) -> Table:
    """Return the functions of a universal file (data sets 58, text, and 58b, binary), and ``time`` of their abscissa.

    A function is called by its first line of identification, or by node and direction such as ``12:+RZ``,
    with the label of its ordinate (``12:+RZ moment``) where one degree of freedom carries several: whatever
    is unique will do.

    Raises
    ------
    InputError
        For bytes that are no universal file, one without data set 58, or one that ends too early.
    MissingExtraError
        Without pyuff.
    """
    pyuff = library(f"{path}: reading", "pyuff")
    with foreign(path, "a universal file"):
        file = pyuff.UFF(str(path))
        sets = [file.read_sets(int(n)) for n in np.flatnonzero(np.asarray(file.get_set_types()) == 58)]
    if not sets:
        raise InputError(f"{path}: holds no complete data set 58; it may be truncated or of another format")
    sizes = [(int(function["num_pts"]), np.size(function["data"])) for function in sets]
    refuse(
        (
            stated != held,
            f"{path}: function {number} announces {stated} values and holds {held}; the file may be truncated",
        )
        for number, (stated, held) in enumerate(sizes, start=1)
    )
    candidates = [_candidates(function) for function in sets]
    flat = [name for names in candidates for name in names]
    unique = [[name for name in names if flat.count(name) == 1] for names in candidates]
    names = [next(iter(own), f"function {number}") for number, own in enumerate(unique, start=1)]
    aliases = {name: position for position, own in enumerate(unique) for name in own}

    def load(wanted: Sequence[int], start: int, stop: int) -> list[NDArray[Any]]:
        functions = [sets[position] for position in wanted if position < len(sets)] or sets
        time = functions[0]["x"]
        if functions is not sets and not all(np.array_equal(other["x"], time) for other in functions):
            raise InputError(f"{path}: its functions have different abscissas; expected the same instants")
        return [sets[position]["data"] if position < len(sets) else time for position in wanted]

    units = [str(function.get("ordinate_axis_units_lab", "")).strip() for function in sets]
    stated = tuple("" if unit == "NONE" else unit for unit in units)
    return Table(path, (*names, "time"), load, aliases, units=stated)


def _candidates(function: dict[str, Any]) -> list[str]:
    """Return the names of a function, the best name first."""
    direction = int(function["rsp_dir"])
    axis = DIRECTIONS.get(abs(direction), str(direction))
    point = f"{int(function['rsp_node'])}:{'-' if direction < 0 else '+'}{axis}"
    first, label = (str(function.get(key, "")).strip() for key in ("id1", "ordinate_axis_lab"))
    named = [first] if first not in ("", "NONE") else []
    return [*named, point, *([f"{point} {label}"] if label not in ("", "NONE") else [])]
