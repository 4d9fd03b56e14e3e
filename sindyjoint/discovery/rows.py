"""Rows of force states, with their labels, as the evidence of a campaign."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from sindyjoint.clock import on_threads
from sindyjoint.discovery import Evidence, RunEvidence
from sindyjoint.discovery.factors import Factor, merge
from sindyjoint.equation.evaluation import TermFunction
from sindyjoint.equation.formula import VARIABLES, compile_terms
from sindyjoint.equation.terms import ResolvedTerm, term_columns
from sindyjoint.errors import InputError, refuse
from sindyjoint.numeric import BLOCK, Array, chunks

Index = slice | NDArray[np.intp]

# Without replicate blocks, a run is cut into this many segments of consecutive rows.
SEGMENTS = 16
# What a single run, which has no other to be held out against, is cut into; none of these is the name of a run.
PARTS = ("part 1", "part 2", "part 3", "part 4")
# Rows below which a second thread takes longer to start than it saves.
THREADED = 50_000


@dataclass(frozen=True, eq=False)
class LabelledRun:
    """A run, and the rows of each of its replicate blocks."""

    name: str
    group: str
    blocks: tuple[Index, ...]


# The runs that rows belong to, in order of appearance.
RowLabels = tuple[LabelledRun, ...]


def row_labels(
    n: int, groups: ArrayLike | None, runs: ArrayLike | None, blocks: ArrayLike | None
) -> RowLabels:
    """Return the labels of n rows, made up where they are not given.

    Raises
    ------
    InputError
        For labels that are not one per row, or blocks that are whole runs.
    """
    given = {"groups": groups, "runs": runs, "blocks": blocks}
    refuse(
        (np.shape(values) != (n,), f"{name} has shape {np.shape(values)}; expected ({n},), one entry per row")
        for name, values in given.items()
        if values is not None
    )
    of_runs, of_groups = (groups if runs is None else runs), (runs if groups is None else groups)
    if of_runs is None or of_groups is None:
        # One record: segments to hold out, each with blocks.
        segments = zip(PARTS, _cut_segments(slice(0, n), len(PARTS)), strict=False)
        of_blocks = None if blocks is None else np.asarray(blocks)
        found = tuple(LabelledRun(part, part, _blocks_of(rows, of_blocks)) for part, rows in segments)
    else:
        found = known_labels(of_groups, of_runs, blocks)
    if blocks is not None and all(len(run.blocks) == 1 for run in found):
        raise InputError("blocks has one block in each run; standard errors need the scatter of two or more")
    return found


def known_labels(groups: ArrayLike, runs: ArrayLike, blocks: ArrayLike | None) -> RowLabels:
    """Return the labels of rows of which group and run are known."""
    group, block = np.asarray(groups), None if blocks is None else np.asarray(blocks)
    return tuple(
        LabelledRun(str(run), str(group[rows][0]), _blocks_of(rows, block))
        for run, rows in _rows_of(np.asarray(runs)).items()
    )


@dataclass(frozen=True, eq=False)
class Rows:
    """Force states and the moment to explain.

    Parameters
    ----------
    X : ndarray, shape (n, 2) or (n, 3)
        θ, θ̇ and perhaps θ̈; SI.
    y : ndarray, shape (n,)
        N·m.
    weight : ndarray, shape (n,), optional
        How often each row counts.
    """

    X: Array
    y: Array
    weight: Array | None = None

    def again(self, X: ArrayLike | None, y: ArrayLike | None) -> Rows:
        """Return the same rows from each single block, as far as these are given."""
        return Rows(
            self.X if X is None else np.asarray(X, dtype=np.float64),
            self.y if y is None else np.asarray(y, dtype=np.float64),
            self.weight,
        )

    def __getitem__(self, index: Index) -> Rows:
        return Rows(self.X[index], self.y[index], None if self.weight is None else self.weight[index])


def gather(
    terms: Sequence[ResolvedTerm],
    rows: Rows,
    labels: RowLabels,
    replicate: Rows | None = None,
    inputs: Sequence[str] = (),
) -> Evidence:
    """Return the factors of every run and block of some terms.

    Parameters
    ----------
    terms : sequence of ResolvedTerm
    rows : Rows
        Behind θ, θ̇ and perhaps θ̈ the inputs.
    labels : tuple of LabelledRun
    replicate : Rows, optional
        The same rows from each single block.
    inputs : sequence of str
        Names of the k inputs.

    Raises
    ------
    InputError
        If a term has no finite value somewhere.
    """
    function = compile_terms([term.expression for term in terms], row_arguments(rows.X.shape[1], inputs))
    try:
        return _gathered(
            [term.id for term in terms],
            lambda some: factor_of(function, [*some.X.T], some.y, some.weight),
            rows,
            labels,
            replicate,
            hierarchy(terms),
        )
    except InputError:
        # Once more, slowly, for a message that names the term.
        for source in (rows, replicate or rows):
            state_columns(terms, source.X, inputs)
        raise


def hierarchy(terms: Sequence[ResolvedTerm]) -> dict[str, tuple[str, ...]]:
    """Return for each term that has some the terms without which it makes no sense."""
    return {term.id: term.term.within for term in terms if term.term.within}


def gather_columns(
    ids: Sequence[str], rows: Rows, labels: RowLabels, replicate: Rows | None = None
) -> Evidence:
    """Return the factors of every run and block of columns that are there, ``X`` of shape (n, p); as :func:`gather`."""
    return _gathered(ids, lambda some: Factor.of(some.X, some.y, some.weight), rows, labels, replicate, {})


def _gathered(
    ids: Sequence[str],
    factor: Callable[[Rows], Factor],
    rows: Rows,
    labels: RowLabels,
    replicate: Rows | None,
    within: dict[str, tuple[str, ...]],
) -> Evidence:
    """Return the evidence of columns whose factor at some rows is known, on threads where there are many rows."""
    other = replicate or rows
    same = np.array_equal(other.X, rows.X) and np.array_equal(other.y, rows.y)
    sources = (rows,) if same else (other, rows)
    parts = [source[block] for source in sources for run in labels for block in run.blocks]
    threaded = sum(part.y.size for part in parts) >= THREADED
    factors = iter(on_threads(factor, parts) if threaded else map(factor, parts))
    single, *pooled = ([tuple(next(factors) for _ in run.blocks) for run in labels] for _ in sources)
    whole = pooled[0] if pooled else single
    runs = [
        RunEvidence(run.name, run.group, merge(every), blocks)
        for run, blocks, every in zip(labels, single, whole, strict=True)
    ]
    return Evidence(tuple(ids), tuple(runs), within)


def rows_that_count(sample_weight: ArrayLike | None, count: int, *parts: ArrayLike | None) -> tuple[Any, ...]:
    """Return the weights of the rows that count, and of each part (y among the first) its entries for them.

    A weight of zero says that the row is not there: it is in no segment, block or group. One that repeats the row
    before it makes that count once more.
    """
    weight = row_weights(sample_weight, count)
    counts = np.arange(count) if weight is None else np.flatnonzero(weight)
    whole = [np.asarray(part) for part in parts if part is not None and len(np.asarray(part)) == count]
    again = np.arange(1, counts.size)
    for part in sorted(whole, key=np.ndim):
        same = np.atleast_2d(part[counts[again]].T == part[counts[again - 1]].T)
        again = again[same.all(axis=0)]
    if counts.size == count and not again.size:
        return weight, *parts
    first = np.delete(np.arange(counts.size), again)
    weight = np.add.reduceat((np.ones(count) if weight is None else weight)[counts], first)
    rows = counts[first]
    return weight, *(
        part if part is None or len(np.asarray(part)) != count else np.asarray(part)[rows] for part in parts
    )


def held_out_groups(cv: Any, X: Array, y: Array) -> NDArray[np.intp]:
    """Return for each row which test set of a splitter, or of its splits, it is in; -1 in none."""
    from sklearn.model_selection import check_cv

    groups = np.full(len(y), -1)
    for group, (_, held_out) in enumerate(check_cv(cv).split(X, y)):
        groups[held_out] = group
    return groups


def row_weights(sample_weight: ArrayLike | None, count: int) -> NDArray[np.float64] | None:
    """Return the weights of rows as an array; a number weighs every row alike."""
    if sample_weight is None:
        return None
    from sklearn.utils.validation import check_array

    weight = check_array(
        np.full(count, sample_weight) if isinstance(sample_weight, int | float) else sample_weight,
        dtype=np.float64,
        ensure_2d=False,
        input_name="sample_weight",
    )
    shape, zero = weight.shape, not np.any(weight)
    refuse(
        [
            (
                shape != (count,),
                f"sample_weight has shape {shape}; one weight for each row is expected, ({count},)",
            ),
            (zero, "sample_weight is zero for every row; at least one row must count"),
            (
                np.any(weight < 0),
                f"sample_weight holds {weight.min(initial=0.0):g}; weights that are not negative are expected",
            ),
        ]
    )
    return weight


def factor_of(
    function: TermFunction, states: Sequence[Array], target: Array, weight: Array | None = None
) -> Factor:
    """Return the factor of terms at force states: each tile of rows is decomposed while it is in the cache.

    Parameters
    ----------
    function : TermFunction
        Of (θ, θ̇, θ̈).
    states : sequence of ndarray, shape (n,)
        θ, θ̇ and, where a term needs it, θ̈.
    target : ndarray, shape (n,)
    weight : ndarray, shape (n,), optional
        How often each row counts.

    Raises
    ------
    InputError
        If a term or the target has no finite value somewhere.
    """
    size, parts = len(function.outputs) + 1, []
    absent = [np.nan] * (len(function.arguments) - len(states))
    for rows in chunks(target.size, BLOCK):
        columns = function(*(signal[rows] for signal in states), *absent)
        if not (np.isfinite(columns).all() and np.isfinite(target[rows]).all()):
            row, column = np.argwhere(~np.isfinite(np.column_stack([columns, target[rows]])))[0]
            what = "the target" if column == size - 1 else f"column {column + 1} (of {size - 1})"
            raise InputError(
                f"rows from {rows.start} of this segment: {what} has no finite value at row {row}; leave the term out "
                "or repair the row"
            )
        parts.append(Factor.of(columns, target[rows], None if weight is None else weight[rows]))
    return merge(parts or [Factor(np.zeros((size, size)), 0.0)])


def row_arguments(columns: int, inputs: Sequence[str]) -> tuple[str, ...]:
    """Return what the columns of force states are called in formulas; an acceleration that is not there comes last."""
    motion = columns - len(inputs)
    return (*VARIABLES[:motion], *inputs, *VARIABLES[motion:])


def state_columns(terms: Sequence[ResolvedTerm], X: Array, inputs: Sequence[str] = ()) -> Array:
    """Return the terms' columns at force states, shape (n, p); the last columns of X are the inputs."""
    motion = X.shape[1] - len(inputs)
    acceleration = X[:, 2] if motion == 3 else None
    named = dict(zip(inputs, X[:, motion:].T, strict=True))
    return term_columns(list(terms), X[:, 0], X[:, 1], acceleration, inputs=named)


def _rows_of(labels: NDArray[Any]) -> dict[Any, Index]:
    """Return the rows that have each label, labels in order of appearance; a slice where they follow one another."""
    edges = [0, *(np.flatnonzero(labels[1:] != labels[:-1]) + 1).tolist(), labels.size]
    names = labels[edges[:-1]].tolist()
    if len(set(names)) == len(names):
        return {name: slice(a, b) for name, a, b in zip(names, edges[:-1], edges[1:], strict=True)}
    code = {name: i for i, name in enumerate(dict.fromkeys(names))}
    codes = np.repeat([code[name] for name in names], np.diff(edges))
    order = np.argsort(codes, kind="stable")
    return dict(zip(code, np.split(order, np.cumsum(np.bincount(codes))[:-1]), strict=True))


def _blocks_of(rows: Index, blocks: NDArray[Any] | None) -> tuple[Index, ...]:
    """Return the rows of each replicate block of a run, blocks in the order of their labels."""
    if blocks is None:
        return _cut_segments(rows, SEGMENTS)
    found = _rows_of(blocks[rows])
    return tuple(_within(rows, found[label]) for label in sorted(found))


def _cut_segments(rows: Index, parts: int) -> tuple[Index, ...]:
    """Cut rows into segments of consecutive ones: the i-th of n goes to segment i · parts // n."""
    n = rows.stop - rows.start if isinstance(rows, slice) else rows.size
    edges = [-(-part * n // parts) for part in range(parts + 1)]
    return tuple(_within(rows, slice(a, b)) for a, b in zip(edges[:-1], edges[1:], strict=True) if b > a)


def _within(rows: Index, part: Index) -> Index:
    """Return which rows a part of some rows is."""
    if not isinstance(rows, slice):
        return rows[part]
    if isinstance(part, slice):
        return slice(rows.start + part.start, rows.start + part.stop)
    return rows.start + part
