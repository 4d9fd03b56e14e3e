"""A model whose inputs are held at values: an ordinary law of angle and rate."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from functools import lru_cache
from typing import TYPE_CHECKING, Any, TypeVar

import numpy as np

from sindyjoint.errors import UnknownNameError

if TYPE_CHECKING:
    from sindyjoint.equation.model_parts import ModelTerm

# A joint model; its own module is above this one.
Model = TypeVar("Model", bound=Any)
#: Formula, nonlinear parameters and inputs of a term.
Written = tuple[str, tuple[tuple[str, float], ...], tuple[str, ...]]


def input_values(model: Any, given: Mapping[str, float]) -> dict[str, float]:
    """Return a value for each input of a model: the given one, or its reference.

    Raises
    ------
    UnknownNameError
        For a name that is no input of the model.
    """
    values = {each.name: each.reference for each in model.inputs}
    for name in given:
        if name not in values:
            known = ", ".join(values) or "none"
            raise UnknownNameError(f"the model has no input {name!r}; its inputs: {known}")
    return values | {name: float(value) for name, value in given.items()}


def model_at(model: Model, given: Mapping[str, float]) -> Model:
    """Return a model with its inputs held; see :meth:`JointModel.at`.

    What then has the form of another term is added to its coefficient: k1 + k1T·(T − T0) is the k1 at T.
    """
    values = tuple(sorted(input_values(model, given).items()))
    if not model.inputs:
        return model
    rows, formulas, matrix = _held(model, values)
    numbers = matrix @ model.numbers
    covariance = matrix @ model.covariance_matrix @ matrix.T if model.covariance else None
    terms = tuple(
        _term(model.terms[place], formulas[place], numbers[row], covariance, row)
        for row, place in enumerate(rows)
    )
    kept = () if covariance is None else tuple(map(tuple, covariance.tolist()))
    at = dict(values)
    inputs = tuple(replace(each, reference=at[each.name]) for each in model.inputs)
    return replace(model, terms=terms, covariance=kept, inputs=inputs)


def _held(model: Any, values: tuple[tuple[str, float], ...]) -> tuple[list[int], tuple[str, ...], np.ndarray]:
    """Return the places of the terms that stay, the formulas of all, and the matrix of their numbers."""
    written = tuple((term.formula, term.parameters, term.inputs) for term in model.terms)
    joined, formulas = _plan(written, values)
    size, count = model.numbers.size, len(model.terms)
    rows = [place for place, target in enumerate(joined) if target is not None and target[0] == place]
    matrix = np.zeros((len(rows) + size - count, size))
    matrix[len(rows) :, count:] = np.eye(size - count)
    for place, target in enumerate(joined):
        if target is not None:
            matrix[rows.index(target[0]), place] = target[1]
    return rows, formulas, matrix


def _term(term: ModelTerm, formula: str, value: float, covariance: np.ndarray | None, row: int) -> ModelTerm:
    own = term.standard_error
    error = own if covariance is None else float(np.sqrt(max(covariance[row, row], 0.0)))
    half = (term.interval95[1] - term.interval95[0]) / 2 * (error / own if own > 0 else 1.0)
    parameters = () if term.inputs else term.parameters
    return replace(
        term,
        formula=formula,
        parameters=parameters,
        inputs=(),
        coefficient=float(value),
        standard_error=error,
        interval95=(float(value) - half, float(value) + half),
    )


@lru_cache(maxsize=512)
def _plan(
    written: tuple[Written, ...], values: tuple[tuple[str, float], ...]
) -> tuple[tuple[tuple[int, float] | None, ...], tuple[str, ...]]:
    """Return of each term to which one it is added and times what (None: it vanishes), and its formula."""
    from sympy import Float

    from sindyjoint.equation.formula import formula_text, parse_formula, state_symbol, variable_symbols
    from sindyjoint.equation.parsing import parameter_symbol

    motion = variable_symbols()
    held = {state_symbol(name): Float(value, 17) for name, value in values}
    expressions = []
    for formula, parameters, inputs in written:
        parsed = parse_formula(formula, [name for name, _ in parameters], inputs)
        if inputs:
            numbers = {parameter_symbol(name): Float(value, 17) for name, value in parameters}
            parsed = parsed.xreplace(held | numbers)
        expressions.append(parsed)
    bases = {expressions[i]: i for i, (_, _, inputs) in reversed([*enumerate(written)]) if not inputs}
    joined: list[tuple[int, float] | None] = []
    formulas = []
    for place, (expression, (formula, _, inputs)) in enumerate(zip(expressions, written, strict=True)):
        factor, base = expression.as_independent(*motion, as_Add=False) if inputs else (1, expression)
        if expression == 0 or factor == 0:
            joined.append(None)
        elif inputs and base in bases:
            joined.append((bases[base], float(factor)))
        else:
            joined.append((place, 1.0))
        formulas.append(formula_text(expression) if inputs else formula)
    return tuple(joined), tuple(formulas)
