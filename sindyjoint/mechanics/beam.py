"""Euler–Bernoulli beams: element matrices and sections."""

from dataclasses import dataclass

import numpy as np

from sindyjoint.errors import refuse
from sindyjoint.numeric import Array


def element_stiffness(bending_stiffness: float, length: float) -> Array:
    """Stiffness of a beam element for (w₁, φ₁, w₂, φ₂), shape (4, 4).

    Cubic Hermite shape functions (Przemieniecki, Theory of Matrix Structural Analysis, 1968, section 5.6);
    exact for loads at the nodes.

    Parameters
    ----------
    bending_stiffness : float
        E·I, N·m².
    length : float
        m.
    """
    a = length
    shape = [[12, 6 * a, -12, 6 * a], [6 * a, 4 * a * a, -6 * a, 2 * a * a]]
    shape += [[-12, -6 * a, 12, -6 * a], [6 * a, 2 * a * a, -6 * a, 4 * a * a]]
    return bending_stiffness / a**3 * np.array(shape)


def element_mass(mass_per_length: float, length: float) -> Array:
    """Consistent mass of a beam element for (w₁, φ₁, w₂, φ₂), shape (4, 4).

    Parameters
    ----------
    mass_per_length : float
        kg/m.
    length : float
        m.
    """
    a = length
    shape = [[156, 22 * a, 54, -13 * a], [22 * a, 4 * a * a, 13 * a, -3 * a * a]]
    shape += [[54, 13 * a, 156, -22 * a], [-13 * a, -3 * a * a, -22 * a, 4 * a * a]]
    return mass_per_length * a / 420 * np.array(shape)


def hermite_shapes(fraction: float, length: float) -> Array:
    """Deflection at a fraction of a beam element by its freedoms (w₁, φ₁, w₂, φ₂), shape (4,): cubic Hermite shapes."""
    x = fraction
    return np.array([
        1 - 3 * x**2 + 2 * x**3, length * (x - 2 * x**2 + x**3), 3 * x**2 - 2 * x**3, length * (x**3 - x**2),
    ])  # fmt: skip


def rectangular_section(
    youngs_modulus: float, density: float, width: float, height: float
) -> tuple[float, float]:
    """Bending stiffness E·b·h³/12, N·m², and mass per length ρ·b·h, kg/m, of a rectangle bent over its height."""
    return youngs_modulus * width * height**3 / 12, density * width * height


@dataclass(frozen=True)
class Beam:
    """A uniform straight beam.

    Parameters
    ----------
    name : str
    length : float
        m.
    bending_stiffness : float
        E·I, N·m².
    mass_per_length : float
        kg/m.
    elements : int
    loss_factor : float
        Material loss factor η; twice the damping ratio of the structure's first mode as far as this beam is bent.

    Raises
    ------
    InputError
        For a length, stiffness or mass that is not positive, no elements, or a negative loss factor.
    """

    name: str
    length: float
    bending_stiffness: float
    mass_per_length: float
    elements: int = 8
    loss_factor: float = 0.0

    def __post_init__(self) -> None:
        values = [(name, getattr(self, name)) for name in ("length", "bending_stiffness", "mass_per_length")]
        faults = [
            *(
                (not 0 < v < np.inf, f"{name} is {v!r}; expected a finite number above zero")
                for name, v in values
            ),
            (self.elements < 1, f"elements is {self.elements!r}; expected at least one"),
            (not 0 <= self.loss_factor < 1, f"loss_factor is {self.loss_factor!r}; expected 0 up to 1"),
        ]
        refuse((there, f"beam {self.name!r}: {words}") for there, words in faults)
