"""What drives a joint in a test, and how far it can go; waveforms that repeat, as sums of tones."""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache
from math import inf
from typing import Literal

import numpy as np

from sindyjoint.errors import InputError, UnknownNameError
from sindyjoint.mechanics.excitation import Excitation, harmonic, repeated

Drive = Literal["moment", "angle"]

SINE = "sine"
#: Waveforms by the amplitudes of sin(n·2πft); all are scaled to their peak.
TONES: dict[str, dict[int, float]] = {
    SINE: {1: 1.0},
    "two-tone-3": {1: 1.0, 3: 0.8},
    "two-tone-5": {1: 1.0, 5: 0.5},
    "triangle": {n: (-1.0) ** (n // 2) / n**2 for n in (1, 3, 5, 7, 9)},
    # The signs with the lowest peak.
    "multisine": {1: 1.0, 2: 1.0, 3: 1.0, 4: -1.0, 5: 1.0},
    # A sine whose frequency goes from f to 5f and back in each period, sin(3x − 2 sin x) with x = 2πft, as its series
    # of amplitudes J₃₋ₙ(2) − J₃₊ₙ(2) (Abramowitz and Stegun 9.1.42), to 2e-3 of its peak.
    "sweep": {1: 0.31884, 2: 0.56969, 3: 0.22269, 4: -0.5769, 5: 0.35281, 6: -0.12895, 7: 0.034, 8: -0.00704},
}  # fmt: skip
POINTS = 2520  # of a period through which the spline of a sum of tones goes


@dataclass(frozen=True)
class Actuator:
    """What drives the joint, and how far it can go.

    Parameters
    ----------
    drive : {"moment", "angle"}
        What it prescribes.
    band : (float, float)
        Hz.
    moment, angle, rate : float
        Largest moment (N·m), angle (rad) and rate (rad/s) on either side of zero.
    duration : float
        Of a run, s, where more is known of it than that it lasts as long as those that were made.
    """

    drive: Drive = "moment"
    band: tuple[float, float] = (2.0, 8.0)
    moment: float = inf
    angle: float = inf
    rate: float = inf
    duration: float = 0.0

    def __post_init__(self) -> None:
        if self.drive not in ("moment", "angle"):
            raise InputError(f"drive is {self.drive!r}; expected 'moment' or 'angle'")
        low, high = self.band
        if not 0 < low <= high < inf:
            raise InputError(f"band is {low:g} to {high:g} Hz; expected two ascending positive frequencies")
        for name in ("moment", "angle", "rate"):
            if not getattr(self, name) > 0:
                raise InputError(
                    f"limit of the {name} is {getattr(self, name)!r}; expected a positive number"
                )


def driven_at(waveform: str) -> tuple[float, float]:
    """Return the lowest and the highest frequency at which a waveform drives, as multiples of its own."""
    return float(min(TONES[waveform])), float(max(TONES[waveform]))


def tones(waveform: str, level: float, frequency: float, phase: float = 0.0) -> Excitation:
    """Return a waveform of some peak, from ``phase`` (rad) of its cycle on.

    Raises
    ------
    UnknownNameError
        For a waveform that is not among :data:`TONES`.
    """
    if waveform == SINE:
        return harmonic(level, frequency, phase)
    if waveform not in TONES:
        raise UnknownNameError(f"waveform {waveform!r}; expected one of {', '.join(TONES)}")
    angle = phase + 2 * np.pi * np.arange(POINTS) / POINTS
    shape = sum(a * np.sin(n * angle) for n, a in TONES[waveform].items())
    return repeated(level / _peak(waveform) * np.asarray(shape), 1 / frequency)


@lru_cache
def _peak(waveform: str) -> float:
    phase = 2 * np.pi * np.arange(20 * POINTS) / (20 * POINTS)
    return float(np.max(np.abs(sum(a * np.sin(n * phase) for n, a in TONES[waveform].items()))))
