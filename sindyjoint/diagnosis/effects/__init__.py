"""Candidate effects, read from catalogues: what a model may lack of its joint, of a test's channels, of a structure.

An effect is a named change of a setup. Of a joint and its channels it has columns, which are evaluated along a measured
motion; of a structure one number, and a place of :data:`~sindyjoint.diagnosis.effects.setup.PLACES` where it acts.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cache, cached_property
from pathlib import Path
from typing import Annotated, Any, Literal

import numpy as np

from sindyjoint.diagnosis.effects.setup import PLACES, JoinedMotions, MeasuredMotion
from sindyjoint.documents import read_toml
from sindyjoint.equation.catalogue_file import library_folder
from sindyjoint.equation.element import Column, ElementState, Form, State
from sindyjoint.equation.formula import (
    coefficient_unit,
    compile_terms,
    formula_pretty,
    parse_formula,
    same_dimension,
    unit_for,
)
from sindyjoint.equation.terms import Parameter, Reference
from sindyjoint.errors import FormulaError, InputError, MissingInputError, UnitError, UnknownNameError
from sindyjoint.numeric import Array
from sindyjoint.plain import SOME, Identifier, Line, entries_of

#: Where an effect of a joint's law or of its channels enters.
OF_JOINT = ("moment", "time shift", "angle zero", "angle drift")

#: Signals that a column may use beside θ, θ̇ and θ̈, with their units.
SIGNALS = {"frequency": "1/s", "time": "s", "elapsed": "s", "moment_rate": "N*m/s", "moment_slope": "N*m/rad"}
ARGUMENTS = ("theta", "omega", "alpha", *SIGNALS)


@dataclass(frozen=True)
class _ParameterEntry:
    name: Line
    unit: Line
    lower: float
    upper: float
    relative_to: Literal["angle", "rate"] | None = None
    open: Literal["lower", "upper"] | None = None
    special: Literal["lower", "upper"] | None = None


@dataclass(frozen=True)
class _VariantEntry:
    columns: tuple[Column, ...] = ()
    parameters: tuple[_ParameterEntry, ...] = ()
    states: tuple[ElementState, ...] = ()


@dataclass(frozen=True)
class _EffectEntry:
    id: Identifier
    name: Line
    family: Line
    meaning: Line
    variant: Annotated[tuple[_VariantEntry, ...], SOME]
    source: str = ""
    confused_with: tuple[Identifier, ...] = ()
    contains: tuple[Identifier, ...] = ()
    enters: Line = "moment"


@dataclass(frozen=True)
class _EffectFile:
    name: Line
    description: Line
    effect: tuple[_EffectEntry, ...] = ()


@dataclass(frozen=True)
class Variant(Form):
    """One way in which an effect may act; ``references`` are the numbers that its formulas use of its inputs."""

    columns: tuple[Column, ...]
    parameters: tuple[Parameter, ...]
    states: tuple[State, ...]
    inputs: tuple[str, ...] = ()
    references: tuple[tuple[str, float], ...] = ()

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the nonlinear parameters."""
        return tuple(parameter.name for parameter in self.parameters)

    @property
    def degrees(self) -> int:
        """Numbers that a fit of the variant chooses."""
        return len(self.columns) + len(self.parameters)

    @property
    def has_special(self) -> bool:
        """Whether it becomes a simpler effect at an end of a parameter's range."""
        return any(parameter.special for parameter in self.parameters)

    def units(self, motion: str) -> dict[str, str]:
        """Return the units of all parameters by name, for ``"rotation"`` or ``"translation"``."""
        own = {c.symbol: c.unit for c in self.columns} | {p.name: p.unit for p in self.parameters}
        if motion == "rotation" or self.inputs:
            return own
        return {name: unit_for(unit, motion) for name, unit in own.items()}

    def bounds(self, reference: Reference) -> Array:
        """Return lower and upper bounds of the nonlinear parameters in SI units, shape (n_parameters, 2).

        An internal state follows the motion from wherever its angle is counted: its angles are relative to the swing.
        """
        if self.states and reference.swing is not None:
            reference = replace(reference, angle=reference.swing)
        scales = [
            1.0 if p.relative_to is None else getattr(reference, p.relative_to) for p in self.parameters
        ]
        ends = [(p.lower * s, p.upper * s) for p, s in zip(self.parameters, scales, strict=True)]  # type: ignore[operator]
        return np.array(ends, dtype=np.float64).reshape(-1, 2)

    @cached_property
    def _function(self) -> Any:
        arguments = (*ARGUMENTS, *self.inputs, *(s.name for s in self.states), *self.names)
        return compile_terms([column.expression for column in self.columns], arguments)

    def states_along(self, motions: JoinedMotions, values: Array) -> Array:
        """Return the internal states at the kept samples of some motions, shape (n_states, m)."""
        parameters = np.array(values, dtype=np.float64)
        return motions.states(parameters, self.limits(parameters), self.state_program)

    def along(self, motion: MeasuredMotion | JoinedMotions, values: Array) -> Array:
        """Return the columns at the kept samples of a motion, or of several, shape (m, n_columns).

        A state that grows beyond all numbers along the motion explains nothing: its columns are zero.
        """
        motions = motion if isinstance(motion, JoinedMotions) else motion.joined
        states = self.states_along(motions, values) if self.states else ()
        inputs = (motions.inputs[name] for name in self.inputs)
        columns = self._function(*motions.signals, *inputs, *states, *map(float, values))
        return columns if np.isfinite(columns).all() else np.zeros_like(columns)


@dataclass(frozen=True)
class Effect:
    """A named change of a setup: something that a model may be missing of a joint, a test or a structure."""

    id: str
    name: str
    family: str
    meaning: str
    source: str = ""
    confused_with: tuple[str, ...] = ()
    enters: str = "moment"
    variants: tuple[Variant, ...] = ()
    contains: tuple[str, ...] = ()


def load_effects(paths: Sequence[str | Path] = (), of: str = "effects") -> tuple[Effect, ...]:
    """Return the shipped effects and those of further files, each id once; a file's own replaces a shipped one.

    Parameters
    ----------
    paths : sequence of path
    of : {"effects", "structure"}
        Folder of the shipped ones: of joints and their channels, or of what is outside the joints.

    Raises
    ------
    MissingInputError, InputError, FormulaError, UnitError, UnknownNameError
        The message names file, effect and field.
    """
    effects: dict[str, Effect] = {}
    shipped = [_read_shipped(path) for path in sorted((library_folder() / of).glob("*.toml"))]
    for read in (*shipped, *(read_effects(Path(path)) for path in paths)):
        effects.update({effect.id: effect for effect in read})
    return tuple(effects.values())


@cache
def _read_shipped(path: Path) -> tuple[Effect, ...]:
    """Return the effects of a file that stays as it is, and with them what of their formulas was compiled."""
    return read_effects(path)


def read_effects(path: Path) -> tuple[Effect, ...]:
    """Return the effects of one file."""
    if not path.is_file():
        raise MissingInputError(f"{str(path)!r} does not exist; expected a .toml file of effects")
    entries = entries_of(_EffectFile, read_toml(path, path.name), path.name)
    return tuple(_effect(path, each) for each in entries.effect)


def select_effects(effects: Sequence[Effect], ids: Sequence[str]) -> tuple[Effect, ...]:
    """Return the effects of some ids; UnknownNameError names one that is not there."""
    known = {effect.id: effect for effect in effects}
    for wanted in ids:
        if wanted not in known:
            raise UnknownNameError(f"no effect {wanted!r}; known are {', '.join(sorted(known))}")
    return tuple(known[wanted] for wanted in ids)


def _effect(path: Path, entry: _EffectEntry) -> Effect:
    try:
        if entry.enters not in (*OF_JOINT, *PLACES):
            known = ", ".join((*OF_JOINT, *PLACES))
            raise InputError(f"enters is {entry.enters!r}; expected one of {known}")
        # What ships is not checked anew by every process: the tests read a copy of it, which is.
        ships = path.parent.parent == library_folder()
        variants = tuple(_variant(each, entry.enters in PLACES, ships) for each in entry.variant)
    except (FormulaError, UnitError, InputError) as error:
        raise type(error)(f"{path.name}: effect {entry.id!r}: {error}") from None
    said = {name: value for name, value in vars(entry).items() if name != "variant"}
    return Effect(**said, variants=variants)


def _check_unit(column: Column, expression: Any, units: Mapping[str, str]) -> None:
    wanted = coefficient_unit(expression, units, "rotation")
    if not same_dimension(column.unit, wanted):
        raise UnitError(f"unit {column.unit!r} times {column.formula} is not N*m; expected {wanted}")


def _variant(entry: _VariantEntry, outside: bool, ships: bool) -> Variant:
    for p in entry.parameters:
        if not p.lower < p.upper:
            raise InputError(f"parameter {p.name!r}: lower {p.lower:g} is not below upper {p.upper:g}")
    if outside:
        if len(entry.parameters) != 1 or entry.columns or entry.states:
            raise InputError("what acts outside the joints has one parameter, and no columns or states")
        (p,) = entry.parameters
        return Variant((), (Parameter(p.name, p.unit, 0.0, None, p.lower, p.upper),), ())
    if not entry.columns or any(p.lower <= 0 or not p.name.isidentifier() for p in entry.parameters):
        raise InputError("a variant has a column at least, and parameters with identifiers that are positive")
    names = [parameter.name for parameter in entry.parameters]
    states = [state.name for state in entry.states]
    units = {p.name: p.unit for p in entry.parameters} | {s.name: s.unit for s in entry.states}
    columns = []
    for column in entry.columns:
        expression = parse_formula(column.formula, names, [*states, *SIGNALS])
        if not ships:
            _check_unit(column, expression, {**units, **SIGNALS})
        columns.append(replace(column, expression=expression))
    parameters = []
    for p in entry.parameters:
        middle = float(np.sqrt(p.lower * p.upper))
        parameters.append(
            Parameter(p.name, p.unit, middle, p.relative_to, p.lower, p.upper, p.open, p.special)
        )
    return Variant(
        tuple(columns),
        tuple(parameters),
        tuple(
            State(
                s.name,
                s.unit,
                parse_formula(s.rate, names, states),
                None if s.limit is None else parse_formula(s.limit, names),
            )
            for s in entry.states
        ),
    )


def pretty(column: Column, motion: str = "rotation") -> str:
    """Return a column's formula as a line to read."""
    return formula_pretty(column.expression, motion)
