"""A law made of formulas that needs no compilation: one compiled callback interprets the operations of any formula.

Naming an effect in a structure simulates dozens of laws, each a few times. Compiling each of them would cost more
than all the simulations; here a law's operations travel among its parameters.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import TYPE_CHECKING, Any

import numpy as np
from numba import carray, cfunc, njit
from numpy.typing import ArrayLike, NDArray

from sindyjoint.equation.evaluation import compile_terms
from sindyjoint.equation.internal_states import program, run_program
from sindyjoint.mechanics.kernels import LAW_SIGNATURE, evaluate_law
from sindyjoint.mechanics.laws import CompiledLaw

if TYPE_CHECKING:
    import sympy

Array = NDArray[np.float64]

# Numbers in front of the program: of states, of values, of constants, of operations.
HEADER = 4


@njit(cache=True, error_model="numpy")
def program_law(theta, omega, direction, state, parameters, out):
    """Moment and rates of the states; pointers to states and results, `parameters` as :func:`packed` makes them."""
    head = carray(parameters, HEADER)
    states, values, constants, count = int(head[0]), int(head[1]), int(head[2]), int(head[3])
    known = values + constants
    whole = carray(parameters, HEADER + known + 3 * count + 1 + states)
    # The bits of these numbers are integers: operations of three numbers each, then the registers of the results.
    plan = whole[HEADER + known :].view(np.int64)
    operations = plan[: 3 * count].reshape(count, 3)
    start = 3 + states + known
    registers = np.empty(start + count)
    registers[0], registers[1], registers[2] = theta, omega, direction
    z, results = carray(state, max(states, 1)), carray(out, 1 + states)
    for i in range(states):
        registers[3 + i] = z[i]
    registers[3 + states : start] = whole[HEADER : HEADER + known]
    run_program(registers, start, operations)
    for i in range(1 + states):
        results[i] = registers[plan[3 * count + i]]


@cfunc(LAW_SIGNATURE, cache=True, error_model="numpy")
def PROGRAM_CALLBACK(theta, omega, direction, state, parameters, out):  # noqa: N802, D103
    program_law(theta, omega, direction, state, parameters, out)


def packed(states: int, values: Array, constants: Array, operations: Array, outputs: Array) -> Array:
    """Return one array of numbers that holds a program and the values of its parameters."""
    plan = np.concatenate([operations.ravel(), outputs]).astype(np.int64)
    head = np.array([states, values.size, constants.size, len(operations)], dtype=np.float64)
    return np.concatenate([head, values, constants, plan.view(np.float64)])


@dataclass(frozen=True, eq=False)
class ProgramLaw:
    """A law written as sympy expressions, like :class:`~sindyjoint.mechanics.laws.FormulaLaw`, but interpreted.

    Parameters
    ----------
    expression : sympy.Expr
        Transfer moment, N·m, in ``theta``, ``omega``, the states and the parameters; ``sign(omega)`` is set-valued at
        rest.
    parameters : mapping of str to float
    state_rates : mapping of str to sympy.Expr
    softening_limit : (float, float)

    Examples
    --------
    >>> from sympy import Symbol, sign
    >>> c, w = Symbol("c"), Symbol("omega")
    >>> ProgramLaw(c * w + 2 * sign(w), {"c": 3.0}).moment([0.0], [0.0], [-1.0])
    array([-2.])
    """

    expression: sympy.Expr
    parameters: Mapping[str, float] = field(default_factory=dict)
    state_rates: Mapping[str, sympy.Expr] = field(default_factory=dict)
    softening_limit: tuple[float, float] = (-np.inf, np.inf)
    inertia: float = 0.0
    _plan: tuple[Any, ...] | None = field(default=None, repr=False)

    def __post_init__(self) -> None:
        if self._plan is None:
            object.__setattr__(self, "_plan", self._compiled_plan())

    def _compiled_plan(self) -> tuple[Any, ...]:
        from sympy import Symbol, sign

        def directed(expression: Any) -> Any:
            rates = {s for s in expression.free_symbols if s.name == "omega"}
            return expression.xreplace({sign(s): Symbol("direction", real=True) for s in rates})

        arguments = ("theta", "omega", "direction", *self.state_rates, *self.parameters)
        expressions = [directed(e) for e in (self.expression, *self.state_rates.values())]
        return program(compile_terms(expressions, arguments))

    @property
    def n_states(self) -> int:
        """Number of internal states."""
        return len(self.state_rates)

    def with_parameters(self, values: Mapping[str, float]) -> ProgramLaw:
        """Return the same formulas with other values of some parameters."""
        return replace(self, parameters={**self.parameters, **values})

    @cached_property
    def _packed(self) -> Array:
        assert self._plan is not None
        constants, operations, outputs = self._plan
        values = np.array([*self.parameters.values()], dtype=np.float64)
        return packed(self.n_states, values, constants, operations, outputs)

    def compiled(self) -> CompiledLaw:
        """Compiled form, shared by all formulas."""
        return CompiledLaw(program_law, PROGRAM_CALLBACK, self._packed, self.n_states)

    def _evaluate(self, angle: ArrayLike, rate: ArrayLike, direction: ArrayLike, state: Any) -> Array:
        theta, omega, s = np.broadcast_arrays(
            *(np.atleast_1d(np.asarray(x, float)) for x in (angle, rate, direction))
        )
        z = np.zeros((self.n_states, theta.size)) if state is None else np.array(state, dtype=np.float64)
        out = np.empty((1 + self.n_states, theta.size))
        law = self.compiled()
        evaluate_law(
            law.address, theta.ravel(), omega.ravel(), s.ravel(), z.reshape(self.n_states, theta.size),
            law.parameters, out,
        )  # fmt: skip
        return out.reshape(1 + self.n_states, *theta.shape)

    def moment(self, angle: ArrayLike, rate: ArrayLike, direction: ArrayLike, state: Any = None) -> Array:
        """Transfer moment, N·m."""
        return self._evaluate(angle, rate, direction, state)[0]

    def state_rate(self, angle: ArrayLike, rate: ArrayLike, direction: ArrayLike, state: Any = None) -> Array:
        """Rates of the internal states, shape (n_states, n)."""
        return self._evaluate(angle, rate, direction, state)[1:]
