"""Elements that a model already has, as effects of a diagnosis: it goes on from the whole model."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from sindyjoint.diagnosis.effects.catalogue import Effect, Variant
from sindyjoint.diagnosis.effects.fitted import FittedEffect
from sindyjoint.equation.element import JointElement
from sindyjoint.equation.model import JointModel
from sindyjoint.equation.terms import Parameter, Reference

# A nonlinear parameter of an element that no catalogue knows is searched within this factor of its value.
REACH = 5.0


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
