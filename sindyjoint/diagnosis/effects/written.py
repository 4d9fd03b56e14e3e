"""A variant of an effect as it is written into a law: for a joint tested alone, and for one in a structure."""

from __future__ import annotations

from collections.abc import Mapping
from types import MappingProxyType
from typing import Any

from sindyjoint.diagnosis.effects.catalogue import Variant
from sindyjoint.equation.formula import variable_symbols


def written(
    variant: Variant, names: Mapping[str, str], given: Mapping[str, Any] = MappingProxyType({})
) -> tuple[list[Any], dict[str, Any]]:
    """Return the columns of a variant, and the rates of its states by name, as they stand in a law.

    A state z with a limit stops there: its rate is r·(1 − H(|z| − limit)·H(z·θ̇)), H being Heaviside's step.

    Parameters
    ----------
    variant : Variant
    names : mapping of str to str
        What its parameters and states are called in the law.
    given : mapping of str to sympy.Expr
        What stands for other symbols, such as the frequency.
    """
    from sympy import Abs, Heaviside, Symbol

    here = {
        s: Symbol(names[s.name], real=True, positive=s.is_positive) if s.name in names else given[s.name]
        for s in variant.symbols
        if s.name in names or s.name in given
    }
    _, omega, _ = variable_symbols()
    rates = {}
    for state in variant.states:
        rate = state.rate.xreplace(here)
        if state.limit is not None:
            z = Symbol(names[state.name], real=True)
            full = Heaviside(Abs(z) - state.limit.xreplace(here), 1) * Heaviside(z * omega, 0)
            rate = rate * (1 - full)
        rates[names[state.name]] = rate
    return [column.expression.xreplace(here) for column in variant.columns], rates
