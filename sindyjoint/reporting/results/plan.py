"""A plan: its runs and the precision expected of them, on a terminal, as a page, as files."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import Any

from sindyjoint.planning.plan import Plan
from sindyjoint.planning.plan_file import PLAN_NAME, drive_signal, plan_text, run_name
from sindyjoint.planning.search import PAPER
from sindyjoint.planning.separation import TELL_APART
from sindyjoint.reporting.figures.plan import GOALS, KINDS, PlanFigures, figures_of
from sindyjoint.reporting.page import number
from sindyjoint.reporting.style import prefixed, pretty_unit
from sindyjoint.reporting.text_table import DASH, TextTable, csv_text, print_whole, terminal, terminal_table
from sindyjoint.reporting.view import View
from sindyjoint.text import list_some, percent, spelled


class PlanView(View[Plan, PlanFigures]):
    """A plan of runs."""

    results = (Plan, PlanFigures)
    data = PlanFigures
    kind = "Plan"
    kinds = KINDS
    template = "plan.html.j2"
    record_file = "plan.json"
    judged_by = ("planning",)
    records_key = "runs"

    def gather(self, result: Plan | PlanFigures) -> PlanFigures:
        """Return what is drawn."""
        return result if isinstance(result, PlanFigures) else figures_of(result)

    def tables(self, result: Plan) -> tuple[TextTable, ...]:
        """Return the runs in their order, and what is expected of each coefficient."""
        columns = ("Run", "Drive", "Waveform", "Frequency", "Level", "Duration", *_bought(result))
        rows = tuple(
            (
                f"{place:02d}",
                run.drive,
                run.waveform,
                f"{run.frequency:g} Hz",
                _amount(run.level, run.unit),
                f"{run.duration:.4g} s",
                *(values[place - 1] for values in _bought(result).values()),
            )
            for place, run in enumerate(result.runs, 1)
        )
        grid = {each.id: each for each in result.grid}
        widths = tuple(
            (
                spelled(each.id, result.model.joint.motion),
                f"{number(each.value, 4)} {pretty_unit(each.unit)}",
                _share(each.relative),
                f"{_share(each.band90[0] / abs(each.value))} … {_share(each.band90[1] / abs(each.value))}",
                _share(grid[each.id].relative) if each.id in grid else DASH,
            )
            for each in result.predicted
        )
        return (
            TextTable("runs", "In the order in which they are to be made.", columns, rows, text=("Run",)),
            TextTable(
                "widths",
                "Half-width of the 95 % interval, relative to the coefficient.",
                ("Coefficient", "About", "Plan", "90 % of tests", "Grid"),
                widths,
            ),
        )

    def content(self, result: Plan, data: PlanFigures, folder: Path | None) -> dict[str, Any]:
        """Return what the page shows."""
        return {
            "title": f"{result.model.joint.name}: which runs to make",
            "headline": headline(result),
            "reason": _sentence(result.stop),
            "lost": undetermined_words(result),
            "plan_file": PLAN_NAME,
        }

    def files(self, result: Plan, data: PlanFigures) -> dict[str, str]:
        """Return the plan as a virtual test plays it, its table, and what drives each run, over time."""
        if not result.runs:
            return {}
        texts = {PLAN_NAME: plan_text(result.runs, result.sensors)}
        for place, run in enumerate(result.runs, 1):
            time, signal = drive_signal(run, result.sensors.sample_rate)
            rows = [[f"{t:.6g}", f"{value:.6g}"] for t, value in zip(time, signal, strict=True)]
            unit = run.unit.replace("*", "")
            texts[f"drive-{run_name(place, run)}.csv"] = csv_text(["time_s", f"{run.drive}_{unit}"], rows)
        return texts

    def show(self, result: Plan) -> None:
        """Print the runs, the precision expected of them, and when to stop."""
        from rich.markup import escape

        console = terminal()
        console.print(f"{escape(result.model.joint.name)}: {escape(headline(result))}\n")
        for table in self.tables(result):
            if table.rows:
                print_whole(terminal_table([column.lower() for column in table.columns], table.rows), console)
                console.print()
        console.print(escape(_sentence(result.stop)))
        for text in (undetermined_words(result), *result.warnings):
            if text:
                console.print(f"- {escape(text)}")

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
        text += f"; the next is {first.frequency:g} Hz, {_amount(first.level, first.unit)} for {first.duration:.4g} s"
    return f"{text}."


def undetermined_words(result: Plan) -> str:
    """Return what no run of the plan determines, in words; empty where all is."""
    if not result.undetermined:
        return ""
    names = [spelled(name, result.model.joint.motion) for name in result.undetermined]
    return f"stays undetermined, its interval holds zero: {list_some(names, 'terms')}"


def _sentence(text: str) -> str:
    return f"{text[:1].upper()}{text[1:]}."


def _amount(value: float, unit: str) -> str:
    factor, shown = prefixed(value, unit)
    return f"{value * factor:.4g} {shown}"


def _share(value: float) -> str:
    return f"{100 * value:.2g} %" if 0 <= value < 10 else DASH
