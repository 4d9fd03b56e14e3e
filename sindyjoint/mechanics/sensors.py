"""Measuring channels: gain, zero error, time delay, noise and quantisation of ideal signals."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from sindyjoint.errors import refuse
from sindyjoint.numeric import Array
from sindyjoint.rig import SensorRig

# The additional beam is a 20 mm high aluminium section and the joint 60 mm long, of the size of a solar panel hinge;
# the paper prints neither, and Eqs. 1–3 read backwards and forwards give the same moment and angle for any of them.
SENSOR_RIG = SensorRig(
    bending_stiffness=2333.0, section_height=0.020, joint_length=0.060, strain_position_factor=1.02
)


@dataclass(frozen=True)
class Channel:
    """A measuring channel.

    Parameters
    ----------
    noise : float
        Standard deviation of white noise as a fraction of the channel's RMS.
    bits : int, optional
        Resolution of the converter, whose range is ±1.25 times the largest value.
    gain : float
        Factor by which the channel reads too high.
    offset : float
        Zero error, in the channel's unit.

    Raises
    ------
    InputError
        For negative noise, a gain of zero, or a resolution outside 4 to 32 bits.
    """

    noise: float = 0.0
    bits: int | None = None
    gain: float = 1.0
    offset: float = 0.0

    def __post_init__(self) -> None:
        refuse(
            [
                (
                    not 0 <= self.noise < np.inf,
                    f"noise is {self.noise!r}; expected a fraction of the RMS that is not negative",
                ),
                (
                    self.bits is not None and not 4 <= self.bits <= 32,
                    f"quantisation is {self.bits!r} bits; expected 4 to 32",
                ),
                (
                    not (np.isfinite(self.gain) and self.gain != 0 and np.isfinite(self.offset)),
                    f"gain {self.gain!r} and offset {self.offset!r}; expected finite numbers, gain not zero",
                ),
            ]
        )

    def read(self, signal: ArrayLike, generator: np.random.Generator) -> Array:
        """Return what the channel shows of an ideal signal, shape (n,)."""
        ideal = np.asarray(signal, dtype=np.float64)
        level = self.noise * np.sqrt(np.mean(ideal**2))
        shown = self.gain * ideal + self.offset + level * generator.standard_normal(ideal.shape)
        return quantised(shown, self.bits) if self.bits else shown


def quantised(signal: ArrayLike, bits: int) -> Array:
    """Round a signal to the steps of a converter with `bits` bits over ±1.25 times its largest value."""
    values = np.asarray(signal, dtype=np.float64)
    largest = float(np.abs(values).max())
    step = 2.5 * largest / 2**bits
    return np.round(values / step) * step if largest > 0 else values


def raw_channels(
    moment: ArrayLike, angle: ArrayLike, channel: Channel, generator: np.random.Generator
) -> dict[str, Array]:
    """Read strain gauges and laser spots under a moment at an angle: Eqs. 1–3 backwards, each channel with errors.

    Parameters
    ----------
    moment, angle : array_like, shape (n,)
        N·m and rad.
    channel : Channel
        Errors of every gauge and spot, independent of each other.
    generator : numpy.random.Generator

    Returns
    -------
    dict of str to ndarray, shape (n,)
        ``e1`` to ``e4``, m/m, and ``d1`` to ``d3``, m.
    """
    theta = np.asarray(angle, dtype=np.float64)
    strains = SENSOR_RIG.strains(np.asarray(moment, dtype=np.float64))
    # Part of the joint's motion that the test bed makes below the joint; it drops out of Eq. 3.
    spots = SENSOR_RIG.displacements(theta, 0.1 * SENSOR_RIG.joint_length * theta)
    names = [*(f"e{i}" for i in range(1, 5)), *(f"d{i}" for i in range(1, 4))]
    return {name: channel.read(x, generator) for name, x in zip(names, [*strains, *spots], strict=True)}
