"""The compiled search of :mod:`sindyjoint.discovery.best_subset`."""

from typing import Any

import numpy as np
from numba import carray, njit, types

from sindyjoint.equation.operations import shifted


@njit(cache=True, nogil=True, error_model="numpy", no_cpython_wrapper=True, no_cfunc_wrapper=True)
def _drop(triangle, n, index, out):
    """Factor of the n columns of ``triangle`` less one: shift left, rotate the subdiagonal away."""
    for j in range(n):  # columns of the result, the last being the target
        source = j if j < index else j + 1
        for i in range(n + 1):
            out[i, j] = triangle[i, source]
    for j in range(index, n):
        a, b = out[j, j], out[j + 1, j]
        if b == 0.0:
            continue
        radius = np.hypot(a, b)
        c, s = a / radius, b / radius
        for k in range(j, n):
            upper, lower = out[j, k], out[j + 1, k]
            out[j, k] = c * upper + s * lower
            out[j + 1, k] = c * lower - s * upper


@njit(cache=True, nogil=True, error_model="numpy", no_cpython_wrapper=True, no_cfunc_wrapper=True)
def _obeys(triangle, n, size, expected, names, solved):
    """Whether the least-squares coefficients of the leading ``size`` columns have the expected signs."""
    needed = False
    for i in range(size):
        if expected[names[i]] != 0:
            needed = True
    if not needed:
        return True
    for i in range(size - 1, -1, -1):
        value = triangle[i, n]
        for j in range(i + 1, size):
            value -= triangle[i, j] * solved[j]
        solved[i] = value / triangle[i, i]
        if expected[names[i]] * solved[i] < 0:
            return False
    return True


def _search(p, fixed, top, start, expected, best_errors, marks, room, integer_room):
    """See :func:`sindyjoint.discovery.best_subset.best_subsets`; all room is zero."""
    best, sets = carray(best_errors, (p + 1,)), carray(marks, (p + 1, p))
    # Depth-first: a node at depth d has p - d columns, so one matrix for each depth is room enough.
    triangles, solved = carray(room, (p + 1, p + 1, p + 1)), shifted(room, (p + 1) ** 3)
    names = carray(integer_room, (p + 1, p))
    lowest = shifted(integer_room, (p + 1) * p)  # columns before this one are not dropped below a node
    following = shifted(lowest, p + 1)  # the next column to drop at a depth
    for i in range(p + 1):  # the assignment of a slice takes seconds to compile
        for j in range(p + 1):
            triangles[0, i, j] = start[i * (p + 1) + j]
    for i in range(p):
        names[0, i] = i
    lowest[0] = fixed
    depth, entering = 0, True
    while depth >= 0:
        n = p - depth
        here = triangles[depth]
        if entering:
            error = here[n, n] ** 2
            for size in range(n, 0, -1):
                if size < n:
                    error += here[size, n] ** 2
                # Leading parts shorter than this were met at the parent.
                if size < max(lowest[depth], 1):
                    break
                if (
                    size <= top
                    and error < best[size]
                    and _obeys(here, n, size, expected, names[depth], solved)
                ):
                    best[size] = error
                    for i in range(p):
                        sets[size, i] = 0
                    for i in range(size):
                        sets[size, names[depth, i]] = 1
            following[depth] = n - 1
            entering = False
        index = following[depth]
        if index < lowest[depth] or n <= 1:
            depth -= 1
            continue
        following[depth] = index - 1
        # Below the child that drops ``index`` lie models of max(index, 1) to n - 1 columns; none fits better than
        # all n columns here do.
        worst = 0.0
        for size in range(max(index, 1), min(n - 1, top) + 1):
            worst = max(worst, best[size])
        if here[n, n] ** 2 >= worst:
            continue
        _drop(here, n, index, triangles[depth + 1])
        child = 0
        for i in range(n):
            if i != index:
                names[depth + 1, child] = names[depth, i]
                child += 1
        lowest[depth + 1] = index
        depth += 1
        entering = True


_whole, _number = types.CPointer(types.int64), types.CPointer(types.float64)
ENTRIES: dict[str, Any] = {
    "best subsets": (
        _search,
        types.void(*[types.intp] * 3, _number, _whole, _number, types.CPointer(types.int8), _number, _whole),
        {},
    )
}
