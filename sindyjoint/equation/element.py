"""Elements of a joint's law beside its terms: moments with internal states, such as a slider or a Maxwell branch."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property, lru_cache
from types import MappingProxyType
from typing import TYPE_CHECKING, Annotated, Any, ClassVar

import numpy as np
from numpy.typing import ArrayLike

from sindyjoint.equation.formula import compile_terms, parse_formula, variable_symbols
from sindyjoint.numeric import Array
from sindyjoint.plain import SOME, Line, Size, same

if TYPE_CHECKING:
    import sympy


@dataclass(frozen=True)
class Column:
    """A moment that stands in a law times a coefficient."""

    WRITTEN: ClassVar = same("symbol", "formula", "unit", "positive")
    symbol: Line
    formula: Line
    unit: Line
    positive: bool = False
    expression: Any = field(repr=False, default=None)


@dataclass(frozen=True)
class State:
    """An internal state: its rate, and the value that it cannot pass."""

    name: str
    unit: str
    rate: sympy.Expr = field(repr=False)
    limit: sympy.Expr | None = field(repr=False, default=None)


class Form:
    """Formulas with internal states, whatever their numbers: what simulations and regressions are made of."""

    columns: tuple[Column, ...]
    states: tuple[State, ...]

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the nonlinear parameters."""
        raise NotImplementedError

    @property
    def uses(self) -> set[str]:
        """Names of all that its columns are made of."""
        return {symbol.name for column in self.columns for symbol in column.expression.free_symbols}

    @property
    def arguments(self) -> tuple[str, ...]:
        """Names of what its columns and rates are functions of, in order."""
        return ("theta", "omega", *(state.name for state in self.states), *self.names)

    @property
    def symbols(self) -> set[Any]:
        """Symbols of its columns, and of the rates and limits of its states."""
        formulas = [c.expression for c in self.columns]
        formulas += [f for state in self.states for f in (state.rate, state.limit) if f is not None]
        return {symbol for formula in formulas for symbol in formula.free_symbols}

    @cached_property
    def _limit_function(self) -> Any:
        return compile_terms([s.limit for s in self.states if s.limit is not None], self.names)

    @cached_property
    def state_program(self) -> Any:
        """The rates of the states as numbered operations; see :mod:`sindyjoint.equation.internal_states`."""
        from sindyjoint.equation.internal_states import state_program

        rates = compile_terms([state.rate for state in self.states], self.arguments)
        return state_program(rates, len(self.states))

    def limits(self, values: Array) -> Array:
        """Return the values that the states cannot pass, infinite where there are none, shape (n_states,)."""
        limits = np.full(len(self.states), np.inf)
        known = [state.limit is not None for state in self.states]
        if any(known):
            limits[known] = self._limit_function(*values)[0]
        return limits

    def written(
        self, names: Mapping[str, str], given: Mapping[str, Any] = MappingProxyType({})
    ) -> tuple[list[Any], dict[str, Any]]:
        """Return the columns, and the rates of the states by name, as they stand in a law.

        A state z with a limit stops there: its rate is r·(1 − H(|z| − limit)·H(z·θ̇)), H being Heaviside's step.

        Parameters
        ----------
        names : mapping of str to str
            What parameters and states are called in the law.
        given : mapping of str to sympy.Expr
            What stands for other symbols, such as the frequency.
        """
        from sympy import Abs, Heaviside, Symbol

        pairs = {
            s: Symbol(names[s.name], real=True, positive=s.is_positive) if s.name in names else given[s.name]
            for s in self.symbols
            if s.name in names or s.name in given
        }
        here = frozenset(pairs.items())
        _, omega, _ = variable_symbols()
        rates = {}
        for state in self.states:
            rate = _renamed(state.rate, here)
            if state.limit is not None:
                z = Symbol(names[state.name], real=True)
                full = Heaviside(Abs(z) - _renamed(state.limit, here), 1) * Heaviside(z * omega, 0)
                rate = rate * (1 - full)
            rates[names[state.name]] = rate
        return [_renamed(column.expression, here) for column in self.columns], rates


@lru_cache(maxsize=512)
def _renamed(expression: sympy.Expr, pairs: frozenset[tuple[Any, Any]]) -> Any:
    """Return an expression with other symbols; SymPy takes long over a minimum, and a fit asks thousands of times."""
    return expression.xreplace(dict(pairs))


_CERTAINTY = same("unit", "standard_error", "interval95")


@dataclass(frozen=True)
class Value:
    """A number of an element and how sure it is.

    Parameters
    ----------
    name : str
        Symbol of a coefficient, or name of a nonlinear parameter.
    value, standard_error : float
        SI.
    interval95 : tuple of float
    unit : str
        For this joint's kind of motion.
    formula : str
        Of a coefficient: the moment that it is the factor of; empty for a nonlinear parameter.
    """

    name: str
    value: float
    standard_error: Size
    interval95: tuple[float, float]
    unit: str
    formula: str = ""

    def renewed(self, value: float, error: float) -> Value:
        """Return it with another value and standard error; the interval is ±1.96 of these."""
        ends = (value - 1.96 * error, value + 1.96 * error)
        return replace(self, value=value, standard_error=error, interval95=ends)


@dataclass(frozen=True)
class ElementState:
    """An internal state as text: its rate, and the value that it cannot pass, in the catalogues' syntax."""

    name: Line
    unit: Line
    rate: Line
    limit: Line | None = None


@dataclass(frozen=True, eq=False)
class _ParsedForm(Form):
    columns: tuple[Column, ...]
    states: tuple[State, ...]
    parameters: tuple[str, ...]

    @property
    def names(self) -> tuple[str, ...]:
        return self.parameters


@dataclass(frozen=True)
class JointElement:
    """A part of a joint's law that has a memory: Σ coefficient · column(θ, θ̇, z), ż = rate(θ̇, z), |z| ≤ limit.

    Parameters
    ----------
    id : str
        Of the element, unique in its model.
    effect : str
        Id in the catalogue of effects.
    symbol, name : str
    columns : tuple of Value
        Moments with their coefficients.
    parameters : tuple of Value
        Nonlinear parameters.
    states : tuple of ElementState
    signals : tuple of str
        What its formulas may be made of beside angle, rate, parameters and states.
    """

    WRITTEN: ClassVar = {
        **same("id", "effect", "symbol", "name"),
        "columns": (
            "columns",
            {"symbol": "name", "formula": "formula", "coefficient": "value", **_CERTAINTY},
        ),
        "parameters": ("parameters", {**same("name", "value"), **_CERTAINTY}),
        "states": "states",
    }
    id: str
    effect: str
    symbol: str
    name: str
    columns: Annotated[tuple[Value, ...], SOME]
    parameters: tuple[Value, ...]
    states: tuple[ElementState, ...]
    signals: tuple[str, ...] = field(default=(), compare=False)

    @property
    def numbers(self) -> tuple[Value, ...]:
        """Coefficients of its columns, then nonlinear parameters."""
        return (*self.columns, *self.parameters)

    @property
    def coefficients(self) -> Array:
        """Coefficients of the columns, SI."""
        return np.array([column.value for column in self.columns])

    @property
    def values(self) -> Array:
        """Nonlinear parameters, SI."""
        return np.array([parameter.value for parameter in self.parameters])

    @property
    def form(self) -> Form:
        """Its formulas."""
        return _parsed(
            tuple((c.name, c.formula, c.unit) for c in self.columns),
            tuple(p.name for p in self.parameters),
            self.states,
            self.signals,
        )

    def with_numbers(self, numbers: Sequence[tuple[float, float]]) -> JointElement:
        """Return the element with other values and standard errors of its :attr:`numbers`."""
        later = tuple(old.renewed(*new) for old, new in zip(self.numbers, numbers, strict=True))
        count = len(self.columns)
        return replace(self, columns=later[:count], parameters=later[count:])

    def along(self, angle: ArrayLike, rate: ArrayLike, step: float, rest: float = 0.0) -> Array:
        """Return its moment along a motion, shape (n,), N·m (N).

        Parameters
        ----------
        angle, rate : array_like, shape (n,)
            rad, rad/s, evenly spaced.
        step : float
            s between samples.
        rest : float
            Angle from which the joint came to the first sample, rad: there its sliders are in their middle.
        """
        return np.asarray(self.columns_along(angle, rate, step, rest) @ self.coefficients)

    def columns_along(self, angle: ArrayLike, rate: ArrayLike, step: float, rest: float = 0.0) -> Array:
        """Return its columns without their coefficients along such a motion, shape (n, n_columns)."""
        theta, omega = (np.asarray(x, dtype=np.float64) for x in (angle, rate))
        return self.columns_of([(theta, omega, step, rest)])[0]

    def columns_of(self, motions: Sequence[tuple[Array, Array, float, float]]) -> list[Array]:
        """Return the same along several motions, each an angle, a rate, a step, a rest: they are integrated at once."""
        form, values = self.form, self.values
        states = states_along(form, values, motions)
        theta, omega = (np.concatenate([motion[k] for motion in motions]) for k in (0, 1))
        columns = compile_terms([c.expression for c in form.columns], form.arguments)
        found = np.asarray(columns(theta, omega, *states, *map(float, values)))
        return np.split(found, np.cumsum([motion[0].size for motion in motions])[:-1])


def states_along(
    form: Form, values: Array, motions: Sequence[tuple[Array, Array, float, float]], passes: int = 1
) -> Array:
    """Return the internal states of a form along motions, one after the other, in the last of so many passes.

    Shape (n_states, samples of all).
    """
    from sindyjoint.equation.internal_states import integrate_runs

    angles, rates, steps, rests = zip(*motions, strict=True)
    if not form.states:
        return np.empty((0, sum(each.size for each in angles)))
    parameters, count = np.array(values, dtype=np.float64), len(motions)
    # Four parts of a step: a reversal within one is then placed well enough.
    first = np.array([angle[0] for angle in angles]) - rests
    timing = np.array(steps), np.full(count, passes), np.full(count, 4), first
    integrate: Any = integrate_runs
    return integrate(
        np.concatenate(angles), np.concatenate(rates), np.cumsum([each.size for each in angles]), timing,
        parameters, form.limits(parameters), form.state_program,
    )  # fmt: skip


@lru_cache(maxsize=256)
def _parsed(
    columns: tuple[tuple[str, str, str], ...],
    names: tuple[str, ...],
    states: tuple[ElementState, ...],
    signals: tuple[str, ...],
) -> Form:
    inner = [state.name for state in states]
    return _ParsedForm(
        tuple(
            Column(symbol, formula, unit, False, parse_formula(formula, names, [*inner, *signals]))
            for symbol, formula, unit in columns
        ),
        tuple(
            State(
                state.name,
                state.unit,
                parse_formula(state.rate, names, [*inner, *signals]),
                None if state.limit is None else parse_formula(state.limit, names),
            )
            for state in states
        ),
        names,
    )
