"""The runs of a structure as the detectors see them: channels by name, and what they are called and measured in."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from sindyjoint.inputs import Source
from sindyjoint.mechanics.rig_test import BASE, DRIVE, RigRun, RigTest
from sindyjoint.numeric import Array
from sindyjoint.soundness.detectors.lines import strongest_line
from sindyjoint.soundness.policy import POLICY
from sindyjoint.soundness.profile import Channel, Periods, cut_periods

OF_QUANTITY = {"acceleration": "m/s^2", "velocity": "m/s", "displacement": "m"}


@dataclass(frozen=True)
class StructureWords:
    """What the channels of a structure are called and measured in.

    Parameters
    ----------
    units : mapping of str to str
        By channel: the drive, then the sensors.
    """

    units: Mapping[str, str]

    def of(self, channel: str) -> str:
        """Return a channel as a sentence names it."""
        return channel if channel in (DRIVE, "time") else f"sensor {channel!r}"

    def label(self, channel: str) -> str:
        """Return a channel as a table names it."""
        return channel

    def unit(self, channel: str) -> str:
        """Return the unit of a channel."""
        return self.units.get(channel, "s")


def words_of_rig(test: RigTest) -> StructureWords:
    """Return what the channels of a test are called."""
    drive = "m/s^2" if test.at == BASE else "N"
    return StructureWords({DRIVE: drive} | {s.name: OF_QUANTITY[s.quantity] for s in test.sensors})


@dataclass(frozen=True, eq=False)
class Recorded:
    """A run of a structure.

    Parameters
    ----------
    name : str
    sample_rate : float
        Hz.
    frequency : float or None
        At which the drive repeats, Hz.
    channels : mapping of str to ndarray, shape (n,)
        The drive, then the sensors.
    jumpy : frozenset of str
        Channels that jump within their range where friction does: accelerations.
    source : Source or None
    """

    name: str
    sample_rate: float
    frequency: float | None
    channels: Mapping[str, Array]
    jumpy: frozenset[str] = frozenset()
    source: Source | None = None
    quasi_static: bool = False

    @property
    def n_samples(self) -> int:
        """Number of samples."""
        return self.channels[DRIVE].size

    @property
    def duration(self) -> float:
        """Length, s."""
        return self.n_samples / self.sample_rate

    @cached_property
    def alive(self) -> tuple[Channel, ...]:
        """Channels that vary."""
        return tuple(c for c in self._all if not c.constant)

    @cached_property
    def dead(self) -> tuple[Channel, ...]:
        """Channels that never change."""
        return tuple(c for c in self._all if c.constant)

    @cached_property
    def _all(self) -> tuple[Channel, ...]:
        return tuple(Channel(name, values) for name, values in self.channels.items())

    @cached_property
    def order(self) -> int:
        """The strongest line of the drive, in multiples of the frequency at which the run repeats; 1 without one."""
        if self.frequency is None:
            return 1
        return max(1, round(strongest_line(self.channels[DRIVE], self.sample_rate) / self.frequency))

    @cached_property
    def periods(self) -> dict[str, Periods]:
        """Channels that vary, period by period, at the strongest line; empty for a run that does not repeat."""
        if self.frequency is None:
            return {}
        per = self.sample_rate / self.frequency
        if per < 4 or self.n_samples / per < POLICY.fewest_periods:
            return {}
        return {c.name: cut_periods(c.values, per, self.order) for c in self.alive}

    def at(self, period: float) -> int:
        """Return the sample at which a period begins."""
        per = self.sample_rate / (self.frequency or self.sample_rate)
        return int(np.clip(round(period * per), 0, self.n_samples))


def recorded_of(test: RigTest, run: RigRun) -> Recorded:
    """Return a run of a test as the detectors see it."""
    names = [DRIVE, *(sensor.name for sensor in test.sensors)]
    jumpy = frozenset(s.name for s in test.sensors if s.quantity == "acceleration")
    channels = dict(zip(names, run.signals, strict=True))
    return Recorded(run.name, run.sample_rate, run.frequency, channels, jumpy, run.source)
