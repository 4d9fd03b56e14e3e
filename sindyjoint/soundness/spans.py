"""Samples as spans, and signals with some samples bridged."""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np
from numpy.typing import NDArray

from sindyjoint.numeric import Array

Spans = tuple[tuple[int, int], ...]


def spans_of(marked: NDArray[np.bool_]) -> Spans:
    """Return the runs of marked samples, from inclusive to exclusive.

    Examples
    --------
    >>> spans_of(np.array([False, True, True, False, True]))
    ((1, 3), (4, 5))
    """
    change = np.diff(np.concatenate([[False], marked, [False]]).astype(np.int8))
    starts, stops = np.flatnonzero(change == 1), np.flatnonzero(change == -1)
    return tuple((int(a), int(b)) for a, b in zip(starts, stops, strict=True))


def bridged(values: Array, spans: Iterable[tuple[int, int]]) -> Array:
    """Return a signal with straight lines across some spans."""
    marked = np.zeros(values.size, dtype=bool)
    for start, stop in spans:
        marked[start:stop] = True
    if not marked.any() or marked.all():
        return values
    index = np.arange(values.size)
    return np.where(marked, np.interp(index, index[~marked], values[~marked]), values)
