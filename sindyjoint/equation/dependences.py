"""Terms of declared inputs: each of the paper's coefficients as it may depend on temperature, load or signal."""

from __future__ import annotations

import re
from collections.abc import Iterable
from dataclasses import replace
from functools import lru_cache

from sindyjoint.equation.catalogue import Catalogue, load_catalogue
from sindyjoint.equation.formula import parse_formula
from sindyjoint.equation.terms import Term, TermInput
from sindyjoint.inputs import Input

TEMPLATE = "inputs"
WORD = "input"


def with_dependences(catalogue: Catalogue, inputs: Iterable[Input]) -> Catalogue:
    """Return a catalogue with the dependences of its terms on inputs that it does not have itself."""
    offered = dependences(inputs, catalogue.ids)
    new = offered.without([term for term in offered.ids if term in catalogue])
    return catalogue.union(new) if new.terms else catalogue


def linear_dependences(catalogue: Catalogue, inputs: Iterable[Input]) -> Catalogue:
    """Return a catalogue with each of its terms linear in the inputs that were tested at more than one level."""
    return with_dependences(catalogue, [replace(each, levels=2) for each in inputs if each.levels > 1])


def dependences(inputs: Iterable[Input], offered: Iterable[str]) -> Catalogue:
    """Return the candidates that declared inputs bring.

    Parameters
    ----------
    inputs : iterable of Input
        With the levels at which they were tested.
    offered : iterable of str
        Ids of the other candidates: a dependence of a term that is not among them is left out.
    """
    known = set(offered)
    found: list[Term] = []
    for each in inputs:
        for term in _named(each.name, each.unit):
            own = term.inputs[0]
            fits = not own.offered_for or each.unit in own.offered_for
            if fits and each.levels >= own.levels and set(term.within) <= known:
                found.append(term)
                known.add(term.id)
    return Catalogue(TEMPLATE, "dependences on declared inputs", tuple(found))


@lru_cache(maxsize=64)
def _named(name: str, unit: str) -> tuple[Term, ...]:
    """Return the terms of the template for one input."""

    def named(text: str) -> str:
        return re.sub(rf"(?<![A-Za-z]){WORD}(?![A-Za-z])", name, text)

    made = []
    for term in load_catalogue(TEMPLATE):
        inputs = tuple(
            TermInput(name, unit, named(each.reference), each.levels, each.offered_for)
            for each in term.inputs
        )
        text = named(term.formula)
        references = [each.reference for each in inputs if each.reference]
        changed = replace(
            term,
            id=named(term.id),
            symbol=named(term.symbol),
            name=named(term.name).replace("_", " "),
            meaning=named(term.meaning),
            formula=text,
            expression=parse_formula(text, references, [name]),
            inputs=inputs,
            within=tuple(named(each) for each in term.within),
        )
        made.append(replace(changed, unit=changed.unit_for("rotation")))
    return tuple(made)
