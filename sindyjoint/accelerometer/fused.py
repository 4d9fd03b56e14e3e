"""By what sensors the angle of a run was measured, and what these leave open."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import ArrayLike

from sindyjoint.numeric import Array


@dataclass(frozen=True, eq=False)
class Fusion:
    """By what sensors the angle of a run was measured, and what it leaves open.

    Parameters
    ----------
    acceleration : ndarray, shape (n,)
        As measured, rad/s² (m/s²).
    angle, rate : ndarray, shape (n,), or None
        As measured beside it, rad and rad/s.
    noise : float
        Of single samples of the acceleration, rad/s².
    angle_noise, rate_noise : float
        Of the others, rad and rad/s; infinite where they are not measured.
    drift : float
        Of the displacement sensor, a random walk, rad per square root of a sample.
    prior : float
        RMS of the angle, rad, where it follows from the acceleration alone; otherwise infinite.
    mean_known : bool
        Whether the mean angle is: an accelerometer does not see it, and a sensor that drifts makes it up.
    constant : float
        Taken off the moment with an unknown mean angle, N·m.
    placed : bool
        Whether an unknown mean angle was chosen so that the elastic moment is zero at zero angle.
    """

    acceleration: Array
    angle: Array | None
    rate: Array | None
    noise: float
    angle_noise: float = np.inf
    rate_noise: float = np.inf
    drift: float = 0.0
    prior: float = np.inf
    mean_known: bool = True
    constant: float = 0.0
    placed: bool = False

    def white_noise(self, frequency: ArrayLike, sample_rate: float) -> Array:
        """Return the RMS of white noise of the angle that is as dense at a frequency as the angle's noise, rad.

        Parameters
        ----------
        frequency : array_like
            Hz.
        sample_rate : float
            Hz.
        """
        angular = (
            2 * np.pi * np.maximum(np.asarray(frequency, dtype=np.float64), 1e-3 / self.acceleration.size)
        )
        displacement = self.angle_noise**2 + (self.drift * sample_rate / angular) ** 2
        told = 1 / displacement + (angular / self.rate_noise) ** 2 + (angular**2 / self.noise) ** 2
        return np.asarray(1 / np.sqrt(told + 1 / self.prior**2))

    def draw(self, size: int, sample_rate: float, generator: np.random.Generator) -> Array:
        """Return noise as the angle has it, rad, shape (size,)."""
        spectrum = np.fft.rfft(generator.standard_normal(size))
        shape = self.white_noise(np.fft.rfftfreq(size, 1 / sample_rate), sample_rate)
        return np.fft.irfft(spectrum * shape, size)

    def scaled(self, factor: float) -> Fusion:
        """Return the same with the noise of all sensors times a factor, as of a mean of samples."""
        names = ("noise", "angle_noise", "rate_noise", "drift")
        return replace(self, **{name: factor * getattr(self, name) for name in names})
