"""An effect with its numbers: the law that it adds to a model, and what it puts right in the channels."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from sindyjoint.diagnosis.effects.catalogue import Effect, Variant
from sindyjoint.equation.model import JointModel
from sindyjoint.response.element_law import Instant, Part, sum_law
from sindyjoint.response.model_law import model_law

if TYPE_CHECKING:
    from sindyjoint.mechanics.laws import Law

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class FittedEffect:
    """An effect with its best nonlinear parameters.

    Parameters
    ----------
    effect : Effect
    variant : Variant
    values : ndarray
        Nonlinear parameters, SI.
    coefficients : ndarray
        Of the variant's columns beside the model's terms, SI.
    gain : float
        Fall of χ².
    within : ndarray, shape (n, 2), optional
        Bounds of the nonlinear parameters; default: those of the variant.
    """

    effect: Effect
    variant: Variant
    values: Array
    coefficients: Array
    gain: float
    within: Array | None = None

    @property
    def name(self) -> str:
        """Id of the effect."""
        return self.effect.id

    @property
    def family(self) -> str:
        """Of the effect."""
        return self.effect.family

    @property
    def contains(self) -> tuple[str, ...]:
        """Ids of effects that are special cases of it."""
        return self.effect.contains

    @property
    def shifts(self) -> bool:
        """Whether it is a time delay between the channels, which is removed from the states."""
        return self.effect.enters == "time shift"

    @property
    def is_term(self) -> bool:
        """Whether it is a term of angle and rate alone, as a model's own terms are."""
        known = {"theta", "omega", *self.variant.names}
        return self.effect.enters == "moment" and not self.variant.states and self.variant.uses <= known

    @property
    def parameters(self) -> dict[str, float]:
        """Nonlinear parameters and coefficients by name."""
        inner = dict(zip(self.variant.names, map(float, self.values), strict=True))
        return {
            **{c.symbol: float(v) for c, v in zip(self.variant.columns, self.coefficients, strict=True)},
            **inner,
        }


@dataclass(frozen=True)
class Corrections:
    """Time shift of the moment (s), zero (rad) and drift (rad/s) of the angle, error of the inertia, by effects."""

    shift: float
    zero: float
    drift: float
    inertia: float

    @classmethod
    def of(cls, effects: Sequence[FittedEffect]) -> Corrections:
        """Return what some effects put right."""
        shift, zero, drift = (
            sum(float(e.coefficients[0]) for e in effects if e.effect.enters == way)
            for way in ("time shift", "angle zero", "angle drift")
        )
        inertia = sum(float(e.coefficients[0]) for e in effects if e.effect.id == "inertia_error")
        return cls(shift, zero, drift, inertia)


def law_of(
    model: JointModel, effects: Sequence[FittedEffect], frequency: float, instant: Instant | None = None
) -> Law:
    """Return the law of a model with effects, for runs of one frequency at one instant."""
    from sindyjoint.mechanics.laws import SumLaw

    inertia = Corrections.of(effects).inertia
    if inertia and model.joint.inertia is not None:
        model = replace(model, joint=replace(model.joint, inertia=max(model.joint.inertia + inertia, 0.0)))
    added = effect_law(effects, frequency, instant)
    law = model_law(model)
    return law if added is None else SumLaw(law, added)


def effect_law(effects: Sequence[FittedEffect], frequency: float, instant: Instant | None = None) -> Any:
    """Return the moment that effects add as a law of :mod:`sindyjoint.mechanics`, or None where none adds one.

    Effects of channels and of the inertia are no part of the law.
    """
    adding = [e for e in effects if e.effect.enters == "moment" and e.effect.id != "inertia_error"]
    return sum_law([Part(e.variant, e.values, e.coefficients) for e in adding], frequency, instant)
