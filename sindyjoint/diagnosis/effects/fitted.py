"""An effect with its numbers: the law that it adds to a model, and what it puts right in the channels."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from sindyjoint.diagnosis.effects.catalogue import Effect, Variant
from sindyjoint.diagnosis.effects.written import written
from sindyjoint.equation.model import JointModel
from sindyjoint.response.model_law import model_law

if TYPE_CHECKING:
    from sindyjoint.mechanics.laws import Law

Array = NDArray[np.float64]

CLOCK = "clock"  # the state that tells a law the time


@dataclass(frozen=True)
class Instant:
    """When a law is asked: ``time`` s into a run that ``began`` s after the first; whether time ``runs`` on."""

    time: float = 0.0
    began: float = 0.0
    runs: bool = False


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
    """

    effect: Effect
    variant: Variant
    values: Array
    coefficients: Array
    gain: float

    @property
    def name(self) -> str:
        """Id of the effect."""
        return self.effect.id

    @property
    def family(self) -> str:
        """Of the effect."""
        return self.effect.family

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

    Effects of channels and of the inertia are no part of the law. Time that runs is a state with the rate one.
    """
    from sympy import Float, Symbol

    from sindyjoint.mechanics.laws import FormulaLaw

    instant = instant or Instant()
    expression: Any = Float(0)
    rates: dict[str, Any] = {}
    values: dict[str, float] = {}
    for index, each in enumerate(effects):
        if each.effect.enters != "moment" or each.effect.id == "inertia_error":
            continue
        variant, given = each.variant, {"frequency": Float(frequency)}
        names = {n: f"p{index}_{n}" for n in variant.names}
        values |= {names[n]: float(v) for n, v in zip(variant.names, each.values, strict=True)}
        for signal, now in (("time", instant.time), ("elapsed", instant.time + instant.began)):
            if signal in {symbol.name for symbol in variant.symbols}:
                # The instant is a parameter: another segment of a run needs no compilation of its own.
                values[f"at_{signal}"] = now
                given[signal] = Symbol(f"at_{signal}", real=True)
                if instant.runs:
                    given[signal] += Symbol(CLOCK, real=True)
                    rates[CLOCK] = Float(1)
        columns, own = written(
            variant, names | {s.name: f"state{index}_{s.name}" for s in variant.states}, given
        )
        for place, (column, value) in enumerate(zip(columns, each.coefficients, strict=True)):
            values[f"c{index}_{place}"] = float(value)
            expression += Symbol(f"c{index}_{place}", real=True) * column
        rates |= own
    return None if expression == 0 else FormulaLaw(expression, values, rates)
