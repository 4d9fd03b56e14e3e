"""An effect with its numbers: the parts and the law that it adds to a model, and what it puts right in the channels."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from sindyjoint.diagnosis.effects import Effect, Variant
from sindyjoint.equation.candidates import dependences
from sindyjoint.equation.element import Column, ElementState, JointElement, Value
from sindyjoint.equation.formula import formula_text, unit_for
from sindyjoint.equation.model import JointModel, ModelTerm
from sindyjoint.equation.terms import Parameter, Reference
from sindyjoint.inputs import Input, reference_values
from sindyjoint.mechanics import Law
from sindyjoint.numeric import Array
from sindyjoint.response.laws import Instant, LawInRun, Part, law_in_run, sum_law, with_added
from sindyjoint.states import ForceStates

# A nonlinear parameter of an element that no catalogue knows is searched within this factor of its value.
REACH = 5.0


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
    def shifts(self) -> bool:
        """Whether it is a time delay between the channels, which is removed from the states."""
        return self.effect.enters == "time shift"

    @property
    def is_term(self) -> bool:
        """Whether it is a term of angle and rate alone, as a model's own terms are."""
        known = {"theta", "omega", *self.variant.names, *self.variant.inputs}
        return self.effect.enters == "moment" and not self.variant.states and self.variant.uses <= known

    @property
    def numbers(self) -> Array:
        """Coefficients, then nonlinear parameters, SI."""
        return np.append(self.coefficients, self.values)

    @property
    def parameters(self) -> dict[str, float]:
        """Coefficients and nonlinear parameters by name."""
        names = (*(column.symbol for column in self.variant.columns), *self.variant.names)
        return dict(zip(names, map(float, self.numbers), strict=True))

    def terms(self, motion: str = "rotation") -> list[ModelTerm]:
        """Return it as terms of a law of ``"rotation"`` or ``"translation"``; errors are not yet known."""
        units, variant = self.variant.units(motion), self.variant
        inner = (*zip(variant.names, map(float, self.values), strict=True), *variant.references)
        return [
            ModelTerm(
                id=self.name if k == 0 else f"{self.name}_{k + 1}",
                symbol=column.symbol,
                name=self.effect.name,
                family=self.family,
                formula=column.formula,
                parameters=inner,
                unit=units[column.symbol],
                coefficient=float(value),
                standard_error=0.0,
                interval95=(0.0, 0.0),
                unique_share=0.0,
                inputs=variant.inputs,
            )
            for k, (column, value) in enumerate(zip(variant.columns, self.coefficients, strict=True))
        ]

    def element(self, motion: str = "rotation") -> JointElement:
        """Return it as an element, or as a moment of a test; errors are not yet known."""
        units, variant = self.variant.units(motion), self.variant

        def number(name: str, value: float, formula: str = "") -> Value:
            return Value(name, float(value), 0.0, (float(value),) * 2, units[name], formula)

        return JointElement(
            id=self.name,
            effect=self.name,
            symbol=variant.columns[0].symbol,
            name=self.effect.name,
            columns=tuple(
                number(c.symbol, value, formula_text(c.expression))
                for c, value in zip(variant.columns, self.coefficients, strict=True)
            ),
            parameters=tuple(map(number, variant.names, self.values)),
            states=tuple(
                ElementState(
                    state.name,
                    state.unit if motion == "rotation" else unit_for(state.unit, motion),
                    formula_text(state.rate),
                    None if state.limit is None else formula_text(state.limit),
                )
                for state in variant.states
            ),
            signals=tuple(sorted(variant.uses & {"frequency", "time", "elapsed"})),
        )


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
    model = replace(model, terms=(*model.terms, *(t for e in own for t in e.terms())), covariance=())
    added = effect_law([e for e in effects if e not in own], states.frequency or 0.0, Instant.of(states))
    return with_added(law_in_run(model, states), added)


def effect_law(effects: Sequence[FittedEffect], frequency: float, instant: Instant | None = None) -> Any:
    """Return the moment that effects add as a law of :mod:`sindyjoint.mechanics`, or None where none adds one.

    Effects of channels and of the inertia are no part of the law.
    """
    adding = [e for e in effects if e.effect.enters == "moment" and e.effect.id != "inertia_error"]
    return sum_law([Part(e.variant, e.values, e.coefficients) for e in adding], frequency, instant)


def effects_of(model: JointModel, known: Sequence[Effect]) -> tuple[FittedEffect, ...]:
    """Return the elements of a model with their numbers; where a catalogue knows one, with its ranges.

    Parameters
    ----------
    model : JointModel
    known : sequence of Effect
        Candidates of the diagnosis.
    """
    reference = Reference(angle=model.fitted.angle, rate=model.fitted.rate)
    found = []
    for element in model.elements:
        effect = next((e for e in known if e.id == element.effect), None)
        variant = None if effect is None else _same_form(effect, element, reference)
        if effect is None or variant is None:
            variant = _own_form(element)
            effect = Effect(
                element.effect, element.name, "memory", element.name, "", (), "moment", (variant,)
            )
        found.append(FittedEffect(effect, variant, element.values, element.coefficients, 0.0))
    return tuple(found)


def _same_form(effect: Effect, element: JointElement, reference: Reference) -> Variant | None:
    """Return the variant of an effect that has the formulas of an element, and its numbers within the ranges."""
    form = element.form
    alike = [
        variant
        for variant in effect.variants
        if [c.expression for c in variant.columns] == [c.expression for c in form.columns]
        and [(s.name, s.rate, s.limit) for s in variant.states]
        == [(s.name, s.rate, s.limit) for s in form.states]
        and variant.names == form.names
    ]
    within = (v for v in alike if _holds(v.bounds(reference), element.values))
    return next(within, alike[0] if alike else None)


def _holds(bounds: np.ndarray, values: np.ndarray) -> bool:
    return bool(np.all((bounds[:, 0] <= values) & (values <= bounds[:, 1])))


def _own_form(element: JointElement) -> Variant:
    form = element.form
    return Variant(
        form.columns,
        tuple(
            Parameter(p.name, p.unit, p.value, None, p.value / REACH, p.value * REACH)
            for p in element.parameters
        ),
        form.states,
    )


def input_effects(inputs: Sequence[Input], model: JointModel) -> tuple[Effect, ...]:
    """Return the dependences of a model's terms on inputs, without those that it has.

    Parameters
    ----------
    inputs : sequence of Input
        Of the campaign; one with a single level shows nothing.
    model : JointModel
    """
    references = Reference(inputs=reference_values(inputs))
    found = []
    for term in dependences(inputs, model.ids):
        if term.id in model:
            continue
        # The formula keeps the name of the reference: a number in its place has no unit.
        resolved, unit = term.resolve(references), term.unit_for(model.joint.motion)
        column = Column(term.symbol, term.formula, unit, False, resolved.expression)
        found.append(
            Effect(
                id=term.id,
                name=term.name,
                family=term.family,
                meaning=term.meaning,
                source="",
                confused_with=(),
                enters="moment",
                variants=(Variant((column,), (), (), (term.inputs[0].name,), resolved.values),),
            )
        )
    return tuple(found)
