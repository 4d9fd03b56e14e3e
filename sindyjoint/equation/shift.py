"""What a shift of the angle's zero makes of terms: those of a Taylor series turn into each other."""

from __future__ import annotations

from collections.abc import Sequence
from functools import cache
from typing import TYPE_CHECKING

from sindyjoint.equation.symbols import variable_symbols

if TYPE_CHECKING:
    import sympy


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
