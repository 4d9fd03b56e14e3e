"""A plan: its runs and the precision expected of them, on a terminal, as pictures, as a page, as files."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from pathlib import Path

import numpy as np
from rich.markup import escape

from sindyjoint.planning.plan import TELL_APART, Plan
from sindyjoint.planning.plan_file import PLAN_NAME, drive_signal, plan_text, run_name
from sindyjoint.planning.search import PAPER
from sindyjoint.reporting.figure import Axes, Kind, by_name
from sindyjoint.reporting.page import Blocks, Page, capital, markup, number, section, sentence
from sindyjoint.reporting.style import INK, MUTED, PALETTE, amount, legend_above, prefixed, pretty_unit
from sindyjoint.reporting.tables import DASH, TextTable, csv_columns
from sindyjoint.reporting.view import View
from sindyjoint.text import list_some, percent, spelled

GOALS = {
    "widths": "widest 95 % interval",
    "frequency": "change over the band",
    "paper": "requirement of the weakest term",
    "tell-apart": "probability of the true effect",
}


def draw_runs(data: Plan, ax: Axes) -> Axes:
    """Draw level over frequency: the plan's runs with how often each is made, the grid's behind them."""
    factor, unit = prefixed(max(run.level for run in data.runs), data.runs[0].unit)
    if data.grid_runs:
        ax.plot(
            [run.frequency for run in data.grid_runs], [run.level * factor for run in data.grid_runs],
            "x", color=MUTED, ms=5, label="plain grid",
        )  # fmt: skip
    places: dict[tuple[float, float], list[int]] = {}
    for place, run in enumerate(data.runs, 1):
        places.setdefault((run.frequency, run.level * factor), []).append(place)
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


def _spans(numbers: Sequence[int]) -> str:
    """Return numbers in words: 1, 4–9."""
    parts = np.split(numbers, np.flatnonzero(np.diff(numbers) > 1) + 1)
    return ", ".join(f"{part[0]}" if part.size == 1 else f"{part[0]}–{part[-1]}" for part in parts)


def draw_curve(data: Plan, ax: Axes) -> Axes:
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


def draw_complete(data: Plan, ax: Axes) -> Axes:
    """Draw the share of the joints of which a discovery takes every term that matters, over the time of the runs."""
    ax.plot(
        [step.seconds for step in data.curve], [100 * step.complete for step in data.curve],
        color=PALETTE[0], marker="o", ms=3.5,
    )  # fmt: skip
    ax.set_ylim(0, 104)
    ax.set_xlim(left=0)
    ax.set(xlabel="Time of all runs (s)", ylabel="Joints with every term found (%)")
    return ax


def draw_separation(data: Plan, ax: Axes) -> Axes:
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


def draw_widths(data: Plan, ax: Axes) -> Axes:
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
        yticklabels=[spelled(each.id, data.model.joint.motion) for each in data.predicted],
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


class PlanView(
    View[Plan, Plan],
    data=Plan,
    kind="Plan",
    kinds=KINDS,
    record_file="plan.json",
    judged_by=("planning",),
    records_key="runs",
    unsaved={"actuator": None, "sensors": None, "stop": "", "warnings": ()},
):
    """A plan of runs."""

    def tables(self, result: Plan) -> tuple[TextTable, ...]:
        """Return the runs in their order, and what is expected of each coefficient."""
        bought = _bought(result)
        columns = ("Run", "Drive", "Waveform", "Frequency", "Level", "Duration", *bought)
        rows = tuple(
            (
                f"{place:02d}",
                run.drive,
                run.waveform,
                f"{run.frequency:g} Hz",
                amount(run.level, run.unit, 4),
                f"{run.duration:.4g} s",
                *(values[place - 1] for values in bought.values()),
            )
            for place, run in enumerate(result.runs, 1)
        )
        grid = {each.id: each for each in result.grid}
        widths = tuple(
            (
                spelled(each.id, result.model.joint.motion),
                f"{number(each.value, 4)} {pretty_unit(each.unit)}",
                _share(each.relative),
                " … ".join(_share(end / abs(each.value)) for end in each.band90),
                _share(grid[each.id].relative) if each.id in grid else DASH,
            )
            for each in result.predicted
        )
        what = "Half-width of the 95 % interval, relative to the coefficient."
        heads = ("Coefficient", "About", "Plan", "90 % of tests", "Grid")
        return (
            TextTable("runs", "In the order in which they are to be made.", columns, rows, text=("Run",)),
            TextTable("widths", what, heads, widths),
        )

    def page(self, result: Plan, data: Plan, show: Blocks, folder: Path | None) -> Page:
        """Return what the plan promises, its runs, and what they are expected to tell."""
        runs, widths = self.tables(result)
        files = markup(
            "The same in <code>{}</code>; <code>drive-*.csv</code> hold what is prescribed over time."
        )
        listed = (show.table(runs), show.paragraph(files.format(PLAN_NAME)))
        expected = (show.table(widths), show.pictures("widths")) if result.predicted else ()
        reason = f"{sentence(result.stop)} {sentence(undetermined_words(result))}".rstrip()
        return Page(
            f"{data.model.joint.name}: which runs to make",
            "Which runs to make, before they are made",
            data.model.joint.name,
            (
                show.verdict(capital(headline(result))),
                show.paragraph(reason, "reason"),
                show.warnings(result.warnings),
            ),
            (
                section(
                    "runs",
                    "The runs",
                    "Runs",
                    *(listed if runs.rows else (show.paragraph("None."),)),
                    show.pictures("runs", "curve", "apart"),
                ),
                section("expected", "What they are expected to tell", "What they tell", *expected),
            ),
        )

    def files(self, result: Plan, data: Plan) -> dict[str, str]:
        """Return the plan as a virtual test plays it, its table, and what drives each run, over time."""
        if not result.runs:
            return {}
        texts = {PLAN_NAME: plan_text(result.runs, result.sensors)}
        for place, run in enumerate(result.runs, 1):
            time, signal = drive_signal(run, result.sensors.sample_rate)
            columns = {"time_s": time, f"{run.drive}_{run.unit.replace('*', '')}": signal}
            texts[f"drive-{run_name(place, run)}.csv"] = csv_columns(columns, 6)
        return texts

    def about(self, result: Plan) -> str:
        """Return the joint and what the plan promises."""
        return f"{escape(result.model.joint.name)}: {escape(headline(result))}"

    def warnings(self, result: Plan) -> list[str]:
        """Return when to stop and what stays undetermined, too."""
        return [text for text in (result.stop, undetermined_words(result), *result.warnings) if text]

    def details(self, result: Plan) -> Iterator[str]:
        """Yield the range of every coefficient."""
        for term, low, high in zip(result.model.terms, result.low, result.high, strict=True):
            yield f"{term.id}: {low:.4g} to {high:.4g} {term.unit}"


def _bought(result: Plan) -> dict[str, list[str]]:
    """Return what is known after each run: what is made small, whether all terms are found, which effect is true."""
    after = () if result.apart is None else result.apart.after
    own = len(result.runs) - len(after)
    steps = result.curve[:own]
    columns = {}
    if steps:
        columns[f"{GOALS[result.goal].capitalize()} then"] = [_share(step.widest) for step in steps]
        columns["All terms found"] = [percent(step.complete) for step in steps]
        columns = {name: [*values, *[DASH] * len(after)] for name, values in columns.items()}
    if after:
        columns[f"{GOALS[TELL_APART].capitalize()}"] = [*[DASH] * own, *map(percent, after)]
    return columns


def headline(result: Plan) -> str:
    """Return what a plan promises, in a sentence."""
    apart = result.apart
    steps = result.curve[: len(result.runs) - (0 if apart is None else len(apart.after))]
    if not result.runs:
        lost = apart is not None and apart.before < apart.enough
        return "no run that can be made tells the effects apart." if lost else "no further run is needed."
    text = f"{result.count}, {result.seconds:.4g} s"
    if steps:
        sign = "" if result.goal == PAPER else "±"
        text += f"; {GOALS[result.goal]} {sign}{_share(steps[-1].widest)}"
        grid = result.curve[-1].grid
        if len(steps) == len(result.curve) and 0 < grid < float("inf"):
            text += f", by a plain grid of the same duration {sign}{_share(grid)}"
    if apart is not None and apart.after:
        text += f"; {GOALS[TELL_APART]} {percent(apart.after[-1])}, {percent(apart.before)} without"
    if result.now is not None:
        first = result.runs[0]
        text += f"; the next is {first.frequency:g} Hz, {amount(first.level, first.unit, 4)} for {first.duration:.4g} s"
    return f"{text}."


def undetermined_words(result: Plan) -> str:
    """Return what no run of the plan determines, in words; empty where all is."""
    if not result.undetermined:
        return ""
    names = [spelled(name, result.model.joint.motion) for name in result.undetermined]
    return f"stays undetermined, its interval holds zero: {list_some(names, 'terms')}"


def _share(value: float) -> str:
    return f"{100 * value:.2g} %" if 0 <= value < 10 else DASH
