"""The exact best subset of every size: branch and bound on the triangular factor.

The referee of every greedier way: of all sets of k columns, the one of least squared error, for each k at once.
A node of the search is an ordered list of columns with its factor; the leading parts of the list are models whose
errors stand in the last column of the factor, and dropping a column costs a few plane rotations. A branch is cut
when even all its columns together fit no better than what is already known for every size it can reach.

Reference: Gatu and Kontoghiorghes, Branch-and-bound algorithms for computing the best-subset regression models,
Journal of Computational and Graphical Statistics 15(1), 2006, 139-156; the idea of the bound is of Furnival and
Wilson, Technometrics 16(4), 1974.
"""

from collections.abc import Mapping, Sequence
from functools import partial

import numpy as np
from numba import njit
from numpy.typing import NDArray

from sindyjoint.discovery.factors import Factor
from sindyjoint.errors import InputError
from sindyjoint.numeric import Array, chunks
from sindyjoint.parallel import side_by_side

# The search is exact and its worst case is 2^p: beyond this many columns it is refused.
MOST_COLUMNS = 40


def best_subsets(
    factor: Factor,
    forced: Sequence[int] = (),
    signs: Mapping[int, int] | None = None,
) -> list[tuple[int, ...]]:
    """Return the columns of the best subset of every size, from one column (or the forced ones) up.

    Parameters
    ----------
    factor : Factor
        Of all candidates.
    forced : sequence of int
        Columns that every set holds.
    signs : mapping of int to int, optional
        Column to +1 or -1: the sign its coefficient must have. Sizes at which no set obeys are omitted.

    Raises
    ------
    InputError
        For more than 40 columns, or linearly dependent ones.
    """
    p = factor.n_columns
    if p > MOST_COLUMNS:
        raise InputError(
            f"{p} candidate terms; an exact best subset takes at most {MOST_COLUMNS}: choose a smaller library"
        )
    scaled, _, _ = factor.normalised()
    order = _search_order(scaled, [*dict.fromkeys(forced)])
    start = scaled.take(order).triangle
    if np.abs(np.diag(start)[:p]).min() < 1e-12:
        raise InputError("linearly dependent candidate terms; take one of them out")
    expected = np.array(
        [0 if signs is None else int(signs.get(column, 0)) for column in order], dtype=np.int64
    )
    errors, sets = _search(start, len(set(forced)), expected, p)
    return [
        tuple(sorted(order[i] for i in np.flatnonzero(sets[size])))
        for size in range(max(1, len(set(forced))), p + 1)
        if np.isfinite(errors[size])
    ]


def replicate_subsets(triangles: Array, largest: int) -> NDArray[np.bool_]:
    """Return the best subsets of many replicates of one problem, side by side.

    Parameters
    ----------
    triangles : ndarray, shape (replicates, p + 1, p + 1)
        Factors of [columns | target], columns of comparable norm.
    largest : int
        Largest size.

    Returns
    -------
    ndarray of bool, shape (replicates, largest + 1, p)
        Marks of the best set of each size; row 0 is empty.
    """
    # Replicates searched in one task: some tens of milliseconds.
    parts = [triangles[some] for some in chunks(len(triangles), 32)]
    return np.concatenate(side_by_side(partial(_subsets_of, largest), parts))


def _subsets_of(largest: int, triangles: Array) -> NDArray[np.bool_]:
    """Return the best subsets of some replicates."""
    replicates, p = triangles.shape[0], triangles.shape[1] - 1
    expected = np.zeros(p, dtype=np.int64)
    marks = np.zeros((replicates, largest + 1, p), dtype=bool)
    for triangle, found in zip(triangles, marks, strict=True):
        # By unique share: to eliminate one by one, as for a single problem, would cost more than it saves.
        factor = Factor(triangle, 1.0)
        order = np.argsort(-np.abs(factor.solve()) / np.linalg.norm(factor.inverse(), axis=1))
        start = np.linalg.qr(triangle[:, [*order, p]], mode="r")
        found[:, order] = _search(start, 0, expected, largest)[1][: largest + 1]
    return marks


def _search_order(scaled: Factor, forced: list[int]) -> list[int]:
    """Return forced columns first, then the strongest: good models are met early and bad branches cut high up."""
    kept = [column for column in range(scaled.n_columns) if column not in forced]
    weakest: list[int] = []
    while len(kept) > 1:
        part = scaled.take([*forced, *kept])
        share = np.abs(part.solve()) / np.linalg.norm(part.inverse(), axis=1)
        weakest.append(kept.pop(int(np.argmin(share[len(forced) :]))))
    return [*forced, *kept, *reversed(weakest)]


@njit(cache=True, nogil=True, no_cpython_wrapper=True, no_cfunc_wrapper=True)
def _drop(triangle, n, index, out):
    """Factor of the n columns of ``triangle`` less one: shift left, rotate the subdiagonal away."""
    # Columns j of the result are columns j + 1 from the index on, the last being the target; zeros are not written.
    for i in range(index + 1):
        for j in range(i, index):
            out[i, j] = triangle[i, j]
        for j in range(index, n):
            out[i, j] = triangle[i, j + 1]
    for j in range(index, n):
        a, b = out[j, j], triangle[j + 1, j + 1]
        radius = np.sqrt(a * a + b * b)
        c, s = (a / radius, b / radius) if b != 0.0 else (1.0, 0.0)
        for k in range(j, n):
            upper, lower = out[j, k], triangle[j + 1, k + 1]
            out[j, k] = c * upper + s * lower
            out[j + 1, k] = c * lower - s * upper


@njit(cache=True, nogil=True, no_cpython_wrapper=True, no_cfunc_wrapper=True)
def _obeys(triangle, n, size, expected, names):
    """Whether the least-squares coefficients of the leading ``size`` columns have the expected signs."""
    solved = np.empty(size)
    for i in range(size - 1, -1, -1):
        value = triangle[i, n]
        for j in range(i + 1, size):
            value -= triangle[i, j] * solved[j]
        solved[i] = value / triangle[i, i]
        if expected[names[i]] * solved[i] < 0:
            return False
    return True


@njit(cache=True, nogil=True, no_cfunc_wrapper=True)
def _search(start, fixed, expected, top):
    """Return least squared errors by size, and the sets as marks on the columns' positions."""
    p = start.shape[0] - 1
    best = np.full(p + 1, np.inf)
    sets = np.zeros((p + 1, p), dtype=np.bool_)
    # Depth-first: a node at depth d has p - d columns, so one matrix for each depth is room enough.
    triangles = np.zeros((p + 1, p + 1, p + 1))
    names = np.zeros((p + 1, p), dtype=np.int64)
    lowest = np.zeros(p + 1, dtype=np.int64)  # columns before this one are not dropped below a node
    following = np.zeros(p + 1, dtype=np.int64)  # the next column to drop at a depth
    for i in range(p + 1):  # the assignment of a slice takes seconds to compile
        for j in range(p + 1):
            triangles[0, i, j] = start[i, j]
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
                if size <= top and error < best[size] and _obeys(here, n, size, expected, names[depth]):
                    best[size] = error
                    sets[size, :] = False
                    for i in range(size):
                        sets[size, names[depth, i]] = True
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
    return best, sets
