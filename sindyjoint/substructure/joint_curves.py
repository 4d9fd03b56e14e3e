"""Stiffness and loss of a joint over amplitude: its loop under a harmonic motion, in the steady state."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import Any, ClassVar, Self

import numpy as np
import scipy
from numpy.typing import ArrayLike

from sindyjoint.described import Shown, same
from sindyjoint.equation.model import JointModel
from sindyjoint.limits import EQUATION
from sindyjoint.numeric import COARSE_DIFFERENCE, Array, Booleans
from sindyjoint.response.laws import model_law
from sindyjoint.substructure.spectra import steady_states

# Samples per period; reversals fall on samples, where friction is taken in the middle of its interval.
SAMPLES = 720
# What a loop is measured by, in the order of :func:`loop_measures`.
MEASURES = ("secant", "storage", "loss_factor", "energy")


def loop_measures(law: Any, amplitude: ArrayLike, frequency: float) -> Array:
    """Return what the loop of a law under θ = A·sin 2πft says, shape (4, n).

    Secant stiffness [M(A) − M(−A)]/(2A) between the reversals, friction there in the middle of its interval; storage
    stiffness K′ = ∮M·sin/(πA), the part of the first harmonic in phase with the angle; energy per cycle E = ∮M dθ; loss
    factor η = E/(πK′A²) (Ferry, Viscoelastic Properties of Polymers, 1980, chapter 1). The paper's law has k1 + k3·A²,
    k1 + ¾·k3·A², and E = π·c1·2πf·A² + 4·M_F·A. The moving inertia is no part of it.

    Parameters
    ----------
    law : Law
    amplitude : array_like, shape (n,)
        A, rad (m).
    frequency : float
        f, Hz.

    Examples
    --------
    >>> from sindyjoint.mechanics import PaperLaw
    >>> secant, storage, loss, energy = loop_measures(PaperLaw(k1=6000.0, M_F=2.0), [5e-4], 4.0)
    >>> round(float(secant[0]), 3), round(float(energy[0]), 6)
    (6000.0, 0.004)
    """
    sizes = np.atleast_1d(np.asarray(amplitude, dtype=np.float64))
    phase = 2 * np.pi * np.arange(SAMPLES) / SAMPLES
    sine, cosine = np.sin(phase), np.cos(phase)
    quarter = SAMPLES // 4
    cosine[[quarter, 3 * quarter]] = 0.0
    found = np.empty((len(MEASURES), sizes.size))
    for place, size in enumerate(sizes):
        angle, rate = size * sine, 2 * np.pi * frequency * size * cosine
        states = steady_states(law, angle, rate, 1.0 / frequency)
        middle, friction = law.friction_interval(angle, rate, states)
        moment = middle + np.sign(cosine) * friction
        storage = 2 * np.mean(moment * sine) / size
        energy = 2 * np.pi * size * np.mean(moment * cosine)
        secant = (moment[quarter] - moment[3 * quarter]) / (2 * size)
        found[:, place] = secant, storage, energy / (np.pi * storage * size**2), energy
    return found


@dataclass(frozen=True, eq=False)
class JointCurve:
    """What a joint does at one frequency.

    Parameters
    ----------
    frequency : float
        Hz.
    amplitude : ndarray, shape (n,)
        rad (m).
    secant, storage : ndarray, shape (n,)
        Secant and storage stiffness, N·m/rad (N/m).
    loss_factor : ndarray, shape (n,)
    energy : ndarray, shape (n,)
        Dissipated per cycle, J.
    secant_error, storage_error, loss_factor_error, energy_error : ndarray, shape (n,)
        Standard errors, from the covariance of the model's numbers.
    tested : ndarray of bool, shape (n,)
        Whether angle, rate and frequency lie within what the model was fitted to.
    """

    WRITTEN: ClassVar = {
        **same("frequency", "amplitude"),
        **{name: {"value": name, "low": f"low.{name}", "high": f"high.{name}"} for name in MEASURES},
        "tested": "tested",
    }
    frequency: float
    amplitude: Array
    secant: Array
    storage: Array
    loss_factor: Array
    energy: Array
    secant_error: Array
    storage_error: Array
    loss_factor_error: Array
    energy_error: Array
    tested: Booleans

    @property
    def low(self) -> "JointCurve":
        """The lower ends of the 95 % intervals of the measures."""
        return self._ends(0)

    @property
    def high(self) -> "JointCurve":
        """The upper ends of the 95 % intervals of the measures."""
        return self._ends(1)

    def _ends(self, side: int) -> "JointCurve":
        ends: dict[str, Any] = {name: self.interval95(name)[side] for name in MEASURES}
        return replace(self, **ends)

    def interval95(self, measure: str) -> tuple[Array, Array]:
        """Return the ends of the 95 % interval of one of the measures, each of shape (n,)."""
        value, error = getattr(self, measure), getattr(self, f"{measure}_error")
        return value - 1.96 * error, value + 1.96 * error


@dataclass(frozen=True, eq=False, repr=False)
class JointCurves(Shown):
    """The result of :func:`sindyjoint.curves` for a model.

    Parameters
    ----------
    name : str
        Of the joint.
    motion : {"rotation", "translation"}
    equation : str
    tested_angle, tested_rate : float
        Largest of the runs that the model was fitted to, rad and rad/s (m, m/s); zero where not known.
    curves : tuple of JointCurve
        One per frequency.
    simulated : bool
        Whether the model comes from a virtual test.
    warnings : tuple of str
    """

    SCHEMA: ClassVar = 1
    WRITTEN: ClassVar = {
        "joint": same("name", "motion"),
        "equation": "equation",
        "tested": {"angle": "tested_angle", "rate": "tested_rate"},
        **same("curves", "warnings"),
    }
    name: str
    motion: str
    equation: str
    tested_angle: float
    tested_rate: float
    curves: tuple[JointCurve, ...]
    simulated: bool = False
    warnings: tuple[str, ...] = ()


def model_curve(model: JointModel, amplitude: ArrayLike, frequency: float) -> JointCurve:
    """Return stiffness, loss and energy of a model over amplitude, with standard errors to first order.

    Parameters
    ----------
    model : JointModel
    amplitude : array_like, shape (n,)
        rad (m).
    frequency : float
        Hz.
    """
    sizes = np.asarray(amplitude, dtype=np.float64)
    values = loop_measures(model_law(model), sizes, frequency)
    varied = Varied.of([None], [model])
    errors = np.zeros_like(values)
    if varied is not None:
        errors = varied.errors(varied.slopes(lambda laws: loop_measures(laws[0], sizes, frequency)))
    fitted, more = model.fitted, 1 + EQUATION.tolerated
    tested = (sizes <= more * fitted.angle) & (2 * np.pi * frequency * sizes <= more * fitted.rate)
    if fitted.frequencies:
        tested &= min(fitted.frequencies) / more <= frequency <= more * max(fitted.frequencies)
    measures = dict(zip(MEASURES, values, strict=True))
    widths = {f"{name}_error": row for name, row in zip(MEASURES, errors, strict=True)}
    return JointCurve(float(frequency), sizes, **measures, **widths, tested=tested)


@dataclass(frozen=True, eq=False)
class Varied:
    """The laws of all joints with one number of a model smaller and larger, for each number.

    Parameters
    ----------
    laws : sequence of (laws, laws, float)
        Each with a law per joint, and the step between the middle and either of them.
    covariance : ndarray, shape (k, k)
        Of the numbers.
    """

    laws: Sequence[tuple[tuple[Any, ...], tuple[Any, ...], float]]
    covariance: Array

    @classmethod
    def of(cls, laws: Sequence[Any], models: Sequence[JointModel | None]) -> Self | None:
        """Return the variations of joints by their models, one model for joints that share it; None without any.

        Parameters
        ----------
        laws : sequence of Law
            Of each joint.
        models : sequence of JointModel or None
            Of each joint; None where its law is taken as known.
        """
        found: list[Any] = []
        blocks: list[Array] = []
        for model in {id(m): m for m in models if m is not None}.values():
            places = np.flatnonzero(model.number_errors > 0)
            blocks.append(model.covariance_matrix[np.ix_(places, places)])
            for place in places:
                step, ends = float(COARSE_DIFFERENCE * model.number_errors[place]), []
                for way in (-step, step):
                    numbers = model.numbers
                    numbers[place] += way
                    law = model_law(model.with_numbers(numbers))
                    ends.append(
                        tuple(law if m is model else own for m, own in zip(models, laws, strict=True))
                    )
                found.append((*ends, step))
        if not found:
            return None
        return cls(found, scipy.linalg.block_diag(*blocks))

    def slopes(self, of: Callable[[tuple[Any, ...]], Array]) -> Array:
        """Return derivatives by the numbers of what the laws of all joints come to, shape (...) → (..., k)."""
        return np.stack([(of(high) - of(low)) / (2 * step) for low, high, step in self.laws], axis=-1)

    def errors(self, slopes: Array) -> Array:
        """Return standard errors of quantities by their derivatives, shape (..., k) → (...)."""
        variance = np.einsum("...i,ij,...j->...", slopes, self.covariance, slopes)
        return np.asarray(np.sqrt(np.maximum(variance, 0.0)))
