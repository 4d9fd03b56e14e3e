"""Compiled forms of laws: one C signature, so that one compiled integrator serves every law.

``void law(double theta, double omega, double direction, const double *state, const double *parameters,
double *out)`` writes the moment to ``out[0]`` and the rates of the internal states behind it. Integrators call
it by address, so they are compiled once and cached; a new law costs only its few lines.
"""

from collections.abc import Callable
from dataclasses import dataclass
from functools import lru_cache
from typing import Any

import numpy as np
from llvmlite import ir
from numba import cfunc, njit, types
from numba.core.errors import NumbaError
from numpy.typing import NDArray

from sindyjoint.equation.evaluation import compile_terms
from sindyjoint.equation.internal_states import intrinsic, operated, pointer, program, shifted
from sindyjoint.errors import InputError
from sindyjoint.numeric import COARSE_DIFFERENCE, Array

#: ``f(theta, omega, direction, state, parameters, out)`` on scalars: writes the moment to ``out[0]`` and the rates
#: of the internal states to ``out[1:]``. It must be compilable by numba.
ScalarLaw = Callable[[float, float, float, Any, Any, Any], None]


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
    parts: tuple["CompiledLaw", ...] = ()

    @property
    def address(self) -> int:
        """Address of the C function."""
        return self.callback.address

    @property
    def places(self) -> NDArray[np.int64]:
        """Where the law's parameters stand among the numbers."""
        return np.arange(self.numbers.size) if self.own is None else self.own

    @property
    def parameters(self) -> Array:
        """Parameters of the law, in its order."""
        return self.numbers[self.places]


_pointer = types.CPointer(types.float64)
LAW_SIGNATURE = types.void(types.float64, types.float64, types.float64, _pointer, _pointer, _pointer)


@intrinsic
def integer_at(typingctx, base):
    """Return the integer whose bits stand where a pointer to numbers points to."""

    def codegen(context, builder, signature, args):
        return builder.bitcast(builder.load(args[0]), ir.IntType(64))

    return types.int64(base), codegen


@intrinsic
def stacked(typingctx, count):
    """Return a pointer to room for so many numbers, which is given back when the function returns.

    For functions that are called by address: in a loop that they were drawn into, the room would add up.
    """

    def codegen(context, builder, signature, args):
        return builder.alloca(ir.DoubleType(), size=args[0])

    return _pointer(types.intp), codegen


@intrinsic
def call_law(typingctx, address, theta, omega, direction, state, parameters, out):
    """Call a law through its address.

    An address kept as an integer, unlike a first-class function, lets numba cache the integrators on disk, and
    costs no more than the call itself.
    """
    signature = types.void(types.intp, *[types.float64] * 3, *[_pointer] * 3)

    def codegen(context, builder, signature, args):
        double = ir.DoubleType()
        kind = ir.FunctionType(ir.VoidType(), [double] * 3 + [double.as_pointer()] * 3)
        builder.call(builder.inttoptr(args[0], kind.as_pointer()), args[1:])
        return context.get_dummy_value()

    return signature, codegen


@njit(cache=True, nogil=True, error_model="numpy", no_cpython_wrapper=True, no_cfunc_wrapper=True)
def copied(count, source, target):
    """Fill so many numbers with others; both are pointers."""
    for i in range(count):
        target[i] = source[i]


@cfunc(LAW_SIGNATURE, cache=True, error_model="numpy")
def PAPER_CALLBACK(theta, omega, direction, state, parameters, out):  # noqa: N802
    """Five-term law (paper Eq. 6); parameters k1, k2, k3, c1, M_F."""
    elastic = theta * (parameters[0] + theta * (parameters[1] + theta * parameters[2]))
    out[0] = elastic + parameters[3] * omega + parameters[4] * direction


@njit(cache=True, nogil=True, no_cfunc_wrapper=True)
def evaluate_law(address, theta, omega, direction, state, parameters, out):
    """Fill `out`, shape (1 + n_states, n), with moment and state rates at n samples."""
    # Number by number, here and below: the assignment of a slice takes seconds to compile, for the text of an error.
    row = np.empty(out.shape[0])
    z = np.empty(max(state.shape[0], 1))
    arguments, results, numbers = pointer(z), pointer(row), pointer(parameters)
    for i in range(theta.size):
        for j in range(state.shape[0]):
            z[j] = state[j, i]
        call_law(address, theta[i], omega[i], direction[i], arguments, numbers, results)
        for j in range(row.size):
            out[j, i] = row[j]


@lru_cache(maxsize=256)
def callback_of(function: ScalarLaw) -> Any:
    """Compile a scalar law function, once whatever its parameters; InputError where numba cannot."""
    compiled = function if hasattr(function, "py_func") else njit(error_model="numpy")(function)

    def callback(theta, omega, direction, state, parameters, out):
        compiled(theta, omega, direction, state, parameters, out)

    try:
        return cfunc(LAW_SIGNATURE)(callback)
    except NumbaError as error:
        reason = str(error).strip().splitlines()[-1]
        name = getattr(function, "__name__", repr(function))
        raise InputError(
            f"the law function {name!r} cannot be compiled ({reason}); write it with scalar arithmetic, math "
            "functions and indexing of state, parameters and out only"
        ) from error


# In front of the numbers of both, by their bits: addresses of the laws, numbers of states and numbers of the first.
SUM_HEADER = 4


@cfunc(LAW_SIGNATURE, cache=True, error_model="numpy")
def SUM_CALLBACK(theta, omega, direction, state, parameters, out):  # noqa: N802, D103
    first, second = integer_at(parameters), integer_at(shifted(parameters, 1))
    n, p = integer_at(shifted(parameters, 2)), integer_at(shifted(parameters, 3))
    own = shifted(parameters, SUM_HEADER)
    call_law(second, theta, omega, direction, shifted(state, n), shifted(own, p), shifted(out, n))
    moment = out[n]
    # The second law's moment landed on the last state rate of the first one, which is written only now.
    call_law(first, theta, omega, direction, state, own, out)
    out[0] += moment


def sum_of(first: CompiledLaw, second: CompiledLaw) -> CompiledLaw:
    """Return the sum of two laws, states and parameters of the first one first; there is nothing to compile."""
    header = np.array([first.address, second.address, first.n_states, first.numbers.size], dtype=np.int64)
    end = SUM_HEADER + first.numbers.size
    return CompiledLaw(
        SUM_CALLBACK,
        np.concatenate([header.view(np.float64), first.numbers, second.numbers]),
        first.n_states + second.n_states,
        np.concatenate([SUM_HEADER + first.places, end + second.places]),
        (first, second),
    )


@njit(cache=True, nogil=True, error_model="numpy", no_cfunc_wrapper=True)
def _state_step(address, cubic, u, width, step, parameters, z, k, moved):
    """Fill `moved` with the states a share `width` of a step after `u` (Runge–Kutta, order 4); tell whether one stops.

    `cubic` is the angle over the step; one stops whose rate is zero at the end only: a slider at its limit.
    """
    n = z.shape[0]
    trial, out = np.empty(n), np.empty(1 + n)
    nodes = (0.0, 0.5, 0.5, 1.0)
    h = width * step
    for stage in range(4):
        at = u + nodes[stage] * width
        theta = cubic[0] + at * (cubic[1] + at * (cubic[2] + at * cubic[3]))
        omega = (cubic[1] + at * (2.0 * cubic[2] + 3.0 * at * cubic[3])) / step
        for j in range(n):
            trial[j] = z[j] + (nodes[stage] * h * k[stage - 1, j] if stage else 0.0)
        direction = 1.0 if omega > 0.0 else (-1.0 if omega < 0.0 else 0.0)
        call_law(address, theta, omega, direction, pointer(trial), pointer(parameters), pointer(out))
        for j in range(n):
            k[stage, j] = out[1 + j]
    stops = False
    for j in range(n):
        moved[j] = z[j] + h * (k[0, j] + 2.0 * k[1, j] + 2.0 * k[2, j] + k[3, j]) / 6.0
        stops = stops or (k[0, j] != 0.0 and (k[1, j] == 0.0 or k[2, j] == 0.0 or k[3, j] == 0.0))
    return stops


@njit(cache=True, nogil=True, error_model="numpy", no_cfunc_wrapper=True)
def integrate_states(address, angle, rate, parameters, step, substeps, state):
    """Fill `state`, shape (n_states, n), from its first column along a prescribed motion (Runge–Kutta, order 4).

    Between samples the angle is the cubic through angles and rates, and the rate its derivative. The instant at which a
    slider reaches its limit is found by halving, so that where it stops follows the motion without jumps.
    """
    n = state.shape[0]
    z, moved, k = state[:, 0].copy(), np.empty(n), np.zeros((4, n))
    cubic, stopped = np.empty(4), np.zeros(n, np.bool_)
    for i in range(angle.size - 1):
        d = angle[i + 1] - angle[i]
        v0, v1 = step * rate[i], step * rate[i + 1]
        cubic[:] = (angle[i], v0, 3.0 * d - 2.0 * v0 - v1, v0 + v1 - 2.0 * d)
        for part in range(substeps):
            u, width = part / substeps, 1.0 / substeps
            for _ in range(1 + n):
                if not _state_step(address, cubic, u, width, step, parameters, z, k, moved):
                    break
                low, high = 0.0, width
                # The step in which a slider reaches its limit is halved.
                for _ in range(30):
                    middle = (low + high) / 2
                    if _state_step(address, cubic, u, middle, step, parameters, z, k, moved):
                        high = middle
                    else:
                        low = middle
                _state_step(address, cubic, u, high, step, parameters, z, k, moved)
                for j in range(n):
                    stopped[j] = k[1, j] == 0.0 or k[2, j] == 0.0 or k[3, j] == 0.0
                _state_step(address, cubic, u, low, step, parameters, z, k, moved)
                for j in range(n):
                    # Just past its limit a slider stays there; the rest of the step is the others'.
                    z[j] = moved[j] + (2.0 * (high - low) * step * k[3, j] if stopped[j] else 0.0)
                u, width = u + high, width - high
            else:
                _state_step(address, cubic, u, width, step, parameters, z, k, moved)
            z[:] = moved
        state[:, i + 1] = z


def fastest_decay(address, angle, rate, direction, parameters, state):
    """Return the largest |∂ż/∂z| of the internal states along a motion, 1/s.

    The smaller one of the differences on either side: a slider that stops does not settle.
    """
    known = np.isfinite(state).all(axis=0)
    motion = angle[known], rate[known], direction[known]

    def rates(there):
        out = np.zeros((1 + len(there), there.shape[1]))
        evaluate_law(address, *motion, there, parameters, out)
        return out[1:]

    largest, own = 0.0, np.ascontiguousarray(state[:, known])
    middle = rates(own)
    for place, size in enumerate(np.abs(own).max(axis=1, initial=0.0)):
        step = COARSE_DIFFERENCE * size
        if not 0 < step < np.inf:
            continue
        nudge = step * np.eye(len(own))[:, [place]]
        sides = (np.abs(rates(own + sign * nudge)[place] - middle[place]) for sign in (-1.0, 1.0))
        with np.errstate(invalid="ignore"):  # rates without bound on both sides
            slope = np.minimum(*sides) / step
        largest = max(largest, float(slope[np.isfinite(slope)].max(initial=0.0)))
    return largest


Integers = NDArray[np.int64]


@lru_cache(maxsize=256)
def program_of_expressions(
    expressions: tuple[Any, ...], states: tuple[str, ...], parameters: tuple[str, ...]
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
        rates = [symbol for symbol in expression.free_symbols if symbol.name == "omega"]
        jumps = {sign(each): direction for each in rates}
        return expression.xreplace(jumps | {Heaviside(each): (1 + direction) / 2 for each in rates})

    arguments = ("theta", "omega", "direction", *states, *parameters)
    return program(compile_terms([directed(each) for each in expressions], arguments))


# Integers in front of the program, by their bits: numbers of states, of values, of constants, of operations.
HEADER = 4


@cfunc(LAW_SIGNATURE, cache=True, error_model="numpy")
def PROGRAM_CALLBACK(theta, omega, direction, state, parameters, out):  # noqa: N802, D103
    states, values = integer_at(parameters), integer_at(shifted(parameters, 1))
    known, count = values + integer_at(shifted(parameters, 2)), integer_at(shifted(parameters, 3))
    numbers = shifted(parameters, HEADER)
    plan = shifted(numbers, known)
    start = 3 + states + known
    registers = stacked(start + count)
    registers[0], registers[1], registers[2] = theta, omega, direction
    for i in range(states):
        registers[3 + i] = state[i]
    for i in range(known):
        registers[3 + states + i] = numbers[i]
    for row in range(count):
        operation = shifted(plan, 3 * row)
        first, second = integer_at(shifted(operation, 1)), integer_at(shifted(operation, 2))
        registers[start + row] = operated(integer_at(operation), registers[first], registers[second])
    outputs = shifted(plan, 3 * count)
    for i in range(1 + states):
        out[i] = registers[integer_at(shifted(outputs, i))]


def interpreted_law(
    program: tuple[Array, Integers, Integers], n_states: int, parameters: Array
) -> CompiledLaw:
    """Return a law of a program: moment and rates of its states, interpreted."""
    constants, operations, outputs = program
    plan = np.concatenate([operations.ravel(), outputs]).astype(np.int64)
    header = np.array([n_states, parameters.size, constants.size, len(operations)], dtype=np.int64)
    numbers = np.concatenate([header.view(np.float64), parameters, constants, plan.view(np.float64)])
    return CompiledLaw(PROGRAM_CALLBACK, numbers, n_states, HEADER + np.arange(parameters.size))
