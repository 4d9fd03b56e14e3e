"""From raw gauges to moment and angle, and back: Eqs. 1–3 of the paper as pure functions.

Four strain gauges sit at the lower end of the additional beam (1 and 2 on one side, 3 and 4 on the other),
three laser spots at the joint (1 and 2 above it, 3 below). A virtual sensor runs the equations backwards.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from sindyjoint.errors import InputError

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
