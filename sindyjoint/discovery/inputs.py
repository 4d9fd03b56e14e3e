"""Inputs of a law as an estimator is given them: by name, or declared with unit, reference and levels."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

from sindyjoint.discovery.rows import RowLabels
from sindyjoint.equation.catalogue import Catalogue
from sindyjoint.equation.dependences import dependences
from sindyjoint.errors import InputError
from sindyjoint.inputs import Input, levels
from sindyjoint.numeric import Array


def input_names(inputs: Sequence[str | Input]) -> tuple[str, ...]:
    """Return the names of inputs, in order."""
    names = tuple(each if isinstance(each, str) else each.name for each in inputs)
    if len(set(names)) < len(names):
        raise InputError(f"inputs: a name is used twice among {', '.join(names)}")
    return names


def known_inputs(
    inputs: Sequence[str | Input], columns: Array, labels: RowLabels | None = None
) -> tuple[Input, ...]:
    """Return inputs with the range and the levels that rows test.

    Parameters
    ----------
    inputs : sequence of str or Input
        Of a name alone the reference is the middle of the range, and its values are plain numbers.
    columns : ndarray, shape (n, k)
    labels : RowLabels, optional
        Of the rows: levels are those of runs.
    """
    found = []
    for each, values in zip(inputs, columns.T, strict=True):
        low, high = float(values.min()), float(values.max())
        made = Input(each, reference=(low + high) / 2) if isinstance(each, str) else each
        parts = [values] if labels is None else [values[b] for run in labels.runs for b in run.blocks]
        count = levels(parts, (low, high))
        found.append(replace(made, tested=(low, high), levels=count))
    return tuple(found)


def with_dependences(catalogue: Catalogue, inputs: Sequence[Input]) -> Catalogue:
    """Return a catalogue with the dependences of its terms on inputs that it does not have itself."""
    if not inputs:
        return catalogue
    offered = dependences(inputs, {each.name: each.levels for each in inputs}, catalogue.ids)
    return catalogue.union(offered.without([term for term in offered.ids if term in catalogue]))
