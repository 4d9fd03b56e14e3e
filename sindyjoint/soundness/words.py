"""What the channels of a joint are called and measured in, by its kind of motion."""

from __future__ import annotations

from dataclasses import dataclass

from sindyjoint.record import MEASURED_ANGLE, MEASURED_RATE, Motion


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
        known = {"moment": self.moment, "angle": self.angle, "rate": self.rate}
        sensors = {MEASURED_ANGLE: f"{self.angle} sensor", MEASURED_RATE: f"{self.rate} sensor"}
        return (known | sensors).get(channel, channel)

    def label(self, channel: str) -> str:
        """Return the name of a channel as a table has it."""
        return self.of(channel)

    def unit(self, channel: str) -> str:
        """Return the unit of a channel."""
        angle = self.angle_unit
        units = {
            "moment": self.moment_unit,
            "angle": angle,
            "rate": f"{angle}/s",
            "acceleration": f"{angle}/s^2",
        }
        units |= {MEASURED_ANGLE: angle, MEASURED_RATE: f"{angle}/s"}
        return units.get(channel, "s")


ROTATION = Words("moment", "angle", "rate", "N*m", "rad")
TRANSLATION = Words("force", "displacement", "velocity", "N", "m")


def words_of(motion: Motion) -> Words:
    """Return the words of a kind of motion."""
    return ROTATION if motion == "rotation" else TRANSLATION
