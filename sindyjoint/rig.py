"""The sensors of a test: raw gauges, what noise they have, and what several of one motion leave open.

From raw gauges to moment and angle, and back, are Eqs. 1–3 of the paper as pure functions.
Four strain gauges sit at the lower end of the additional beam (1 and 2 on one side, 3 and 4 on the other),
three laser spots at the joint (1 and 2 above it, 3 below). A virtual sensor runs the equations backwards.
"""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import ArrayLike, NDArray

from sindyjoint.errors import InputError
from sindyjoint.text import Quantities, list_some

Array = NDArray[np.float64]


def full_bridge_strain(e1: ArrayLike, e2: ArrayLike, e3: ArrayLike, e4: ArrayLike) -> Array:
    """Bending strain of a full bridge, ε = (ε1 + ε2 − ε3 − ε4) / 4 (Eq. 1).

    Parameters
    ----------
    e1, e2, e3, e4 : array_like, shape (n,)
        Strains, m/m; 3 and 4 are on the side of the beam opposite to 1 and 2.

    Returns
    -------
    ndarray, shape (n,)
        Strain, m/m.
    """
    first, second, third, fourth = (np.asarray(e, dtype=np.float64) for e in (e1, e2, e3, e4))
    return (first + second - third - fourth) / 4


def bending_moment(
    strain: ArrayLike, bending_stiffness: float, section_height: float, position_factor: float = 1.0
) -> Array:
    """Moment at the joint, M = β · 2 E I ε / h (Eq. 2).

    Parameters
    ----------
    strain : array_like, shape (n,)
        Bending strain at the surface of the section, m/m.
    bending_stiffness : float
        E I of the additional beam, N·m².
    section_height : float
        h, m.
    position_factor : float
        β, which corrects for the position of the gauges.

    Returns
    -------
    ndarray, shape (n,)
        Moment, N·m.
    """
    return position_factor * 2 * bending_stiffness * np.asarray(strain, dtype=np.float64) / section_height


def joint_angle(d1: ArrayLike, d2: ArrayLike, d3: ArrayLike, *, joint_length: float) -> Array:
    """Bending angle of the joint, θ ≈ ((d1 + d2) / 2 − d3) / L (Eq. 3).

    Parameters
    ----------
    d1, d2, d3 : array_like, shape (n,)
        Displacements, m; 1 and 2 above the joint, 3 below it.
    joint_length : float
        L, m.

    Returns
    -------
    ndarray, shape (n,)
        Angle, rad.
    """
    first, second, third = (np.asarray(d, dtype=np.float64) for d in (d1, d2, d3))
    return ((first + second) / 2 - third) / joint_length


@dataclass(frozen=True)
class SensorRig:
    """The constants of Eqs. 1–3, checked on creation.

    Parameters
    ----------
    bending_stiffness : float
        E I of the additional beam, N·m².
    section_height : float
        h, m.
    joint_length : float
        L, m.
    strain_position_factor : float
        β, no unit.

    Raises
    ------
    InputError
        For a constant that is not a finite number above zero; the message names it.
    """

    bending_stiffness: float
    section_height: float
    joint_length: float
    strain_position_factor: float = 1.0

    def __post_init__(self) -> None:
        for name in ("bending_stiffness", "section_height", "joint_length", "strain_position_factor"):
            check_positive(name, getattr(self, name))

    def moment(self, strains: ArrayLike) -> Array:
        """Moment, N·m, shape (n,), from four strains, m/m, shape (4, n)."""
        strain = full_bridge_strain(*np.asarray(strains, dtype=np.float64))
        return bending_moment(
            strain, self.bending_stiffness, self.section_height, self.strain_position_factor
        )

    def angle(self, displacements: ArrayLike) -> Array:
        """Angle, rad, shape (n,), from three displacements, m, shape (3, n)."""
        return joint_angle(*np.asarray(displacements, dtype=np.float64), joint_length=self.joint_length)

    def strains(self, moment: ArrayLike) -> Array:
        """Strains of four ideal gauges, m/m, shape (4, n), under a moment, N·m, shape (n,).

        ε, ε, −ε, −ε with ε = M h / (2 β E I): Eqs. 1 and 2 backwards.
        """
        stiffness = 2 * self.strain_position_factor * self.bending_stiffness
        strain = np.asarray(moment, dtype=np.float64) * self.section_height / stiffness
        return np.stack([strain, strain, -strain, -strain])

    def displacements(self, angle: ArrayLike, base: ArrayLike = 0.0) -> Array:
        """Displacements of three ideal laser spots, m, shape (3, n), at an angle, rad, shape (n,).

        d3 + θ L, d3 + θ L, d3: Eq. 3 backwards, where the displacement d3 below the joint, m, drops out.
        """
        theta = np.asarray(angle, dtype=np.float64)
        below = np.broadcast_to(np.asarray(base, dtype=np.float64), theta.shape)
        above = below + theta * self.joint_length
        return np.stack([above, above, below])


def check_positive(name: str, value: float) -> float:
    """Return a constant of the rig, or refuse it by name.

    Raises
    ------
    InputError
        Unless the value is a finite number above zero.
    """
    if not (np.isfinite(value) and value > 0):
        raise InputError(f"{name} is {value!r}; expected a finite number above zero")
    return value


@dataclass(frozen=True)
class SensorNoise:
    """RMS noise of single samples as a data sheet or a calibration gives it; None where nothing is declared.

    Parameters
    ----------
    moment, angle, rate, acceleration : float, optional
        N·m, rad, rad/s, rad/s² (N, m, m/s, m/s²).
    """

    moment: float | None = None
    angle: float | None = None
    rate: float | None = None
    acceleration: float | None = None

    def __post_init__(self) -> None:
        for name in ("moment", "angle", "rate", "acceleration"):
            value = getattr(self, name)
            if value is not None and not (np.isfinite(value) and value > 0):
                raise InputError(f"noise of the {name} is {value!r}; expected a finite number above zero")

    def scaled(self, factor: float) -> "SensorNoise":
        """Return the noise of all channels times a factor, as that of a mean of samples is."""
        values = (self.moment, self.angle, self.rate, self.acceleration)
        return SensorNoise(*(None if value is None else factor * value for value in values))


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

    def scaled(self, factor: float) -> "Fusion":
        """Return the same with the noise of all sensors times a factor, as of a mean of samples."""
        names = ("noise", "angle_noise", "rate_noise", "drift")
        return replace(self, **{name: factor * getattr(self, name) for name in names})


def unknown_means(fusions: Mapping[str, Fusion | None], q: Quantities) -> Iterator[str]:
    """Yield what the sensors of the motion of some runs leave open at zero frequency, in words."""
    angle, moment = q.angle.lower(), q.moment.lower()
    for drifts, cause in ((False, "an accelerometer does not see it"), (True, f"the {angle} sensor drifts")):
        runs = {
            name: fusion
            for name, fusion in fusions.items()
            if fusion is not None and not fusion.mean_known and (fusion.angle is not None) == drifts
        }
        for placed in (True, False):
            names = [name for name, fusion in runs.items() if fusion.placed == placed]
            if not names:
                continue
            largest = max(abs(runs[name].constant) for name in names)
            yield f"the mean {angle} is not known in {list_some(names)} ({cause}): " + (
                f"zero {angle} was put where the elastic {moment} is zero, so that a preload and a zero error of the "
                f"{moment} are undetermined; with a preload the stiffness coefficients hold about that position (at θ0 "
                "from the unloaded one k1 + 2·k2·θ0 + 3·k3·θ0² and k2 + 3·k3·θ0)"
                if placed
                else f"a preload is undetermined, the constant part (up to {largest:.3g} {q.moment_unit}) was taken "
                f"off the {moment}, and coefficients hold about the mean position of each run"
            )
