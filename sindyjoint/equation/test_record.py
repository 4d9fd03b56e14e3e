"""What belongs to one test and not to the joint: errors of channels and inertia, moments of time and frequency.

It goes with the model. Delay and gain of a channel and an error of the inertia are the rig's: they hold in every
campaign of that rig. A zero, a drift and a moment of time are the campaign's that they were found in.
"""

from __future__ import annotations

import json
import math
import os
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, field, replace
from pathlib import Path
from typing import Annotated, Any, Literal

from pydantic import BaseModel, ConfigDict, Field, ValidationError

from sindyjoint.documents import read_json
from sindyjoint.equation.element import ElementState, JointElement, Value
from sindyjoint.errors import InputError
from sindyjoint.record import Joint
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


SCHEMA = 1
KIND = "TestNuisances"
# Where earlier versions left it, beside the model.
FILE = "test.json"
# What a moment of the test may depend on beside the motion.
TEST_SIGNALS = ("frequency", "time", "elapsed")
Enters = Literal["time shift", "angle gain", "moment gain", "angle zero", "angle drift", "inertia"]
# What holds in every campaign of a rig: errors of its channels, and of the inertia that it declares.
OF_CHANNELS: tuple[Enters, ...] = ("time shift", "angle gain", "moment gain")
OF_RIG: tuple[Enters, ...] = (*OF_CHANNELS, "inertia")


@dataclass(frozen=True)
class Nuisance:
    """An error of a channel, or of the declared inertia.

    Parameters
    ----------
    id : str
        In the catalogue of effects.
    enters : {"time shift", "angle gain", "moment gain", "angle zero", "angle drift", "inertia"}
        What it corrects: a lag of the moment, s; the factor by which a channel reads too high; the zero of the angle,
        rad; its drift, rad/s; the inertia, kg·m².
    number : Value
    """

    id: str
    enters: Enters
    number: Value


def channel_delay(time: float, standard_error: float) -> Nuisance:
    """Return a lag of the moment behind the angle, s, as a nuisance."""
    ends = (time - 1.96 * standard_error, time + 1.96 * standard_error)
    return Nuisance("channel_delay", "time shift", Value("tau", time, standard_error, ends, "s"))


@dataclass(frozen=True)
class TestNuisances:
    """What is to be put right in a campaign before a model is compared with it.

    Parameters
    ----------
    campaign : str
        Content hash of the campaign; see :func:`~sindyjoint.states.build.content_hash`.
    joint : str
        Its joint's name.
    nuisances : tuple of Nuisance
    drift : {"moment_drift", "angle_drift", ""}
        Channel whose mean moves along each run.
    slopes : dict of str to float
        Of that channel by run, N·m/s or rad/s.
    moments : tuple of JointElement
        Moments that depend on time or on the excitation's frequency.
    """

    __test__ = False  # no test of pytest's

    campaign: str
    joint: str = ""
    nuisances: tuple[Nuisance, ...] = ()
    drift: str = ""
    slopes: Mapping[str, float] = field(default_factory=dict)
    moments: tuple[JointElement, ...] = ()

    def __bool__(self) -> bool:
        return bool(self.nuisances or self.drift or self.moments)

    @property
    def words(self) -> str:
        """What is put right, in words."""
        names = [
            f"{each.id.replace('_', ' ')} {each.number.value:.3g} {each.number.unit}".removesuffix(" 1")
            for each in self.nuisances
        ]
        names += [each.id.replace("_", " ") for each in self.moments]
        return ", ".join(names + [self.drift.replace("_", " ")] * bool(self.drift))

    def only(self, enters: Sequence[Enters]) -> TestNuisances:
        """Return errors of some kinds alone, without drifts of single runs and moments."""
        kept = tuple(each for each in self.nuisances if each.enters in enters)
        return replace(self, nuisances=kept, drift="", slopes={}, moments=())

    @property
    def varies(self) -> tuple[str, ...]:
        """What every run has its own value of: zero and drift of the angle, drift of the moment."""
        found = {each.enters for each in self.nuisances} | {self.drift.replace("_", " ")}
        return tuple(name for name in ("angle zero", "angle drift", "moment drift") if name in found)

    def total(self, enters: Enters) -> float:
        """Return the sum of the nuisances of one kind, SI."""
        return sum(each.number.value for each in self.nuisances if each.enters == enters)

    def gain(self, channel: str) -> float:
        """Return the factor by which the angle or the moment reads too high."""
        values = [each.number.value for each in self.nuisances if each.enters == f"{channel} gain"]
        return math.prod(values, start=1.0)

    def joint_of(self, joint: Joint) -> Joint:
        """Return a joint with its declared inertia put right."""
        error = self.total("inertia")
        if not error or joint.inertia is None:
            return joint
        return replace(joint, inertia=max(joint.inertia + error, 0.0))

    @property
    def timed(self) -> bool:
        """Whether a moment of the test changes in time."""
        used = {symbol.name for each in self.moments for symbol in each.form.symbols}
        return bool({"time", "elapsed"} & used)

    def to_dict(self) -> dict[str, Any]:
        """Return it as plain JSON data, as it stands in ``model.json``."""
        return {
            "schema": SCHEMA,
            "kind": KIND,
            "campaign": {"hash": self.campaign, "joint": self.joint},
            "nuisances": [
                {
                    "id": each.id,
                    "enters": each.enters,
                    "symbol": each.number.name,
                    "value": each.number.value,
                    "unit": each.number.unit,
                    "standard_error": each.number.standard_error,
                    "interval95": list(each.number.interval95),
                }
                for each in self.nuisances
            ],
            "drift": {"channel": self.drift, "slopes": dict(self.slopes)} if self.drift else None,
            "moments": [element_record(each) for each in self.moments],
        }

    def to_json(self) -> str:
        """Return the same as text."""
        return json.dumps(self.to_dict(), indent=1, ensure_ascii=False)

    @classmethod
    def from_dict(cls, data: Any) -> TestNuisances:
        """Return the nuisances that :meth:`to_dict` wrote; InputError names the field that is at fault."""
        return cls.of_record(validated(TestRecord, data, "a record of a test"))

    @classmethod
    def of_record(cls, record: TestRecord) -> TestNuisances:
        """Return the nuisances of a record that was checked."""
        return cls(
            campaign=record.campaign.hash,
            joint=record.campaign.joint,
            nuisances=tuple(
                Nuisance(n.id, n.enters, Value(n.symbol, n.value, n.standard_error, n.interval95, n.unit))
                for n in record.nuisances
            ),
            drift=record.drift.channel if record.drift else "",
            slopes=record.drift.slopes if record.drift else {},
            moments=tuple(element_of_record(each, TEST_SIGNALS) for each in record.moments),
        )


class CampaignRecord(Part):
    """The campaign that the nuisances were found in."""

    hash: Text
    joint: Text


class NuisanceRecord(Part):
    """An error of a channel, or of the declared inertia."""

    id: Text
    enters: Enters
    symbol: Text
    value: Number
    unit: Text
    standard_error: Size
    interval95: Interval


class DriftRecord(Part):
    """A channel whose mean moves along each run."""

    channel: Literal["moment_drift", "angle_drift"]
    slopes: dict[Text, Number]


class TestRecord(Part):
    """What belongs to one test and not to the joint."""

    __test__ = False

    schema_: Annotated[Literal[1], Field(alias="schema")]
    kind: Literal["TestNuisances"]
    campaign: CampaignRecord
    nuisances: list[NuisanceRecord]
    drift: DriftRecord | None
    moments: list[ElementRecord]
    kept_out: list[Text] = []  # of earlier versions


def read_test(path: str | os.PathLike[str]) -> TestNuisances | None:
    """Return the nuisances in ``test.json`` beside a model (or in its folder); None where there is none.

    Raises
    ------
    InputError
        If the file is none; the message names file and field.
    """
    file = Path(path)
    file = file / FILE if file.is_dir() else file.with_name(FILE)
    if not file.is_file():
        return None
    data = read_json(file)
    try:
        return TestNuisances.from_dict(data)
    except (ValueError, AttributeError) as error:
        reason = str(error) if isinstance(error, InputError) else f"not a record of a test: {error}"
        raise InputError(f"{file}: {reason}") from error
