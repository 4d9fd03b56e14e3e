"""The contract of all targets: files, and a fidelity table that says what they carry and how well.

An exporter says of every term and every element how it is represented and what moment the represented form gives over
a set of test cycles; the table compares that with the model.
"""

from __future__ import annotations

import os
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from types import MappingProxyType
from typing import TYPE_CHECKING, Any, ClassVar

import numpy as np
from numpy.typing import NDArray

from sindyjoint.described import Described, Maybe, same
from sindyjoint.documents import refuse_foreign_file
from sindyjoint.equation.element import states_along
from sindyjoint.equation.formula import compile_terms, variable_symbols
from sindyjoint.errors import InputError
from sindyjoint.export.parts import contribution
from sindyjoint.files.atomic import output_folder, write_bytes
from sindyjoint.numeric import Array
from sindyjoint.states.policy import POLICY as STATES

if TYPE_CHECKING:
    from sindyjoint.equation.element import JointElement
    from sindyjoint.equation.model import JointModel, ModelTerm

ALL_TERMS = "all terms"
LEVELS, PHASES = 10, 720
# A cycle is gone through so often, or until its internal states repeat.
ROUNDS = 50


@dataclass(frozen=True)
class Fidelity:
    """A row of the fidelity table.

    Parameters
    ----------
    term, symbol : str
        Id of the term or element and symbol of its coefficient; the last row is :data:`ALL_TERMS`.
    representation : str
        How the target represents it; for what is left out, "not carried" and why.
    carried : bool
    error, largest_error : float
        RMS and largest deviation from the term of the model over the tested range, as shares of the RMS moment of the
        test; over moving states, as everywhere: at a reversal friction is set-valued, and the representation says in
        words how the target sticks. For an omitted term this is the error of omitting it.
    """

    term: str
    symbol: str
    representation: str
    carried: bool
    error: Maybe
    largest_error: Maybe


@dataclass(frozen=True)
class Export(Described):
    """A model written for a target.

    Parameters
    ----------
    target : str
    files : mapping of str to (str or bytes)
        Content by file name.
    fidelity : tuple of Fidelity
    notes : tuple of str
        What a user of the files has to know.
    """

    SCHEMA: ClassVar = 1
    WRITTEN: ClassVar = {"target": "target", "files": "names", **same("fidelity", "not_carried", "notes")}
    target: str
    files: Mapping[str, str | bytes]
    fidelity: tuple[Fidelity, ...]
    notes: tuple[str, ...] = ()

    def __post_init__(self) -> None:
        object.__setattr__(self, "files", MappingProxyType(dict(self.files)))

    @property
    def not_carried(self) -> tuple[str, ...]:
        """One sentence for each thing that the target cannot express."""
        return not_carried(self.fidelity)

    @property
    def names(self) -> tuple[str, ...]:
        """Of the files."""
        return tuple(self.files)


@dataclass(frozen=True, eq=False)
class Cycles:
    """Harmonic motions that fill the tested range, on which representations are judged.

    Parameters
    ----------
    angle, rate : ndarray, shape (levels, phases)
        One whole cycle per row, rad and rad/s, from a tenth of the tested range to all of it. No rate is zero.
    step : float
        s between phases.
    """

    angle: Array
    rate: Array
    step: float

    @property
    def moving(self) -> NDArray[np.bool_]:
        """Where the rate is large enough to say on which side friction is: the states that errors are taken over."""
        return np.abs(self.rate) >= STATES.periodic_rate_share * np.abs(self.rate).max(axis=1, keepdims=True)

    @classmethod
    def of(cls, model: JointModel) -> Cycles:
        """Return the cycles up to the largest angle and rate of the test of the model."""
        level = np.linspace(1 / LEVELS, 1, LEVELS)[:, None]
        phase = (np.arange(PHASES) + 0.5) * 2 * np.pi / PHASES
        fitted = model.fitted
        step = 2 * np.pi * fitted.angle / fitted.rate / PHASES
        return cls(level * fitted.angle * np.sin(phase), level * fitted.rate * np.cos(phase), step)

    def term(self, term: ModelTerm) -> Array:
        """Moment of one term over the cycles; zero for one in the acceleration or an input, which no cycle defines."""
        if variable_symbols()[2] in term.expression.free_symbols or term.inputs:
            return np.zeros(self.angle.shape)
        return contribution(term, self.angle, self.rate)

    def states(self, element: JointElement) -> Array:
        """Return internal states of an element over the cycles once they repeat, shape (n_states, levels, phases)."""
        form = element.form
        levels = [
            states_along(form, element.values, angle, rate, self.step, ROUNDS)
            for angle, rate in zip(self.angle, self.rate, strict=True)
        ]
        return np.stack(levels, axis=1)

    def element(self, element: JointElement) -> Array:
        """Return the moment of an element over the cycles once they repeat."""
        return column_moments(element, self.angle, self.rate, self.states(element)) @ element.coefficients

    def slider(self, limit: Array, stiffness: float) -> Array:
        """Moment of a spring-slider (Jenkins) friction element over the cycles once they repeat.

        Parameters
        ----------
        limit : ndarray, shape (levels, phases)
            Moment at which it slides; not negative.
        stiffness : float
            While it sticks, N·m/rad.
        """
        moment = np.zeros(self.angle.shape)
        step = stiffness * np.diff(self.angle, axis=1, prepend=self.angle[:, -1:])
        last = np.clip(stiffness * self.angle[:, -1], -limit[:, -1], limit[:, -1])
        for _ in range(2):  # the first round forgets the start
            for i in range(self.angle.shape[1]):
                last = np.clip(last + step[:, i], -limit[:, i], limit[:, i])
                moment[:, i] = last
        return moment


def column_moments(element: JointElement, angle: Array, rate: Array, states: Array) -> Array:
    """Return the columns of an element at states, shape (..., n_columns)."""
    form = element.form
    columns = compile_terms([column.expression for column in form.columns], form.arguments)
    flat = [angle.ravel(), rate.ravel(), *(state.ravel() for state in states)]
    values = [float(value) for value in element.values]
    return np.asarray(columns(*flat, *values)).reshape(*angle.shape, len(form.columns))


@dataclass(frozen=True, eq=False)
class Represented:
    """What a target does with one term or element.

    Parameters
    ----------
    how : str
        For the table.
    moment : ndarray, shape (levels, phases), or None
        Represented moment over the cycles; ``None`` for what is not carried.
    """

    how: str
    moment: Array | None


def check_exportable(model: JointModel) -> None:
    """Refuse a model that no target can make use of.

    Raises
    ------
    InputError
        For a model without terms and elements, numbers that are not finite, or no tested range.
    """
    if not model.terms and not model.elements:
        raise InputError("the model has no terms: nothing was found, so there is nothing to export")
    for term in model.terms:
        numbers = {
            "coefficient": term.coefficient,
            "standard_error": term.standard_error,
            **dict(term.parameters),
        }
        for name, value in numbers.items():
            if not _is_finite(value):
                raise InputError(
                    f"term {term.id!r} of the model: {name} is {value!r}; expected a finite number, "
                    "as discover writes it"
                )
        for name in ("id", "symbol", "name", "unit"):
            if not isinstance(getattr(term, name), str):
                raise InputError(
                    f"term {term.id!r} of the model: {name} is no text; expected one, as discover writes it"
                )
    for element in model.elements:
        form = element.form
        known = {"theta", "omega", *form.names, *(state.name for state in form.states)}
        others = sorted({symbol.name for symbol in form.symbols} - known)
        if others:
            raise InputError(
                f"element {element.id!r} of the model depends on {', '.join(others)}; expected formulas of angle, rate "
                "and its own states, which are all that the targets know"
            )
        for number in element.numbers:
            if not _is_finite(number.value):
                raise InputError(
                    f"element {element.id!r} of the model: {number.name} is {number.value!r}; expected a finite "
                    "number, as diagnose writes it"
                )
    ids = [*model.ids, *(element.id for element in model.elements)]
    if len(set(ids)) < len(ids):
        raise InputError(f"the model has a term twice: {', '.join(map(repr, ids))}; expected each one once")
    for name in ("angle", "rate", "moment_rms"):
        value = getattr(model.fitted, name)
        if not (_is_finite(value) and value > 0):
            raise InputError(
                f"'fitted' of the model gives {name} = {value!r}; expected a positive number, as the tested range is "
                "what an export is made for and judged on"
            )


def _is_finite(value: Any) -> bool:
    # Comparing is safe for every number that JSON can hold, integers of a thousand digits included.
    return isinstance(value, int | float) and -1e300 < value < 1e300


def fidelity_table(
    model: JointModel, cycles: Cycles, represented: Mapping[str, Represented], total: Array | None = None
) -> tuple[Fidelity, ...]:
    """Compare what a target represents with the model.

    Parameters
    ----------
    model : JointModel
    cycles : Cycles
    represented : mapping of str to Represented
        By id; every term and every element must be there.
    total : ndarray, shape (levels, phases), optional
        Moment of the exported form as written, rounding included; otherwise the sum over the terms.
    """
    rows, moving = [], cycles.moving
    exact, carried = np.zeros(cycles.angle.shape), np.zeros(cycles.angle.shape)
    parts: list[tuple[ModelTerm | JointElement, Array]] = [(term, cycles.term(term)) for term in model.terms]
    for term, moment in [*parts, *((each, cycles.element(each)) for each in model.elements)]:
        item = represented[term.id]
        given = np.zeros_like(moment) if item.moment is None else item.moment
        exact, carried = exact + moment, carried + given
        rows.append(
            Fidelity(
                term.id, term.symbol, item.how, item.moment is not None,
                *shares((given - moment)[moving], model.fitted.moment_rms),
            )
        )  # fmt: skip
    whole = carried if total is None else total
    rows.append(
        Fidelity(
            ALL_TERMS, "M" if model.joint.motion == "rotation" else "F", "the exported form as a whole",
            all(item.moment is not None for item in represented.values()),
            *shares((whole - exact)[moving], model.fitted.moment_rms),
        )
    )  # fmt: skip
    return tuple(rows)


def held_rows(model: JointModel, held: JointModel) -> tuple[Fidelity, ...]:
    """Return a row for each input that an export holds at a value: what the law misses at the ends of its range."""
    cycles, rows = Cycles.of(model), []
    used = {each.name for each in model.used_inputs}
    whole = held.without_elements().moment(cycles.angle, cycles.rate)
    at = {each.name: each.reference for each in held.inputs}
    for each in held.inputs:
        if each.name not in used:
            continue
        ends = [
            model.without_elements().moment(cycles.angle, cycles.rate, inputs=at | {each.name: end})
            for end in each.tested or ()
        ]
        costs = [shares((end - whole)[cycles.moving], model.fitted.moment_rms) for end in ends]
        words = f"not carried: held at {each.shown(each.reference)}"
        if each.tested:
            words += f", tested from {each.shown(each.tested[0])} to {each.shown(each.tested[1])}"
        rows.append(Fidelity(each.name, each.name, words, False, *max(costs, default=(0.0, 0.0))))
    return tuple(rows)


def shares(difference: Array, reference: float) -> tuple[float, float]:
    """Return RMS and largest difference as shares of the RMS moment of the test."""
    return (
        float(np.sqrt(np.mean(difference**2))) / reference,
        float(np.max(np.abs(difference))) / reference,
    )


def not_carried(rows: Sequence[Fidelity]) -> tuple[str, ...]:
    """Return a sentence for each term or element that a table does not carry."""
    load = "force" if any(row.term == ALL_TERMS and row.symbol == "F" for row in rows) else "moment"
    return tuple(
        f"{row.term} ({row.symbol}): {row.representation.removeprefix('not carried: ')}; "
        f"leaving it out costs {100 * row.error:.3g} % of the RMS {load}"
        for row in rows
        if not row.carried and row.term != ALL_TERMS
    )


def write_export(export: Export, out: str | os.PathLike[str], force: bool = False) -> list[Path]:
    """Write the files of an export, all or none.

    Parameters
    ----------
    export : Export
    out : path
        A file for an export of one file; a folder for one of several, or for one file under its name when the
        folder exists.
    force : bool
        Replace files of a folder that were not written so, or were changed since, and a file that is no export.

    Returns
    -------
    list of Path
        What was written.

    Raises
    ------
    OutputError
        When the path cannot be written, or a folder holds other files of these names.
    """
    path = Path(out)
    data = {
        name: content.encode("utf-8") if isinstance(content, str) else content
        for name, content in export.files.items()
    }
    if len(data) == 1 and not path.is_dir():
        refuse_foreign_file(path, force)
        return [write_bytes(path, *data.values())]
    with output_folder(path, force=force) as stage:
        for name, content in data.items():
            (stage / name).parent.mkdir(parents=True, exist_ok=True)
            (stage / name).write_bytes(content)
    return [path / name for name in data]
