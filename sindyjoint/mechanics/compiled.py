"""Laws in the one C signature that lets one compiled integrator serve every law, and what is done with them."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from ctypes import c_double, c_int64
from dataclasses import dataclass
from functools import lru_cache
from typing import Any

import numpy as np
from numpy.typing import NDArray

from sindyjoint.equation.evaluation import Integers, compile_terms, program
from sindyjoint.machine_code import Entry
from sindyjoint.numeric import COARSE_DIFFERENCE, Array

#: ``f(theta, omega, direction, state, parameters, out)`` on scalars: writes the moment to ``out[0]`` and the rates
#: of the internal states to ``out[1:]``. It must be compilable by numba.
ScalarLaw = Callable[[float, float, float, Any, Any, Any], None]

LAW = (c_double, c_double, c_double, None, None, None)
PAPER, SUM, PROGRAM = (Entry(name, *LAW) for name in ("paper law", "sum of laws", "program"))
_EVALUATE = Entry("evaluate law", c_int64, *[None] * 6, c_int64, c_int64)
_INTEGRATE = Entry("integrate states", c_int64, None, None, None, c_double, *[c_int64] * 3, None, None)
_RUN = Entry("integrate run", c_int64, *[None] * 13)
# How the simulation of a run ends.
DONE, LIMIT, NOT_FINITE, STEP_TOO_SMALL, TOO_MANY_STEPS, ACTIVE_FRICTION = range(6)


@dataclass(frozen=True)
class CompiledLaw:
    """A law as the integrators call it: a C function and the numbers it reads.

    Parameters
    ----------
    callback : object
        The C callback. Held here so that its address stays valid.
    numbers : ndarray
        What the function reads: the law's parameters, and what a general function needs to know of a law beside them.
    n_states : int
    own : ndarray of int, optional
        Where among the numbers the law's parameters stand. Default: all are parameters.
    parts : tuple of CompiledLaw
        Laws whose functions it calls, for they must stay, too.
    """

    callback: Any
    numbers: Array
    n_states: int
    own: NDArray[np.int64] | None = None
    parts: tuple[CompiledLaw, ...] = ()

    @property
    def address(self) -> int:
        """Address of the C function."""
        return int(self.callback.address)

    @property
    def places(self) -> NDArray[np.int64]:
        """Where the law's parameters stand among the numbers."""
        return np.arange(self.numbers.size) if self.own is None else self.own

    @property
    def parameters(self) -> Array:
        """Parameters of the law, in its order."""
        return self.numbers[self.places]


def evaluate_law(address: int, motion: tuple[Array, Array, Array], state: Array, parameters: Array) -> Array:
    """Return moment and state rates, shape (1 + n_states, n), at n samples of angle, rate and direction."""
    theta, omega, direction, z, numbers = (
        np.ascontiguousarray(each, dtype=np.float64) for each in (*motion, state, parameters)
    )
    out = np.empty((1 + len(z), theta.size))
    _EVALUATE(address, theta, omega, direction, z, numbers, out, len(z), theta.size)
    return out


def integrate_states(
    address: int, motion: tuple[Array, Array], parameters: Array, step: float, substeps: int, state: Array
) -> None:
    """Fill `state`, shape (n_states, n), from its first column along a prescribed motion (Runge–Kutta, order 4).

    Between samples the angle is the cubic through angles and rates, and the rate its derivative. The instant at which a
    slider reaches its limit is found by halving, so that where it stops follows the motion without jumps.
    """
    n, samples = state.shape
    angle, rate, numbers = (np.ascontiguousarray(each, dtype=np.float64) for each in (*motion, parameters))
    _INTEGRATE(address, angle, rate, numbers, step, substeps, n, samples, state, np.empty(9 * n + 5))


def integrate_run(
    address: int, counts: Sequence[int], numbers: Sequence[float], arrays: Sequence[Array]
) -> tuple[int, float, int]:
    """Integrate one run, fill its samples, and return status, time reached and steps taken.

    Parameters
    ----------
    address : int
        Of the law; zero means the paper's five-term law.
    counts : sequence of int
        States, samples, pieces of the excitation, whether it is periodic, whether it is smooth, most steps.
    numbers : sequence of float
        Inertia, step, scale and ramp of the excitation, sampling step, rtol, largest step, lowest and highest angle.
    arrays : sequence of ndarray, all contiguous
        What the law reads; pieces, shape (count, 4); angle, rate and states at time zero; values below which no
        relative accuracy is asked for (overwritten); then filled: angle, rate, acceleration, each of shape
        (n_samples,), states, shape (n_states, n_samples), and where it sticks, int8.
    """
    p, pieces, y, sizes, *filled = arrays
    ended, room = np.empty(3), np.zeros(11 * counts[0] + 6)
    _RUN(
        address,
        np.array(counts, dtype=np.int64),
        np.array(numbers),
        p,
        pieces,
        y,
        sizes,
        room,
        *filled,
        ended,
    )
    return int(ended[0]), float(ended[1]), int(ended[2])


def sum_of(first: CompiledLaw, second: CompiledLaw) -> CompiledLaw:
    """Return the sum of two laws, states and parameters of the first one first; there is nothing to compile."""
    # In front of the numbers of both, by their bits: addresses, numbers of states and numbers of the first.
    header = np.array([first.address, second.address, first.n_states, first.numbers.size], dtype=np.int64)
    end = header.size + first.numbers.size
    return CompiledLaw(
        SUM,
        np.concatenate([header.view(np.float64), first.numbers, second.numbers]),
        first.n_states + second.n_states,
        np.concatenate([header.size + first.places, end + second.places]),
        (first, second),
    )


def fastest_decay(address: int, motion: tuple[Array, Array, Array], parameters: Array, state: Array) -> float:
    """Return the largest |∂ż/∂z| of the internal states along a motion, 1/s.

    The smaller one of the differences on either side: a slider that stops does not settle.
    """
    known = np.isfinite(state).all(axis=0)
    there = motion[0][known], motion[1][known], motion[2][known]

    largest, own = 0.0, np.ascontiguousarray(state[:, known])
    middle = evaluate_law(address, there, own, parameters)[1:]
    for place, size in enumerate(np.abs(own).max(axis=1, initial=0.0)):
        step = COARSE_DIFFERENCE * size
        if not 0 < step < np.inf:
            continue
        sides = []
        for sign in (-1.0, 1.0):
            moved = own.copy()
            moved[place] += sign * step
            rates = evaluate_law(address, there, moved, parameters)[1:]
            sides.append(np.abs(rates[place] - middle[place]))
        slope = np.minimum(*sides) / step
        largest = max(largest, float(slope[np.isfinite(slope)].max(initial=0.0)))
    return largest


@lru_cache(maxsize=256)
def program_of_expressions(
    expressions: tuple, states: tuple[str, ...], parameters: tuple[str, ...]
) -> tuple[Array, Integers, Integers]:
    """Return the program of sympy expressions (moment, then state rates); ``sign(omega)`` is the direction of slip.

    Raises
    ------
    FormulaError
        For a function that formulas do not have.
    """
    from sympy import Heaviside, Symbol, sign

    direction = Symbol("direction", real=True)

    def directed(expression: Any) -> Any:
        jumps: dict[Any, Any] = {}
        for symbol in expression.free_symbols:
            if symbol.name == "omega":
                jumps |= {sign(symbol): direction, Heaviside(symbol): (1 + direction) / 2}
        return expression.xreplace(jumps)

    arguments = ("theta", "omega", "direction", *states, *parameters)
    return program(compile_terms([directed(each) for each in expressions], arguments))


def interpreted_law(
    program: tuple[Array, Integers, Integers], n_states: int, parameters: Array
) -> CompiledLaw:
    """Return a law of a program: moment and rates of its states, interpreted."""
    constants, operations, outputs = program
    plan = np.concatenate([operations.ravel(), outputs]).astype(np.int64)
    # In front of the program, by their bits: numbers of states, of values, of constants, of operations.
    header = np.array([n_states, parameters.size, constants.size, len(operations)], dtype=np.int64)
    numbers = np.concatenate([header.view(np.float64), parameters, constants, plan.view(np.float64)])
    return CompiledLaw(PROGRAM, numbers, n_states, header.size + np.arange(parameters.size))
