"""Compiled sweeps over blocks of rows, for :mod:`sindyjoint.discovery.accumulate`; importing this imports numba.

Blocks have a row for each column of the problem. Sums are of SWEEP rows at a time, always in the same order.
"""

from __future__ import annotations

import numba

# Rows taken together.
SWEEP = 1024
_jit = numba.njit(cache=True, nogil=True, fastmath={"reassoc", "contract", "nsz"}, no_cfunc_wrapper=True)


# Rows are taken by slices of one axis: of two, numba no longer knows them to be contiguous, and vectorises nothing.
@_jit
def products(block, start, stop, gram):  # pragma: no cover
    """Add the products of some rows of a block to the upper half of a matrix."""
    last = block.shape[0] - 1
    # Three by three: nine products for six loads. At the edge the last column stands in, and is not written.
    for j in range(0, last + 1, 3):
        a = block[j, start:stop]
        b, c = block[min(j + 1, last), start:stop], block[min(j + 2, last), start:stop]
        for i in range(0, j + 1, 3):
            d = block[i, start:stop]
            e, f = block[min(i + 1, last), start:stop], block[min(i + 2, last), start:stop]
            da = db = dc = ea = eb = ec = fa = fb = fc = 0.0
            for r in range(stop - start):
                da += d[r] * a[r]
                db += d[r] * b[r]
                dc += d[r] * c[r]
                ea += e[r] * a[r]
                eb += e[r] * b[r]
                ec += e[r] * c[r]
                fa += f[r] * a[r]
                fb += f[r] * b[r]
                fc += f[r] * c[r]
            sums = ((da, db, dc), (ea, eb, ec), (fa, fb, fc))
            for row in range(min(3, last + 1 - i)):
                for column in range(min(3, last + 1 - j)):
                    gram[i + row, j + column] += sums[row][column]


@_jit
def plain(block, gram):  # pragma: no cover
    """Add the products of a block."""
    rows = block.shape[1]
    for start in range(0, rows, SWEEP):
        products(block, start, min(start + SWEEP, rows), gram)


@_jit
def solved(block, base, scratch, gram):  # pragma: no cover
    """Add the products of a block whose rows are first solved with an upper triangle."""
    size, rows = block.shape
    for start in range(0, rows, SWEEP):
        n = min(SWEEP, rows - start)
        for j in range(0, size, 2):
            pair = j + 1 < size
            k = j + 1 if pair else j
            x, y = scratch[j, :n], scratch[k, :n]
            # One by one: the assignment of a slice takes seconds to compile.
            for r in range(n):
                x[r], y[r] = block[j, start + r], block[k, start + r]
            # Two columns less four at a time: fourteen loads and stores for sixteen operations.
            for i in range(0, j - 3, 4):
                c0, c1, c2, c3 = base[i, j], base[i + 1, j], base[i + 2, j], base[i + 3, j]
                d0, d1, d2, d3 = base[i, k], base[i + 1, k], base[i + 2, k], base[i + 3, k]
                x0, x1, x2, x3 = (
                    scratch[i, :n],
                    scratch[i + 1, :n],
                    scratch[i + 2, :n],
                    scratch[i + 3, :n],
                )
                for r in range(n):
                    p, q, u, v = x0[r], x1[r], x2[r], x3[r]
                    x[r] -= (c0 * p + c1 * q) + (c2 * u + c3 * v)
                    if pair:
                        y[r] -= (d0 * p + d1 * q) + (d2 * u + d3 * v)
            for i in range(j // 4 * 4, j):
                c0, d0, x0 = base[i, j], base[i, k], scratch[i, :n]
                for r in range(n):
                    x[r] -= c0 * x0[r]
                    if pair:
                        y[r] -= d0 * x0[r]
            inverse = 1.0 / base[j, j]
            for r in range(n):
                x[r] *= inverse
            if pair:
                inverse, c0 = 1.0 / base[k, k], base[j, k]
                for r in range(n):
                    y[r] = (y[r] - c0 * x[r]) * inverse
        products(scratch, 0, n, gram)
