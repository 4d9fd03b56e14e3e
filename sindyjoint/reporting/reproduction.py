"""The reproduction of the paper for people: tables, a page, a page of text, and their folder."""

from __future__ import annotations

import csv
import io
import os
import sys
from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from sindyjoint.paper import FREQUENCIES, PULSE, SYMBOLS, TERMS, UNITS
from sindyjoint.reporting.style import pretty_unit

if TYPE_CHECKING:
    from sindyjoint.reporting.provenance import Provenance
    from sindyjoint.workflows.paper_tables import TableCheck
    from sindyjoint.workflows.reproduce import JointReproduction, Reproduction

WIDTH = 118

# Powers of ten that k1, k2, k3, c1, M_F are printed in.
_POWERS = (3, 5, 9, 1, 0)


def table_rows(joint: JointReproduction) -> list[list[str]]:
    """Return a table as rows of text: identified, and the paper's value in brackets."""
    heading = [
        f"{symbol} [{f'1e{power} ' if power > 1 else ''}{pretty_unit(unit)}]"
        for symbol, unit, power in zip(SYMBOLS, UNITS, _POWERS, strict=True)
    ]
    scale = 10.0 ** np.array([power if power > 1 else 0 for power in _POWERS])

    def cells(values: Any) -> list[str]:
        return [_four_digits(value) for value in np.asarray(values) / scale]

    paper = joint.table
    rows = [["", *heading]]
    for label, ours, theirs in (
        *((f"{f:g} Hz", r, p) for f, r, p in zip(FREQUENCIES, joint.rows, paper.rows, strict=True)),
        ("average", joint.average, paper.average),
        ("deviation", joint.deviation, paper.deviation),
    ):
        rows.append([label, *(f"{a} ({b})" for a, b in zip(cells(ours), cells(theirs), strict=True))])
    rows.append(["furthest", *(f"{value:.2f}" for value in joint.largest_error)])
    rows.append(["paper's way, 3 Hz", *cells(joint.paper_fit.coefficients)])
    return rows


def _four_digits(value: float) -> str:
    """Return four digits, trailing zeros included, as the paper prints them."""
    digits = 3 - int(np.floor(np.log10(abs(value)))) if value else 3
    return f"{value:.{max(digits, 0)}f}"


def check_rows(checks: Sequence[TableCheck]) -> list[list[str]]:
    """Return what the printed tables say as rows of text."""
    rows = [
        [
            "table",
            "parameter",
            "average",
            "printed",
            "s.d.",
            "printed",
            "change, 3–6 Hz",
            "possible",
            "answer",
        ]
    ]
    for check in checks:
        rows.append(
            [
                str(check.table),
                check.symbol,
                f"{check.average:.4g}",
                f"{check.printed_average:.4g}{'' if check.average_follows else ' !'}",
                f"{check.deviation:.4g}",
                f"{check.printed_deviation:.4g}{'' if check.deviation_follows else ' !'}",
                f"{100 * check.test.change:+.1f} % (p {check.test.p_trend:.2f})",
                f"{100 * check.test.change_bound:.0f} %",
                check.test.answer,
            ]
        )
    return rows


def _markdown(rows: list[list[str]]) -> str:
    lines = [f"| {' | '.join(row)} |" for row in rows]
    return "\n".join([lines[0], "|" + "---|" * len(rows[0]), *lines[1:]])


_LEGEND = (
    "Identified (paper). Deviation: population standard deviation over the frequencies. Furthest: largest distance "
    "of a row from the paper's, in the paper's deviations. Paper's way: cells averaged with the sticking samples in "
    "them, then a surface, on virtual runs at 3 Hz."
)


def page_text(result: Reproduction, captions: Mapping[str, str]) -> str:
    """Return everything as one Markdown page; `captions` of the figures by name."""
    parts = ["# The paper's tables and figures from virtual tests", ""]
    parts += [f"- {sentence}" for sentence in result.statements]
    for joint in result.joints:
        parts += ["", f"## Table {joint.table.number}: {joint.table.joint}", "", _LEGEND, ""]
        parts.append(_markdown(table_rows(joint)))
    parts += ["", "## What the printed tables show", "", _markdown(check_rows(result.checks)), ""]
    parts += [
        "`!`: does not follow from the printed rows. *Possible*: the largest change that the four values leave",
        "",
    ]
    parts[-2] += " possible at 5 % risk."
    parts += ["## Figures", ""]
    parts += [f"![{caption}](figures/{name}.svg)\n\n{caption}\n" for name, caption in captions.items()]
    return "\n".join(parts)


def tables_csv(result: Reproduction) -> str:
    """Return Tables 1 and 2, identified and printed, as CSV."""
    buffer = io.StringIO()
    writer = csv.writer(buffer, lineterminator="\n")
    writer.writerow(
        ["table", "joint", "frequency_hz", "term", "symbol", "unit", "identified", "standard_error", "paper"]
    )
    for joint in result.joints:
        for f, ours, errors, theirs in zip(
            FREQUENCIES, joint.rows, joint.errors, joint.table.rows, strict=True
        ):
            for i, term in enumerate(TERMS):
                writer.writerow(
                    [joint.table.number, joint.table.joint, f, term, SYMBOLS[i], UNITS[i], repr(float(ours[i])),
                     repr(float(errors[i])), repr(theirs[i])]
                )  # fmt: skip
    return buffer.getvalue()


def reproduction_page(result: Reproduction, origin: Provenance, pictures: dict[str, bytes]) -> str:
    """Return the report as one HTML text."""
    from sindyjoint.reporting.page import render
    from sindyjoint.reporting.reproduction_figures import TRUTHS, figures_of
    from sindyjoint.reporting.result_pages import inlined, milliseconds, response_payload
    from sindyjoint.text import percent

    figures = figures_of(result)
    furthest = max(float(joint.largest_error.max()) for joint in result.joints)
    plain, richer = result.pulse.plain, result.pulse.richer
    return render(
        "reproduction.html.j2",
        title="The paper's joints from virtual tests",
        origin=origin,
        within=furthest < 1,
        headline="Every parameter comes back within the paper's own standard deviations."
        if furthest < 1
        else "Not every parameter comes back within the paper's own standard deviations.",
        reason="Everything here is simulated from the paper's printed values: it shows that the chain from strains to "
        "tables holds, not that a real joint is like that.",
        facts=[
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
        legend=_LEGEND,
        tables=[
            (
                f"table-{joint.table.number}",
                f"Table {joint.table.number}: {joint.table.joint}.",
                rows[0],
                rows[1:],
            )
            for joint in result.joints
            for rows in (table_rows(joint),)
        ],
        printed=[(f"{row[0]}, {row[1]}", *row[2:]) for row in check_rows(result.checks)],
        statements=result.statements,
        payload={
            "loops": response_payload(
                [replace(getattr(figures, truth), name=name) for truth, name in TRUTHS.items()]
            )
        },
        **inlined(figures, pictures),
    )


def write_reproduction(
    result: Reproduction,
    folder: str | os.PathLike[str],
    command_line: str | Sequence[str] | None = None,
    seed: object = None,
) -> Path:
    """Write report.html, reproduction.md, reproduction.json, tables.csv and figures/*.svg, all of them or none."""
    from sindyjoint.reporting.figures import kinds_of
    from sindyjoint.reporting.output import draw_all, json_text, write_folder
    from sindyjoint.reporting.provenance import provenance
    from sindyjoint.reporting.reproduction_figures import figures_of
    from sindyjoint.reporting.saved import DATA_FILE, saved_text

    figures = figures_of(result)
    pictures = draw_all(figures)
    captions = {name: kinds_of(figures)[name].caption for name in pictures}
    texts = {
        DATA_FILE: saved_text(figures),
        "report.html": reproduction_page(result, provenance(None, seed, command_line), pictures),
        "reproduction.md": page_text(result, captions),
        "reproduction.json": json_text(result.to_dict()),
        "tables.csv": tables_csv(result),
    }
    return write_folder(folder, pictures, texts)


def show_reproduction(result: Reproduction) -> None:
    """Print tables and statements."""
    for joint in result.joints:
        _print_table(
            f"Table {joint.table.number}: {joint.table.joint}, identified (paper)", table_rows(joint)
        )
    _console().print(_LEGEND + "\n")
    show_checks(result.checks, ())
    _print_statements(result.statements)


def show_checks(checks: Sequence[TableCheck], findings: Sequence[str]) -> None:
    """Print what the paper's printed tables show."""
    _print_table("The printed tables, recomputed from their rows", check_rows(checks))
    _print_statements(findings)


def _console() -> Any:
    from rich.console import Console

    return Console(width=None if sys.stdout.isatty() else WIDTH, highlight=False, markup=False)


def _print_table(title: str, rows: list[list[str]]) -> None:
    from rich.table import Table

    console = _console()
    console.print(title)
    table = Table(box=None, pad_edge=False, padding=(0, 2, 0, 0))
    for column, heading in enumerate(rows[0]):
        table.add_column(heading, justify="right" if column else "left")
    for row in rows[1:]:
        table.add_row(*row)
    console.print(table)
    console.print()


def _print_statements(said: Sequence[str]) -> None:
    console = _console()
    for sentence in said:
        console.print(f"- {sentence}")
