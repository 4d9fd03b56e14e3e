"""What a kind of figure is: a name, how to read it, and the panels that it is made of."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from matplotlib.axes import Axes

Panel = Callable[[Any, Axes], Axes]

MOST_PANELS = 6


@dataclass(frozen=True)
class Kind:
    """A figure: its name, what it shows, and the panels it is made of.

    Parameters
    ----------
    name, title : str
    caption : str
        One sentence that says how to read it; also what a screen reader says.
    panels : callable
        Result → panels to draw, in order; none: the result has nothing of this kind.
    part : bool
        Whether it is one panel of another kind, for drawing alone.
    wide : bool
        Whether a single panel takes the whole width.
    height : callable, optional
        Result → height of a panel in inches; default: by its width.
    projection : str, optional
        Of the axes: ``"3d"``.
    """

    name: str
    title: str
    caption: str
    panels: Callable[[Any], list[Panel]]
    part: bool = False
    wide: bool = False
    height: Callable[[Any], float] | None = None
    projection: str | None = None


def fixed(*panels: Panel) -> Callable[[Any], list[Panel]]:
    """Return what gives the same panels for every result."""
    return lambda data: list(panels)


def each(
    items: Callable[[Any], Sequence[Any]], draw: Callable[[Any, Axes], Axes]
) -> Callable[[Any], list[Panel]]:
    """Return what gives a panel for each of some items of a result; ``draw`` draws one item."""
    return lambda data: [lambda _, ax, item=item: draw(item, ax) for item in items(data)]  # type: ignore[misc]


def spread(items: Sequence[Any], most: int = MOST_PANELS) -> list[Any]:
    """Return at most ``most`` of the items, evenly over the sequence, first and last among them."""
    if len(items) <= most:
        return list(items)
    return [items[i] for i in np.unique(np.linspace(0, len(items) - 1, most).round().astype(int))]


def by_name(*kinds: Kind) -> dict[str, Kind]:
    """Return the kinds of figure of a result by their names, in order."""
    return {kind.name: kind for kind in kinds}
