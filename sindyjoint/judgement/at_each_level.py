"""The law that a model is at each level of its inputs: five terms that depend on one are five terms there."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache
from typing import TYPE_CHECKING

from sindyjoint.equation.catalogue import load_catalogue
from sindyjoint.equation.formula import variable_symbols
from sindyjoint.equation.model import INERTIA, JointModel
from sindyjoint.text import spelled

if TYPE_CHECKING:
    import sympy

# Standard errors by which a coefficient is of another sign at the other end of the range.
SIGNS = 2.0


@dataclass(frozen=True)
class LevelLaw:
    """What a model is where its inputs stand still.

    Parameters
    ----------
    ids : tuple of str
        Of its terms there, without inertia; a dependence goes by the term of the paper that it changes.
    dependences : tuple of (str, str)
        Ids of terms of the paper that depend on an input, and that input.
    """

    ids: tuple[str, ...]
    dependences: tuple[tuple[str, str], ...]

    def words(self, model: JointModel) -> str:
        """Return which coefficients depend on what; empty where none does."""
        labels = {each.name: each.label for each in model.inputs}
        parts = []
        for name in dict.fromkeys(name for _, name in self.dependences):
            terms = [spelled(term, model.joint.motion) for term, own in self.dependences if own == name]
            listed = terms[0] if len(terms) == 1 else ", ".join(terms[:-1]) + " and " + terms[-1]
            parts.append(f"{listed} depend{'s' * (len(terms) == 1)} on {labels.get(name, name)}")
        return ", ".join(parts)


def law_at_levels(model: JointModel) -> LevelLaw:
    """Return the terms that a model has at each level of its inputs, and which of them depend on one."""
    ids, dependences = [], []
    for term in model.terms:
        changes = changed_term(term.expression) if term.inputs else None
        ids.append(changes or term.id)
        dependences += [(changes, name) for name in term.inputs] if changes else []
    return LevelLaw(
        tuple(name for name in dict.fromkeys(ids) if name != INERTIA), tuple(dict.fromkeys(dependences))
    )


def vanishing(model: JointModel, law: LevelLaw) -> tuple[tuple[str, str], ...]:
    """Return terms of which the coefficient changes its sign over the tested range of an input, and that input."""
    tested = {each.name: each.tested for each in model.inputs if each.tested is not None}
    found = []
    for term, name in law.dependences:
        if name not in tested:
            continue
        ends = [model.at(**{name: value}) for value in tested[name]]
        low, high = (held[term] if term in held else None for held in ends)
        if low is None or high is None or low.coefficient * high.coefficient >= 0:
            continue
        if all(abs(each.coefficient) > SIGNS * each.standard_error for each in (low, high)):
            found.append((term, name))
    return tuple(found)


def changed_term(expression: sympy.Expr) -> str | None:
    """Return the term of the paper that a dependence is where its inputs stand still; None where it is none."""
    _, form = expression.as_independent(*variable_symbols(), as_Add=False)
    return _paper_forms().get(form)


@cache
def _paper_forms() -> dict[sympy.Expr, str]:
    return {term.expression: term.id for term in load_catalogue("paper")}
