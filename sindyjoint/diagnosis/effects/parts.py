"""A variant of an effect with its numbers as parts of a joint's law: terms of angle and rate, or an element."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from sindyjoint.diagnosis.effects.catalogue import Variant
from sindyjoint.equation.dimensions import unit_for
from sindyjoint.equation.element import ElementState, JointElement, Value
from sindyjoint.equation.formula import formula_text
from sindyjoint.equation.model import ModelTerm

Numbers = Sequence[float] | NDArray[np.float64]


def parts_of_law(
    effect: str,
    family: str,
    variant: Variant,
    coefficients: Numbers,
    values: Numbers,
    *,
    name: str = "",
    motion: str = "rotation",
) -> tuple[list[ModelTerm], JointElement | None]:
    """Return an effect as terms, or as an element where it has internal states; errors are not yet known.

    Parameters
    ----------
    effect, family : str
        Id and family of the effect.
    variant : Variant
    coefficients, values : array_like, shape (n,)
        Of its columns, and of its nonlinear parameters, SI.
    name : str
        Default: the id in words.
    motion : {"rotation", "translation"}
    """
    units, known = variant.units(motion), name or effect.replace("_", " ")
    if variant.states:
        return [], element_of(effect, known, variant, coefficients, values, motion)
    inner = (*zip(variant.names, map(float, values), strict=True), *variant.references)
    return [
        ModelTerm(
            id=effect if k == 0 else f"{effect}_{k + 1}",
            symbol=column.symbol,
            name=known,
            family=family,
            formula=column.formula,
            parameters=inner,
            unit=units[column.symbol],
            coefficient=float(value),
            standard_error=0.0,
            interval95=(0.0, 0.0),
            unique_share=0.0,
            inputs=variant.inputs,
        )
        for k, (column, value) in enumerate(zip(variant.columns, coefficients, strict=True))
    ], None


def element_of(
    effect: str,
    name: str,
    variant: Variant,
    coefficients: Numbers,
    values: Numbers,
    motion: str = "rotation",
) -> JointElement:
    """Return an effect as an element, or as a moment of a test; its id is that of the effect."""
    units = variant.units(motion)
    return JointElement(
        id=effect,
        effect=effect,
        symbol=variant.columns[0].symbol,
        name=name,
        columns=tuple(
            Value(
                c.symbol, float(value), 0.0, (float(value),) * 2, units[c.symbol], formula_text(c.expression)
            )
            for c, value in zip(variant.columns, coefficients, strict=True)
        ),
        parameters=tuple(
            Value(inner, float(value), 0.0, (float(value),) * 2, units[inner])
            for inner, value in zip(variant.names, values, strict=True)
        ),
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
