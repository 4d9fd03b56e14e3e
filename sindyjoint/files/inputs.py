"""``[inputs]`` of a campaign: from declared columns and constants to named signals in SI units."""

from __future__ import annotations

from collections.abc import Mapping
from contextlib import suppress
from dataclasses import replace
from typing import Any

import numpy as np

from sindyjoint.errors import InputError, UnitError
from sindyjoint.files.manifest import InputTable, Manifest, RunTable
from sindyjoint.files.units import input_unit, parse_quantity, split_quantity
from sindyjoint.inputs import Input, lagged
from sindyjoint.numeric import Array


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
        for number, run in enumerate(manifest.run, start=1):
            unknown = sorted(set(run.inputs) - set(self.tables))
            if unknown:
                raise InputError(
                    f"{file}: [[run]] {number} inputs: {unknown[0]!r} is not declared; add it to [inputs] (declared "
                    f"there: {', '.join(self.tables) or 'none'})"
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
        lag = 0.0 if table.lag is None else parse_quantity(table.lag, "s", f"{where}.lag")
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
    try:
        si, factor, zero = input_unit(unit, where)
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
            if isinstance(value, str):
                run[name] = value_in(each, value, f"inputs {name}")
            else:
                run[name] = each.zero + each.factor * np.asarray(value, dtype=np.float64)
        declared.append(each)
    return declared, runs
