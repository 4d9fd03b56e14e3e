"""Compiled forms of laws: one C signature, so that one compiled integrator serves every law.

``void law(double theta, double omega, double direction, const double *state, const double *parameters,
double *out)`` writes the moment to ``out[0]`` and the rates of the internal states behind it. Integrators call
it by address, so they are compiled once and cached; a new law costs only its few lines.
"""

from functools import lru_cache
from typing import Any

import numpy as np
from llvmlite import ir
from numba import cfunc, njit, types
from numba.core.errors import NumbaError
from numpy.typing import NDArray

from sindyjoint.equation.operations import integer_at, intrinsic, operated, shifted, stacked
from sindyjoint.errors import InputError
from sindyjoint.mechanics.compiled import CompiledLaw, ScalarLaw

HALVINGS = 30  # of a step in which a slider reaches its limit
_pointer = types.CPointer(types.float64)
LAW_SIGNATURE = types.void(types.float64, types.float64, types.float64, _pointer, _pointer, _pointer)


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


def _paper_law(theta, omega, direction, state, parameters, out):
    """Five-term law (paper Eq. 6); parameters k1, k2, k3, c1, M_F."""
    elastic = theta * (parameters[0] + theta * (parameters[1] + theta * parameters[2]))
    out[0] = elastic + parameters[3] * omega + parameters[4] * direction


def _evaluate_law(address, theta, omega, direction, state, parameters, out, states, samples):
    z, row = stacked(states), stacked(1 + states)
    for i in range(samples):
        for j in range(states):
            z[j] = state[j * samples + i]
        call_law(address, theta[i], omega[i], direction[i], z, parameters, row)
        for j in range(1 + states):
            out[j * samples + i] = row[j]


@lru_cache(maxsize=256)
def _compile(function: ScalarLaw) -> Any:
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


def compile_scalar_law(function: ScalarLaw, parameters: NDArray[np.float64], n_states: int) -> CompiledLaw:
    """Compile a scalar law function; the same function is compiled once whatever its parameters.

    Raises
    ------
    InputError
        When numba cannot compile the function.
    """
    return CompiledLaw(_compile(function), np.array(parameters, dtype=np.float64), n_states)


SUM_HEADER, HEADER = 4, 4  # numbers in front of what a law reads; see sindyjoint.mechanics.compiled


def _sum_of_laws(theta, omega, direction, state, parameters, out):
    first, second = integer_at(parameters), integer_at(shifted(parameters, 1))
    n, p = integer_at(shifted(parameters, 2)), integer_at(shifted(parameters, 3))
    own = shifted(parameters, SUM_HEADER)
    call_law(second, theta, omega, direction, shifted(state, n), shifted(own, p), shifted(out, n))
    moment = out[n]
    # The second law's moment landed on the last state rate of the first one, which is written only now.
    call_law(first, theta, omega, direction, state, own, out)
    out[0] += moment


@njit(cache=True, nogil=True, error_model="numpy", no_cfunc_wrapper=True, no_cpython_wrapper=True)
def _state_step(address, cubic, u, width, step, parameters, n, room):
    """Fill `moved` with the states a share `width` of a step after `u` (Runge–Kutta, order 4); tell whether one stops.

    `cubic` is the angle over the step; one stops whose rate is zero at the end only: a slider at its limit.
    """
    z, moved, k, trial, out = room
    nodes = (0.0, 0.5, 0.5, 1.0)
    h = width * step
    for stage in range(4):
        at = u + nodes[stage] * width
        theta = cubic[0] + at * (cubic[1] + at * (cubic[2] + at * cubic[3]))
        omega = (cubic[1] + at * (2.0 * cubic[2] + 3.0 * at * cubic[3])) / step
        for j in range(n):
            trial[j] = z[j] + (nodes[stage] * h * k[(stage - 1) * n + j] if stage else 0.0)
        direction = 1.0 if omega > 0.0 else (-1.0 if omega < 0.0 else 0.0)
        call_law(address, theta, omega, direction, trial, parameters, out)
        for j in range(n):
            k[stage * n + j] = out[1 + j]
    stops = False
    for j in range(n):
        k0, k1, k2, k3 = k[j], k[n + j], k[2 * n + j], k[3 * n + j]
        moved[j] = z[j] + h * (k0 + 2.0 * k1 + 2.0 * k2 + k3) / 6.0
        stops = stops or (k0 != 0.0 and (k1 == 0.0 or k2 == 0.0 or k3 == 0.0))
    return stops


def _integrate_states(address, angle, rate, parameters, step, substeps, n, samples, state, room):
    # Seven numbers of each state, a law's answer behind them, and which states stopped.
    z, moved, k = room, shifted(room, n), shifted(room, 2 * n)
    held = (z, moved, k, shifted(room, 6 * n), shifted(room, 7 * n))
    stopped = shifted(room, 8 * n + 1)
    for j in range(n):
        z[j] = state[j * samples]
        stopped[j] = 0.0
    for i in range(samples - 1):
        d = angle[i + 1] - angle[i]
        v0, v1 = step * rate[i], step * rate[i + 1]
        cubic = (angle[i], v0, 3.0 * d - 2.0 * v0 - v1, v0 + v1 - 2.0 * d)
        for part in range(substeps):
            u, width = part / substeps, 1.0 / substeps
            for _ in range(1 + n):
                if not _state_step(address, cubic, u, width, step, parameters, n, held):
                    break
                low, high = 0.0, width
                for _ in range(HALVINGS):
                    middle = (low + high) / 2
                    if _state_step(address, cubic, u, middle, step, parameters, n, held):
                        high = middle
                    else:
                        low = middle
                _state_step(address, cubic, u, high, step, parameters, n, held)
                for j in range(n):
                    still = k[n + j] == 0.0 or k[2 * n + j] == 0.0 or k[3 * n + j] == 0.0
                    stopped[j] = 1.0 if still else 0.0
                _state_step(address, cubic, u, low, step, parameters, n, held)
                for j in range(n):
                    # Just past its limit a slider stays there; the rest of the step is the others'.
                    beyond = 2.0 * (high - low) * step * k[3 * n + j]
                    z[j] = moved[j] + (beyond if stopped[j] != 0.0 else 0.0)
                u, width = u + high, width - high
            else:
                _state_step(address, cubic, u, width, step, parameters, n, held)
            for j in range(n):
                z[j] = moved[j]
        for j in range(n):
            state[j * samples + i + 1] = z[j]


def _program(theta, omega, direction, state, parameters, out):
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


#: Functions, signatures and options by the names that :mod:`sindyjoint.mechanics.compiled` calls them by.
ENTRIES: dict[str, Any] = {
    "paper law": (_paper_law, LAW_SIGNATURE, {}),
    "sum of laws": (_sum_of_laws, LAW_SIGNATURE, {}),
    "program": (_program, LAW_SIGNATURE, {}),
    "evaluate law": (_evaluate_law, types.void(types.intp, *[_pointer] * 6, types.intp, types.intp), {}),
    "integrate states": (
        _integrate_states,
        types.void(types.intp, *[_pointer] * 3, types.float64, *[types.intp] * 3, *[_pointer] * 2),
        {},
    ),
}
