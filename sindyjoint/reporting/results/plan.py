"""A plan: its runs and the precision expected of them, on a terminal, as pictures, as a page, as files."""

import textwrap
from collections.abc import Sequence
from typing import Any

import numpy as np

from sindyjoint.planning.plan import PLAN_NAME, TELL_APART, Plan, drive_signal, plan_text, run_name
from sindyjoint.planning.search import PAPER
from sindyjoint.reporting.figure import Curve, Kind, by_name, fixed, plot, scaled
from sindyjoint.reporting.page import Blocks, Page, capital, markup, number, section, sentence
from sindyjoint.reporting.style import INK, MUTED, PALETTE, Axes, amount, pretty_unit
from sindyjoint.reporting.tables import DASH, TextTable, csv_columns, escape, tabulate
from sindyjoint.reporting.view import View
from sindyjoint.text import list_some, percent, spelled
from sindyjoint.trust import Light, Trust, doubt

GOALS = {
    "widths": "widest 95 % interval",
    "frequency": "change over the band",
    "paper": "requirement of the weakest term",
    "tell-apart": "probability of the true effect",
}
DOTS: Any = {"color": PALETTE[0], "marker": "o"}
CROSSES: Any = {"color": MUTED, "marker": "x", "ls": "none", "ms": 5}


def draw_runs(data: Plan, ax: Axes) -> None:
    """Draw level over frequency: the plan's runs with how often each is made, the grid's behind them."""
    up = scaled(f"Amplitude of the {data.runs[0].drive}", max(r.level for r in data.runs), data.runs[0].unit)
    places: dict[tuple[float, float], list[int]] = {}
    for place, run in enumerate(data.runs, 1):
        places.setdefault((run.frequency, run.level * up.factor), []).append(place)
    x, y = zip(*places, strict=True)
    ax.scatter(
        x, y, s=[30.0 * len(numbers) for numbers in places.values()], color=PALETTE[0], alpha=0.8, lw=0
    )
    for (frequency, level), numbers in places.items():
        ax.annotate(
            _spans(numbers), (frequency, level), xytext=(7 + len(numbers), 0), textcoords="offset points",
            va="center", fontsize=6.5, color=INK,
        )  # fmt: skip
    grid = [run.frequency for run in data.grid_runs], [run.level for run in data.grid_runs]
    curves: list[Curve] = [
        *[(*grid, {**CROSSES, "label": "plain grid"})] * bool(data.grid_runs),
        ([], [], {**DOTS, "ls": "none", "ms": 4.5, "label": "plan, larger: made more often"}),
    ]
    plot(ax, "Frequency (Hz)", up, curves, xmargin=0.16, ymargin=0.1, ylim=(0, None))


def _spans(numbers: Sequence[int]) -> str:
    """Return numbers in words, a few spans on each line: 1, 4–9."""
    parts = np.split(numbers, np.flatnonzero(np.diff(numbers) > 1) + 1)
    spans = ", ".join(f"{part[0]}" if part.size == 1 else f"{part[0]}–{part[-1]}" for part in parts)
    return textwrap.fill(spans, 7)


def draw_curve(data: Plan, ax: Axes) -> None:
    """Draw what is made small over the time of the runs, of the plan and of the grid."""
    curves: list[Curve] = []
    for name, look in (
        ("widest", {"color": PALETTE[0], "marker": "o", "label": "plan"}),
        ("highest", {"color": PALETTE[5], "marker": "^", "label": "plan, 95 of 100 tests lie below"}),
        ("grid", {"color": MUTED, "marker": "x", "label": "grid in the same time"}),
    ):
        steps = [(s.seconds, 100 * getattr(s, name)) for s in data.curve if np.isfinite(getattr(s, name))]
        curves += [(*np.transpose(steps), {**look, "ms": 3.5})] * bool(steps)
    if data.now is not None and np.isfinite(data.now.widest):
        dot = {"color": INK, "marker": "D", "ms": 4, "ls": "none", "label": "now", "clip_on": False}
        curves.append(([0], [100 * data.now.widest], dot))
    until = None if data.until is None else 100 * data.until
    curves.append((None, until, {"color": PALETTE[1], "ls": "--", "lw": 0.9, "label": "enough"}))
    label = f"{GOALS[data.goal].capitalize()} (%)"
    plot(ax, "Time of all runs (s)", label, curves, yscale="log", xlim=(0, None))


def draw_complete(data: Plan, ax: Axes) -> None:
    """Draw the share of the joints of which a discovery takes every term that matters, over the time of the runs."""
    curve = [s.seconds for s in data.curve], [100 * s.complete for s in data.curve], DOTS | {"ms": 3.5}
    label = "Joints with every term found (%)"
    plot(ax, "Time of all runs (s)", label, [curve], ylim=(0, 104), xlim=(0, None))


def draw_separation(data: Plan, ax: Axes) -> None:
    """Draw the probability of the true effect, before and after each run that tells effects apart."""
    assert data.apart is not None
    values = [data.apart.before, *data.apart.after]
    plot(
        ax,
        "",
        "Probability of the true effect (%)",
        [
            (range(len(values)), [100 * value for value in values], DOTS | {"ms": 4.5}),
            (
                None,
                100 / len(data.apart.effects),
                {"color": MUTED, "ls": "--", "lw": 0.9, "label": "by chance"},
            ),
        ],
        ylim=(0, 102),
        xlim=(-0.2, len(values) - 0.8),
        xticks=range(len(values)),
        xticklabels=["before", *(f"after run {k}" for k in range(1, len(values)))],
    )


def draw_widths(data: Plan, ax: Axes) -> None:
    """Draw the relative half-width of each term: median and 90 % band of the plan, and the grid's median."""
    band = {"color": PALETTE[0], "lw": 4, "alpha": 0.35, "solid_capstyle": "butt"}
    curves: list[Curve] = [
        ([100 * end / abs(each.value) for end in each.band90], [row, row], band)
        for row, each in enumerate(data.predicted)
    ]
    curves += [
        ([100 * each.relative for each in known], list(range(len(known))), look)
        for known, look in (
            (data.predicted, {**DOTS, "ls": "none", "ms": 4.5, "label": "plan, 90 % band"}),
            (data.grid, {**CROSSES, "label": "grid"}),
        )
        if known
    ]
    plot(
        ax,
        "Half-width of the 95 % interval (% of the coefficient)",
        "",
        curves,
        legend="upper left",
        columns=2,
        xscale="log",
        yticks=range(len(data.predicted)),
        yticklabels=[spelled(each.id, data.model.joint.motion) for each in data.predicted],
        ylim=(len(data.predicted) - 0.5, -1.3),
    )


KINDS = by_name(
    Kind(
        "runs",
        "The runs",
        "Frequency and level of every run; the numbers are their order. Crosses: the grid of the same duration.",
        fixed(draw_runs, when=lambda data: len({run.drive for run in data.runs}) == 1 < len(data.runs)),
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
        fixed(draw_separation, when=lambda data: data.apart is not None and data.apart.after),
        wide=True,
    ),
    Kind(
        "widths",
        "Expected intervals",
        "Half-width of each coefficient's interval, expected from the plan and from the grid of the same duration.",
        fixed(draw_widths, when=lambda data: data.predicted),
        wide=True,
    ),
)


def _share(value: float) -> str:
    return f"{100 * value:.2g} %" if 0 <= value < 10 else DASH


def _tables(result: Plan) -> tuple[TextTable, ...]:
    """Return the runs in their order, and what is expected of each coefficient."""
    grid = {each.id: each for each in result.grid}
    return (
        tabulate(
            "runs",
            "In the order in which they are to be made.",
            range(len(result.runs)),
            {
                "Run": lambda at: f"{at + 1:02d}",
                "Drive": lambda at: result.runs[at].drive,
                "Waveform": lambda at: result.runs[at].waveform,
                "Frequency": lambda at: f"{result.runs[at].frequency:g} Hz",
                "Level": lambda at: amount(result.runs[at].level, result.runs[at].unit, 4),
                "Duration": lambda at: f"{result.runs[at].duration:.4g} s",
                **{name: values.__getitem__ for name, values in _bought(result).items()},
            },
            text=("Run",),
        ),
        tabulate(
            "widths",
            "Half-width of the 95 % interval, relative to the coefficient.",
            result.predicted,
            {
                "Coefficient": lambda each: spelled(each.id, result.model.joint.motion),
                "About": lambda each: f"{number(each.value, 4)} {pretty_unit(each.unit)}",
                "Plan": lambda each: _share(each.relative),
                "90 % of tests": lambda each: " … ".join(
                    _share(end / abs(each.value)) for end in each.band90
                ),
                "Grid": lambda each: _share(grid[each.id].relative) if each.id in grid else DASH,
            },
        ),
    )


def _bought(result: Plan) -> dict[str, list[str]]:
    """Return what is known after each run: what is made small, whether all terms are found, which effect is true."""
    after = () if result.apart is None else result.apart.after
    own = len(result.runs) - len(after)
    steps, beyond, columns = result.curve[:own], [DASH] * len(after), {}
    if steps:
        columns[f"{GOALS[result.goal].capitalize()} then"] = [*(_share(s.widest) for s in steps), *beyond]
        columns["All terms found"] = [*(percent(step.complete) for step in steps), *beyond]
    if after:
        columns[GOALS[TELL_APART].capitalize()] = [*[DASH] * own, *map(percent, after)]
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
    names = [spelled(name, result.model.joint.motion) for name in result.undetermined]
    return f"stays undetermined, its interval holds zero: {list_some(names, 'terms')}" * bool(names)


def _trust(result: Plan) -> Trust:
    """Return what a plan rests on, what its runs will not tell, and what to do with it."""
    apart = result.apart
    unsure = apart is not None and (apart.after or (apart.before,))[-1] < apart.enough
    return Trust(
        (
            doubt(
                "joint",
                "known from before: what is expected holds for joints in that range" * (result.now is None),
                "as the runs of the campaign show it",
            ),
            doubt(
                "determined",
                undetermined_words(result),
                "every coefficient is expected to stand clear of zero",
            ),
            *[Light("apart", "fair", "the effects stay less sure than was asked for")] * unsure,
            *[Light("limits", "fair", "; ".join(result.warnings))] * bool(result.warnings),
        ),
        (
            (
                "sindyjoint simulate --plan RESULTS --out virtual",
                "try these runs on a simulated joint before the bench",
            ),
            ("make the runs in their order", "have a campaign to discover the joint’s law from"),
        )
        if result.runs
        else (
            ("sindyjoint discover CAMPAIGN --out results", "find the law that the runs determine already"),
        ),
    )


def _page(result: Plan, data: Plan, show: Blocks) -> Page:
    """Return what the plan promises, its runs, and what they are expected to tell."""
    runs, widths = _tables(result)
    files = markup("The same in <code>{}</code>; <code>drive-*.csv</code> hold what is prescribed over time.")
    reason = f"{sentence(result.stop)} {sentence(undetermined_words(result))}".rstrip()
    name = data.model.joint.name
    return Page(
        f"{name}: which runs to make",
        "Which runs to make, before they are made",
        name,
        show.hero("runs"),
        (show.verdict(capital(headline(result))), show.paragraph(reason, "reason")),
        (),
        (
            section(
                "runs",
                "The runs",
                "Runs",
                show.tables(runs),
                show.paragraph(files.format(PLAN_NAME) if runs.rows else "None."),
                show.pictures("runs", "curve", "apart"),
            ),
            section(
                "expected",
                "What they are expected to tell",
                "What they tell",
                show.tables(widths),
                show.pictures("widths"),
            ),
        ),
    )


def _files(result: Plan, data: Plan) -> dict[str, str]:
    """Return the plan as a virtual test plays it, its table, and what drives each run, over time."""
    texts = {PLAN_NAME: plan_text(result.runs, result.sensors)} if result.runs else {}
    for place, run in enumerate(result.runs, 1):
        time, signal = drive_signal(run, result.sensors.sample_rate)
        columns = {"time_s": time, f"{run.drive}_{run.unit.replace('*', '')}": signal}
        texts[f"drive-{run_name(place, run)}.csv"] = csv_columns(columns, 6)
    return texts


PLAN = View(
    about=lambda result: f"{escape(result.model.joint.name)}: {escape(headline(result))}",
    data=Plan,
    kind="Plan",
    kinds=KINDS,
    record_file="plan.json",
    judged_by=lambda result: ("planning",),
    rows="runs",
    unsaved={"actuator": None, "sensors": None, "stop": "", "warnings": ()},
    question="Which runs are to be made?",
    headline=_trust,
    tables=_tables,
    page=_page,
    files=_files,
    # When to stop; the rest is held by lights.
    warnings=lambda result: [result.stop] if result.stop else [],
    details=lambda result: (
        f"{term.id}: {low:.4g} to {high:.4g} {term.unit}"
        for term, low, high in zip(result.model.terms, result.low, result.high, strict=True)
    ),
)
