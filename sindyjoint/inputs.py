"""Inputs: what is measured or known of a run beside motion and moment, and what the law may depend on."""

from __future__ import annotations

import re
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from sindyjoint.errors import InputError

Array = NDArray[np.float64]

# Words that already mean something in a formula, or in the file of an effect.
RESERVED = frozenset(
    "theta omega alpha x v a pi abs sign sqrt exp log sin cos tan tanh atan min max heaviside frequency time elapsed "
    "moment_rate moment_slope angle rate acceleration moment".split()
)
# Values are sorted into so many bins over the tested range: neighbours are one level.
BINS = 50
# A bin that holds less of each run than this share was passed on the way to another.
PASSED = 0.005


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
        At which the coefficients of the law hold that do not depend on it, SI.
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
    reference: float = 0.0
    label: str = ""
    shown_unit: str = ""
    factor: float = 1.0
    zero: float = 0.0
    tested: tuple[float, float] | None = None
    levels: int = 1
    lag: float = 0.0

    def __post_init__(self) -> None:
        check_name(self.name)
        if not np.isfinite([self.reference, self.factor, self.zero]).all() or self.factor == 0:
            raise InputError(f"input {self.name!r}: reference and unit are not finite numbers")
        if not self.label:
            object.__setattr__(self, "label", self.name.replace("_", " "))
        if not self.shown_unit:
            object.__setattr__(self, "shown_unit", self.unit)

    def shown(self, value: float) -> str:
        """Return a value with the unit in which the input was declared."""
        number = f"{(value - self.zero) / self.factor:.6g}"
        return number if self.shown_unit in ("", "1") else f"{number} {self.shown_unit}"

    def parse(self, text: str | float) -> float:
        """Return the SI value of a number in the declared unit, with or without that unit."""
        given = str(text).strip().removesuffix(self.shown_unit).strip()
        try:
            return self.zero + self.factor * float(given)
        except ValueError:
            raise InputError(
                f"input {self.name!r}: {text!r} is no number; expected one in {self.shown_unit}, such as "
                f"{self.shown(self.reference)!r}"
            ) from None


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


def with_range(declared: Iterable[Input], runs: Iterable[Any], given: Iterable[str]) -> tuple[Input, ...]:
    """Return inputs with the range that runs test; the reference of those not ``given`` is its middle."""
    runs, known = list(runs), set(given)
    runs = [run for run in runs if run.use == "identify"] or runs
    found = []
    for each in declared:
        present = [run.inputs[each.name] for run in runs if each.name in run.inputs]
        if not present:
            found.append(each)
            continue
        low, high = min(float(v.min()) for v in present), max(float(v.max()) for v in present)
        each = replace(each, tested=(low, high), levels=levels(present, (low, high)))
        found.append(each if each.name in known else replace(each, reference=(low + high) / 2))
    return tuple(found)


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
    seen = np.flatnonzero(np.sum(parts, axis=0) > min(PASSED * len(parts), 0.5))
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
    """Return the numbers that formulas use of inputs: each one's reference by its name, and its ``NAME_mid``."""
    pairs = [(each.name, each.reference, sum(each.tested or (each.reference,) * 2) / 2) for each in inputs]
    return tuple(pair for name, own, mid in pairs for pair in ((name, own), (f"{name}_mid", mid)))


def lagged(values: Array, samples: float) -> Array:
    """Return a signal behind a first-order lag with a time constant of so many samples; it begins settled."""
    if samples <= 0 or values[0] == values.min() == values.max():
        return values
    from scipy.signal import lfilter

    share = 1 - np.exp(-1 / samples)
    return lfilter([share], [1, share - 1], values, zi=[(1 - share) * values[0]])[0]
