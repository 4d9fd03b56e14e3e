"""What a folder holds: the runs that its data files make, and what their columns measure."""

import os
import re
from collections.abc import Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from itertools import pairwise
from pathlib import Path, PurePosixPath

import numpy as np
import scipy

from sindyjoint.documents import read_regular
from sindyjoint.errors import InputError, MissingInputError, SindyJointError
from sindyjoint.files.manifest import natural_order
from sindyjoint.files.readers import READERS, ending_of, open_blocks, read_table
from sindyjoint.files.timeaxis import LONGEST_GAP, bridged, on_clock
from sindyjoint.files.units import KNOWN, LETTERS, unit_in_name, unit_ratio
from sindyjoint.numeric import Array
from sindyjoint.policy import SHARED
from sindyjoint.record import MINIMUM_SAMPLES, Motion
from sindyjoint.text import control_character

# Files that speak of runs beside them; of a longer one nobody writes.
NOTES = (".json", ".yaml", ".yml", ".txt", ".md", ".ini", ".cfg", ".hdr", ".log", ".xml")
# What a unit can only be the unit of, by SI unit.
BY_UNIT = {
    "s": "time",
    "rad": "angle",
    "m": "displacement",
    "N*m": "moment",
    "N": "force",
    "rad/s": "angular rate",
    "m/s": "velocity",
    "rad/s**2": "acceleration",
    "m/s**2": "acceleration",
}
# Of temperatures, where they are no coulombs and farads.
WARM = {"C": "degC", "°C": "degC", "F": "degF", "°F": "degF"}
SI_UNITS = {role: unit for unit, role in BY_UNIT.items()}
# Words in names of columns and files, in the order in which they decide: "angle rate" is a rate.
WORDS = {
    "command": {"command", "cmd", "setpoint", "soll", "target", "desired", "demand", "ref", "nominal"},
    "velocity": {"velocity", "vel", "speed", "v", "xdot", "geschwindigkeit", "vitesse"},
    "angular rate": {"rate", "omega", "gyro", "thetadot", "phidot", "drehzahl", "winkelgeschwindigkeit"},
    "acceleration": {"acceleration", "acc", "accel", "beschleunigung"},
    "temperature": {"temperature", "temp", "temperatur"},
    "time": {"time", "t", "zeit", "temps", "stamp", "timestamp", "clock", "sec", "seconds", "when", "uhrzeit"},
    "moment": {"moment", "torque", "trq", "tau", "drehmoment", "couple", "m", "mz", "my", "mx"},
    "force": {"force", "kraft", "load", "loadcell", "f", "fx", "fy", "fz", "effort"},
    "angle": {"angle", "theta", "phi", "rotation", "rot", "winkel", "alpha", "ang", "θ", "φ", "ϕ", "encoder"},
    "displacement": {
        "displacement", "disp", "displ", "travel", "stroke", "weg", "lvdt", "deflection", "extension", "x", "laser",
        "elongation", "hub", "crosshead",
    },
    "position": {"position", "pos", "q", "qm"},
    "counter": {"pulse", "pulses", "count", "counts", "counter", "ticks", "index", "idx", "number", "scan", "cycle"},
}  # fmt: skip
ROLES: dict[Motion, dict[str, str]] = {
    "rotation": {"moment": "moment", "angle": "angle", "rate": "angular rate"},
    "translation": {"moment": "force", "angle": "displacement", "rate": "velocity"},
}
LOADS = {"moment", "force"}
MOTIONS = {"angle", "displacement", "position"}
_CHANNEL_WORDS = frozenset().union(*WORDS.values()) | {"data", "channel", "ch", "signal"}
# Words that number runs: what stands beside them is no number of a sensor.
_RUN_WORDS = {"run", "test", "trial", "versuch", "lauf", "essai", "rec", "record", "messung", "exp", "hz"}
_WORD = re.compile(r"[A-Z]+(?![a-z])|[A-Z]?[a-z]+|[^\W\d_A-Za-z]+")
_PER = re.compile(r"_([a-z]+)_per_([a-z]+)$", re.IGNORECASE)


@dataclass(frozen=True, eq=False)
class Column:
    """One column of numbers of a run.

    Parameters
    ----------
    key : str or int
        What the manifest calls it: its name, or its number where the name does not do.
    title, unit : str
        As the file states them.
    values : ndarray, shape (n,)
    role : str or None
        What it measures, as far as unit and names show.
    file : str or None
        The file that holds it, where that is not the run's first one.
    minus : str, int or None
        What the manifest calls the column that is subtracted already.
    """

    key: str | int
    title: str
    unit: str
    values: Array
    role: str | None = None
    file: str | None = None
    minus: str | int | None = None


@dataclass(frozen=True, eq=False)
class Bundle:
    """The files and columns of one run: one file, or several with the channels of one run on one time base.

    Parameters
    ----------
    name : str
        Path of the first file from the folder.
    titles : tuple of str
        Names of all of its columns.
    columns : tuple of Column
        Those that hold finite numbers, as many as the longest of them.
    remarks : tuple of str
        What its files say about themselves.
    simulated : bool
        Whether one of its files says that it comes from a virtual test.
    scalars : tuple of (str, float)
        Single numbers beside the columns, by their titles, such as a sampling rate.
    run : str
        Which of several runs in one file this is.
    rows : tuple of int or None
        Its first and last row, from 1, where runs stand one below the other.
    refused : tuple of str
        Why columns are none of the run, such as those with blanks, or of another length.
    notes : tuple of (str, str)
        Name and text of the files that speak of it: those whose name its own begins with, else those on all.
    """

    name: str
    titles: tuple[str, ...]
    columns: tuple[Column, ...]
    remarks: tuple[str, ...] = ()
    simulated: bool = False
    scalars: tuple[tuple[str, float], ...] = ()
    run: str = ""
    rows: tuple[int, int] | None = None
    refused: tuple[str, ...] = ()
    notes: tuple[tuple[str, str], ...] = ()

    def find(self, name: str) -> Column | None:
        """Return the column of a name or number."""
        return next((column for column in self.columns if name in (str(column.key), column.title)), None)


def survey_folder(folder: Path) -> tuple[tuple[Bundle, ...], tuple[tuple[str, str], ...]]:
    """Return the data files of a folder, or of the folders in it if it has none, and those left out with the reason.

    Raises
    ------
    MissingInputError
        When there is no such folder, or no file in it that could hold runs.
    """
    if not folder.is_dir():
        raise MissingInputError(f"{str(folder)!r} is no folder; expected a folder with data files")
    found = [(path.relative_to(folder).as_posix(), path) for path in (*folder.glob("*"), *folder.glob("*/*"))]
    data = {
        name: path
        for name, path in sorted(found, key=lambda item: natural_order(item[0]))
        if ending_of(path) in READERS and path.is_file() and not path.name.startswith(".")
    }
    here = {name: path for name, path in data.items() if "/" not in name} or data
    if not here:
        endings = ", ".join(ending.removeprefix(".") for ending in READERS)
        raise MissingInputError(
            f"folder {str(folder)!r} holds no data file; expected files that end in {endings}"
        )
    files, left_out = [], []
    for name, path in here.items():
        try:
            files.append(_read(path, name))
        except SindyJointError as error:
            left_out.append((name, str(error).removeprefix(f"{path}: ")))
    names = {file.name for file in files}
    notes: list[tuple[str, str, str]] = []
    for name, path in sorted(found):
        if path.suffix.lower() in NOTES and name not in names:
            with suppress(SindyJointError):
                text = read_regular(path, 1 << 16).decode("utf-8", "replace")
                notes.append((*os.path.splitext(name), text))
    # A file is called as its note but for what follows, as run1_torque.csv and run1.json are.
    begun = {n: [s for s, *_ in notes if n.startswith(s) and not n[len(s) :][:1].isalnum()] for n in names}
    own = {name: max(stems, key=len, default=None) for name, stems in begun.items()}
    shared = [each for each in notes if each[0] not in own.values()]
    told = tuple(
        replace(
            file,
            notes=tuple(
                (f"its {ending} file", text) for stem, ending, text in notes if stem == own[file.name]
            )
            # Of all files in its folder, or below it.
            or tuple(
                (stem + ending, text)
                for stem, ending, text in shared
                if file.name.startswith(stem.rpartition("/")[0])
            ),
        )
        for file in files
    )
    return told, tuple(each for each in left_out if os.path.splitext(each[0])[0] not in own.values())


def _read(path: Path, name: str) -> Bundle:
    if sign := control_character(name):
        raise InputError(f"its name holds the control character U+{ord(sign):04X}; rename it")
    # Of a larger file only so many rows are looked at.
    blocks = open_blocks(path) if path.stat().st_size > (1 << 26) else None
    table = read_table(path)[0] if blocks is None else blocks.table(0, min(1 << 18, blocks.rows))
    columns, scalars, refused = [], [], []
    for position, title in enumerate(table.names, start=1):
        try:
            values = bridged(table.columns([position], gaps=True)[0])
        except InputError as error:
            # A column of words, or with blanks, is no channel.
            refused.append(str(error).removeprefix(f"{path}: "))
            continue
        if values.size == 1:
            scalars.append((title, float(values[0])))
        elif values.size >= MINIMUM_SAMPLES:
            unnamed = table.names.count(title) > 1 or not title.strip() or control_character(title)
            columns.append(
                Column(position if unnamed else title, title, table.stated_unit(position)[1], values)
            )
    if not columns:
        raise InputError(f"holds no column of {MINIMUM_SAMPLES} numbers or more")
    file = Bundle(
        name,
        table.names,
        tuple(columns),
        table.remarks,
        table.simulated,
        tuple(scalars),
        refused=tuple(refused),
    )
    if blocks is not None and len(_by_restart(file)) > 1:
        raise InputError(
            "its time leaps, as where a run ends, and it is too large to be looked at whole: make a file of each run"
        )
    return file


def _by_restart(file: Bundle) -> tuple[Bundle, ...]:
    """Return the runs that stand one below the other: where the time leaps, back or ahead, one ends.

    What a recorder loses within a run is short beside it.
    """
    clock = next((c for c in file.columns if role_of(c.title, c.unit) == "time"), None)
    size = 0 if clock is None else clock.values.size
    if clock is None or any(column.values.size not in (1, size) for column in file.columns):
        return (file,)
    steps = np.abs(np.diff(clock.values))
    # The usual step nearby: runs may differ in their rates.
    leaps = np.flatnonzero(steps > LONGEST_GAP * scipy.ndimage.uniform_filter1d(steps, MINIMUM_SAMPLES + 1))
    lasting = np.median([np.ptp(part) for part in np.split(clock.values, leaps + 1)])
    ends = leaps[steps[leaps] > SHARED.minor_share * lasting] + 1
    edges = [0, *map(int, ends), size]
    if not ends.size or min(np.diff(edges)) < MINIMUM_SAMPLES:
        return (file,)
    parts = [
        replace(
            file,
            columns=tuple(replace(c, values=c.values[start:stop]) for c in file.columns),
            rows=(start + 1, stop),
            run=f"{number}",
        )
        for number, (start, stop) in enumerate(pairwise(edges), start=1)
    ]
    # A column that is one number in each run, and another one in every run, numbers them.
    for at in range(len(file.columns)):
        levels = [part.columns[at].values for part in parts]
        if all(np.ptp(level) == 0 for level in levels) and len({level[0] for level in levels}) == len(parts):
            title = file.columns[at].title
            parts = [
                replace(p, columns=(*p.columns[:at], *p.columns[at + 1 :]), run=f"{title} {level[0]:g}")
                for p, level in zip(parts, levels, strict=True)
            ]
            break
    return tuple(parts)


def split_runs(file: Bundle) -> tuple[tuple[Bundle, ...], bool]:
    """Return the runs of a file that holds several, and whether names, groups or the time say so; else the file itself.

    Columns that are called alike but for a name or number belong to runs of that name, where each of these has a load
    and a motion; what has no such name, as the time, is of all.
    """
    below = _by_restart(file)
    if len(below) > 1:
        return below, True
    marks = [marks_of(column.title) for column in file.columns]
    own: dict[tuple[str, ...], set[str]] = {}
    for mark, column in zip(marks, file.columns, strict=True):
        own.setdefault(mark, set()).add(role_of(column.title, column.unit) or "")
    whole = [mark for mark, roles in own.items() if mark and LOADS & roles and MOTIONS & roles]
    if len(whole) < 2:
        return (_on_one_time(file),), True
    runs = []
    for mark in whole:
        rest = {word for other in whole if other != mark for word in other} - set(mark)
        columns = [c for c, words in zip(file.columns, marks, strict=True) if words == mark]
        called = os.path.commonprefix([c.title for c in columns]).strip("/._- ") or " ".join(mark)
        # Without the run, the unit may stand at the end.
        stated = [unit_in_name(c.title.replace(called, "").strip("/._- ")) for c in columns]
        columns = [
            replace(c, unit=c.unit or (s[0] if s else "")) for c, s in zip(columns, stated, strict=True)
        ]
        shared = [c for c, words in zip(file.columns, marks, strict=True) if words not in whole]
        scalars = tuple(each for each in file.scalars if not rest & {*marks_of(each[0])})
        made = replace(file, columns=(*columns, *shared), scalars=scalars, run=called)
        runs.append(_on_one_time(made, columns[0].values.size))
    told = all({word.lower() for word in mark} & _RUN_WORDS or not mark[0].isdigit() for mark in whole)
    return tuple(runs), told


def _on_one_time(file: Bundle, length: int | None = None) -> Bundle:
    """Return a run with its columns on the time of the slower of load and motion, without those of another length.

    A column with its own time is brought onto that one; the manifest then names its file, be it the same.
    """
    roles = [role_of(column.title, column.unit) for column in file.columns]
    sizes = [column.values.size for column in file.columns]
    of_kinds = [
        [n for n, role in zip(sizes, roles, strict=True) if role in kind] for kind in (LOADS, MOTIONS)
    ]
    size = min(max(kind or sizes) for kind in of_kinds) if length is None else length
    places = [(column.file or file.name, n) for column, n in zip(file.columns, sizes, strict=True)]
    clocks = {
        place: column
        for place, column, role in zip(places[::-1], file.columns[::-1], roles[::-1], strict=True)
        if role == "time"
    }
    base = next((place for place in places if place in clocks and place[1] == size), (file.name, size))
    columns, refused = [], list(file.refused)
    for column, place in zip(file.columns, places, strict=True):
        if place != base and {place, base} <= clocks.keys():
            one, other = clocks[base], clocks[place]
            ratio = unit_ratio(other.unit or "s", one.unit or "s") or 1.0
            try:
                moved = on_clock(
                    one.values, ratio * other.values, column.values, f"column {other.title!r}", str
                )
            except InputError as error:
                refused.append(str(error))
                continue
            column = replace(column, values=bridged(moved))
        if column.values.size == size:
            columns.append(replace(column, file=None if place == base else place[0]))
        else:
            refused.append(
                f"{column.title!r} has {place[1]} samples and the others {size}: bring all to one rate, or give each "
                "its time"
            )
    columns.sort(key=lambda column: column.file is not None)
    return replace(file, name=base[0], columns=tuple(columns), refused=tuple(refused))


def marks_of(text: str) -> tuple[str, ...]:
    """Return the words and numbers of a name that stand for no channel and no unit.

    Examples
    --------
    >>> marks_of("run 2 torque (N*m)"), marks_of("low/angle"), marks_of("0.5Hz_1in-Kraft"), marks_of("M_Nm")
    (('run', '2'), ('low',), ('0.5', '1'), ())
    """
    parts = re.findall(r"[^\W\d_]+|\d+(?:[.,]\d+)?", re.sub(r"[\[({].*?[\])}]", " ", text))
    channel = [part in KNOWN | LETTERS or {part.lower(), *_words(part)} & _CHANNEL_WORDS for part in parts]
    return tuple(part for part, known in zip(parts, channel, strict=True) if not known)


def bundle_files(files: Sequence[Bundle]) -> tuple[Bundle, ...]:
    """Return one bundle for each run, of files with one each.

    A column of one name below one header is one sensor of the test: the unit that some files state, and none denies, is
    that of all. Where no file has both a load and a motion, files whose names differ only in the word for their channel
    belong together, if they are equally long or each has its time.
    """
    stated: dict[tuple[tuple[str, ...], str], set[str]] = {}
    for file in files:
        for column in file.columns:
            if column.title.strip() and column.unit:
                stated.setdefault((file.titles, column.title), set()).add(column.unit)
    known = {place: next(iter(units)) for place, units in stated.items() if len(units) == 1}
    told = tuple(replace(file, columns=_told(file, known)) for file in files)
    roles = [{column.role for column in file.columns} for file in told]
    apart = any(LOADS & found for found in roles) and any(MOTIONS & found for found in roles)
    if not apart or any(LOADS & found and MOTIONS & found for found in roles):
        return told
    groups: dict[tuple[str, ...], list[Bundle]] = {}
    for file in told:
        # By what is left of its name without words for channels.
        groups.setdefault(marks_of(PurePosixPath(file.name).with_suffix("").as_posix()), []).append(file)
    return tuple(
        _on_one_time(
            replace(
                group[0],
                columns=group[0].columns
                + tuple(replace(column, file=other.name) for other in group[1:] for column in other.columns),
                remarks=tuple(remark for file in group for remark in file.remarks),
                simulated=any(file.simulated for file in group),
                scalars=tuple(scalar for file in group for scalar in file.scalars),
            )
        )
        for group in groups.values()
    )


def _told(file: Bundle, known: dict[tuple[tuple[str, ...], str], str]) -> tuple[Column, ...]:
    """Return the columns of a file with units and roles; a single one that is not the time may be named by the file."""
    found = []
    for column in file.columns:
        per = _PER.search(column.title)
        unit = (
            column.unit or known.get((file.titles, column.title), "") or (f"{per[1]}/{per[2]}" if per else "")
        )
        role = role_of(column.title, unit)
        unit = SI_UNITS.get(role or "", unit) if file.simulated else unit
        found.append(replace(column, unit=unit, role=role))
    if len(found) == 1 or (len(found) == 2 and (found[0].role == "time" or is_clock(found[0].values))):
        # A single column may be named by its file.
        called = PurePosixPath(file.name).stem
        unit = found[-1].unit or (unit_in_name(called) or ("",))[0]
        found[-1] = replace(found[-1], unit=unit, role=found[-1].role or role_of(called, unit))
    return tuple(found)


def is_twin(one: Array, other: Array) -> bool:
    """Return whether two signals are one but for their scale and noise."""
    moving = np.ptp(one) > 0 and np.ptp(other) > 0
    # Two columns so alike are one signal, wanted and measured.
    return bool(moving and one.size == other.size and abs(np.corrcoef(one, other)[0, 1]) > 0.999)


def moves_otherwise(own: Array, other: Array) -> bool:
    """Return whether another signal in the unit of the own one moves, and not as that does, beyond noise and 5 %."""
    # White noise has twice its variance in its differences.
    moving = (np.var(x) - np.var(np.diff(x)) / 2 for x in (other, other - own))
    return bool(min(moving) > SHARED.tolerated**2 * np.var(own))


def is_clock(values: Array) -> bool:
    """Return whether a column counts evenly upwards."""
    steps = np.diff(values)
    return bool(np.all(steps > 0) and steps.max() < 3 * np.median(steps))


def role_of(title: str, unit: str) -> str | None:
    """Return what a column measures, or None where neither unit nor name shows it.

    Examples
    --------
    >>> role_of("ch1", "mm"), role_of("Drehmoment", ""), role_of("theta_dot", ""), role_of("ch2", "")
    ('displacement', 'moment', 'angular rate', None)
    >>> role_of("force_N", "N"), role_of("pulses_N", "N"), role_of("pulses [N]", "N")
    ('force', 'counter', 'force')
    """
    bare = unit_in_name(title)
    # The V of supply_V is no velocity.
    words = role_of_words(re.sub(r"[\s_/]+[^\s_/]+$", "", title) if bare and bare[1] else title)
    # The ending of a name is a unit only where the name can be that of a quantity: pulses_N is a number of pulses.
    if not unit or words == "command" or (words == "counter" and unit_in_name(title) == (unit, True)):
        return words
    if unit in {*WARM, *WARM.values()}:
        return "temperature"
    return next((role for si, role in BY_UNIT.items() if unit_ratio(unit, si)), words)


def role_of_words(text: str) -> str | None:
    """Return what the words of a name speak of.

    Examples
    --------
    >>> role_of_words("3Hz-Kraft"), role_of_words("jointAngle"), role_of_words("velocity_in_per_s")
    ('force', 'angle', 'velocity')
    """
    words = _words(re.sub(r"[\[({].*$", "", text))
    if "dot" in words:
        words.append("xdot" if {"x", "disp", "displacement"} & set(words) else "thetadot")
    return next((role for role, known in WORDS.items() if known & set(words)), None)


def _words(text: str) -> list[str]:
    return [word.lower() for word in _WORD.findall(text)]
