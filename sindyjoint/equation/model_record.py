"""A joint model as JSON data, and back: every number, name and formula is checked on the way in."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import asdict
from typing import Annotated, Any, Literal

import numpy as np
from pydantic import BaseModel, ConfigDict, Field, ValidationError

from sindyjoint.equation.element import ElementState, JointElement, Value
from sindyjoint.equation.model_parts import Fitted, ModelTerm
from sindyjoint.errors import InputError
from sindyjoint.inputs import Input
from sindyjoint.record import Joint
from sindyjoint.text import expectation

SCHEMA = 2
KIND: Literal["JointModel"] = "JointModel"
# Of what a model was fitted on; NaN inside, null in JSON.
MAY_BE_UNKNOWN = ("noise_floor", "moment_rms", "residual_rms", "moving_fraction", "angle", "rate")

Number = Annotated[float, Field(strict=True, allow_inf_nan=False, ge=-1e200, le=1e200)]
Size = Annotated[float, Field(strict=True, allow_inf_nan=False, ge=0, le=1e200)]
Text = Annotated[str, Field(max_length=2000)]
Interval = tuple[Number, Number]


class _Part(BaseModel):
    model_config = ConfigDict(extra="forbid")


class TermRecord(_Part):
    """A term of angle and rate with its coefficient."""

    id: Text
    symbol: Text
    name: Text
    family: Text
    formula: Text
    parameters: list[tuple[Text, Number]]
    unit: Text
    coefficient: Number
    standard_error: Size
    interval95: Interval
    unique_share: Number
    inputs: list[Text] = []


class ColumnRecord(_Part):
    """A moment of an element, and its coefficient."""

    symbol: Text
    formula: Text
    coefficient: Number
    unit: Text
    standard_error: Size
    interval95: Interval


class ParameterRecord(_Part):
    """A nonlinear parameter of an element."""

    name: Text
    value: Number
    unit: Text
    standard_error: Size
    interval95: Interval


class StateRecord(_Part):
    """An internal state: its rate, and the value that it cannot pass."""

    name: Text
    unit: Text
    rate: Text
    limit: Text | None = None


class InputRecord(_Part):
    """An input of the law: SI unit, reference, the unit that it was declared in, and the range tested."""

    name: Text
    unit: Text
    reference: Number
    label: Text = ""
    shown_unit: Text = ""
    factor: Number = 1.0
    zero: Number = 0.0
    tested: Interval | None = None
    levels: Annotated[int, Field(ge=1, le=10**9)] = 1
    lag: Size = 0.0


class ElementRecord(_Part):
    """A part of the law that has a memory."""

    id: Text
    effect: Text
    symbol: Text
    name: Text = ""
    columns: Annotated[list[ColumnRecord], Field(min_length=1)]
    parameters: list[ParameterRecord]
    states: list[StateRecord]


class JointRecord(_Part):
    """The joint under test."""

    name: Text
    motion: Literal["rotation", "translation"]
    inertia: Size | None = None
    temperature: Number | None = None
    serial: Text | None = None
    labels: dict[Text, Text] = {}


class FittedRecord(_Part):
    """On what data the model was fitted, and the range that they cover."""

    moment_rms: Size | None
    residual_rms: Size | None
    noise_floor: Size | None
    moving_fraction: Number | None
    samples: Annotated[int, Field(ge=0, le=10**15)]
    runs: Annotated[int, Field(ge=0, le=10**9)]
    angle: Size | None
    rate: Size | None
    frequencies: list[Number] = []
    simulated: bool = False
    data: Text = ""
    versions: dict[Text, Text] = {}
    gains: dict[Text, Size] = {}
    mean_known: bool = True
    quasi_static: bool = False


class ModelRecord(_Part):
    """``model.json``: the equation of a joint with the covariance of all its numbers."""

    schema_: Annotated[Literal[1, 2], Field(alias="schema")]
    kind: Literal["JointModel"] = KIND
    joint: JointRecord
    terms: Annotated[list[TermRecord], Field(max_length=200)]
    covariance: list[list[Number]]
    fitted: FittedRecord
    elements: Annotated[list[ElementRecord], Field(max_length=50)] = []
    inputs: Annotated[list[InputRecord], Field(max_length=20)] = []
    fidelity: list[dict[str, Any]] = []  # of an export to JSON


def to_record(model: Any) -> dict[str, Any]:
    """Return a model as plain JSON data, schema 2."""
    fitted = asdict(model.fitted)
    del fitted["gains"]  # written where there are some
    if fitted["mean_known"]:
        del fitted["mean_known"]
    if not model.fitted.quasi_static:
        del fitted["quasi_static"]  # likewise
    for name in MAY_BE_UNKNOWN:
        if not math.isfinite(fitted[name]):
            fitted[name] = None  # JSON has no NaN
    return {
        "schema": SCHEMA,
        "kind": KIND,
        "joint": {**asdict(model.joint), "labels": dict(model.joint.labels)},
        "terms": [_without_empty(asdict(term)) for term in model.terms],
        "elements": [element_record(element) for element in model.elements],
        "covariance": [list(row) for row in model.covariance],
        "fitted": {
            **fitted,
            "versions": dict(model.fitted.versions),
            **({"gains": dict(model.fitted.gains)} if model.fitted.gains else {}),
        },
        **({"inputs": [asdict(each) for each in model.inputs]} if model.inputs else {}),
    }


def _without_empty(term: dict[str, Any]) -> dict[str, Any]:
    """Return the record of a term; one that depends on no input does not speak of them."""
    return {key: value for key, value in term.items() if key != "inputs" or value}


def element_record(element: JointElement) -> dict[str, Any]:
    """Return an element as plain JSON data."""
    return {
        "id": element.id,
        "effect": element.effect,
        "symbol": element.symbol,
        "name": element.name,
        "columns": [
            {"symbol": n.name, "formula": n.formula, "coefficient": n.value, **_certainty(n)}
            for n in element.columns
        ],
        "parameters": [{"name": n.name, "value": n.value, **_certainty(n)} for n in element.parameters],
        "states": [asdict(state) for state in element.states],
    }


def _certainty(number: Value) -> dict[str, Any]:
    return {
        "unit": number.unit,
        "standard_error": number.standard_error,
        "interval95": list(number.interval95),
    }


def from_record(data: Any) -> dict[str, Any]:
    """Return the fields of the model that :func:`to_record` wrote, or one of schema 1.

    Raises
    ------
    InputError
        If it is none; the message names the field.
    """
    if not isinstance(data, Mapping) or data.get("schema") not in (1, SCHEMA) or "terms" not in data:
        raise InputError(
            f"not a joint model: expected 'schema': {SCHEMA} (or 1) and 'terms', as in model.json"
        )
    record = validated(ModelRecord, data, "a joint model")
    terms = tuple(_term(each) for each in record.terms)
    elements = tuple(element_of_record(each) for each in record.elements)
    ids = [term.id for term in terms] + [element.id for element in elements]
    twice = next((name for name in ids if ids.count(name) > 1), None)
    if twice is not None:
        raise InputError(f"not a joint model: the id {twice!r} is used twice; expected each id once")
    fitted = record.fitted.model_dump()
    fitted |= {name: math.nan for name in MAY_BE_UNKNOWN if fitted[name] is None}
    return {
        "joint": Joint(**record.joint.model_dump()),
        "terms": terms,
        "covariance": _covariance(record.covariance, len(terms) + sum(len(e.numbers) for e in elements)),
        "fitted": Fitted(
            **{
                **fitted,
                "frequencies": tuple(fitted["frequencies"]),
                "versions": tuple(fitted["versions"].items()),
                "gains": tuple(fitted["gains"].items()),
            }
        ),
        "elements": elements,
        "inputs": tuple(Input(**each.model_dump()) for each in record.inputs),
    }


def validated(schema: Any, data: Any, wanted: str) -> Any:
    """Return data as a schema has it; InputError names the first field that is not so."""
    try:
        return schema.model_validate(data)
    except ValidationError as error:
        fault = sorted(error.errors(), key=lambda each: each["type"] == "extra_forbidden")[0]
        place = ".".join(str(step + 1) if isinstance(step, int) else str(step) for step in fault["loc"])
        words = {"missing": "is missing", "extra_forbidden": "is unknown"}
        given = f" is {str(fault['input'])[:40]!r};" if fault["type"] not in words else ""
        reason = words.get(fault["type"]) or expectation(fault)
        raise InputError(f"not {wanted}: {place}{given} {reason}") from None


def _term(record: TermRecord) -> ModelTerm:
    tuples = {"parameters": tuple(record.parameters), "inputs": tuple(record.inputs)}
    term = ModelTerm(**{**record.model_dump(), **tuples})
    _ = term.expression  # a formula that cannot be read is said at once
    return term


def element_of_record(record: ElementRecord, signals: tuple[str, ...] = ()) -> JointElement:
    """Return the element of a record; its formulas are read, so that a fault is said at once."""
    element = JointElement(
        id=record.id,
        effect=record.effect,
        symbol=record.symbol,
        name=record.name or record.effect.replace("_", " "),
        columns=tuple(
            Value(c.symbol, c.coefficient, c.standard_error, c.interval95, c.unit, c.formula)
            for c in record.columns
        ),
        parameters=tuple(
            Value(p.name, p.value, p.standard_error, p.interval95, p.unit) for p in record.parameters
        ),
        states=tuple(ElementState(s.name, s.unit, s.rate, s.limit) for s in record.states),
        signals=signals,
    )
    _ = element.form
    return element


def _covariance(rows: list[list[float]], size: int) -> tuple[tuple[float, ...], ...]:
    if not rows:
        return ()
    lengths = {len(row) for row in rows}
    if len(rows) != size or lengths != {size}:
        raise InputError(
            f"not a joint model: covariance has {len(rows)} row(s) of {', '.join(map(str, sorted(lengths)))} numbers; "
            f"expected {size} of {size}, one for each number of the model"
        )
    matrix = np.array(rows)
    scale = np.sqrt(np.abs(np.diagonal(matrix)))
    bound = (1 + 1e-6) * np.outer(scale, scale)
    if np.any(np.diagonal(matrix) < 0) or np.any(np.abs(matrix) > bound):
        raise InputError(
            "not a joint model: in covariance a variance is negative, or a correlation is beyond 1"
        )
    if np.any(np.abs(matrix - matrix.T) > 1e-6 * bound):
        raise InputError("not a joint model: covariance is not symmetric")
    return tuple(map(tuple, rows))
