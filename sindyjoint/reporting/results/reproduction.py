"""The reproduction of the paper: its tables and figures again, on a terminal, as a page, as files."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from sindyjoint.paper import FREQUENCIES, PULSE, SYMBOLS, TERMS, UNITS
from sindyjoint.reporting.figures.reproduction import KINDS, TRUTHS, ReproductionFigures, figures_of
from sindyjoint.reporting.interactive import response_payload
from sindyjoint.reporting.results.discovery import state_lines
from sindyjoint.reporting.style import pretty_unit
from sindyjoint.reporting.text_table import TextTable, csv_text, milliseconds, terminal, terminal_table
from sindyjoint.reporting.view import View
from sindyjoint.text import percent
from sindyjoint.workflows.reproduce import Reproduction

if TYPE_CHECKING:
    from sindyjoint.judgement.paper_tables import TableCheck
    from sindyjoint.workflows.reproduce import JointReproduction

WIDTH = 118  # characters, for the widest of the tables
# Powers of ten that k1, k2, k3, c1, M_F are printed in.
_POWERS = (3, 5, 9, 1, 0)
_LEGEND = (
    "Identified (paper). Deviation: population standard deviation over the frequencies. Furthest: largest distance "
    "of a row from the paper's, in the paper's deviations. Paper's way: cells averaged with the sticking samples in "
    "them, then a surface, on virtual runs at 3 Hz."
)


class ReproductionView(View[Reproduction, ReproductionFigures]):
    """A reproduction of the paper."""

    results = (Reproduction, ReproductionFigures)
    data = ReproductionFigures
    kind = "Reproduction"
    folder = "reproduction"
    kinds = KINDS
    template = "reproduction.html.j2"
    record_file = "reproduction.json"
    judged_by = ("states", "discovery", "response")

    def gather(self, result: Reproduction | ReproductionFigures) -> ReproductionFigures:
        """Return what is drawn."""
        return result if isinstance(result, ReproductionFigures) else figures_of(result)

    def tables(self, result: Reproduction) -> tuple[TextTable, ...]:
        """Return Tables 1 and 2, and what the printed ones show."""
        checks = check_table(result.checks)
        rows = tuple((f"{row[0]}, {row[1]}", *row[2:]) for row in checks.rows)
        columns = (f"{checks.columns[0]}, {checks.columns[1]}", *checks.columns[2:])
        return (
            *map(joint_table, result.joints),
            TextTable("printed", f"{checks.title}.", columns, rows),
        )

    def content(self, result: Reproduction, data: ReproductionFigures, folder: Path | None) -> dict[str, Any]:
        """Return what the page shows."""
        furthest = max(float(joint.largest_error.max()) for joint in result.joints)
        plain, richer = result.pulse.plain, result.pulse.richer
        every = "Every parameter comes" if furthest < 1 else "Not every parameter comes"
        return {
            "title": "The paper's joints from virtual tests",
            "within": furthest < 1,
            "headline": f"{every} back within the paper's standard deviations.",
            "reason": "Everything here is simulated from the paper's printed values: it shows that the pipeline from "
            "strains to tables holds, not that a real joint is like that.",
            "facts": [
                ("Furthest parameter", f"{furthest:.2f}", "of the paper's standard deviation"),
                (
                    "Amplitude",
                    percent(plain.amplitude_rms_error),
                    f"the paper prints {PULSE.amplitude_rms_error:g}",
                ),
                (
                    "Period",
                    milliseconds(plain.mean_period_difference),
                    f"the paper prints {milliseconds(PULSE.mean_period_difference)}",
                ),
                (
                    "With friction that gives way",
                    f"{percent(richer.amplitude_rms_error)}, {milliseconds(richer.mean_period_difference)}",
                    "amplitude, period: what the model lacks shows",
                ),
            ],
            "legend": _LEGEND,
            "statements": result.statements,
            "payload": {
                "loops": response_payload(
                    [replace(getattr(data, truth), name=name) for truth, name in TRUTHS.items()]
                )
            },
        }

    def files(self, result: Reproduction, data: ReproductionFigures) -> dict[str, str]:
        """Return everything as one page of Markdown, and the tables as CSV."""
        captions = {name: kind.caption for name, kind in self.kinds.items() if kind.panels(data)}
        return {"reproduction.md": page_text(result, captions), "tables.csv": tables_csv(result)}

    def show(self, result: Reproduction) -> None:
        """Print tables and statements."""
        for joint in result.joints:
            table = joint_table(joint)
            _print_table(replace(table, title=f"{table.title[:-1]}, identified (paper)"))
        terminal(WIDTH, markup=False).print(_LEGEND + "\n")
        show_checks(result.checks, result.statements)

    def details(self, result: Reproduction) -> Iterator[str]:
        """Yield the states behind each joint's table."""
        for joint in result.joints:
            yield joint.table.joint
            yield from state_lines(joint.loops)
            yield "furthest of each parameter, in the paper's deviations: " + ", ".join(
                f"{value:.2f}" for value in joint.largest_error
            )


def joint_table(joint: JointReproduction) -> TextTable:
    """Return a table of the paper: identified, and the paper's value in brackets."""
    columns = [
        f"{symbol} [{f'1e{power} ' if power > 1 else ''}{pretty_unit(unit)}]"
        for symbol, unit, power in zip(SYMBOLS, UNITS, _POWERS, strict=True)
    ]
    scale = 10.0 ** np.array([power if power > 1 else 0 for power in _POWERS])

    def cells(values: Any) -> list[str]:
        return [_four_digits(value) for value in np.asarray(values) / scale]

    paper = joint.table
    rows: list[tuple[str, ...]] = []
    for label, ours, theirs in (
        *((f"{f:g} Hz", r, p) for f, r, p in zip(FREQUENCIES, joint.rows, paper.rows, strict=True)),
        ("average", joint.average, paper.average),
        ("deviation", joint.deviation, paper.deviation),
    ):
        rows.append((label, *(f"{a} ({b})" for a, b in zip(cells(ours), cells(theirs), strict=True))))
    rows.append(("furthest", *(f"{value:.2f}" for value in joint.largest_error)))
    rows.append(("paper's way, 3 Hz", *cells(joint.paper_fit.coefficients)))
    title = f"Table {paper.number}: {paper.joint}."
    return TextTable(f"table-{paper.number}", title, ("", *columns), tuple(rows))


def _four_digits(value: float) -> str:
    """Return four digits, trailing zeros included, as the paper prints them."""
    digits = 3 - int(np.floor(np.log10(abs(value)))) if value else 3
    return f"{value:.{max(digits, 0)}f}"


def check_table(checks: Sequence[TableCheck]) -> TextTable:
    """Return what the printed tables say."""
    columns = (
        *("table", "parameter", "average", "printed", "s.d.", "printed"),
        *("change, 3–6 Hz", "possible", "answer"),
    )
    rows = tuple(
        (
            str(check.table),
            check.symbol,
            f"{check.average:.4g}",
            f"{check.printed_average:.4g}{'' if check.average_follows else ' !'}",
            f"{check.deviation:.4g}",
            f"{check.printed_deviation:.4g}{'' if check.deviation_follows else ' !'}",
            f"{100 * check.test.change:+.1f} % (p {check.test.p_trend:.2f})",
            f"{100 * check.test.change_bound:.0f} %",
            check.test.answer,
        )
        for check in checks
    )
    return TextTable("printed", "The printed tables, recomputed from their rows", columns, rows)


def page_text(result: Reproduction, captions: Mapping[str, str]) -> str:
    """Return everything as one Markdown page; `captions` of the figures by name."""
    parts = ["# The paper's tables and figures from virtual tests", ""]
    parts += [f"- {sentence}" for sentence in result.statements]
    for joint in result.joints:
        table = joint_table(joint)
        parts += ["", f"## {table.title[:-1]}", "", _LEGEND, "", table.markdown()]
    parts += ["", "## What the printed tables show", "", check_table(result.checks).markdown(), ""]
    parts += [
        "`!`: does not follow from the printed rows. *Possible*: the largest change that the four values leave "
        "possible at 5 % risk.",
        "",
    ]
    parts += ["## Figures", ""]
    parts += [f"![{caption}](figures/{name}.svg)\n\n{caption}\n" for name, caption in captions.items()]
    return "\n".join(parts)


def tables_csv(result: Reproduction) -> str:
    """Return Tables 1 and 2, identified and printed, as CSV."""
    columns = ("table", "joint", "frequency_hz", "term", "symbol", "unit")
    rows = [
        (joint.table.number, joint.table.joint, f, term, symbol, unit, *map(repr, map(float, numbers)))
        for joint in result.joints
        for f, *values in zip(FREQUENCIES, joint.rows, joint.errors, joint.table.rows, strict=True)
        for term, symbol, unit, *numbers in zip(TERMS, SYMBOLS, UNITS, *values, strict=True)
    ]
    return csv_text((*columns, "identified", "standard_error", "paper"), rows)


def show_checks(checks: Sequence[TableCheck], findings: Sequence[str]) -> None:
    """Print what the paper's printed tables show."""
    _print_table(check_table(checks))
    console = terminal(WIDTH, markup=False)
    for sentence in findings:
        console.print(f"- {sentence}")


def _print_table(table: TextTable) -> None:
    console = terminal(WIDTH, markup=False)
    console.print(table.title)
    console.print(terminal_table(table.columns, table.rows, wraps=True))
    console.print()
