"""The figures of a comparison: which term is chosen by what, and coefficients by frequency."""

from __future__ import annotations

from functools import partial
from typing import TYPE_CHECKING, Any

import numpy as np

from sindyjoint.reporting.figures.evidence import dependence
from sindyjoint.reporting.figures.kind import Kind, by_name, fixed
from sindyjoint.reporting.style import INK, MUTED, PALETTE, RULE, plain, shortened
from sindyjoint.text import spelled

if TYPE_CHECKING:
    from matplotlib.axes import Axes

    from sindyjoint.judgement.comparison import Comparison


def inclusion_height(result: Comparison) -> float:
    """Return the height of the inclusion map, inches: its rows, and the names of the terms below them."""
    return 2.0 + 0.17 * len(_inclusion_rows(result))


def _inclusion_rows(result: Comparison) -> list[tuple[str, list[float]]]:
    """Return label and share of each term: of the resampled campaigns first, then of every choice."""
    terms = result.shown_ids
    share = dict(zip(result.ids, result.inclusion, strict=True))
    rows = [("resampled campaigns", [share.get(term, 0.0) for term in terms])]
    for choices in (result.methods, result.frequencies, result.libraries):
        rows += [(choice.name, [float(choice[term] is not None) for term in terms]) for choice in choices]
    return rows


def inclusion(result: Comparison, ax: Axes) -> Axes:
    """Draw which term is chosen by what: one row for each method, frequency, library, and the resampled campaigns."""
    terms, rows = result.shown_ids, _inclusion_rows(result)
    ends = np.cumsum([1, len(result.methods), len(result.frequencies)])
    for y, (_, values) in enumerate(rows):
        for x, value in enumerate(values):
            if value > 0:
                colour = PALETTE[0] if terms[x] in result.wanted else PALETTE[1]
                # Area shows the share of replicates; a full square is a certain choice.
                ax.add_patch(_square(x, y, 0.86 * np.sqrt(value), colour))
    for end in ends:
        ax.axhline(end - 0.5, color=MUTED, linewidth=0.6)
    ax.axvline(len(result.wanted) - 0.5, color=INK, linewidth=0.8)
    ax.set(xlim=(-0.5, len(terms) - 0.5), ylim=(len(rows) - 0.5, -0.5))
    names = [spelled(term, result.motion) for term in terms]
    ax.set_xticks(range(len(terms)), names, rotation=40, ha="right", rotation_mode="anchor")
    ax.set_yticks(range(len(rows)), [plain(shortened(name, 20)) for name, _ in rows])
    ax.tick_params(length=0)
    ax.grid(color=RULE, linewidth=0.3)
    ax.set_title("left of the line: the paper's five")
    return ax


def _square(x: float, y: float, side: float, colour: str) -> Any:
    from matplotlib.patches import Rectangle

    return Rectangle((x - side / 2, y - side / 2), side, side, color=colour, linewidth=0)


KINDS = by_name(
    Kind(
        "inclusion",
        "Inclusion map",
        "A square: the term is chosen. In the first row its area is the share of resampled campaigns that do.",
        fixed(inclusion),
        wide=True,
        height=inclusion_height,
    ),
    Kind(
        "dependence",
        "Coefficients by frequency",
        "Each coefficient at each single frequency with its 95 % interval; line and grey band: their mean and the "
        "margin within which they count as the same. Crosses: the paper's tables, where the joint is one of them.",
        lambda result: [partial(dependence, test=test) for test in result.tests],
    ),
)
