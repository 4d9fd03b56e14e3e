"""Two tests of one joint: what moved, on a terminal, as a picture, as a page, as files."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import numpy as np
from rich.markup import escape

from sindyjoint.judgement.changed import Change, Shift
from sindyjoint.reporting.figure import Axes, Kind, by_name, math_symbol
from sindyjoint.reporting.page import Blocks, Page, section, sentence
from sindyjoint.reporting.style import ACCENT, INK, PALETTE, RULE, pretty_unit
from sindyjoint.reporting.tables import DASH, Console, TextTable, csv_text, print_table
from sindyjoint.reporting.view import View
from sindyjoint.text import rounded


def _drawn(data: Change) -> list[Shift]:
    """Return the coefficients that are in both tests."""
    return [shift for shift in data.shifts if np.isfinite(shift.change)]


def shifts(data: Change, ax: Axes) -> Axes:
    """Draw the relative change of each coefficient with its 95 % interval, over the margin."""
    rows, margin = _drawn(data), 100 * data.margin
    ax.axvspan(-margin, margin, color=RULE, alpha=0.6, lw=0)
    ax.axvline(0, color=INK, linewidth=0.8)
    reach = 1.4 * data.margin
    for row, shift in enumerate(rows):
        colour = ACCENT if shift.answer.startswith("changed") else PALETTE[0]
        ax.plot([100 * end for end in shift.interval], [row, row], color=colour, solid_capstyle="butt")
        ax.plot(100 * shift.change, row, "o", color=colour, markersize=4)
        if abs(shift.change) < 3:
            reach = max(reach, *(min(abs(end), 3.0) * 1.1 for end in shift.interval))
    ax.set(
        xlim=(-100 * reach, 100 * reach), yticks=range(len(rows)),
        yticklabels=[math_symbol(shift.symbol) for shift in rows], ylim=(len(rows) - 0.5, -0.5),
        xlabel="Change (% of the value before)", title="After against before",
    )  # fmt: skip
    return ax


KINDS = by_name(
    Kind(
        "shifts",
        "After against before",
        "Relative change of each coefficient with its 95 % interval; grey: the margin within which a change does not "
        "matter; orange: changed beyond noise and calibration.",
        lambda data: [shifts] if _drawn(data) else [],
        wide=True,
        height=lambda data: 0.9 + 0.28 * len(_drawn(data)),
    )
)


class ChangeView(
    View[Change, Change],
    data=Change,
    kind="Change",
    kinds=KINDS,
    record_file="changed.json",
    records_key="coefficients",
    judged_by=("judgement",),
):
    """Two tests of one joint."""

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

    def page(self, result: Change, data: Change, show: Blocks, folder: Path | None) -> Page:
        """Return the answer and every coefficient."""
        before, after = result.names
        named = (before, after) != ("before", "after")
        badge, word = ("refuted", "changed") if result.changed else ("confirmed", "no change")
        which = f"Before: {before}; after: {after}. " if named else ""
        said = (
            show.verdict(sentence(result.sentence), badge, word),
            show.paragraph(f"{which}Margin {100 * result.margin:.3g} %.", "reason"),
        )
        blocks = (show.pictures("shifts"), show.table(self.tables(result)[0]), show.warnings(result.warnings))
        return Page(
            f"{data.after.joint.name}: before and after",
            "Before and after",
            data.after.joint.name,
            said,
            (section("coefficients", "Coefficients", "Coefficients", *blocks),),
        )

    def files(self, result: Change, data: Change) -> dict[str, str]:
        """Return the table as CSV."""
        (table,) = self.tables(result)
        return {"changed.csv": csv_text(["symbol", *table.columns[1:]], table.rows)}

    def about(self, result: Change) -> str:
        """Return the joint and its two tests."""
        return f"[bold]{escape(result.after.joint.name)}[/]: {escape(' and '.join(result.names))}\n"

    def show_result(self, result: Change, console: Console) -> None:
        """Print table and answer."""
        print_table(self.tables(result)[0], console, "llrrrrl", ruled=True)
        console.print(f"\n{result.sentence}", markup=False)

    def details(self, result: Change) -> Iterator[str]:
        """Yield the p-value of each coefficient."""
        for shift in result.shifts:
            if np.isfinite(shift.p_value):
                yield f"{shift.id}: p = {shift.p_value:.2g} of being the same"


def _value(value: float, interval: tuple[float, float]) -> str:
    return rounded(value, (interval[1] - interval[0]) / 3.92) if np.isfinite(value) else DASH


def _percent(shift: Shift) -> tuple[str, str]:
    if not np.isfinite(shift.change):
        return DASH, DASH
    low, high = (100 * end for end in shift.interval)
    return f"{100 * shift.change:+.3g} %", f"{low:+.3g} … {high:+.3g} %"
