"""Campaigns of arrays and data frames that are in memory already."""

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from sindyjoint.errors import InputError, UnitError, refuse_unknown
from sindyjoint.files.campaign import inputs_of_runs
from sindyjoint.files.channels import KEYS
from sindyjoint.files.drafting.assignment import Dialogue, assign_columns, find_motion
from sindyjoint.files.drafting.run import find_frequency, name_levels
from sindyjoint.files.drafting.survey import Bundle, Column, role_of
from sindyjoint.files.readers import UNIT_KEYS
from sindyjoint.files.timeaxis import check_order, uniform_rate
from sindyjoint.files.units import conversion, parse_optional, parse_quantity, unit_in_name
from sindyjoint.measurement.runs import measured_run, travelled_run
from sindyjoint.numeric import Array
from sindyjoint.record import Campaign, Joint, Motion, Use

FOUND = "found"


def campaign_from_arrays(
    *,
    moment: Any = None,
    angle: Any = None,
    force: Any = None,
    displacement: Any = None,
    acceleration: Any = None,
    time: Any = FOUND,
    rate: float | str | None = None,
    units: Mapping[str, str] | None = None,
    frequency: float | str | None | Sequence[float | None] = FOUND,
    level: str | Sequence[str] | None = None,
    names: Sequence[str] | None = None,
    use: Use | Sequence[Use] = "identify",
    name: str = "joint",
    inertia: float | str | None = None,
    simulated: bool = False,
    inputs: Mapping[str, Any] | None = None,
    references: Mapping[str, str | float] | None = None,
) -> Campaign:
    """Return a campaign of arrays.

    Parameters
    ----------
    moment, angle : array_like, shape (n,), or a sequence of these
        Of a joint that rotates: one run, or one entry for each run.
    force, displacement : array_like, shape (n,), or a sequence of these
        Of a joint that slides, instead of the two above.
    acceleration : array_like, shape (n,), or a sequence of these, optional
        Of the joint's motion, instead of angle or displacement, or beside it.
    time : array_like, shape (n,), or a sequence of these, optional
        Sampling instants; ``None``: there are none, the samples are quasi-static and have only an order.
    rate : float or str, optional
        Sampling rate instead of them: Hz, or ``"1 kHz"``.
    units : mapping of str to str, optional
        By the names of these parameters, any that pint knows: ``{"angle": "mrad"}``. Default: SI.
    frequency : float, None, or a sequence of these
        Of the excitation, Hz; None for an aperiodic run. Default: found in the spectrum.
    level : str or sequence of str, optional
        Label of the excitation level. Default: by the amplitude.
    names, use : optional
        Of the runs.
    name : str
        Of the joint.
    inertia : float or str, optional
        Moving with the joint: SI, or ``"0.02 kg*m^2"``. Default: identified.
    simulated : bool
        Whether the arrays come from a simulation. Reports say so.
    inputs : mapping of str to value, array_like, or a sequence of these, optional
        What else the law may depend on, by its name in formulas: one value for all runs or one for each, each a number
        in the unit that ``units`` gives, a quantity such as ``"-40 degC"``, or an array, shape (n,).
    references : mapping of str to float or str, optional
        Values of the inputs at which coefficients that do not depend on them hold. Default: the middle of the range.

    Raises
    ------
    InputError, UnitError
        For arrays, units or options that cannot be used.
    """
    given = {
        "moment": moment, "angle": angle, "force": force, "displacement": displacement, "acceleration": acceleration,
    }  # fmt: skip
    columns = {key: _as_runs(values) for key, values in given.items() if values is not None}
    motion = _motion_of(list(columns))
    known = dict(KEYS[motion].values())
    stated = {key: known[key] for key in columns} | {"time": "s"}
    refuse_unknown("units", units or {}, [*stated, *(inputs or {})])
    stated |= dict(units or {})
    if time is not None and not isinstance(time, str):
        stamps = _as_runs(time)
        columns["time"] = stamps * len(next(iter(columns.values()))) if len(stamps) == 1 else stamps
    return campaign_from_frames(
        _named_runs(columns, names), units=stated, rate=rate, frequency=frequency, level=level, use=use, name=name,
        inertia=inertia, motion=motion, simulated=simulated, inputs=inputs, references=references,
        time=time if time is None else FOUND,
        columns=None if acceleration is None else {"acceleration": "acceleration"},
    )  # fmt: skip


def _motion_of(present: list[str]) -> Motion:
    """Return the motion whose arrays were given."""
    ways = [["moment", "angle"], ["force", "displacement"]]
    ways += [[way[0], *more, "acceleration"] for way in ways for more in ([], way[1:])]
    if present not in ways:
        raise InputError(
            f"arrays were given of {', '.join(present) or 'nothing'}; expected moment and angle, or force and "
            "displacement; acceleration instead of angle or displacement, or beside it"
        )
    return "rotation" if "moment" in present else "translation"


def _named_runs(
    columns: Mapping[str, Sequence[Any]], names: Sequence[str] | None
) -> dict[str, dict[str, Any]]:
    """Return the columns of each run under its name."""
    counts = {key: len(runs) for key, runs in columns.items()}
    if len(set(counts.values())) > 1:
        listed = ", ".join(f"{count} of {key}" for key, count in counts.items())
        raise InputError(
            f"arrays of different numbers of runs were given: {listed}; expected one of each for each run"
        )
    count = next(iter(counts.values()))
    titles = list(names) if names is not None else [f"run {number + 1}" for number in range(count)]
    frames = {
        title: {key: runs[i] for key, runs in columns.items()} for i, title in enumerate(titles[:count])
    }
    if len(frames) != count:
        raise InputError(
            f"{len(titles)} name(s) were given for {count} run(s); expected a different one for each"
        )
    return frames


def campaign_from_frames(
    frames: Any,
    *,
    units: Mapping[str, str] | None = None,
    columns: Mapping[str, str] | None = None,
    motion: Motion | None = None,
    rate: float | str | None = None,
    frequency: float | str | None | Sequence[float | None] = FOUND,
    level: str | Sequence[str] | None = None,
    use: Use | Sequence[Use] = "identify",
    name: str = "joint",
    inertia: float | str | None = None,
    simulated: bool = False,
    inputs: Mapping[str, Any] | None = None,
    references: Mapping[str, str | float] | None = None,
    time: str | None = FOUND,
) -> Campaign:
    """Return a campaign of data frames, one for each run.

    Parameters
    ----------
    frames : data frame, or mapping of str to data frame
        Of one run, or by the name of the run: of pandas or polars, a data set of xarray, or any mapping from names of
        columns to arrays. The order of the columns does not matter: their names and units say what they are. A
        dimension ``"run"`` of a data set is that of several runs.
    units : mapping of str to str, optional
        Unit of each column by its name; where the name states it (``"angle [mrad]"``), or the attributes of a column
        do, it may be left out.
    columns : mapping of str to str, optional
        Which column is which channel, where names do not say: ``{"moment": "ch1", "angle": "ch2"}``. An acceleration
        beside an angle is used where it is named here.
    motion : {"rotation", "translation"}, optional
    rate, frequency, level, use, name, inertia, simulated, inputs, references
        As for :func:`campaign_from_arrays`; of an input also the name of a column.
    time : None, optional
        The samples are quasi-static, whatever columns there are.

    Raises
    ------
    InputError, UnitError
        For frames, units or options that cannot be used.
    """
    frames = _by_run(frames)
    answers = dict(columns or {}) | ({} if motion is None else {"motion": motion})
    dialogue = Dialogue(answers)
    bundles = [_bundle(title, frame, dict(units or {})) for title, frame in frames.items()]
    titles = {column.title for bundle in bundles for column in bundle.columns}
    refuse_unknown("units", units or {}, sorted({*titles, "time", *(inputs or {})}))
    declared, values = inputs_of_runs(inputs or {}, units or {}, references or {}, frames)
    found: Motion = find_motion(bundles, dialogue)
    if time is None and rate is not None:
        raise InputError(
            f"time=None says that the samples have no time, and rate is {rate!r}; give one of the two"
        )
    # A rate that stands for that of samples without time.
    runs = [_signals(bundle, found, rate if time else 1.0, dialogue) for bundle in bundles]
    if dialogue.questions:
        question = next(iter(dialogue.questions.values()))
        raise InputError(f"{question.text} Give columns={{{question.key!r}: ...}} (guess: {question.guess})")
    quantity = "angle" if all("angle" in run for run, _ in runs) else "acceleration"
    peaks = [float(np.ptp(run[quantity] if quantity in run else run["angle"])) / 2 for run, _ in runs]
    labels = name_levels([""] * len(runs), peaks, KEYS[found][quantity][1]) if level is None else level
    made = []
    for i, (title, (signals, sample_rate)) in enumerate(zip(frames, runs, strict=True)):
        asked = _of(frequency, i, len(runs))
        if asked == FOUND:
            moving = signals["angle" if "angle" in signals else "acceleration"]
            asked = None if time is None else find_frequency(moving, signals["moment"], sample_rate, title)
        known: dict[str, Any] = {
            "level": _of(labels, i, len(runs)),
            "use": _of(use, i, len(runs)),
            "frequency": parse_optional(asked, "Hz", "frequency"),
            "inputs": values[i],
        }
        made.append(
            travelled_run(title, signals["moment"], signals["angle"], **known)
            if time is None
            else measured_run(title, signals, sample_rate, **known)
        )
    key, unit = KEYS[found]["inertia"]
    joint = Joint(name, found, parse_optional(inertia, unit, key))
    return Campaign(joint, tuple(made), simulated=simulated, inputs=tuple(declared))


def _by_run(frames: Any) -> Mapping[str, Any]:
    """Return the frame of each run by its name."""
    if "run" in getattr(frames, "sizes", ()):
        labels = [str(label) for label in frames["run"].values]
        return {
            label: frames.isel(run=at).drop_vars("run", errors="ignore") for at, label in enumerate(labels)
        }
    of_columns = isinstance(frames, Mapping) and all(np.ndim(values) == 1 for values in frames.values())
    if hasattr(frames, "columns") or hasattr(frames, "data_vars") or of_columns:
        return {"run 1": frames}
    if not isinstance(frames, Mapping):
        raise InputError(
            f"data of type {type(frames).__name__} were given; expected a data frame, or a mapping from names of runs "
            "to frames"
        )
    return frames


def _as_runs(values: Any) -> list[Array]:
    """Return one array for each run."""
    if isinstance(values, np.ndarray):
        return [values] if values.ndim == 1 else list(values)
    items = list(values)
    one = bool(items) and np.ndim(items[0]) == 0
    return [np.asarray(items, dtype=float)] if one else [np.asarray(each) for each in items]


def _of(values: Any, index: int, count: int) -> Any:
    """Return the entry of a run, of what may be given once for all."""
    if values is None or isinstance(values, str | float | int):
        return values
    if len(values) != count:
        raise InputError(
            f"{len(values)} value(s) were given for {count} run(s): {list(values)!r:.60}; expected one each"
        )
    return values[index]


def _bundle(title: str, frame: Any, units: dict[str, str]) -> Bundle:
    """Return the columns of a frame with the units that are given, or stand in their names."""
    # Of a data set of xarray its coordinates are columns, too.
    titles = list(getattr(frame, "columns", getattr(frame, "variables", frame)))
    names = [str(title) for title in titles]
    columns = []
    for given, name in zip(titles, names, strict=True):
        values = np.asarray(frame[given])
        if values.dtype.kind not in "fiub" or values.ndim != 1:
            continue  # words and dates are no channel
        stated, attributes = unit_in_name(name), getattr(frame[given], "attrs", {})
        noted = next((str(attributes[key]) for key in UNIT_KEYS if key in attributes), "")
        unit = units.get(name) or (stated[0] if stated else noted)
        columns.append(Column(name, name, unit, values.astype(np.float64), role_of(name, unit)))
    if not columns:
        raise InputError(
            f"run {title!r}: holds no column of numbers; columns there: {', '.join(names) or 'none'}"
        )
    return Bundle(title, tuple(names), tuple(columns))


def _signals(
    bundle: Bundle, motion: Motion, rate: float | str | None, dialogue: Dialogue
) -> tuple[dict[str, Array], float]:
    """Return the channels of one run in SI units, and its sampling rate, Hz."""
    chosen = assign_columns(bundle, motion, dialogue)
    signals = {}
    for quantity, column in chosen.items():
        key, si = ("time", "s") if quantity == "time" else KEYS[motion][quantity]
        if not column.unit and quantity != "time":
            raise UnitError(
                f"run {bundle.name!r}: the unit of column {column.title!r} ({key}) is not told; give "
                f"units={{{column.title!r}: {si.replace('**', '^')!r}}}"
            )
        signals[quantity] = column.values * conversion(column.unit or "s", si, f"run {bundle.name!r}: {key}")
    stamps = signals.pop("time", None)
    if rate is not None:
        return signals, parse_quantity(rate, "Hz", "rate")
    if stamps is None:
        raise InputError(
            f"run {bundle.name!r}: neither time nor rate was given; give rate='1 kHz', or the instants, or time=None "
            "where the samples are quasi-static"
        )
    where = f"run {bundle.name!r}: time"
    check_order(stamps, where, lambda index: f"sample {index}")
    return signals, uniform_rate(stamps, where, lambda index: f"sample {index}")
