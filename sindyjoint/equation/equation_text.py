"""The equation of a joint as one line of text, and as LaTeX."""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any

from sindyjoint.equation.element import Column, JointElement
from sindyjoint.equation.formula import formula_latex, formula_pretty, state_symbol
from sindyjoint.equation.model_parts import INERTIA, ModelTerm
from sindyjoint.record import Joint


def plain_equation(joint: Joint, terms: Sequence[ModelTerm], elements: Sequence[JointElement] = ()) -> str:
    """Return the equation as text; the rates of internal states, and their limits, stand behind it."""
    rotates = joint.motion == "rotation"
    parts = [_product(t.symbol, formula_pretty(t.expression, joint.motion), "·") for t in _ordered(terms)]
    if joint.inertia:
        parts.insert(0, "I·θ̈" if rotates else "m·ẍ")
    rates = []
    for each, written in zip(elements, numbered(elements), strict=True):
        columns, states = renamed(each, written)
        parts += [_product(c.symbol, formula_pretty(c.expression, joint.motion), "·") for c in columns]
        for name, rate, limit in states:
            bound = "" if limit is None else f" with |{name}| ≤ {formula_pretty(limit, joint.motion)}"
            rates.append(f"d{name}/dt = {formula_pretty(rate, joint.motion)}{bound}")
    left = "M" if rotates else "F"
    return "; ".join([f"{left} = {' + '.join(parts) or '0'}", *rates])


def latex_equation(joint: Joint, terms: Sequence[ModelTerm], elements: Sequence[JointElement] = ()) -> str:
    """Return the equation as LaTeX; the rates of internal states, and their limits, follow behind."""
    rotates = joint.motion == "rotation"

    def product(symbol: str, formula: str) -> str:
        return _product(latex_symbol(symbol), formula, r"\,")

    parts = [product(t.symbol, formula_latex(t.expression, joint.motion)) for t in _ordered(terms)]
    if joint.inertia:
        parts.insert(0, r"I\,\ddot{\theta}" if rotates else r"m\,\ddot{x}")
    rates = []
    for each, written in zip(elements, numbered(elements), strict=True):
        columns, states = renamed(each, written)
        parts += [product(c.symbol, formula_latex(c.expression, joint.motion)) for c in columns]
        for name, rate, limit in states:
            letter = latex_symbol(name)
            bound = "" if limit is None else rf",\ |{letter}| \leq {formula_latex(limit, joint.motion)}"
            rates.append(rf"\dot{{{letter}}} = {formula_latex(rate, joint.motion)}{bound}")
    left = "M" if rotates else "F"
    return r",\quad ".join([f"{left} = {' + '.join(parts) or '0'}", *rates])


def numbered(elements: Sequence[JointElement]) -> list[dict[str, str]]:
    """Return how the states of each element are written where several elements stand side by side: z1, z2."""
    count = Counter(state.name for element in elements for state in element.states)
    seen: Counter[str] = Counter()
    result = []
    for element in elements:
        names = {}
        for state in element.states:
            seen[state.name] += 1
            names[state.name] = f"{state.name}{seen[state.name]}" if count[state.name] > 1 else state.name
        result.append(names)
    return result


def renamed(
    element: JointElement, written: Mapping[str, str]
) -> tuple[list[Column], list[tuple[str, Any, Any]]]:
    """Return columns, and name, rate and limit of each state, with the states' names as they are written."""
    form, other = element.form, _renaming(written)
    columns = [replace(c, expression=c.expression.xreplace(other)) for c in form.columns]
    states = [
        (written[s.name], s.rate.xreplace(other), None if s.limit is None else s.limit.xreplace(other))
        for s in form.states
    ]
    return columns, states


def _renaming(written: Mapping[str, str]) -> dict[Any, Any]:
    return {state_symbol(name): state_symbol(new) for name, new in written.items()}


def _ordered(terms: Sequence[ModelTerm]) -> list[ModelTerm]:
    """Inertia first, as the field writes it."""
    return sorted(terms, key=lambda term: term.id != INERTIA)


def _product(symbol: str, formula: str, times: str) -> str:
    if formula == "1":
        return symbol
    # A formula that begins with a sign is not a factor as it stands.
    return f"{symbol}{times}({formula})" if formula.startswith("-") else f"{symbol}{times}{formula}"


def latex_symbol(symbol: str) -> str:
    r"""Return k1 as k_{1}, M_F as M_{F} and mu_a as \mu_{a}."""
    from sympy.core.alphabets import greeks

    head, _, tail = symbol.partition("_")
    if not tail and len(head) > 1 and head not in greeks:
        head, tail = head[0], head[1:]
    head, tail = (f"\\{part}" if part in greeks else part for part in (head, tail))
    return f"{head}_{{{tail}}}" if tail else head
