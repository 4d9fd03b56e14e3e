"""The paper's numbers, typed from its text: Tables 1 and 2, the fits of section 4.2 and the pulse test of section 5.

Nonlinear Dynamic Modeling of Joints between Solar Panels on Spacecraft. SI units throughout.
"""

from dataclasses import dataclass

TITLE = "Nonlinear Dynamic Modeling of Joints between Solar Panels on Spacecraft"
DOI = "10.3390/aerospace9080459"
# By which its joints are known: those of the built-in virtual tests.
JOINTS = ("inter-panel joint", "panel root joint", "panel-root joint")
TERMS = (
    "linear_stiffness",
    "quadratic_stiffness",
    "cubic_stiffness",
    "linear_damping",
    "coulomb_friction",
)
SYMBOLS = ("k1", "k2", "k3", "c1", "M_F")
PARAMETERS = dict(zip(TERMS, SYMBOLS, strict=True))  # as a PaperLaw has them
UNITS = ("N*m/rad", "N*m/rad^2", "N*m/rad^3", "N*m*s/rad", "N*m")
FREQUENCIES = (3.0, 4.0, 5.0, 6.0)  # Hz


@dataclass(frozen=True)
class PaperTable:
    """One of the paper's tables of identified parameters.

    Parameters
    ----------
    number : int
        Of the table.
    joint : str
    rows : tuple of tuple of float
        k1, k2, k3, c1, M_F at each of :data:`FREQUENCIES`.
    average, deviation : tuple of float
        As printed in the last two rows. The deviation is the population one (divided by four, not three).
    surface_rms : float
        RMS error of the surface fit at 3 Hz, N·m.
    """

    number: int
    joint: str
    rows: tuple[tuple[float, ...], ...]
    average: tuple[float, ...]
    deviation: tuple[float, ...]
    surface_rms: float

    def row(self, frequency: float) -> tuple[float, ...]:
        """Return k1, k2, k3, c1, M_F at a frequency of the table, Hz."""
        return self.rows[FREQUENCIES.index(frequency)]

    def column(self, term: str) -> tuple[float, ...]:
        """Return one parameter at the four frequencies, by the id of its term."""
        return tuple(row[TERMS.index(term)] for row in self.rows)


INTER_PANEL = PaperTable(
    1,
    "inter-panel joint",
    (
        (6.153e3, -2.209e5, -2.761e9, 46.68, 1.892),
        (6.134e3, -1.625e5, -2.733e9, 49.00, 1.821),
        (5.912e3, -1.901e5, -2.739e9, 48.51, 1.840),
        (6.063e3, -1.972e5, -2.501e9, 48.32, 1.916),
    ),
    (6.066e3, -1.927e5, -2.684e9, 48.13, 1.867),
    (94.76, 2.082e4, 1.059e8, 0.8651, 0.03831),
    0.494,
)
PANEL_ROOT = PaperTable(
    2,
    "panel root joint",
    (
        (1.060e4, -6.601e5, -7.741e9, 54.68, 2.110),
        (1.231e4, -5.988e5, -7.366e9, 54.01, 2.145),
        (1.279e4, -6.304e5, -7.310e9, 54.32, 2.128),
        (1.115e4, -6.200e5, -7.282e9, 53.29, 2.379),
    ),
    (1.171e4, -6.273e5, -7.425e9, 54.07, 2.191),
    (876.4, 2.208e4, 1.851e8, 0.5115, 0.1095),
    0.787,
)
TABLES = (INTER_PANEL, PANEL_ROOT)


@dataclass(frozen=True)
class PulseFigures:
    """What section 5 says of the pulse test and its simulation."""

    force: float = 65.0  # N
    duration: float = 0.005  # s
    compared: float = 20.0  # s
    amplitude_rms_error: float = 0.035  # its unit is not printed
    mean_period_difference: float = 0.018  # s


PULSE = PulseFigures()
