"""Two tests of one joint: what moved, on a terminal, as a picture, as a page, as files."""

import numpy as np

from sindyjoint.judgement.changed import Change, Shift
from sindyjoint.reporting.figure import Curve, Kind, by_name, fixed, math_symbol, plot
from sindyjoint.reporting.page import Blocks, Page, section, sentence
from sindyjoint.reporting.style import ACCENT, INK, PALETTE, RULE, Axes, pretty_unit
from sindyjoint.reporting.tables import DASH, TextTable, csv_text, escape, shown, tabulate
from sindyjoint.reporting.view import View
from sindyjoint.text import list_some, rounded
from sindyjoint.trust import Trust, doubt


def _drawn(data: Change) -> list[Shift]:
    """Return the coefficients that are in both tests."""
    return [shift for shift in data.shifts if np.isfinite(shift.change)]


def shifts(data: Change, ax: Axes) -> None:
    """Draw the relative change of each coefficient with its 95 % interval, over the margin."""
    rows, margin = _drawn(data), 100 * data.margin
    ends = [min(abs(end), 3.0) for shift in rows if abs(shift.change) < 3 for end in shift.interval]
    reach = 100 * max([1.4 * data.margin, *(1.1 * end for end in ends)])
    ax.axvspan(-margin, margin, color=RULE, alpha=0.6, lw=0)
    curves: list[Curve] = [(0, None, {"color": INK, "lw": 0.8})]
    for row, shift in enumerate(rows):
        look = {"color": ACCENT if shift.answer.startswith("changed") else PALETTE[0]}
        curves.append(([100 * end for end in shift.interval], [row, row], {"solid_capstyle": "butt", **look}))
        curves.append((100 * shift.change, row, {"marker": "o", "ms": 4, **look}))
    plot(
        ax, "Change (% of the value before)", "", curves, "After against before", xlim=(-reach, reach),
        yticks=range(len(rows)), ylim=(len(rows) - 0.5, -0.5),
        yticklabels=[math_symbol(shift.symbol) for shift in rows],
    )  # fmt: skip


KINDS = by_name(
    Kind(
        "shifts",
        "After against before",
        "Relative change of each coefficient with its 95 % interval; grey: the margin within which a change does not "
        "matter; orange: changed beyond noise and calibration.",
        fixed(shifts, when=_drawn),
        wide=True,
        height=lambda data: 0.9 + 0.28 * len(_drawn(data)),
    )
)


def _value(value: float, interval: tuple[float, float]) -> str:
    return rounded(value, (interval[1] - interval[0]) / 3.92) if np.isfinite(value) else DASH


def coefficients_table(result: Change) -> TextTable:
    """Return a row for each coefficient."""
    return tabulate(
        "coefficients",
        "Coefficients before and after",
        result.shifts,
        {
            "coefficient": lambda shift: shift.symbol,
            "answer": lambda shift: shift.answer,
            "change": lambda shift: shown("{:+.3g} %", 100 * shift.change),
            "95 % interval": lambda shift: shown(
                "{:+.3g} … {:+.3g} %", *(100 * end for end in shift.interval)
            ),
            "before": lambda shift: _value(shift.before, shift.interval_before),
            "after": lambda shift: _value(shift.after, shift.interval_after),
            "unit": lambda shift: pretty_unit(shift.unit),
        },
        text=("unit",),
    )


def _trust(result: Change) -> Trust:
    """Return whether the two tests can be compared and tell a change from none, and what to do next."""
    unsure = [shift.symbol for shift in result.shifts if shift.answer == "cannot tell"]
    alone = [shift.symbol for shift in result.shifts if shift.answer == "not compared"]
    beyond = f"{100 * result.margin:.3g} %"
    return Trust(
        (
            doubt("data", "; ".join(result.warnings), "nothing stands against either of the tests"),
            doubt(
                "alike",
                f"only one of the tests has {list_some(alone, 'terms')}" * bool(alone),
                "both tests have the same terms",
            ),
            doubt(
                "resolved",
                f"a change of more than {beyond} is not ruled out for {list_some(unsure, 'terms')}"
                * bool(unsure),
                f"a change of {beyond} of any coefficient would be seen",
            ),
        ),
        (
            *[("record longer, or at more levels", f"rule out changes of more than {beyond}")] * bool(unsure),
            ("sindyjoint diagnose CAMPAIGN", "see what the later test shows that the earlier model lacks")
            if result.changed
            else ("test the joint again after further use", "see whether that stays so"),
        ),
    )


def _page(result: Change, data: Change, show: Blocks) -> Page:
    """Return the answer and every coefficient."""
    before, after = result.names
    which = f"Before: {before}; after: {after}. " if result.names != ("before", "after") else ""
    badge, word = ("refuted", "changed") if result.changed else ("confirmed", "no change")
    return Page(
        f"{data.after.joint.name}: before and after",
        "Before and after",
        data.after.joint.name,
        "",
        (
            show.verdict(sentence(result.sentence), badge, word),
            show.paragraph(which.strip(), "reason"),
        ),
        (),
        (
            section(
                "coefficients",
                "Coefficients",
                "Coefficients",
                show.pictures("shifts"),
                show.tables(coefficients_table(result)),
            ),
        ),
    )


CHANGED = View(
    about=lambda result: f"[bold]{escape(result.after.joint.name)}[/]: {escape(' and '.join(result.names))}",
    data=Change,
    kind="Change",
    kinds=KINDS,
    record_file="changed.json",
    rows="coefficients",
    judged_by=lambda result: ("judgement",),
    question="Has it changed?",
    headline=_trust,
    tables=lambda result: (coefficients_table(result),),
    page=_page,
    printed=lambda result, console: (
        coefficients_table(result).headed(ruled=True),
        f"\n{escape(result.sentence)}",
    ),
    # What a light holds.
    warnings=lambda result: (),
    # The table as CSV.
    files=lambda result, data: {
        "changed.csv": csv_text(["symbol", *(table := coefficients_table(result)).columns[1:]], table.rows)
    },
    details=lambda result: (
        f"{shift.id}: p = {shift.p_value:.2g} of being the same"
        for shift in result.shifts
        if np.isfinite(shift.p_value)
    ),
)
