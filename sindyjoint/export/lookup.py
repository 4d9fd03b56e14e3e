"""A law that depends on inputs, for programs that know none: a table of decks, one at each value of the inputs."""

from __future__ import annotations

import re
from collections.abc import Callable
from itertools import product
from typing import TYPE_CHECKING

import numpy as np

from sindyjoint.export.base import ALL_TERMS, Cycles, Export, Fidelity, shares

if TYPE_CHECKING:
    from sindyjoint.equation.model import JointModel
    from sindyjoint.inputs import Input

# Decks over the tested range of an input, where it is the only one, and where there are more.
POINTS, POINTS_OF_SEVERAL = 5, 3
TABLE = "lookup.csv"


def lookup(model: JointModel, write: Callable[[JointModel], Export]) -> Export:
    """Return the exports of a law held at values over the tested ranges of its inputs, and a table of them.

    Parameters
    ----------
    model : JointModel
        Whose inputs were tested over a range each.
    write : callable
        Writes a law without inputs.
    """
    inputs = model.used_inputs
    points = POINTS if len(inputs) == 1 else POINTS_OF_SEVERAL
    nodes = {each.name: np.linspace(*(each.tested or (0.0, 0.0)), points) for each in inputs}
    files: dict[str, str | bytes] = {}
    table = [",".join([*(f"{each.name} [{each.shown_unit}]" for each in inputs), "folder"])]
    decks = []
    for values in product(*nodes.values()):
        given = zip(inputs, values, strict=True)
        shown = [each.shown(value) for each, value in given]
        folder = "_".join(
            f"{each.name}_{re.sub(r'[^A-Za-z0-9.+-]', '', text)}"
            for each, text in zip(inputs, shown, strict=True)
        )
        made = write(model.at(**dict(zip(nodes, map(float, values), strict=True))))
        decks.append(made)
        files |= {f"{folder}/{name}": content for name, content in made.files.items()}
        table.append(",".join([*(text.split(" ")[0] for text in shown), folder]))
    files[TABLE] = "\n".join([*table, ""])
    first = decks[0]
    note = f"{TABLE} says which folder holds the joint at which {' and '.join(each.label for each in inputs)}"
    rows = [_between(model, each, nodes[each.name]) for each in inputs]
    return Export(first.target, files, (*rows, *_worst(decks)), (note, *first.notes))


def _between(model: JointModel, each: Input, nodes: np.ndarray) -> Fidelity:
    """Return the row of an input: what a straight line between decks misses of the law half way between them."""
    cycles = Cycles.of(model)
    alone = model.without_elements()

    def moments(values: np.ndarray) -> np.ndarray:
        return np.array([alone.moment(cycles.angle, cycles.rate, inputs={each.name: v}) for v in values])

    at = moments(nodes)
    missed = (at[1:] + at[:-1]) / 2 - moments((nodes[1:] + nodes[:-1]) / 2)
    words = f"lookup: {nodes.size} decks from {each.shown(nodes[0])} to {each.shown(nodes[-1])}, straight in between"
    worst = max(
        (shares(part[cycles.moving], model.fitted.moment_rms) for part in missed), key=lambda pair: pair[0]
    )
    return Fidelity(each.name, each.name, words, True, *worst)


def _worst(decks: list[Export]) -> list[Fidelity]:
    """Return of each term the row of the deck that carries it worst; all terms last."""
    rows: dict[str, list[Fidelity]] = {}
    for made in decks:
        for row in made.fidelity:
            rows.setdefault(row.term, []).append(row)
    worst = [max(same, key=lambda row: (not row.carried, row.error)) for same in rows.values()]
    return sorted(worst, key=lambda row: row.term == ALL_TERMS)
