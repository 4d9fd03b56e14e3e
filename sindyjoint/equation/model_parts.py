"""What a discovered model is made of: its terms, and on what data it was fitted."""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    import sympy

INERTIA = "inertia"


@dataclass(frozen=True)
class ModelTerm:
    """A term of a discovered model.

    Parameters
    ----------
    id, symbol : str
    name, family : str
    formula : str
        In the catalogues' syntax; nonlinear parameters by name.
    parameters : tuple of (str, float)
        Values of the nonlinear parameters, SI.
    unit : str
        SI unit of the coefficient for this joint's kind of motion.
    coefficient, standard_error : float
    interval95 : tuple of float
    unique_share : float
        Moment that no other term can take over, relative to the RMS moment.
    inputs : tuple of str
        Names of the inputs that the formula uses.
    """

    id: str
    symbol: str
    name: str
    family: str
    formula: str
    parameters: tuple[tuple[str, float], ...]
    unit: str
    coefficient: float
    standard_error: float
    interval95: tuple[float, float]
    unique_share: float
    inputs: tuple[str, ...] = ()

    @cached_property
    def expression(self) -> sympy.Expr:
        """The formula with numbers for its nonlinear parameters."""
        from sympy import Float

        from sindyjoint.equation.formula import parameter_symbol, parse_formula

        parsed = parse_formula(self.formula, [name for name, _ in self.parameters], self.inputs)
        return parsed.xreplace({parameter_symbol(name): Float(value, 17) for name, value in self.parameters})


@dataclass(frozen=True)
class Fitted:
    """On what data a model was fitted and how well.

    Parameters
    ----------
    moment_rms, residual_rms, noise_floor : float
        Of the transfer moment over moving samples, N·m. The noise floor is the part of the residual that the data
        themselves cannot repeat; NaN where it could not be measured.
    moving_fraction : float
    samples : int
        Moving samples.
    runs : int
    angle, rate : float
        Largest absolute angle (rad) and rate (rad/s) tested.
    frequencies : tuple of float
        Hz.
    simulated : bool
    data : str
        Hash of the campaign's content, see :func:`~sindyjoint.states.campaigns.content_hash`; empty where not known.
    versions : tuple of (str, str)
        Names and versions of what fitted it.
    gains : tuple of (str, float)
        Declared relative uncertainty of the gain of each channel, which is in the intervals.
    mean_known : bool
        Whether the mean angle was measured; otherwise zero is where the elastic moment is zero.
    quasi_static : bool
        Whether the samples had no time: the rate is then that of the path, one.
    """

    moment_rms: float
    residual_rms: float
    noise_floor: float
    moving_fraction: float
    samples: int
    runs: int
    angle: float
    rate: float
    frequencies: tuple[float, ...] = ()
    simulated: bool = False
    data: str = ""
    versions: tuple[tuple[str, str], ...] = ()
    gains: tuple[tuple[str, float], ...] = ()
    mean_known: bool = True
    quasi_static: bool = False

    @property
    def misfit(self) -> float:
        """Share of the moment's RMS that neither model nor noise explains; all that is left where no noise is known."""
        floor = self.noise_floor if math.isfinite(self.noise_floor) else 0.0
        beyond = max(self.residual_rms**2 - floor**2, 0.0)
        return float(np.sqrt(beyond)) / self.moment_rms if self.moment_rms > 0 else 0.0
