"""What belongs to one test and not to the joint: errors of channels and inertia, moments of time and frequency.

It goes with the model. Delay and gain of a channel and an error of the inertia are the rig's: they hold in every
campaign of that rig. A zero, a drift and a moment of time are the campaign's that they were found in.
"""

from __future__ import annotations

import json
import math
import os
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, ClassVar, Literal

from sindyjoint.described import Described, same
from sindyjoint.documents import read_json
from sindyjoint.equation.element import JointElement, Value
from sindyjoint.errors import InputError
from sindyjoint.plain import from_plain
from sindyjoint.record import Joint

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

    WRITTEN: ClassVar = {
        **same("id", "enters"),
        "symbol": "number.name",
        **{name: f"number.{name}" for name in ("value", "unit", "standard_error", "interval95")},
    }
    id: str
    enters: Enters
    number: Value


def channel_delay(time: float, standard_error: float) -> Nuisance:
    """Return a lag of the moment behind the angle, s, as a nuisance."""
    ends = (time - 1.96 * standard_error, time + 1.96 * standard_error)
    return Nuisance("channel_delay", "time shift", Value("tau", time, standard_error, ends, "s"))


@dataclass(frozen=True)
class Drift:
    """A channel whose mean moves along each run.

    Parameters
    ----------
    channel : {"moment_drift", "angle_drift"}
    slopes : mapping of str to float
        By run, N·m/s or rad/s.
    """

    channel: str
    slopes: Mapping[str, float]


@dataclass(frozen=True)
class TestNuisances(Described):
    """What is to be put right in a campaign before a model is compared with it.

    Parameters
    ----------
    campaign : str
        Content hash of the campaign; see :func:`~sindyjoint.states.content_hash`.
    joint : str
        Its joint's name.
    nuisances : tuple of Nuisance
    drift : Drift, optional
    moments : tuple of JointElement
        Moments that depend on time or on the excitation's frequency.
    """

    __test__ = False  # no test of pytest's
    SCHEMA: ClassVar = 1
    KIND: ClassVar = "TestNuisances"
    WRITTEN: ClassVar = {
        "campaign": {"hash": "campaign", "joint": "joint"},
        **same("nuisances", "drift", "moments"),
    }
    FORMERLY: ClassVar = ("kept_out",)

    campaign: str
    joint: str = ""
    nuisances: tuple[Nuisance, ...] = ()
    drift: Drift | None = None
    moments: tuple[JointElement, ...] = ()

    def __post_init__(self) -> None:
        timed = tuple(replace(each, signals=TEST_SIGNALS) for each in self.moments)
        object.__setattr__(self, "moments", timed)

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
        return ", ".join(names + [drift.channel.replace("_", " ") for drift in [self.drift] if drift])

    def only(self, enters: Sequence[Enters]) -> TestNuisances:
        """Return errors of some kinds alone, without drifts of single runs and moments."""
        kept = tuple(each for each in self.nuisances if each.enters in enters)
        return replace(self, nuisances=kept, drift=None, moments=())

    @property
    def varies(self) -> tuple[str, ...]:
        """What every run has its own value of: zero and drift of the angle, drift of the moment."""
        drifts = self.drift.channel.replace("_", " ") if self.drift else ""
        found = {drifts, *(each.enters for each in self.nuisances)}
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

    def to_json(self) -> str:
        """Return it as JSON text, as it stands in ``model.json``."""
        return json.dumps(self.to_dict(), indent=1, ensure_ascii=False)

    @classmethod
    def from_dict(cls, data: Any) -> TestNuisances:
        """Return the nuisances that :meth:`to_dict` wrote; InputError names the field that is at fault."""
        try:
            return from_plain(cls, data)
        except InputError as error:
            raise InputError(f"not a record of a test: {error}") from None

    def checked(self) -> TestNuisances:
        """Return it after its formulas were read, so that a fault is said at once."""
        _ = [each.form for each in self.moments]
        return self


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
    except InputError as error:
        raise InputError(f"{file}: {error}") from error
