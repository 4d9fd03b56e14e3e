"""What a figure is: a name, how to read it, panels, their axes and places; and its drawing."""

import math
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from typing import Any, TypeAlias

import numpy as np

from sindyjoint.equation.model import JointModel
from sindyjoint.plain import to_plain
from sindyjoint.reporting.equation import split_symbol
from sindyjoint.reporting.style import (
    DASHES,
    DIVERGING,
    INK,
    PALETTE,
    SEQUENTIAL,
    Axes,
    Figure,
    drawing_style,
    legend_above,
    plain,
    prefixed,
    pretty_unit,
    shortened,
)
from sindyjoint.states.surface import ForceStateMap
from sindyjoint.text import power_of_ten, quantities, superscript

# Draws a result into axes.
Panel: TypeAlias = "Callable[[Any, Axes], None]"

# Places, values and look of what is drawn; see :func:`plot`.
Curve: TypeAlias = tuple[Any, Any, Mapping[str, Any]]

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
        Whether it is a single panel of another kind.
    wide : bool
        Whether a single panel takes the whole width.
    height : callable, optional
        Result → height of a panel in inches; default: by its width.
    projection : str, optional
        Of the axes: ``"3d"``.
    columns : int, optional
        Of panels; default: by their number.
    """

    name: str
    title: str
    caption: str
    panels: Callable[[Any], list[Panel]]
    part: bool = False
    wide: bool = False
    height: Callable[[Any], float] | None = None
    projection: str | None = None
    columns: int | None = None


def nothing(ax: Axes, sentence: str) -> None:
    """Say in the picture why there is none."""
    ax.set_axis_off()
    ax.text(0.5, 0.5, sentence, ha="center", va="center", wrap=True, transform=ax.transAxes)


def fixed(*panels: Panel, when: Callable[[Any], object] = lambda data: True) -> Callable[[Any], list[Panel]]:
    """Return what gives the same panels for every result that has what they show."""
    return lambda data: [*panels] * bool(when(data))


def each(
    items: Callable[[Any], Sequence[Any]], draw: Callable[[Any, Axes], None]
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


def drawn(chosen: Kind, panels: Sequence[Panel], data: Any, width: float) -> Figure:
    """Return the panels of a kind of figure as one figure of a width in inches, free of any global state."""
    columns = 1 if width < 5 or len(panels) == 1 else chosen.columns or (3 if len(panels) > 4 else 2)
    rows = math.ceil(len(panels) / columns)
    cell = width / columns if len(panels) > 1 or chosen.wide else min(width, 4.6)
    height = chosen.height(data) if chosen.height else max(2.0, min(0.78 * cell, 2.7))
    with drawing_style():
        from matplotlib.figure import Figure
        from matplotlib.layout_engine import ConstrainedLayoutEngine

        figure = Figure(figsize=(cell * columns, rows * height))
        grid = figure.add_gridspec(rows, columns)
        for index, panel in enumerate(panels):
            row, column = divmod(index, columns)
            # Of an odd number of panels in two columns the last takes the whole row.
            single = columns == 2 and index == len(panels) - 1 and column == 0
            ax = figure.add_subplot(
                grid[row, :] if single else grid[row, column], projection=chosen.projection
            )
            panel(data, ax)
            _plain_ticks(ax)
        # Once: panels that are laid out again while they are written would cost as much as their drawing.
        ConstrainedLayoutEngine().execute(figure)
    return figure


def plot(
    ax: Axes,
    x: "Scale | str",
    y: "Scale | str",
    curves: Iterable[Curve],
    title: object = "",
    *,
    legend: Any = "above",
    columns: int = 1,
    **settings: Any,
) -> None:
    """Draw curves over each other on axes of some scale or label, each given by its places, its values and its look.

    Values without places are a level across the panel, places without values a line up it, and neither is drawn where
    it is not known; a pair of values is a band between them, and a look with ``yerr`` has bars. The ``legend`` stands
    above what is drawn, or where it is said.
    """
    across, up = (each if isinstance(each, Scale) else Scale(each, "") for each in (x, y))
    labels = 0
    for places, values, given in curves:
        level = values if places is None else places if values is None else 0.0
        if not np.isfinite(np.array(level, dtype=float)).all():
            continue
        look = {**given, "label": plain(given["label"])} if given.get("label") else dict(given)
        labels += bool(given.get("label"))
        at: Any = None if places is None else np.asarray(places) * across.factor
        if values is None:
            ax.axvline(at, **look)
        elif isinstance(values, tuple):
            ends: Any = [np.asarray(end) * up.factor for end in values]
            ax.axhspan(*sorted(map(float, ends)), **look) if at is None else ax.fill_between(
                at, *ends, **look
            )
        elif at is None:
            ax.axhline(values * up.factor, **look)
        elif "yerr" in look:
            ax.errorbar(at, np.asarray(values) * up.factor, **look | {"yerr": look["yerr"] * abs(up.factor)})
        else:
            ax.plot(at, np.asarray(values) * up.factor, **look)
    ax.set(xlabel=across.label, ylabel=up.label, **settings)
    if title:
        ax.set_title(plain(shortened(title, 40)))
    if labels and legend == "above":
        legend_above(ax, -(-labels // columns), columns)
    elif labels and legend != "none":
        ax.legend(loc=legend, ncols=columns, labelspacing=0.3)


def cycled(place: int, **more: Any) -> dict[str, Any]:
    """Return colour and dashes of one of several curves, so that each survives grey printing."""
    return {"color": PALETTE[place % len(PALETTE)], "ls": DASHES[place % len(DASHES)], **more}


def bars(
    ax: Axes,
    names: Sequence[str],
    values: Sequence[float],
    end: float,
    label: str,
    color: Any,
    written: str = "",
    height: float = 0.8,
    title: str = "",
) -> None:
    """Draw bars from top to bottom on an axis from zero to ``end``; ``written`` formats the values behind them."""
    ax.barh(range(len(names)), values, height=height, color=color)
    for row, value in enumerate(values if written else ()):
        ax.text(value + 0.008 * end, row, written.format(value), va="center", color=INK)
    ax.set(
        yticks=range(len(names)),
        yticklabels=names,
        ylim=(len(names) - 0.5, -0.5),
        xlim=(0, end),
        xlabel=label,
        title=title,
    )


def _plain_ticks(ax: Axes) -> None:
    """Keep to six ticks, and to text that is no mathematics: drawing spends its time on ticks."""
    from matplotlib.ticker import AutoLocator, LogFormatter, MaxNLocator

    class Powers(LogFormatter):
        """Numbers of a logarithmic axis; which of them stand there is matplotlib's choice."""

        def __call__(self, x: float, pos: int | None = None) -> str:
            return power_of_ten(x) if super().__call__(x, pos) else ""

    for axis in (ax.xaxis, ax.yaxis):
        if isinstance(axis.get_major_locator(), AutoLocator):
            axis.set_major_locator(MaxNLocator(5, steps=[1, 2, 2.5, 5, 10]))
        if axis.get_scale() == "log":
            axis.set_major_formatter(Powers())
            axis.set_minor_formatter(Powers())


def written_cells(
    ax: Axes,
    values: Any,
    words: Any,
    colours: Any,
    names: tuple[Sequence[str], Sequence[str]],
    size: float = 6.5,
    slanted: float = 0.0,
    **look: Any,
) -> Any:
    """Draw a matrix as coloured cells with words of some colours in them, and the names of its rows and columns."""
    mesh = ax.imshow(values, **look)
    for (row, column), word in np.ndenumerate(words):
        ax.text(column, row, word, ha="center", va="center", fontsize=size, color=colours[row, column])
    ax.set_yticks(range(len(names[0])), names[0])
    ax.set_xticks(range(len(names[1])), names[1], rotation=slanted, ha="right" if slanted else "center")
    ax.grid(False)
    return mesh


def colour_scale(ax: Axes, field: Any, label: str) -> None:
    """Put the scale of a coloured field to the right of its panel."""
    ax.figure.colorbar(field, cax=ax.inset_axes((1.03, 0.0, 0.035, 1.0)), label=label)


SUBSCRIPTS = str.maketrans("0123456789", "₀₁₂₃₄₅₆₇₈₉")


def time_label(without_time: bool, motion: str) -> str:
    """Return what an axis of time is called; of samples without time it is the path that they travel."""
    return f"Travelled path ({quantities(motion).angle_unit})" if without_time else "Time (s)"


@dataclass(frozen=True)
class Scale:
    """An axis: the quantity on it, the unit with the prefix that suits it, and the factor to that from SI."""

    name: str
    unit: str
    factor: float = 1.0
    symbol: str = ""

    @property
    def label(self) -> str:
        """What stands at the axis of a picture."""
        unit = f"({self.unit})" if self.unit not in ("", "1") else ""
        return " ".join(part for part in (self.name, self.symbol, unit) if part)

    def to_dict(self) -> dict[str, str]:
        """Return what the drawings of a page say of the axis."""
        return {"name": self.name, "symbol": self.symbol, "unit": self.unit}


def scaled(name: str, values: Any, unit: str, symbol: str = "") -> Scale:
    """Return the axis of a quantity, for values in an SI unit."""
    factor, shown = prefixed(float(np.nanmax(np.abs(values))), unit)
    return Scale(name, shown, factor, symbol)


def angle_scale(motion: str, values: Any) -> Scale:
    """Return the axis of angles (displacements)."""
    q = quantities(motion)
    return scaled(q.angle, values, q.angle_unit, q.angle_symbol)


def rate_scale(model: JointModel, values: Any) -> Scale:
    """Return the axis of rates; along a path without time it is the direction of motion."""
    q = quantities(model.joint.motion)
    if model.fitted.quasi_static:
        return Scale("Direction", "1", symbol=f"d{q.angle_symbol}/ds")
    return scaled(q.rate, values, q.rate_unit, q.rate_symbol)


def moment_scale(motion: str, values: Any, name: str = "") -> Scale:
    """Return the axis of transfer moments (forces), or of another moment by its name."""
    q = quantities(motion)
    return scaled(name or q.transfer, values, q.moment_unit)


def coloured_cells(
    ax: Axes,
    cells: ForceStateMap,
    model: JointModel,
    values: Any,
    limits: tuple[float, float],
    label: str,
    title: str,
    colours: str = SEQUENTIAL,
) -> None:
    """Draw a field over the cells of a map, with its scale unless that has no label; empty cells stay empty."""
    x, y = angle_scale(model.joint.motion, cells.angle_edges), rate_scale(model, cells.rate_edges)
    # Cells as vectors with their seams show through in some viewers; a picture inside the vector file does not.
    mesh = ax.pcolormesh(
        cells.angle_edges * x.factor, cells.rate_edges * y.factor, np.ma.masked_invalid(values.T), cmap=colours,
        vmin=limits[0], vmax=limits[1], rasterized=True,
    )  # fmt: skip
    ax.grid(False)
    if label:
        colour_scale(ax, mesh, label)
    ax.set(xlabel=x.label, ylabel=y.label, title=title)


def moment_cells(
    ax: Axes,
    cells: ForceStateMap,
    model: JointModel,
    title: str,
    label: str = "{}",
    like: ForceStateMap | None = None,
) -> None:
    """Draw the mean moment of every cell of a map, in the colours of that map or of another one.

    The scale has a ``label``, with the unit in the place of its braces.
    """
    largest = float(np.nanmax(np.abs((like or cells).moment))) or 1.0
    z = moment_scale(model.joint.motion, largest)
    ends = -largest * z.factor, largest * z.factor
    coloured_cells(ax, cells, model, cells.moment * z.factor, ends, label.format(z.unit), title, DIVERGING)


#: To four digits for a drawing of a page, lists of lists as the array was; null for what is none.
short_numbers = partial(to_plain, digits=4)


def scale_of(value: float, unit: str) -> tuple[float, str]:
    """Return a power of ten for large coefficients; a prefix would hide the powers of the unit."""
    power = int(np.floor(np.log10(abs(value)))) if value else 0
    if -1 <= power < 5:
        return 1.0, pretty_unit(unit)
    power = 3 * (power // 3)
    return 10.0**-power, f"10{superscript(power)} {pretty_unit(unit)}"


def math_symbol(symbol: str) -> str:
    """Return a term's symbol with its index lowered; text that is not such a symbol stays as it is."""
    head, tail = split_symbol(symbol)
    if tail.isdigit() or not tail:
        return plain(head + tail.translate(SUBSCRIPTS))
    return f"${head}_{{{tail}}}$" if head.isalpha() and tail.isalnum() else plain(symbol)
