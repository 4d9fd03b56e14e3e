"""Feature libraries of pysindy as catalogues: each feature is read as a formula, so that all that follows is the same.

The features' names are read by the allow-list of formulas, never evaluated, and the columns of the formula are compared
with those of the library; a library whose names do not say what it computes is refused.
"""

from __future__ import annotations

import re
from collections.abc import Sequence
from copy import deepcopy
from typing import TYPE_CHECKING, Any

import numpy as np

from sindyjoint.equation.catalogue import Catalogue, as_catalogue, load_catalogue
from sindyjoint.equation.dimensions import coefficient_unit
from sindyjoint.equation.formula import compile_terms, parse_formula
from sindyjoint.equation.terms import Term
from sindyjoint.errors import FormulaError, InputError, UnitError

if TYPE_CHECKING:
    import sympy

# Angles and rates at which a formula is compared with its feature: both signs, sizes of order one.
_POINTS = np.random.default_rng(0).uniform(-1.0, 1.0, (64, 2))


def catalogue_of(library: Any) -> Catalogue:
    """Return the catalogue of a library in any form that discovery takes.

    Parameters
    ----------
    library : str, Path, Catalogue, pysindy feature library, or a sequence of these
        Of a pysindy library the features of (θ, θ̇). What a shipped catalogue holds keeps its id, unit and meaning;
        another feature is a term of its own, whose unit is empty where the formula has none.

    Raises
    ------
    InputError
        For a library whose features cannot be read as formulas.
    """
    if isinstance(library, Sequence) and not isinstance(library, str):
        parts = [catalogue_of(each) for each in library]
        if not parts:
            return as_catalogue(library)
        return parts[0].union(*parts[1:]) if len(parts) > 1 else parts[0]
    if not hasattr(library, "get_feature_names"):
        return as_catalogue(library)
    if hasattr(library, "physical_coefficients"):  # a TermLibrary, which imports this module
        return catalogue_of(library.library)
    if (inner := getattr(library, "libraries", None)) and type(library).__name__ == "ConcatLibrary":
        return catalogue_of(list(inner))
    return _read(library)


def _read(library: Any) -> Catalogue:
    kind = type(library).__name__
    try:
        # A copy: the caller's library may be fitted to something else, and CustomLibrary cannot be cloned.
        fitted = deepcopy(library).fit(_POINTS)
        names = fitted.get_feature_names(["theta", "omega"])
        columns = np.asarray(fitted.transform(_POINTS))
    except Exception as error:  # whatever a foreign library raises, it cannot be used
        raise InputError(
            f"library {kind}: its features of (angle, rate) cannot be computed ({error}); write the candidates as a "
            "catalogue instead"
        ) from error
    return Catalogue(
        kind, f"features of pysindy's {kind}",
        tuple(_term(kind, name, column) for name, column in zip(names, columns.T, strict=True)),
    )  # fmt: skip


def _term(kind: str, name: str, column: Any) -> Term:
    text = re.sub(r"\s+", "*", name.strip().replace("^", "**"))
    try:
        expression = parse_formula(text)
        values = compile_terms([expression])(_POINTS[:, 0], _POINTS[:, 1], np.nan)[:, 0]
    except FormulaError as error:
        raise InputError(
            f"library {kind}: the feature {name!r} cannot be read as a formula ({error}); write it as a term of a "
            "catalogue"
        ) from error
    if not np.allclose(values, column, rtol=1e-9, atol=1e-12):
        raise InputError(
            f"library {kind}: the feature {name!r} is not what its name says; write it as a term of a catalogue"
        )
    known = _known(expression)
    return known if known is not None else _new_term(kind, name, text, expression)


def _known(expression: sympy.Expr) -> Term | None:
    """Return the shipped term of the same formula."""
    return next(
        (t for t in load_catalogue("extended") if not t.parameters and t.expression == expression), None
    )


def _new_term(kind: str, name: str, text: str, expression: sympy.Expr) -> Term:
    try:
        unit = coefficient_unit(expression, {}, "rotation")
    except UnitError:
        unit = ""
    plain = re.sub(r"\W+", "_", text.replace("**", "_")).strip("_").lower()
    label = plain if plain[:1].isalpha() else f"f_{plain}"
    return Term(
        id=label, symbol=f"c_{label}", formula=text, unit=unit, name=name if unit else f"{name} (no unit)",
        meaning=f"feature of pysindy's {kind}", family="pysindy", source="pysindy", confused_with=(), parameters=(),
        expression=expression,
    )  # fmt: skip
