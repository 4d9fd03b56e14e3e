"""The figures of a plan: its runs, the precision expected of them, and what each further run gives."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from sindyjoint.planning.plan import Now, Plan, Prediction, Step
from sindyjoint.planning.runs import PlannedRun
from sindyjoint.planning.separation import Separation
from sindyjoint.reporting.figures.kind import Kind, by_name
from sindyjoint.reporting.style import INK, MUTED, PALETTE, legend_above, prefixed
from sindyjoint.text import spelled

if TYPE_CHECKING:
    from matplotlib.axes import Axes

GOALS = {
    "widths": "widest 95 % interval",
    "frequency": "change over the band",
    "paper": "requirement of the weakest term",
    "tell-apart": "probability of the true effect",
}


@dataclass(frozen=True, eq=False)
class PlanFigures:
    """What the pictures of a plan are drawn from; see :class:`~sindyjoint.planning.plan.Plan`."""

    joint: str
    motion: str
    goal: str
    terms: tuple[str, ...]
    runs: tuple[PlannedRun, ...]
    grid_runs: tuple[PlannedRun, ...]
    predicted: tuple[Prediction, ...]
    grid: tuple[Prediction, ...]
    curve: tuple[Step, ...]
    until: float | None
    now: Now | None = None
    apart: Separation | None = None


def figures_of(result: Plan) -> PlanFigures:
    """Return what is drawn of a plan."""
    joint = result.model.joint
    names = ("goal", "terms", "runs", "grid_runs", "predicted", "grid", "curve", "until", "now", "apart")
    return PlanFigures(joint.name, joint.motion, **{name: getattr(result, name) for name in names})


def draw_runs(data: PlanFigures, ax: Axes) -> Axes:
    """Draw level over frequency: the plan's runs with how often each is made, the grid's behind them."""
    factor, unit = prefixed(max(run.level for run in data.runs), data.runs[0].unit)
    if data.grid_runs:
        ax.plot(
            [run.frequency for run in data.grid_runs], [run.level * factor for run in data.grid_runs],
            "x", color=MUTED, ms=5, label="plain grid",
        )  # fmt: skip
    places: dict[tuple[float, float], list[int]] = {}
    for number, run in enumerate(data.runs, 1):
        places.setdefault((run.frequency, run.level * factor), []).append(number)
    x, y = zip(*places, strict=True)
    sizes = [30.0 * len(numbers) for numbers in places.values()]
    ax.scatter(x, y, s=sizes, color=PALETTE[0], alpha=0.8, lw=0)
    ax.plot([], [], "o", color=PALETTE[0], ms=4.5, label="plan, larger: made more often")
    for (frequency, level), numbers in places.items():
        ax.annotate(
            _spans(numbers), (frequency, level), xytext=(7 + len(numbers), 0), textcoords="offset points",
            va="center", fontsize=6.5, color=INK,
        )  # fmt: skip
    ax.set(xlabel="Frequency (Hz)", ylabel=f"Amplitude of the {data.runs[0].drive} ({unit})")
    ax.margins(x=0.16, y=0.1)
    ax.set_ylim(bottom=0)
    legend_above(ax, 2)
    return ax


def _spans(numbers: list[int]) -> str:
    """Return numbers in words: 1, 4–9."""
    spans = [[numbers[0], numbers[0]]]
    for number in numbers[1:]:
        if number == spans[-1][1] + 1:
            spans[-1][1] = number
        else:
            spans.append([number, number])
    return ", ".join(str(a) if a == b else f"{a}–{b}" for a, b in spans)


def draw_curve(data: PlanFigures, ax: Axes) -> Axes:
    """Draw what is made small over the time of the runs, of the plan and of the grid's first runs."""
    for index, (name, label) in enumerate(
        (("widest", "plan"), ("highest", "plan, 95 of 100 tests lie below"), ("grid", "grid, run by run"))
    ):
        steps = [(s.seconds, 100 * getattr(s, name)) for s in data.curve if np.isfinite(getattr(s, name))]
        if steps:
            color = (PALETTE[0], PALETTE[5], MUTED)[index]
            ax.plot(*zip(*steps, strict=True), color=color, marker="o^x"[index], ms=3.5, label=label)
    if data.now is not None and np.isfinite(data.now.widest):
        ax.plot(0, 100 * data.now.widest, "D", color=INK, ms=4, label="now", clip_on=False)
    if data.until is not None:
        ax.axhline(100 * data.until, color=PALETTE[1], ls="--", lw=0.9, label="enough")
    ax.set_yscale("log")
    ax.set_xlim(left=0)
    ax.set(xlabel="Time of all runs (s)", ylabel=f"{GOALS[data.goal].capitalize()} (%)")
    legend_above(ax, 5)
    return ax


def draw_complete(data: PlanFigures, ax: Axes) -> Axes:
    """Draw the share of the joints of which a discovery takes every term that matters, over the time of the runs."""
    ax.plot(
        [step.seconds for step in data.curve], [100 * step.complete for step in data.curve],
        color=PALETTE[0], marker="o", ms=3.5,
    )  # fmt: skip
    ax.set_ylim(0, 104)
    ax.set_xlim(left=0)
    ax.set(xlabel="Time of all runs (s)", ylabel="Joints with every term found (%)")
    return ax


def draw_separation(data: PlanFigures, ax: Axes) -> Axes:
    """Draw the probability of the true effect, before and after each run that tells effects apart."""
    assert data.apart is not None
    values = [data.apart.before, *data.apart.after]
    ax.plot(range(len(values)), [100 * value for value in values], color=PALETTE[0], marker="o", ms=4.5)
    ax.axhline(100 / len(data.apart.effects), color=MUTED, ls="--", lw=0.9, label="by chance")
    ax.set(
        ylim=(0, 102),
        xlim=(-0.2, len(values) - 0.8),
        xticks=range(len(values)),
        xticklabels=["before", *(f"after run {k}" for k in range(1, len(values)))],
        ylabel="Probability of the true effect (%)",
    )
    legend_above(ax, 1)
    return ax


def draw_widths(data: PlanFigures, ax: Axes) -> Axes:
    """Draw the relative half-width of each term: median and 90 % band of the plan, and the grid's median."""
    rows = range(len(data.predicted))
    for row, each in zip(rows, data.predicted, strict=True):
        ends = [100 * end / abs(each.value) for end in each.band90]
        ax.plot(ends, [row, row], color=PALETTE[0], lw=4, alpha=0.35, solid_capstyle="butt")
        ax.plot(
            100 * each.relative, row, "o", color=PALETTE[0], ms=4.5, label="" if row else "plan, 90 % band"
        )
    for row, each in zip(rows, data.grid, strict=False):
        ax.plot(100 * each.relative, row, "x", color=MUTED, ms=5, label="" if row else "grid")
    ax.set(
        xscale="log",
        yticks=list(rows),
        yticklabels=[spelled(each.id, data.motion) for each in data.predicted],
        ylim=(len(data.predicted) - 0.5, -1.3),
        xlabel="Half-width of the 95 % interval (% of the coefficient)",
    )
    ax.legend(loc="upper left", ncols=2, borderaxespad=0.2)
    return ax


KINDS = by_name(
    Kind(
        "runs",
        "The runs",
        "Frequency and level of every run; the numbers are their order. Crosses: the grid of the same duration.",
        lambda data: [draw_runs] if len({run.drive for run in data.runs}) == 1 < len(data.runs) else [],
        wide=True,
    ),
    Kind(
        "curve",
        "What each run buys",
        "What is made small, and, where not in all, in how many joints every term is found, over the time of the runs.",
        lambda data: [
            *[draw_curve] * bool(data.curve),
            *[draw_complete] * any(step.complete < 1 for step in data.curve),
        ],
        wide=True,
    ),
    Kind(
        "apart",
        "Effects told apart",
        "Probability of the true one of the effects, before and after each run that separates them.",
        lambda data: [draw_separation] if data.apart is not None and data.apart.after else [],
        wide=True,
    ),
    Kind(
        "widths",
        "Expected intervals",
        "Half-width of each coefficient's interval, expected from the plan and from the grid of the same duration.",
        lambda data: [draw_widths] if data.predicted else [],
        wide=True,
    ),
)
