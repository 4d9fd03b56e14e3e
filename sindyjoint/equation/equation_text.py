"""The equation of a joint as one line of text, and as LaTeX."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Mapping, Sequence
from typing import Any

from sindyjoint.equation.element import JointElement
from sindyjoint.equation.formula import formula_latex, formula_pretty, state_symbol
from sindyjoint.equation.model_parts import INERTIA, ModelTerm
from sindyjoint.record import Joint


def plain_equation(joint: Joint, terms: Sequence[ModelTerm], elements: Sequence[JointElement] = ()) -> str:
    """Return the equation as text; the rates of internal states, and their limits, stand behind it."""
    rotates = joint.motion == "rotation"
    parts = [_product(t.symbol, formula_pretty(t.expression, joint.motion), "·") for t in _ordered(terms)]
    if joint.inertia is not None:
        parts.insert(0, "I·θ̈" if rotates else "m·ẍ")
    rates = []
    for each, written in zip(elements, numbered(elements), strict=True):
        parts += _columns(each, written, lambda symbol, f: _product(symbol, f, "·"), _pretty(joint.motion))
        for name, rate, limit in _states(each, written):
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
    if joint.inertia is not None:
        parts.insert(0, r"I\,\ddot{\theta}" if rotates else r"m\,\ddot{x}")
    rates = []
    for each, written in zip(elements, numbered(elements), strict=True):
        parts += _columns(each, written, product, _latex(joint.motion))
        for name, rate, limit in _states(each, written):
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


def _states(element: JointElement, written: Mapping[str, str]) -> list[tuple[str, Any, Any]]:
    form, renamed = element.form, _renaming(written)
    return [
        (
            written[state.name],
            state.rate.xreplace(renamed),
            None if state.limit is None else state.limit.xreplace(renamed),
        )
        for state in form.states
    ]


def _columns(
    element: JointElement,
    written: Mapping[str, str],
    product: Callable[[str, str], str],
    formula: Callable[[Any], str],
) -> list[str]:
    renamed = _renaming(written)
    return [product(c.symbol, formula(c.expression.xreplace(renamed))) for c in element.form.columns]


def _renaming(written: Mapping[str, str]) -> dict[Any, Any]:
    return {state_symbol(name): state_symbol(new) for name, new in written.items()}


def _pretty(motion: str) -> Callable[[Any], str]:
    return lambda expression: formula_pretty(expression, motion)


def _latex(motion: str) -> Callable[[Any], str]:
    return lambda expression: formula_latex(expression, motion)


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
