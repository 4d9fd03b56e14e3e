"""What is known of a run beside motion and moment: inputs of the law, its file, units of columns, noise of sensors."""

import math
import re
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import scipy
from numpy.typing import ArrayLike, NDArray

from sindyjoint.errors import InputError
from sindyjoint.plain import Size

Array = NDArray[np.float64]

# Words that already mean something in a formula, or in the file of an effect.
RESERVED = frozenset(
    "theta omega alpha x v a pi abs sign sqrt exp log sin cos tan tanh atan min max heaviside frequency time elapsed "
    "moment_rate moment_slope angle rate acceleration moment".split()
)
# Values are sorted into so many bins over the tested range: neighbours are one level.
BINS = 50


@dataclass(frozen=True)
class Input:
    """A quantity that a law may depend on: temperature, load, control signal.

    Parameters
    ----------
    name : str
        In formulas; ``NAME_ref`` stands for the reference there.
    unit : str
        SI unit of its values.
    reference : float
        At which the coefficients of the law hold that do not depend on it, SI. Default: the middle of the tested range.
    label : str
        In reports; default: the name.
    shown_unit : str
        In which it was declared; default: the SI unit.
    factor, zero : float
        SI value = zero + factor · shown value.
    tested : (float, float), optional
        Least and largest value of the runs, SI.
    levels : int
        At how many levels it was tested.
    lag : float
        Time constant of the first-order lag with which the joint follows it, s; already in the runs.
    """

    name: str
    unit: str = "1"
    reference: float = math.nan
    label: str = ""
    shown_unit: str = ""
    factor: float = 1.0
    zero: float = 0.0
    tested: tuple[float, float] | None = None
    levels: int = 1
    lag: Size = 0.0

    def __post_init__(self) -> None:
        check_name(self.name)
        if math.isinf(self.reference) or not np.isfinite([self.factor, self.zero]).all() or self.factor == 0:
            raise InputError(f"input {self.name!r}: reference and unit are not finite numbers")
        if not self.label:
            object.__setattr__(self, "label", self.name.replace("_", " "))
        if not self.shown_unit:
            object.__setattr__(self, "shown_unit", self.unit)
        if math.isnan(self.reference) and self.tested is not None:
            object.__setattr__(self, "reference", sum(self.tested) / 2)

    def tested_by(self, parts: Sequence[Array]) -> "Input":
        """Return it with the range and the levels of its values in the parts of some data, usually runs."""
        # A constant takes the memory of one value, and the time.
        parts = [v[:1] if v.strides == (0,) else v for v in parts]
        low, high = min(float(v.min()) for v in parts), max(float(v.max()) for v in parts)
        return replace(self, tested=(low, high), levels=levels(parts, (low, high)))

    def shown(self, value: float) -> str:
        """Return a value with the unit in which the input was declared."""
        number = f"{(value - self.zero) / self.factor:.6g}"
        return number if self.shown_unit in ("", "1") else f"{number} {self.shown_unit}"


def check_name(name: str) -> None:
    """Refuse a name that cannot stand in a formula, or means something there already."""
    if not re.fullmatch(r"[A-Za-z][A-Za-z0-9_]{0,27}", str(name), re.ASCII):
        raise InputError(
            f"input {name!r}: expected a name of letters, digits and _ that begins with a letter"
        )
    if name in RESERVED:
        raise InputError(f"input {name!r}: the name already means something in a formula; take another one")


def constant(value: float, samples: int) -> Array:
    """Return a read-only array of one value that takes the memory of one."""
    return np.broadcast_to(np.float64(value), (samples,))


def signals_of(run: str, inputs: Mapping[str, ArrayLike], samples: int) -> dict[str, Array]:
    """Return checked read-only signals of the inputs of a run; a number stands for a constant."""
    checked: dict[str, Array] = {}
    for name, values in inputs.items():
        check_name(name)
        array = np.asarray(values, dtype=np.float64)
        if array.ndim and array.shape != (samples,):
            raise InputError(
                f"run {run!r}: input {name!r} has shape {array.shape}; expected a number, or {samples} samples as the "
                "angle has"
            )
        if not np.isfinite(array).all():
            raise InputError(f"run {run!r}: input {name!r} holds values that are not finite; repair them")
        if array.size and array.min() == array.max():
            array = constant(array.flat[0], samples)
        else:
            array = array.copy()
            array.flags.writeable = False
        checked[name] = array
    return checked


def input_names(inputs: Sequence[str | Input]) -> tuple[str, ...]:
    """Return the names of inputs, in order."""
    names = tuple(each if isinstance(each, str) else each.name for each in inputs)
    if len(set(names)) < len(names):
        raise InputError(f"inputs: a name is used twice among {', '.join(names)}")
    return names


def tested_inputs(inputs: Sequence[str | Input], parts: Sequence[Array]) -> tuple[Input, ...]:
    """Return inputs as some data test them; those of a campaign are as its runs tested them.

    Parameters
    ----------
    inputs : sequence of str or Input
        The values of a name alone are plain numbers.
    parts : sequence of ndarray, shape (m, k)
        Their values in each run.
    """
    made = [Input(each) if isinstance(each, str) else each for each in inputs]
    return tuple(
        each if each.tested is not None else each.tested_by([part[:, place] for part in parts])
        for place, each in enumerate(made)
    )


def check_inputs(declared: Iterable[Input], runs: Iterable[Any]) -> None:
    """Refuse runs that lack an input, or have one that is not declared."""
    names = [each.name for each in declared]
    for run in runs:
        if set(run.inputs) != set(names):
            lacking = sorted(set(names) - set(run.inputs))
            word = f"has no value of the input {lacking[0]!r}" if lacking else "has the input " + repr(
                sorted(set(run.inputs) - set(names))[0]) + ", which is not declared"  # fmt: skip
            raise InputError(
                f"run {run.name!r} {word}; expected {', '.join(names) or 'no inputs'} of every run"
            )


def levels(values: Iterable[Array], tested: tuple[float, float]) -> int:
    """Return at how many levels an input was tested: in runs of one value each, or along runs."""
    low, high = tested
    if not high > low:
        return 1
    parts = [np.histogram(v, BINS, (low, high))[0] / v.size for v in values]
    # What is passed on the way from one level to another is none.
    # A bin that holds less of each run than this share was passed on the way to another.
    seen = np.flatnonzero(np.sum(parts, axis=0) > min(0.005 * len(parts), 0.5))
    # A level is a stretch without a gap; one that runs on counts once more for every quarter of the range.
    groups = np.split(seen, np.flatnonzero(np.diff(seen) > 1) + 1)
    return int(sum(1 + 4 * (group.size - 1) // BINS for group in groups))


def run_levels(values: Mapping[str, Array], tested: tuple[float, float] | None) -> dict[str, float]:
    """Return at which level each run was, by its name: the mean of the runs that were nearly at the same.

    Nothing is returned where an input moves within a run by more than a bin, or was tested at one value.
    """
    low, high = tested or (0.0, 0.0)
    width = (high - low) / BINS
    if not width > 0 or any(np.ptp(signal) > width for signal in values.values()):
        return {}
    found: dict[str, float] = {}
    means = sorted((float(np.mean(signal)), name) for name, signal in values.items())
    edges = [i for i in range(1, len(means)) if means[i][0] - means[i - 1][0] > width]
    for start, stop in zip([0, *edges], [*edges, len(means)], strict=True):
        level = float(np.mean([mean for mean, _ in means[start:stop]]))
        found |= {name: level for _, name in means[start:stop]}
    return found


def fixed_notes(inputs: Iterable[Input], elements: Iterable[str]) -> tuple[str, ...]:
    """Return that elements do not depend on inputs, where there are both.

    Examples
    --------
    >>> fixed_notes([Input("oil", "K", levels=3), Input("load", "N")], ["Jenkins element"])
    ('Jenkins element: the same at every value of oil, for elements depend on no input',)
    """
    moved, named = " and ".join(each.label for each in inputs if each.levels > 1), " and ".join(elements)
    if not moved or not named:
        return ()
    return (f"{named}: the same at every value of {moved}, for elements depend on no input",)


def reference_values(inputs: Iterable[Input]) -> tuple[tuple[str, float], ...]:
    """Return the numbers that formulas use of inputs: each one's reference by its name, and its ``NAME_mid``.

    Raises
    ------
    InputError
        For an input that has neither a reference nor a tested range.
    """
    found = []
    for each in inputs:
        if math.isnan(each.reference):
            raise InputError(
                f"input {each.name!r} has neither a reference nor a tested range; give one: "
                f"Input({each.name!r}, {each.unit!r}, reference=...)"
            )
        middle = sum(each.tested or (each.reference,) * 2) / 2
        found += [(each.name, each.reference), (f"{each.name}_mid", middle)]
    return tuple(found)


def lagged(values: Array, samples: float) -> Array:
    """Return a signal behind a first-order lag with a time constant of so many samples; it begins settled."""
    if samples <= 0 or values[0] == values.min() == values.max():
        return values
    share = 1 - np.exp(-1 / samples)
    return scipy.signal.lfilter([share], [1, share - 1], values, zi=[(1 - share) * values[0]])[0]


@dataclass(frozen=True)
class FileUnit:
    """In what unit the values of a column stand in their file, as the manifest declares it and as the file states it.

    Parameters
    ----------
    channel : str
        ``"moment"``, ``"angle"``, ``"rate"``, ``"time"`` or the name of a sensor.
    unit : str
        As declared; before the gain, such as ``"V"``.
    factor : float
        What one of it is in SI, gain included.
    column : str
        Name of the column; empty where it has none.
    stated : str
        As the file states it; empty where it does not.
    named : bool
        Whether the file states it by the ending of the column's name only (``"angle_mrad"``), which may mean another
        thing.
    beside : tuple of str
        Columns of the file that measure the same quantity, move otherwise, and are not used.
    """

    channel: str
    unit: str
    factor: float = 1.0
    column: str = ""
    stated: str = ""
    named: bool = False
    beside: tuple[str, ...] = ()


@dataclass(frozen=True)
class Source:
    """Where a run came from, for provenance.

    Parameters
    ----------
    path : str
        Name of the file.
    sha256 : str
        Of its bytes.
    units : tuple of FileUnit
        Of its columns.
    """

    path: str
    sha256: str
    units: tuple[FileUnit, ...] = ()


@dataclass(frozen=True)
class LongRecord:
    """Where the whole of a run lies that is too long for memory; the run itself then holds its first segment.

    Parameters
    ----------
    manifest : str
        The campaign's file.
    index : int
        Of the run in it.
    edges : tuple of int
        Rows of its file at which it is cut into segments.
    """

    manifest: str
    index: int
    edges: tuple[int, ...]

    @property
    def n_stretches(self) -> int:
        """Number of segments."""
        return len(self.edges) - 1
