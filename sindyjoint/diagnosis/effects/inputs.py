"""Declared inputs that a model does not use, as effects that it may be missing."""

from __future__ import annotations

from collections.abc import Sequence

from sindyjoint.diagnosis.effects.catalogue import Effect, Variant
from sindyjoint.equation.dependences import dependences
from sindyjoint.equation.element import Column
from sindyjoint.equation.model import JointModel
from sindyjoint.equation.terms import Reference
from sindyjoint.inputs import Input, reference_values


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
