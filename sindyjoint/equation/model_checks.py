"""What must hold of a model that was read from a file, before anything is computed with it.

The first check is of the plain JSON data and knows the kinds of the fields, not the record: it holds for every schema.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Mapping
from typing import TYPE_CHECKING, Any

import numpy as np

from sindyjoint.errors import InputError

if TYPE_CHECKING:
    from sindyjoint.equation.model import JointModel

# A term of a law that was measured stays near the measured moment; collinear terms may cancel, not to this extent.
LARGEST_SHARE = 1e6
LONGEST_TEXT = 2000
MOST_TERMS = 200


def _is_number(value: Any) -> bool:
    return isinstance(value, int | float) and not isinstance(value, bool) and math.isfinite(value)


def _is_magnitude(value: Any) -> bool:
    return _is_number(value) and value >= 0


def _is_text(value: Any) -> bool:
    return isinstance(value, str) and len(value) <= LONGEST_TEXT


def _is_count(value: Any) -> bool:
    return isinstance(value, int) and not isinstance(value, bool) and value >= 0


def _is_pair(value: Any) -> bool:
    return isinstance(value, list) and len(value) == 2 and all(map(_is_number, value))


def _are_parameters(value: Any) -> bool:
    return isinstance(value, list) and all(
        isinstance(pair, list) and len(pair) == 2 and _is_text(pair[0]) and _is_number(pair[1])
        for pair in value
    )


def _are_labels(value: Any) -> bool:
    return isinstance(value, dict) and all(_is_text(text) for pair in value.items() for text in pair)


def _or_nothing(check: Callable[[Any], bool]) -> Callable[[Any], bool]:
    return lambda value: value is None or check(value)


Kinds = Mapping[str, tuple[Callable[[Any], bool], str]]
_NUMBER, _MAGNITUDE = (_is_number, "a finite number"), (_is_magnitude, "a finite number that is not negative")
_TEXT, _COUNT = (_is_text, "a text"), (_is_count, "a count")
TERM: Kinds = {
    **dict.fromkeys(("id", "symbol", "name", "family", "formula", "unit"), _TEXT),
    "parameters": (_are_parameters, "pairs of a name and a number"),
    "coefficient": _NUMBER,
    "standard_error": _MAGNITUDE,
    "interval95": (_is_pair, "two numbers"),
    "unique_share": _NUMBER,
}
FITTED: Kinds = {
    **dict.fromkeys(("moment_rms", "residual_rms", "moving_fraction", "angle", "rate"), _MAGNITUDE),
    "noise_floor": (_or_nothing(_is_magnitude), "a number that is not negative, or null"),
    "samples": _COUNT,
    "runs": _COUNT,
    "frequencies": (lambda value: isinstance(value, list) and all(map(_is_magnitude, value)), "numbers"),
    "simulated": (lambda value: isinstance(value, bool), "true or false"),
}
JOINT: Kinds = {
    "name": _TEXT,
    "motion": _TEXT,
    "serial": (_or_nothing(_is_text), "a text or null"),
    "inertia": (_or_nothing(_is_magnitude), "a number that is not negative, or null"),
    "temperature": (_or_nothing(_is_magnitude), "a number that is not negative, or null"),
    "labels": (_are_labels, "texts by name"),
}


def check_model_data(data: Any) -> None:
    """Refuse JSON data in which a field of a model has another kind of value than is written there.

    A field that is missing, or that is not known here, is left to who reads the record.

    Raises
    ------
    InputError
        Naming the field.
    """
    if not isinstance(data, Mapping) or not isinstance(data.get("terms"), list):
        raise InputError("not a joint model: expected 'schema' and 'terms', as in model.json")
    if len(data["terms"]) > MOST_TERMS:
        raise InputError(f"'terms' are {len(data['terms'])}; expected at most {MOST_TERMS}")
    ids = []
    for where, kinds, table in _tables(data):
        if not isinstance(table, Mapping):
            raise InputError(f"{where} is {table!r:.40}; expected a table of fields")
        for name, (check, expected) in kinds.items():
            if name in table and not check(table[name]):
                raise InputError(f"{where}: {name!r} is {table[name]!r:.40}; expected {expected}")
        if kinds is TERM and "id" in table:
            ids.append(table["id"])
    twice = sorted({id for id in ids if ids.count(id) > 1})
    if twice:
        raise InputError(f"the id {twice[0]!r} is there {ids.count(twice[0])} times; expected each one once")
    if "covariance" in data:
        _check_covariance(data["covariance"], len(data["terms"]) if data.get("schema") == 1 else None)


def _tables(data: Mapping[str, Any]) -> Iterator[tuple[str, Kinds, Any]]:
    """Yield the parts of a model: what messages call each, the kinds of its fields, and the part."""
    for number, term in enumerate(data["terms"], start=1):
        name = term.get("id") if isinstance(term, Mapping) else None
        yield f"term {number}" + (f" ({name})" if isinstance(name, str) else ""), TERM, term
    yield from ((f"'{part}'", kinds, data[part]) for part, kinds in (("fitted", FITTED), ("joint", JOINT))
                if part in data)  # fmt: skip


def _check_covariance(rows: Any, size: int | None) -> None:
    """Refuse what is no matrix, of another size than ``size``, or that no coefficients can have."""
    size = len(rows) if size is None and isinstance(rows, list) else size
    shaped = isinstance(rows, list) and all(isinstance(row, list) and len(row) == size for row in rows)
    if not shaped or len(rows) != size or not all(_is_number(value) for row in rows for value in row):
        raise InputError(f"'covariance' is no matrix of {size} rows and columns of finite numbers")
    matrix = np.array(rows, dtype=np.float64).reshape(size, size)
    scale = np.sqrt(np.abs(np.diagonal(matrix)))
    bound = (1 + 1e-6) * np.outer(scale, scale)
    if np.any(np.diagonal(matrix) < 0) or np.any(np.abs(matrix) > bound):
        raise InputError("'covariance' is none: a variance is negative, or a correlation is beyond 1")
    if np.any(np.abs(matrix - matrix.T) > 1e-6 * bound):
        raise InputError("'covariance' is not symmetric")


def check_model(model: JointModel) -> None:
    """Refuse a model of which a term is beyond all measure within the range that it was fitted on.

    Raises
    ------
    InputError
        Naming the term.
    """
    from sindyjoint.equation.formula import compile_terms, variable_symbols

    fitted = model.fitted
    if not (fitted.moment_rms > 0 and fitted.angle > 0 and fitted.rate > 0):
        return
    acceleration = variable_symbols()[2]
    terms = [term for term in model.terms if acceleration not in term.expression.free_symbols]
    if not terms:
        return
    angle, rate = (a.ravel() for a in np.meshgrid(fitted.angle * np.array([-1, -0.5, 0.5, 1]),
                                                  fitted.rate * np.array([-1, -0.5, 0.5, 1])))  # fmt: skip
    with np.errstate(all="ignore"):
        moments = compile_terms([term.expression for term in terms])(angle, rate, np.nan)
        moments = np.abs(moments * [term.coefficient for term in terms]).max(axis=0)
    for term, moment in zip(terms, moments, strict=True):
        if not moment <= LARGEST_SHARE * fitted.moment_rms:
            raise InputError(
                f"term {term.id!r}: its coefficient {term.coefficient:g} makes {moment:.3g} within the tested range, "
                f"where {fitted.moment_rms:.3g} was measured; the file was changed or damaged"
            )
