"""What tables and lumped elements make of a model: rows that the decks of several programs share."""

from __future__ import annotations

import numpy as np

from sindyjoint.equation.model import INERTIA, JointModel, ModelTerm
from sindyjoint.export.base import Cycles, Represented
from sindyjoint.export.parts import RAMP, Curve, Parts, contribution, piecewise, total
from sindyjoint.export.text import words_of
from sindyjoint.numeric import Array


def elastic_curve(parts: Parts, count: int) -> Curve:
    """Tabulate the elastic part over the tested range at an odd number of points."""
    nodes = parts.elastic_nodes(count)
    return Curve(nodes, total(parts.elastic, nodes, 0.0))


def elastic_rows(parts: Parts, cycles: Cycles, nodes: Array, how: str) -> dict[str, Represented]:
    """Return what a table at the nodes makes of each elastic term."""
    return {
        term.id: Represented(how, piecewise(nodes, contribution(term, nodes, 0.0), cycles.angle))
        for term in parts.elastic
    }


def rate_curve(parts: Parts, terms: tuple[ModelTerm, ...]) -> Curve:
    """Tabulate terms of the rate; a jump at zero rate becomes a ramp."""
    nodes = parts.rate_nodes()
    return Curve(nodes, total(terms, 0.0, nodes))


def rate_rows(
    parts: Parts, terms: tuple[ModelTerm, ...], cycles: Cycles, nodes: Array, how: str
) -> dict[str, Represented]:
    """Return what a table at the nodes makes of each term of the rate."""
    rows = {}
    for term in terms:
        text = how
        if jump_of(term, float(nodes.max())):
            rate = words_of(parts.model).rate
            text += f", its jump a ramp up to {RAMP:g} of the tested {rate}; creeps instead of sticking"
        rows[term.id] = Represented(text, piecewise(nodes, contribution(term, 0.0, nodes), cycles.rate))
    return rows


def jump_of(term: ModelTerm, rate: float) -> float:
    """Half the jump of a term of the rate at zero rate, N·m, with an accuracy of 1e-9 of the tested rate."""
    ahead, behind = contribution(term, 0.0, np.array([1e-9, -1e-9]) * rate)
    half = (ahead - behind) / 2
    size = np.abs(contribution(term, 0.0, rate))
    return float(half) if abs(half) > 1e-6 * max(float(size), abs(half)) else 0.0


def viscous_rows(parts: Parts, cycles: Cycles, how: str) -> dict[str, Represented]:
    """Return rows for terms in proportion to the rate, which a dashpot carries exactly."""
    return {term.id: Represented(how, cycles.term(term)) for term in parts.viscous}


def inertial_rows(parts: Parts) -> dict[str, Represented]:
    """Return rows for inertia, which belongs to the masses of a structure, not to the joint's elements."""
    return {
        term.id: Represented(
            "not carried: the inertia of the test article belongs to the masses of the structure"
            if term.id == INERTIA
            else "not carried: a formula of the acceleration",
            None,
        )
        for term in parts.inertial
    }


def left_out(terms: tuple[ModelTerm, ...], why: str) -> dict[str, Represented]:
    """Return rows for terms that are not carried."""
    return {term.id: Represented(f"not carried: {why}", None) for term in terms}


def inertia_note(model: JointModel) -> tuple[str, ...]:
    """Return the note on the inertia of the test, where it is known."""
    if model.inertia == 0:
        return ()
    return (
        f"the moving inertia of the test, {model.inertia:.6g} {words_of(model).inertia_unit}, is not in the joint's "
        "elements: it belongs to the masses of the structure around it",
    )


def range_note(model: JointModel, beyond: str) -> str:
    """Return the note on the tested range."""
    fitted = model.fitted
    unit = words_of(model).angle_unit
    return f"tables cover the tested range, {fitted.angle:.6g} {unit} and {fitted.rate:.6g} {unit}/s; beyond, {beyond}"
