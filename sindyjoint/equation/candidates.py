"""Which terms data can show: those of inputs, those without the rate where samples have no time, those of pysindy.

Features of pysindy's libraries are read by their names as formulas, which are never evaluated, and the columns of a
formula are compared with those of its library; one whose names do not say what it computes is refused.
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Sequence
from copy import deepcopy
from dataclasses import replace
from functools import cache, lru_cache
from typing import TYPE_CHECKING, Any

import numpy as np

from sindyjoint.equation.catalogue import Catalogue, as_catalogue, load_catalogue
from sindyjoint.equation.element import Form
from sindyjoint.equation.formula import coefficient_unit, compile_terms, parse_formula
from sindyjoint.equation.model import JointModel
from sindyjoint.equation.parsing import variable_symbols
from sindyjoint.equation.terms import Term, TermInput
from sindyjoint.errors import FormulaError, InputError, UnitError
from sindyjoint.inputs import Input
from sindyjoint.text import list_some, spelled

if TYPE_CHECKING:
    import sympy

TEMPLATE = "inputs"
WORD = "input"


def with_dependences(catalogue: Catalogue, inputs: Iterable[Input]) -> Catalogue:
    """Return a catalogue with the dependences of its terms on inputs that it does not have itself."""
    offered = dependences(inputs, catalogue.ids)
    new = offered.without([term for term in offered.ids if term in catalogue])
    return catalogue.union(new) if new.terms else catalogue


def dependences(inputs: Iterable[Input], offered: Iterable[str], template: str = TEMPLATE) -> Catalogue:
    """Return the candidates that declared inputs bring.

    Parameters
    ----------
    inputs : iterable of Input
        With the levels at which they were tested.
    offered : iterable of str
        Ids of the other candidates: a dependence of a term that is not among them is left out.
    template : str
        Catalogue of the candidates, with the word ``input`` for the name of each.
    """
    known = set(offered)
    found: list[Term] = []
    for each in inputs:
        for term in _named(template, each.name, each.unit):
            own = term.inputs[0]
            fits = not own.offered_for or each.unit in own.offered_for
            if fits and each.levels >= own.levels and set(term.within) <= known:
                found.append(term)
                known.add(term.id)
    return Catalogue(template, "dependences on declared inputs", tuple(found))


@lru_cache(maxsize=64)
def _named(template: str, name: str, unit: str) -> tuple[Term, ...]:
    """Return the terms of a template for one input."""

    def named(text: str) -> str:
        return re.sub(rf"(?<![A-Za-z]){WORD}(?![A-Za-z])", name, text)

    made = []
    for term in load_catalogue(template):
        inputs = tuple(
            TermInput(name, unit, named(each.reference), each.levels, each.offered_for)
            for each in term.inputs
        )
        text = named(term.formula)
        names = [each.reference for each in inputs if each.reference]
        names += [each.name for each in term.parameters]
        changed = replace(
            term,
            id=named(term.id),
            symbol=named(term.symbol),
            name=named(term.name).replace("_", " "),
            meaning=named(term.meaning),
            formula=text,
            expression=parse_formula(text, names, [name]),
            inputs=inputs,
            within=tuple(named(each) for each in term.within),
        )
        made.append(replace(changed, unit=changed.unit_for("rotation")))
    return tuple(made)


NO_DELAY = "the samples have no time, so that channels have no delay between them; leave it out"
NO_RESPONSE = "the samples have no time, so that no response can be simulated; leave it out"

# Signals of effects that have no meaning without time.
TIMED = frozenset({"alpha", "frequency", "time", "elapsed", "moment_rate"})


def scales_with_rate(expression: sympy.Expr, degree: int) -> bool:
    """Return whether an expression grows with this power of the rate, and holds nothing else of time."""
    from sympy import Symbol, simplify

    if any(symbol.name in TIMED for symbol in expression.free_symbols):
        return False
    _, omega, _ = variable_symbols()
    if omega not in expression.free_symbols:
        return degree == 0 or expression == 0
    factor = Symbol("factor", positive=True)
    faster = expression.xreplace({omega: factor * omega}).doit() / factor**degree
    return factor not in faster.free_symbols or factor not in simplify(faster).free_symbols


def is_rate_free(form: Form) -> bool:
    """Return whether a form with internal states goes by the path alone."""
    limits: list[Any] = [state.limit for state in form.states if state.limit is not None]
    return all(
        scales_with_rate(each, 0) for each in (*(c.expression for c in form.columns), *limits)
    ) and all(scales_with_rate(state.rate, 1) for state in form.states)


def rate_free(catalogue: Catalogue) -> Catalogue:
    """Return the terms of a catalogue that samples without time can show.

    Raises
    ------
    InputError
        Where there is none.
    """
    kept = [term.id for term in catalogue if scales_with_rate(term.expression, 0)]
    if not kept:
        raise InputError(
            f"library {catalogue.name!r}: every term depends on rate or time, which these samples do not have; "
            "expected terms of angle and direction"
        )
    return catalogue if len(kept) == len(catalogue) else catalogue.select(kept)


def without_rate(model: JointModel) -> tuple[JointModel, str]:
    """Return what samples without time can be held against of a model, and a sentence on what they cannot.

    Raises
    ------
    InputError
        Where nothing is left, or an element depends on the rate.
    """
    timed = [element.name for element in model.elements if not is_rate_free(element.form)]
    if timed:
        raise InputError(
            f"the model has {list_some(timed)}, which depends on the rate, and the samples have no time: expected a "
            "law without rate, or samples with time"
        )
    places = [i for i, term in enumerate(model.terms) if scales_with_rate(term.expression, 0)]
    if len(places) == len(model.terms):
        return model, ""
    if not places and not model.elements:
        raise InputError("every term of the model depends on the rate, and the samples have no time")
    dropped = [spelled(t.id, model.joint.motion) for i, t in enumerate(model.terms) if i not in places]
    rows = [*places, *range(len(model.terms), model.numbers.size)]
    matrix = model.covariance_matrix[rows][:, rows]
    kept = replace(model.with_terms([model.terms[i] for i in places], matrix), elements=model.elements)
    return kept, f"not compared, for the samples have no time: {', '.join(dropped)}"


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
    if not hasattr(library, "get_feature_names"):
        return as_catalogue(library, catalogue_of)
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
    for known in load_catalogue("extended"):
        if not known.parameters and known.expression == expression:
            return known
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


def made_by_shift(expressions: Sequence[sympy.Expr]) -> tuple[bool, ...]:
    """Return of each term whether another one, its angle counted from another zero, contains it.

    To first order in the shift d: f(θ − d) = f(θ) − d·f'(θ), so θ² stands in θ³ and θ in θ², and a model with θ³ and
    without θ² belongs to one zero only.
    """
    return tuple(
        any(_is_slope(term, other) for other in expressions if other is not term) for term in expressions
    )


@cache
def _is_slope(term: sympy.Expr, other: sympy.Expr) -> bool:
    """Return whether a term is proportional to the slope of another over the angle."""
    ratio = other.diff(variable_symbols()[0]) / term
    return bool(ratio.is_number and ratio != 0)
