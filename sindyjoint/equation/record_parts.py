"""What records of models and tests share: checked numbers, elements with an internal state, and errors in words."""

from __future__ import annotations

from dataclasses import asdict
from typing import Annotated, Any

from pydantic import BaseModel, ConfigDict, Field, ValidationError

from sindyjoint.equation.element import ElementState, JointElement, Value
from sindyjoint.errors import InputError
from sindyjoint.text import expectation

Number = Annotated[float, Field(strict=True, allow_inf_nan=False, ge=-1e200, le=1e200)]
Size = Annotated[float, Field(strict=True, allow_inf_nan=False, ge=0, le=1e200)]
Text = Annotated[str, Field(max_length=2000)]
Interval = tuple[Number, Number]


class Part(BaseModel):
    """A part of a record: no field that is not known."""

    model_config = ConfigDict(extra="forbid")


class ColumnRecord(Part):
    """A moment of an element, and its coefficient."""

    symbol: Text
    formula: Text
    coefficient: Number
    unit: Text
    standard_error: Size
    interval95: Interval


class ParameterRecord(Part):
    """A nonlinear parameter of an element."""

    name: Text
    value: Number
    unit: Text
    standard_error: Size
    interval95: Interval


class StateRecord(Part):
    """An internal state: its rate, and the value that it cannot pass."""

    name: Text
    unit: Text
    rate: Text
    limit: Text | None = None


class ElementRecord(Part):
    """A part of the law that has a memory."""

    id: Text
    effect: Text
    symbol: Text
    name: Text = ""
    columns: Annotated[list[ColumnRecord], Field(min_length=1)]
    parameters: list[ParameterRecord]
    states: list[StateRecord]


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
