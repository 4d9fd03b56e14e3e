"""A formula as a short list of numbered operations, the interpreter that compiled loops call for one, and pointers."""

from __future__ import annotations

from typing import Any

import numpy as np
from llvmlite import ir
from numba import njit, types
from numba.extending import intrinsic as numba_intrinsic
from numpy.typing import NDArray

from sindyjoint.equation.evaluation import TermFunction
from sindyjoint.numeric import Array

# Its annotations describe the Python function, which takes a typing context first; callers do not give that.
intrinsic: Any = numba_intrinsic

_pointer = types.CPointer(types.float64)


@intrinsic
def pointer(typingctx, array):
    """Pointer to the first element of an array, which the caller keeps alive.

    The integrators work on pointers: numba counts references to arrays, and counting costs them more than the
    arithmetic does.
    """

    def codegen(context, builder, signature, args):
        return context.make_array(signature.args[0])(context, builder, args[0]).data

    return types.CPointer(array.dtype)(array), codegen


@intrinsic
def shifted(typingctx, base, count):
    """Pointer `count` elements further on."""

    def codegen(context, builder, signature, args):
        return builder.gep(args[0], [args[1]])

    return base(base, types.intp), codegen


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


Integers = NDArray[np.int64]

CODES = {
    name: code
    for code, name in enumerate(
        (
            "abs", "sign", "sqrt", "exp", "log", "sin", "cos", "tan", "tanh", "atan",
            "add", "subtract", "multiply", "divide", "power", "minimum", "maximum", "heaviside",
        )
    )
}  # fmt: skip


def program(function: TermFunction) -> tuple[Array, Integers, Integers]:
    """Return constants, operations (code, first, second) and output registers as arrays.

    Where an operation has one operand only, that stands for the second, too.
    """
    operations = np.array(
        [(CODES[name], first, first if second < 0 else second)
         for name, first, second in function.operations], dtype=np.int64,
    ).reshape(-1, 3)  # fmt: skip
    return (
        np.array(function.constants, dtype=np.float64),
        operations,
        np.array(function.outputs, dtype=np.int64),
    )


@njit(cache=True, error_model="numpy", inline="always")
def operated(code, a, b):
    """Return the result of one operation."""
    if code == 12:
        value = a * b
    elif code == 10:
        value = a + b
    elif code == 11:
        value = a - b
    elif code == 13:
        value = a / b
    elif code == 0:
        value = abs(a)
    elif code == 1:
        value = np.sign(a)
    elif code == 14:
        value = a**b
    elif code == 3:
        value = np.exp(a)
    elif code == 15:
        value = min(a, b)
    elif code == 16:
        value = max(a, b)
    elif code == 2:
        value = np.sqrt(a)
    elif code == 4:
        value = np.log(a)
    elif code == 5:
        value = np.sin(a)
    elif code == 6:
        value = np.cos(a)
    elif code == 7:
        value = np.tan(a)
    elif code == 8:
        value = np.tanh(a)
    elif code == 9:
        value = np.arctan(a)
    else:
        value = 1.0 if a > 0 else (0.0 if a < 0 else b)
    return value


@njit(cache=True, error_model="numpy", no_cpython_wrapper=True, no_cfunc_wrapper=True)
def run_lanes(registers, lanes, stride, start, operations, rows, begin, end):
    """Fill the registers of operations ``rows[begin:end]`` for several motions at once; all are pointers.

    A register holds one number for each lane, ``stride`` apart from the next register: an operation is looked up once
    for all lanes, and the plain ones are carried out several lanes at a time.
    """
    for i in range(begin, end):
        operation = shifted(operations, 3 * rows[i])
        code = operation[0]
        a = shifted(registers, stride * operation[1])
        b = shifted(registers, stride * operation[2])
        out = shifted(registers, stride * (start + rows[i]))
        if code == 12:
            for lane in range(lanes):
                out[lane] = a[lane] * b[lane]
        elif code == 10:
            for lane in range(lanes):
                out[lane] = a[lane] + b[lane]
        elif code == 11:
            for lane in range(lanes):
                out[lane] = a[lane] - b[lane]
        elif code == 13:
            for lane in range(lanes):
                out[lane] = a[lane] / b[lane]
        elif code == 0:
            for lane in range(lanes):
                out[lane] = abs(a[lane])
        else:
            for lane in range(lanes):
                out[lane] = operated(code, a[lane], b[lane])
