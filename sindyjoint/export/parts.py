"""A model taken apart by what its terms depend on, as tables and lumped elements need it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from itertools import product
from typing import TYPE_CHECKING

import numpy as np
import scipy
from numpy.typing import ArrayLike

from sindyjoint.equation.formula import compile_terms, variable_symbols
from sindyjoint.numeric import Array

if TYPE_CHECKING:
    import sympy

    from sindyjoint.equation.model import JointModel, ModelTerm

# Full friction is reached at this share of the tested rate where a target has no set-valued friction.
RAMP = 1e-3
# Of a table of the elastic moment.
POINTS = 41
# A number of a node or an element that a model rarely uses; those that follow are taken, too.
RARE = 900001
# A spring that stands for sticking gives way by this share of the tested angle at full friction.
GIVE = 1e-4


@dataclass(frozen=True)
class Curve:
    """A moment over angle or rate as a table: straight lines between the points, and beyond them.

    Parameters
    ----------
    x, y : ndarray, shape (n,)
        rad or rad/s, rising; N·m.
    """

    x: Array
    y: Array

    @property
    def points(self) -> list[tuple[float, float]]:
        """Places and moments."""
        return list(zip(self.x.tolist(), self.y.tolist(), strict=True))

    @property
    def flat(self) -> list[float]:
        """Places and moments in turn."""
        return [value for point in self.points for value in point]

    def __call__(self, x: ArrayLike) -> Array:
        """Return the tabulated moment."""
        piece = np.clip(np.searchsorted(self.x, x) - 1, 0, self.x.size - 2)
        slope = np.diff(self.y) / np.diff(self.x)
        return self.y[piece] + slope[piece] * (np.asarray(x, dtype=np.float64) - self.x[piece])


@dataclass(frozen=True)
class Parts:
    """The terms of a model by what they depend on.

    Parameters
    ----------
    model : JointModel
    elastic : tuple of ModelTerm
        Functions of the angle, constants among them.
    rate : tuple of ModelTerm
        Functions of the rate only.
    coupled : tuple of ModelTerm
        Functions of both.
    inertial : tuple of ModelTerm
        With the acceleration.
    """

    model: JointModel
    elastic: tuple[ModelTerm, ...]
    rate: tuple[ModelTerm, ...]
    coupled: tuple[ModelTerm, ...]
    inertial: tuple[ModelTerm, ...]

    @classmethod
    def of(cls, model: JointModel) -> Parts:
        """Sort the terms of a model."""
        theta, omega, alpha = variable_symbols()

        def kind_of(term: ModelTerm) -> str:
            symbols = term.expression.free_symbols
            moving = "coupled" if theta in symbols else "rate"
            return "inertial" if alpha in symbols else moving if omega in symbols else "elastic"

        kinds = ("elastic", "rate", "coupled", "inertial")
        return cls(model, *(tuple(t for t in model.terms if kind_of(t) == kind) for kind in kinds))

    @cached_property
    def viscous(self) -> tuple[ModelTerm, ...]:
        """Terms in proportion to the rate."""
        return tuple(term for term in self.rate if term.expression == variable_symbols()[1])

    @cached_property
    def coulomb(self) -> tuple[ModelTerm, ...]:
        """Terms in proportion to the sign of the rate."""
        import sympy

        return tuple(term for term in self.rate if term.expression == sympy.sign(variable_symbols()[1]))

    @property
    def other_rate(self) -> tuple[ModelTerm, ...]:
        """Terms of the rate that are neither viscous nor Coulomb friction."""
        return tuple(term for term in self.rate if term not in self.viscous and term not in self.coulomb)

    @property
    def damping(self) -> float:
        """Sum of the viscous coefficients, N·m·s/rad."""
        return float(sum(term.coefficient for term in self.viscous))

    @property
    def friction(self) -> float:
        """Sum of the Coulomb coefficients, N·m."""
        return float(sum(term.coefficient for term in self.coulomb))

    @property
    def stuck_stiffness(self) -> float:
        """Of the spring that stands for sticking Coulomb friction, N·m/rad; zero without friction."""
        return max(self.friction, 0.0) / (GIVE * self.model.fitted.angle)

    def elastic_nodes(self, count: int) -> Array:
        """Angles of a table over the tested range: an odd ``count``, zero in the middle."""
        half = np.linspace(0, 1, count // 2 + 1)[1:]
        return self.model.fitted.angle * np.concatenate([-half[::-1], [0.0], half])


def corners(model: JointModel) -> tuple[JointModel, ...]:
    """Return a law held at its inputs' reference and at the ends of their tested ranges, in every combination."""
    values = [
        [(each.name, value) for value in sorted({each.reference, *(each.tested or ())})]
        for each in model.used_inputs
    ]
    return tuple(model.at(**dict(chosen)) for chosen in product(*values)) if values else (model,)


def contribution(term: ModelTerm, angle: ArrayLike, rate: ArrayLike) -> Array:
    """Coefficient times formula at states, shape (n,); sign(0) is 0."""
    theta, omega = np.broadcast_arrays(np.asarray(angle, float), np.asarray(rate, float))
    column = compile_terms([term.expression])(theta.ravel(), omega.ravel(), np.nan)[:, 0]
    return term.coefficient * column.reshape(theta.shape)


def total(terms: Sequence[ModelTerm], angle: ArrayLike, rate: ArrayLike) -> Array:
    """Sum of terms at states, shape (n,)."""
    shape = np.broadcast_shapes(np.shape(angle), np.shape(rate))
    return sum((contribution(term, angle, rate) for term in terms), np.zeros(shape))


def softening_limits(model: JointModel) -> tuple[float, float]:
    """Angles between which the moment at standstill rises with the angle.

    Infinite where it rises up to three times as far as tested. The moment at standstill is the elastic part and
    that of coupled terms without friction.
    """
    parts, angle = Parts.of(model), model.fitted.angle
    terms = (*parts.elastic, *parts.coupled)

    def tangents(theta: Array) -> Array:
        step = 1e-6 * angle
        return total(terms, theta + step, 0.0) - total(terms, theta - step, 0.0)

    def limit(side: float) -> float:
        grid = side * np.linspace(0, 3 * angle, 301)
        values = tangents(grid)
        for a, b, u, v in zip(grid, grid[1:], values, values[1:], strict=False):
            if u > 0 >= v:
                return (
                    float(scipy.optimize.brentq(lambda x: tangents(np.array([x]))[0], a, b))
                    if v < 0
                    else float(b)
                )
        return side * np.inf

    return limit(-1.0), limit(1.0)


def steepness(model: JointModel) -> tuple[float, float]:
    """Return the largest |∂M/∂θ|, N·m/rad, and |∂M/∂θ̇| away from zero rate, N·m·s/rad, over the tested range.

    They bound the step of an explicit integration of the joint's terms.
    """
    parts = Parts.of(model)
    terms = (*parts.elastic, *parts.rate, *parts.coupled)

    angle = model.fitted.angle * np.linspace(-1.2, 1.2, 49)
    size = model.fitted.rate * np.geomspace(1e-4, 1.2, 25)
    theta, omega = (grid.ravel() for grid in np.meshgrid(angle, np.concatenate([-size[::-1], size])))
    dt, dw = 1e-4 * model.fitted.angle, 1e-3 * omega
    stiffness = (total(terms, theta + dt, omega) - total(terms, theta - dt, omega)) / (2 * dt)
    damping = (total(terms, theta, omega + dw) - total(terms, theta, omega - dw)) / (2 * dw)
    return float(np.max(np.abs(stiffness))), float(np.max(np.abs(damping)))


def power_law(expression: sympy.Expr) -> tuple[float, float, str] | None:
    """Recognise |θ|^p · |θ̇|^q times θ̇ or sign θ̇.

    Returns
    -------
    (p, q, kind) or None
        ``kind`` is "rate" for a factor θ̇ and "sign" for sign θ̇; p, q ≥ 0.

    Examples
    --------
    >>> from sindyjoint.equation.formula import parse_formula
    >>> power_law(parse_formula("theta**2*omega"))
    (2.0, 0.0, 'rate')
    >>> power_law(parse_formula("omega*abs(omega)"))
    (0.0, 1.0, 'rate')
    >>> power_law(parse_formula("theta*omega")) is None
    True
    """
    import sympy

    theta, omega, _ = variable_symbols()
    names = {theta: "theta", sympy.Abs(theta): "theta", sympy.Abs(omega): "size", omega: "rate"}
    powers = {"theta": 0.0, "size": 0.0, "rate": 0.0, "sign": 0.0}
    for base, exponent in expression.as_powers_dict().items():
        name = "sign" if base == sympy.sign(omega) else names.get(base, "")
        whole = bool(exponent.is_Integer)
        fits = {
            "theta": base != theta or (whole and int(exponent) % 2 == 0),
            "size": True,
            "rate": whole,
            "sign": exponent == 1,
        }
        if not (exponent.is_number and exponent > 0 and fits.get(name)):
            return None
        powers[name] += float(exponent)
    p, size, odd, sign = powers["theta"], powers["size"] + powers["rate"], powers["rate"] % 2, powers["sign"]
    if odd == bool(sign):
        return None
    if size == 0:
        return p, 0.0, "sign"
    return (p, size - 1, "rate") if odd or size >= 1 else None
