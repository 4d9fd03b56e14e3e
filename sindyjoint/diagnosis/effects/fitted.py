"""An effect with its numbers: the law that it adds to a model, and what it puts right in the channels."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

from sindyjoint.diagnosis.effects.catalogue import Effect, Variant
from sindyjoint.equation.model import JointModel, ModelTerm
from sindyjoint.numeric import Array
from sindyjoint.response.element_law import Instant, Part, sum_law
from sindyjoint.response.law_in_run import LawInRun, law_in_run, with_added
from sindyjoint.states import ForceStates

if TYPE_CHECKING:
    from sindyjoint.mechanics.laws import Law


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
        known = {"theta", "omega", *self.variant.names, *self.variant.inputs}
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


def law_of(model: JointModel, effects: Sequence[FittedEffect], states: ForceStates) -> Law | LawInRun:
    """Return the law of a model with effects in one run."""
    inertia = Corrections.of(effects).inertia
    if inertia and model.joint.inertia is not None:
        model = replace(model, joint=replace(model.joint, inertia=max(model.joint.inertia + inertia, 0.0)))
    # What depends on inputs is a term: these are held at the run's values.
    own = [e for e in effects if e.variant.inputs]
    model = replace(model, terms=(*model.terms, *(t for e in own for t in input_terms(e))), covariance=())
    added = effect_law([e for e in effects if e not in own], states.frequency or 0.0, Instant.of(states))
    return with_added(law_in_run(model, states), added)


def input_terms(fitted: FittedEffect) -> list[ModelTerm]:
    """Return an effect of inputs as terms; errors are not known."""
    from sindyjoint.diagnosis.effects.parts import parts_of_law

    return parts_of_law(fitted.name, fitted.family, fitted.variant, fitted.coefficients, fitted.values)[0]


def effect_law(effects: Sequence[FittedEffect], frequency: float, instant: Instant | None = None) -> Any:
    """Return the moment that effects add as a law of :mod:`sindyjoint.mechanics`, or None where none adds one.

    Effects of channels and of the inertia are no part of the law.
    """
    adding = [e for e in effects if e.effect.enters == "moment" and e.effect.id != "inertia_error"]
    return sum_law([Part(e.variant, e.values, e.coefficients) for e in adding], frequency, instant)
