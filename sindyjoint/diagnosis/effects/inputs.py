"""Declared inputs that a model does not use, as effects that it may be missing."""

from __future__ import annotations

from collections.abc import Sequence

from sindyjoint.diagnosis.effects.catalogue import Effect, Variant
from sindyjoint.equation import dimensions
from sindyjoint.equation.dependences import dependences
from sindyjoint.equation.element import Column
from sindyjoint.equation.formula import formula_text
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
    levels = {each.name: each.levels for each in inputs}
    reference = reference_values(inputs)
    found = []
    for term in dependences(inputs, levels, model.ids):
        if term.id in model:
            continue
        own = term.inputs[0]
        expression = term.resolve(Reference(inputs=reference)).expression
        units = {own.name: own.unit}
        unit = dimensions.coefficient_unit(expression, units, model.joint.motion)
        column = Column(term.symbol, formula_text(expression), unit, False, expression)
        found.append(
            Effect(
                id=term.id,
                name=term.name,
                family=term.family,
                meaning=term.meaning,
                source="",
                confused_with=(),
                enters="moment",
                variants=(Variant((column,), (), (), (own.name,)),),
            )
        )
    return tuple(found)
