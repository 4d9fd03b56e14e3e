"""Two tests of one joint: what moved, on a terminal, as a page, as files."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np

from sindyjoint.judgement.changed import Change, Shift
from sindyjoint.reporting.figures.changed import KINDS, ChangeFigures
from sindyjoint.reporting.style import pretty_unit
from sindyjoint.reporting.text_table import DASH, TextTable, csv_text, print_whole, terminal, terminal_table
from sindyjoint.reporting.view import View
from sindyjoint.text import rounded


class ChangeView(View[Change, ChangeFigures]):
    """Two tests of one joint."""

    results = (Change, ChangeFigures)
    data = ChangeFigures
    kind = "Change"
    kinds = KINDS
    template = "changed.html.j2"
    record_file = "changed.json"
    records_key = "coefficients"
    judged_by = ("judgement",)

    def gather(self, result: Change | ChangeFigures) -> ChangeFigures:
        """Return what is drawn."""
        if isinstance(result, ChangeFigures):
            return result
        return ChangeFigures(result.after.joint.name, result.shifts, result.margin, result.simulated)

    def tables(self, result: Change) -> tuple[TextTable, ...]:
        """Return a row for each coefficient."""
        rows = tuple(
            (
                shift.symbol,
                shift.answer,
                *_percent(shift),
                _value(shift.before, shift.interval_before),
                _value(shift.after, shift.interval_after),
                pretty_unit(shift.unit),
            )
            for shift in result.shifts
        )
        columns = ("coefficient", "answer", "change", "95 % interval", "before", "after", "unit")
        return (TextTable("coefficients", "Coefficients before and after", columns, rows, text=("unit",)),)

    def content(self, result: Change, data: ChangeFigures, folder: Path | None) -> dict[str, Any]:
        """Return what the page shows."""
        return {
            "title": f"{result.after.joint.name}: before and after",
            "badge": "changed" if result.changed else "no change",
            "headline": result.sentence[:1].upper() + result.sentence[1:] + ".",
            "reason": f"{_named(result.names)}Margin {100 * result.margin:.3g} %.",
        }

    def files(self, result: Change, data: ChangeFigures) -> dict[str, str]:
        """Return the table as CSV."""
        (table,) = self.tables(result)
        return {"changed.csv": csv_text(["symbol", *table.columns[1:]], [list(row) for row in table.rows])}

    def show(self, result: Change) -> None:
        """Print table and answer."""
        from rich.markup import escape

        console = terminal()
        console.print(f"[bold]{escape(result.after.joint.name)}[/]: {escape(' and '.join(result.names))}\n")
        (table,) = self.tables(result)
        print_whole(terminal_table(table.columns, table.rows, "llrrrrl", ruled=True), console)
        console.print(f"\n{escape(result.sentence)}")
        for warning in result.warnings:
            console.print(f"- {escape(warning)}")

    def details(self, result: Change) -> Iterator[str]:
        """Yield the p-value of each coefficient."""
        for shift in result.shifts:
            if np.isfinite(shift.p_value):
                yield f"{shift.id}: p = {shift.p_value:.2g} of being the same"


def _named(names: tuple[str, str]) -> str:
    """Return what the two tests are called, where they have names of their own."""
    return "" if names == ("before", "after") else f"Before: {names[0]}; after: {names[1]}. "


def _value(value: float, interval: tuple[float, float]) -> str:
    return rounded(value, (interval[1] - interval[0]) / 3.92) if np.isfinite(value) else DASH


def _percent(shift: Shift) -> tuple[str, str]:
    if not np.isfinite(shift.change):
        return DASH, DASH
    low, high = (100 * end for end in shift.interval)
    return f"{100 * shift.change:+.3g} %", f"{low:+.3g} … {high:+.3g} %"
