"""Pointers for compiled loops: what they point to is kept alive by the caller."""

from __future__ import annotations

from typing import Any

from llvmlite import ir
from numba import types
from numba.extending import intrinsic as numba_intrinsic

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
