"""What belongs to one test and not to the joint: errors of channels and inertia, moments of time and frequency.

They are found by a diagnosis, stored in ``test.json`` beside the model, and applied to the campaign that they were
found in and to no other.
"""

from __future__ import annotations

import json
import os
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Annotated, Any, Literal

import numpy as np
from pydantic import BaseModel, ConfigDict, Field

from sindyjoint.checksums import read_json
from sindyjoint.equation.element import JointElement, Value
from sindyjoint.equation.model import JointModel
from sindyjoint.equation.model_record import (
    ElementRecord,
    Interval,
    Number,
    Size,
    Text,
    element_of_record,
    element_record,
    validated,
)
from sindyjoint.errors import InputError
from sindyjoint.mechanics.laws import FormulaLaw, Law
from sindyjoint.record import Campaign, Joint, Run
from sindyjoint.response.element_law import TEST_SIGNALS, Instant, parts_of, sum_law
from sindyjoint.response.law_in_run import law_in_run, with_added
from sindyjoint.states import ForceStates
from sindyjoint.states.campaigns import aligned_run, content_hash

SCHEMA = 1
KIND = "TestNuisances"
FILE = "test.json"
Enters = Literal["time shift", "angle zero", "angle drift", "inertia"]


@dataclass(frozen=True)
class Nuisance:
    """An error of a channel, or of the declared inertia.

    Parameters
    ----------
    id : str
        In the catalogue of effects.
    enters : {"time shift", "angle zero", "angle drift", "inertia"}
        What it corrects: a lag of the moment, s; the zero of the angle, rad; its drift, rad/s; the inertia, kg·m².
    number : Value
    """

    id: str
    enters: Enters
    number: Value


@dataclass(frozen=True)
class TestNuisances:
    """What is to be put right in one campaign before a model is compared with it.

    Parameters
    ----------
    campaign : str
        Content hash of the campaign; see :func:`~sindyjoint.states.campaigns.content_hash`.
    joint : str
        Its joint's name.
    nuisances : tuple of Nuisance
    drift : {"moment_drift", "angle_drift", ""}
        Channel whose mean moves along each run.
    slopes : dict of str to float
        Of that channel by run, N·m/s or rad/s.
    moments : tuple of JointElement
        Moments that depend on time or on the excitation's frequency.
    kept_out : tuple of str
        Runs that no number was fitted to.
    """

    __test__ = False  # no test of pytest's

    campaign: str
    joint: str = ""
    nuisances: tuple[Nuisance, ...] = ()
    drift: str = ""
    slopes: Mapping[str, float] = field(default_factory=dict)
    moments: tuple[JointElement, ...] = ()
    kept_out: tuple[str, ...] = ()

    def __bool__(self) -> bool:
        return bool(self.nuisances or self.drift or self.moments or self.kept_out)

    @property
    def words(self) -> str:
        """What is put right, in words."""
        names = [each.id for each in self.nuisances] + [each.id for each in self.moments]
        names += [self.drift] * bool(self.drift)
        return ", ".join(name.replace("_", " ") for name in names)

    def belongs_to(self, campaign: Campaign) -> bool:
        """Whether this is the campaign that they were found in."""
        return content_hash(campaign) == self.campaign

    def total(self, enters: Enters) -> float:
        """Return the sum of the nuisances of one kind, SI."""
        return sum(each.number.value for each in self.nuisances if each.enters == enters)

    def joint_of(self, joint: Joint) -> Joint:
        """Return a joint with its declared inertia put right."""
        error = self.total("inertia")
        if not error or joint.inertia is None:
            return joint
        return replace(joint, inertia=max(joint.inertia + error, 0.0))

    def corrected(self, campaign: Campaign) -> Campaign:
        """Return the campaign with channels and inertia put right, and the runs kept out marked for validation."""
        out = () if campaign.validation_runs else self.kept_out
        runs = tuple(self._corrected_run(run) for run in campaign.runs)
        runs = tuple(replace(run, use="validate") if run.name in out else run for run in runs)
        return replace(campaign, joint=self.joint_of(campaign.joint), runs=runs)

    def _corrected_run(self, run: Run) -> Run:
        ramp = self.slopes.get(run.name, 0.0) * run.time
        if self.drift == "moment_drift":
            run = replace(run, moment=run.moment - ramp)
        angle = run.angle - self.total("angle zero") - self.total("angle drift") * run.time
        if self.drift == "angle_drift":
            angle = angle - ramp
        if np.any(angle != run.angle):
            run = replace(run, angle=angle)
        delay = self.total("time shift")
        return aligned_run(run, delay) if delay else run

    @property
    def timed(self) -> bool:
        """Whether a moment of the test changes in time."""
        used = {symbol.name for each in self.moments for symbol in each.form.symbols}
        return bool({"time", "elapsed"} & used)

    def law(self, model: JointModel, states: ForceStates) -> Law:
        """Return the law of a model in one run of this test."""
        law = law_in_run(replace(model, joint=self.joint_of(model.joint)), states)
        return with_added(law, self.added(states))

    def added(self, states: ForceStates) -> FormulaLaw | None:
        """Return the moments that the test adds in one of its runs; None where it adds none."""
        return sum_law(parts_of(self.moments), states.frequency or 0.0, Instant.of(states))

    def to_dict(self) -> dict[str, Any]:
        """Return what ``test.json`` holds."""
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
            "kept_out": list(self.kept_out),
        }

    def to_json(self) -> str:
        """Return ``test.json`` as text."""
        return json.dumps(self.to_dict(), indent=1, ensure_ascii=False)

    @classmethod
    def from_dict(cls, data: Any) -> TestNuisances:
        """Return the nuisances that :meth:`to_dict` wrote; InputError names the field that is at fault."""
        record = validated(TestRecord, data, "a record of a test")
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
            kept_out=tuple(record.kept_out),
        )


class _Part(BaseModel):
    model_config = ConfigDict(extra="forbid")


class CampaignRecord(_Part):
    """The campaign that the nuisances were found in."""

    hash: Text
    joint: Text


class NuisanceRecord(_Part):
    """An error of a channel, or of the declared inertia."""

    id: Text
    enters: Enters
    symbol: Text
    value: Number
    unit: Text
    standard_error: Size
    interval95: Interval


class DriftRecord(_Part):
    """A channel whose mean moves along each run."""

    channel: Literal["moment_drift", "angle_drift"]
    slopes: dict[Text, Number]


class TestRecord(_Part):
    """``test.json``: what belongs to one test and not to the joint."""

    __test__ = False

    schema_: Annotated[Literal[1], Field(alias="schema")]
    kind: Literal["TestNuisances"]
    campaign: CampaignRecord
    nuisances: list[NuisanceRecord]
    drift: DriftRecord | None
    moments: list[ElementRecord]
    kept_out: list[Text]


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
