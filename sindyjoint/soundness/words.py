"""What the channels of a joint are called and measured in, by its kind of motion."""

from __future__ import annotations

from dataclasses import dataclass

from sindyjoint.record import Motion


@dataclass(frozen=True)
class Words:
    """Names and units of the channels of one kind of motion, and the coefficients that a fault shifts.

    Parameters
    ----------
    moment, angle, rate : str
    moment_unit, angle_unit : str
    """

    moment: str
    angle: str
    rate: str
    moment_unit: str
    angle_unit: str

    def of(self, channel: str) -> str:
        """Return the name of a channel, such as ``"displacement"`` for ``"angle"``."""
        return {"moment": self.moment, "angle": self.angle, "rate": self.rate}.get(channel, channel)

    def unit(self, channel: str) -> str:
        """Return the unit of a channel."""
        units = {"moment": self.moment_unit, "angle": self.angle_unit, "rate": f"{self.angle_unit}/s"}
        return units.get(channel, "s")


ROTATION = Words("moment", "angle", "rate", "N*m", "rad")
TRANSLATION = Words("force", "displacement", "velocity", "N", "m")


def words_of(motion: Motion) -> Words:
    """Return the words of a kind of motion."""
    return ROTATION if motion == "rotation" else TRANSLATION
