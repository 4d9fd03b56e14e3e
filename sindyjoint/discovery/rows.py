"""Rows of force states, with their labels, as the evidence of a campaign."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray
from sklearn.utils.validation import check_array

from sindyjoint.discovery.evidence import Evidence, RunEvidence
from sindyjoint.discovery.factors import Factor
from sindyjoint.equation.terms import ResolvedTerm, term_columns
from sindyjoint.errors import InputError

Array = NDArray[np.float64]

# Without replicate blocks of its own, a run is cut into this many stretches of consecutive rows.
STRETCHES = 16
# What a single run, which has no other to be held out against, is cut into; none of these is the name of a run.
PARTS = ("part 1", "part 2", "part 3", "part 4")


@dataclass(frozen=True, eq=False)
class RowLabels:
    """Group, run and replicate block of every row, each of shape (n,)."""

    group: NDArray[Any]
    run: NDArray[Any]
    block: NDArray[Any]

    @property
    def run_names(self) -> list[Any]:
        """Runs in order of appearance."""
        return list(dict.fromkeys(self.run.tolist()))

    @classmethod
    def of(
        cls, n: int, groups: ArrayLike | None, runs: ArrayLike | None, blocks: ArrayLike | None
    ) -> RowLabels:
        """Return the labels of n rows, made up where they are not given.

        Raises
        ------
        InputError
            For labels that are not one per row, or blocks that are whole runs.
        """
        given = {"groups": groups, "runs": runs, "blocks": blocks}
        for name, values in given.items():
            if values is not None and np.shape(values) != (n,):
                raise InputError(f"{name} has shape {np.shape(values)}; ({n},), one entry per row, is wanted")
        if groups is None and runs is None:
            # One record: four parts to hold out, each with its own blocks.
            group = run = np.array(PARTS, dtype=object)[np.arange(n) * len(PARTS) // n]
        else:
            run = np.asarray(groups if runs is None else runs)
            group = np.asarray(runs if groups is None else groups)
        block = np.asarray(blocks) if blocks is not None else _stretches(run)
        if blocks is not None and len(set(zip(run.tolist(), block.tolist(), strict=True))) == len(
            set(run.tolist())
        ):
            raise InputError(
                "blocks has one block in each run; standard errors need the scatter of two or more"
            )
        return cls(group, run, block)


def gather(
    terms: Sequence[ResolvedTerm],
    X: Array,
    y: Array,
    labels: RowLabels,
    weight: Array | None = None,
    X_replicate: ArrayLike | None = None,
    y_replicate: ArrayLike | None = None,
) -> Evidence:
    """Return the factors of every run and block of some terms.

    Parameters
    ----------
    terms : sequence of ResolvedTerm
    X : ndarray, shape (n, 2) or (n, 3)
        θ, θ̇ and perhaps θ̈; SI.
    y : ndarray, shape (n,)
        N·m.
    labels : RowLabels
    weight : ndarray, shape (n,), optional
    X_replicate, y_replicate : array_like, optional
        The same rows as each block alone gives them.
    """
    columns = state_columns(terms, X)
    other = None if X_replicate is None else state_columns(terms, np.asarray(X_replicate, dtype=np.float64))
    ids = tuple(term.id for term in terms)
    return gather_columns(ids, columns, y, labels, weight, other, y_replicate)


def gather_columns(
    ids: Sequence[str],
    columns: Array,
    y: Array,
    labels: RowLabels,
    weight: Array | None = None,
    columns_replicate: Array | None = None,
    y_replicate: ArrayLike | None = None,
) -> Evidence:
    """Return the factors of every run and block of columns that are there, shape (n, p); else as :func:`gather`."""
    replicates = columns if columns_replicate is None else columns_replicate
    replicate_target = y if y_replicate is None else np.asarray(y_replicate, dtype=np.float64)
    runs = []
    for run in labels.run_names:
        rows = np.flatnonzero(labels.run == run)
        w = None if weight is None else weight[rows]
        block = labels.block[rows]
        parts = tuple(
            Factor.of(
                replicates[rows[block == b]],
                replicate_target[rows[block == b]],
                None if w is None else w[block == b],
            )
            for b in np.unique(block)
        )
        pooled = Factor.of(columns[rows], y[rows], w)
        runs.append(RunEvidence(str(run), str(labels.group[rows[0]]), pooled, parts))
    return Evidence(tuple(ids), tuple(runs))


def row_weights(sample_weight: ArrayLike | None, count: int) -> NDArray[np.float64] | None:
    """Return the weights of rows as an array; a number weighs every row alike."""
    if sample_weight is None:
        return None
    weight = check_array(
        np.full(count, sample_weight) if isinstance(sample_weight, int | float) else sample_weight,
        dtype=np.float64,
        ensure_2d=False,
        input_name="sample_weight",
    )
    if weight.shape != (count,):
        raise InputError(
            f"sample_weight has shape {weight.shape}; one weight for each row is expected, ({count},)"
        )
    if not np.any(weight):
        raise InputError("sample_weight is zero for every row; at least one row must count")
    if np.any(weight < 0):
        raise InputError(f"sample_weight holds {weight.min():g}; weights that are not negative are expected")
    return weight


def state_columns(terms: Sequence[ResolvedTerm], X: Array) -> Array:
    """Return the terms' columns at force states, shape (n, p)."""
    return term_columns(list(terms), X[:, 0], X[:, 1], X[:, 2] if X.shape[1] == 3 else None)


def _stretches(run: NDArray[Any]) -> NDArray[np.intp]:
    """Cut each run into stretches of consecutive rows."""
    block = np.zeros(run.size, dtype=np.intp)
    for name in dict.fromkeys(run.tolist()):
        rows = np.flatnonzero(run == name)
        block[rows] = np.arange(rows.size) * STRETCHES // rows.size
    return block
