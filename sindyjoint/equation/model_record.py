"""A joint model as JSON data, and back: every number, name and formula is checked on the way in."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import asdict
from typing import Annotated, Any, Literal

import numpy as np
from pydantic import Field

from sindyjoint.equation.model_parts import UNKNOWN, Fitted, ModelTerm
from sindyjoint.equation.test_record import (
    ElementRecord,
    Interval,
    Number,
    Part,
    Size,
    TestNuisances,
    TestRecord,
    Text,
    element_of_record,
    element_record,
    validated,
)
from sindyjoint.errors import InputError
from sindyjoint.inputs import Input
from sindyjoint.record import Joint

SCHEMA = 2
KIND: Literal["JointModel"] = "JointModel"
# Of what a model was fitted on; NaN inside, null in JSON.
MAY_BE_UNKNOWN = ("noise_floor", "moment_rms", "residual_rms", "moving_fraction", "angle", "rate")


class TermRecord(Part):
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


class InputRecord(Part):
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


class JointRecord(Part):
    """The joint under test."""

    name: Text
    motion: Literal["rotation", "translation"]
    inertia: Size | None = None
    temperature: Number | None = None
    serial: Text | None = None
    labels: dict[Text, Text] = {}


class FittedRecord(Part):
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
    seen: list[Text] = [UNKNOWN]


class ModelRecord(Part):
    """``model.json``: the equation of a joint with the covariance of all its numbers."""

    schema_: Annotated[Literal[1, 2], Field(alias="schema")]
    kind: Literal["JointModel"] = KIND
    joint: JointRecord
    terms: Annotated[list[TermRecord], Field(max_length=200)]
    covariance: list[list[Number]]
    fitted: FittedRecord
    elements: Annotated[list[ElementRecord], Field(max_length=50)] = []
    inputs: Annotated[list[InputRecord], Field(max_length=20)] = []
    test: TestRecord | None = None
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
        "terms": [
            {key: value for key, value in asdict(term).items() if key != "inputs" or value}
            for term in model.terms
        ],
        "elements": [element_record(element) for element in model.elements],
        "covariance": [list(row) for row in model.covariance],
        "fitted": {
            **fitted,
            "versions": dict(model.fitted.versions),
            **({"gains": dict(model.fitted.gains)} if model.fitted.gains else {}),
        },
        **({"inputs": [asdict(each) for each in model.inputs]} if model.inputs else {}),
        **({"test": model.test.to_dict()} if model.test else {}),
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
                "seen": tuple(fitted["seen"]),
            }
        ),
        "elements": elements,
        "inputs": tuple(Input(**each.model_dump()) for each in record.inputs),
        "test": None if record.test is None else TestNuisances.of_record(record.test),
    }


def _term(record: TermRecord) -> ModelTerm:
    tuples = {"parameters": tuple(record.parameters), "inputs": tuple(record.inputs)}
    term = ModelTerm(**{**record.model_dump(), **tuples})
    _ = term.expression  # a formula that cannot be read is said at once
    return term


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
