"""Other starts of a refinement: nonlinear parameters of elements spread, all that is linear fitted to the moment."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from sindyjoint.equation.element import JointElement
from sindyjoint.equation.formula import VARIABLES, compile_terms
from sindyjoint.equation.model import JointModel
from sindyjoint.response.policy import POLICY
from sindyjoint.response.run import followed_motion
from sindyjoint.states import ForceStates


def spread_starts(model: JointModel, states: Sequence[ForceStates]) -> list[JointModel]:
    """Return a model with the nonlinear parameters of its elements larger and smaller by turns, and the opposite.

    The response has several minima over these: a gap that is too small and a ramp that is too long fit each other.
    Coefficients are those of least squares on the moment along the measured motion. None for a model without nonlinear
    parameters; a start whose elements would have to push the other way is left out.
    """
    inner = [(i, number.name) for i, each in enumerate(model.elements) for number in each.parameters]
    starts = []
    for turn in (1, -1) if inner else ():
        signs = {key: turn * (-1) ** place for place, key in enumerate(inner)}
        elements = [_spread(each, i, signs) for i, each in enumerate(model.elements)]
        start = _fitted(model, elements, states)
        if start is not None:
            starts.append(start)
    return starts


def _spread(element: JointElement, index: int, signs: dict[tuple[int, str], int]) -> JointElement:
    numbers = [(number.value, number.standard_error) for number in element.numbers]
    for place, number in enumerate(element.parameters, len(element.columns)):
        factor = POLICY.shape_spread if number.unit in ("", "1") else POLICY.start_spread
        numbers[place] = number.value * factor ** signs[index, number.name], number.standard_error
    return element.with_numbers(numbers)


def _fitted(
    model: JointModel, elements: Sequence[JointElement], states: Sequence[ForceStates]
) -> JointModel | None:
    """Return the model with these elements, all coefficients fitted to the moment of moving samples."""
    columns, targets = [], []
    names = tuple(each.name for each in model.inputs)
    function = (
        compile_terms([t.expression for t in model.terms], (*VARIABLES, *names)) if model.terms else None
    )
    declared = model.joint.inertia or 0.0
    for state in states:
        moving = state.moving
        inputs = [state.inputs[name] for name in names]
        own = [] if function is None else [function(state.angle, state.rate, state.acceleration, *inputs)]
        own += [each.columns_along(*followed_motion(state), 1 / state.sample_rate) for each in elements]
        columns.append(np.hstack(own)[moving])
        targets.append(state.transfer_moment(declared)[moving])
    matrix, target = np.vstack(columns), np.concatenate(targets)
    size = np.linalg.norm(matrix, axis=0)
    if not np.isfinite(size).all() or not np.all(size > 0):
        return None
    values = np.linalg.lstsq(matrix / size, target, rcond=None)[0] / size
    count = len(model.terms)
    numbers, used = list(values[:count]), count
    for before, each in zip(model.elements, elements, strict=True):
        own = values[used : used + len(each.columns)]
        used += own.size
        if np.any(own * before.coefficients < 0):
            return None
        numbers += [*own, *each.values]
    return model.with_numbers(numbers)
