"""What a law is made of where samples have no time: terms and elements that how fast the joint moves does not change.

A term is such that f(θ, λθ̇) = f(θ, θ̇) for every λ > 0: the direction of motion may stand in it, the rate may not. An
element is such that its moment keeps to that and its states go by the path, dz/dt(λθ̇) = λ·dz/dt(θ̇).
"""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING, Any

from sindyjoint.equation.catalogue import Catalogue
from sindyjoint.equation.element import Form
from sindyjoint.equation.model import JointModel
from sindyjoint.equation.parsing import variable_symbols
from sindyjoint.errors import InputError
from sindyjoint.text import list_some, spelled

if TYPE_CHECKING:
    import sympy

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
