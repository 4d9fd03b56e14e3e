"""The figures of a diagnosis: its gap by step, where it lies, what it is made of, and what would explain it."""

from __future__ import annotations

from textwrap import fill
from typing import TYPE_CHECKING

from sindyjoint.diagnosis.falling import reported_together
from sindyjoint.reporting.figures import before_after
from sindyjoint.reporting.figures.kind import Kind, bars, by_name, fixed
from sindyjoint.reporting.style import (
    DASHES,
    MARKERS,
    MUTED,
    PALETTE,
    legend_above,
    plain,
    shortened,
)
from sindyjoint.text import percent, quantities, spelled

if TYPE_CHECKING:
    from matplotlib.axes import Axes

    from sindyjoint.diagnosis.result import Diagnosis

NARROW = 4  # inches of a panel, below which a legend has one column
MOST_RIVALS = 4
FAR = 30  # a noise floor so many times below the gap is drawn on a logarithmic scale


def gap_by_step(result: Diagnosis, ax: Axes) -> Axes:
    """Draw the moment and response gap after each step, down to the noise floor.

    The scale is logarithmic where the noise lies so far below the gap that a linear one would not show it.
    """
    motion = result.model.joint.motion
    groups = reported_together(result.steps)
    labels = ["\n".join(f"+ {spelled(s.effect, motion)}" for s in group) for group in groups]
    labels = ["model alone", *labels]
    gaps = [result.initial, *(group[-1].gap_after for group in groups)]
    names = {"moment": quantities(motion).moment.lower(), "response": "response"}
    shown = [100 * getattr(gap, name) for gap in gaps for name in names]
    shown = [value for value in shown if value == value and value > 0]
    floors = [100 * getattr(result.noise_floor, name) for name in names]
    # A floor of mere rounding would be all that a picture shows; the legend states it.
    known = shown + [floor for floor in floors if shown and floor > min(shown) / FAR**2]
    for index, (name, called) in enumerate(names.items()):
        values = [100 * getattr(gap, name) for gap in gaps]
        colour = PALETTE[index]
        ax.plot(
            range(len(gaps)),
            values,
            color=colour,
            ls=DASHES[index],
            marker=MARKERS[index],
            label=f"{called} gap",
        )
        for step, value in enumerate(values):
            if value == value:
                # The larger of the two gaps is written above its mark, the other below.
                other = 100 * getattr(gaps[step], "response" if name == "moment" else "moment")
                below = value < other or (index == 1 and value == other)
                ax.annotate(
                    percent(value / 100),
                    (step, value),
                    # A gap that falls comes from the upper left and leaves to the lower right.
                    (-6, -3) if below else (6, 3),
                    textcoords="offset points",
                    ha="right" if below else "left",
                    va="top" if below else "bottom",
                    color=colour,
                )
        floor = 100 * getattr(result.noise_floor, name)
        if floor == floor:
            label = f"noise floor of the {called}, {percent(floor / 100)}"
            if shown and floor not in known:
                label += ", below the axis"
            ax.axhline(floor, color=colour, lw=0.8, ls=(0, (1, 1.5)), label=label)
    if known and max(known) > FAR * min(known):
        ax.set(yscale="log", ylim=(0.5 * min(known), 2 * max(known)))
    elif known:
        ax.set_ylim(0, 1.1 * max(known))
    ax.set(
        xticks=range(len(labels)),
        xticklabels=labels,
        xlim=(-0.3, len(labels) - 0.5),
        ylabel="relative RMS (%)",
        title="Gap between model and measurement",
    )
    narrow = ax.bbox.width < NARROW * ax.figure.dpi
    legend_above(ax, 4 if narrow else 2, columns=1 if narrow else 2)
    return ax


def budget_parts(result: Diagnosis, ax: Axes) -> Axes:
    """Draw what the first gap is made of, in mean square."""
    names = ("state", "history", "run", "processing", "noise")
    total = result.budget.total or 1.0
    shares = [100 * getattr(result.budget, name) / total for name in names]
    bars(ax, names, shares, 112, "share of the mean square gap (%)", [*PALETTE[:4], MUTED], "{:.1f} %")
    ax.set_title("Budget of the first gap")
    return ax


def rivals_height(result: Diagnosis) -> float:
    """Return the height of the picture of the rivals, inches: a bar is as thick whatever their number."""
    return 1.1 + 0.28 * sum(1 + len(step.rivals[:MOST_RIVALS]) for step in result.steps)


def rivals(result: Diagnosis, ax: Axes) -> Axes:
    """Draw the probability of the named effect of each step and of its rivals."""
    rows, motion = [], result.model.joint.motion
    for index, step in enumerate(result.steps):
        rows.append((f"{index + 1}. {spelled(step.effect, motion)}", step.probability, PALETTE[0]))
        rows += [(f"    {spelled(name, motion)}", p, MUTED) for name, p in step.rivals[:MOST_RIVALS]]
    labels, values, colours = zip(*rows, strict=True)
    bars(ax, labels, values, 1.08, "probability", colours, "{:.2f}", 0.6)
    ax.set_title("Named effects and their rivals")
    return ax


def where(result: Diagnosis, ax: Axes) -> Axes:
    """Draw the regions that hold more of the gap than their share of the samples."""
    regions = list(result.where)
    labels = [plain(fill(shortened(region.words.partition(":")[0], 60), 26)) for region in regions]
    shares = [100 * region.share for region in regions]
    bars(ax, labels, shares, 100, "share of the mean square gap (%)", PALETTE[0], height=0.6)
    ax.set_title("Where the gap lies")
    return ax


KINDS = by_name(
    Kind(
        "gap",
        "Gap by step",
        "Gap between model and measurement before and after each named effect, with the noise floor.",
        fixed(gap_by_step),
        wide=True,
    ),
    Kind(
        "maps",
        "Maps before and after",
        "Mean of measured less model over cells of angle and rate, with the model alone and with the effects, in "
        "the same colours.",
        before_after.maps,
    ),
    Kind(
        "overlay",
        "Runs before and after",
        "Some runs with the model alone and with the effects, and the residual of either with the noise. "
        "Coefficients are those of the fit to all runs.",
        before_after.overlays,
    ),
    Kind(
        "where",
        "Where the gap lies",
        "Regions of the motion that hold more of the first gap than their share of the samples.",
        lambda result: [where] if result.where else [],
        wide=True,
    ),
    Kind(
        "budget",
        "Budget of the gap",
        "What the first gap is made of: a function of the state, hysteresis, differences between runs, processing, "
        "noise.",
        lambda result: [budget_parts] if result.budget.total == result.budget.total else [],
        wide=True,
    ),
    Kind(
        "rivals",
        "Rivals",
        "Probability of each named effect, and of the effects that would explain nearly as much.",
        lambda result: [rivals] if result.steps else [],
        wide=True,
        height=rivals_height,
    ),
)
