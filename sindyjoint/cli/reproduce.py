"""``sindyjoint reproduce``: the paper's tables and figures from virtual tests."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Annotated

import typer

from sindyjoint.cli.answer import answer, call
from sindyjoint.cli.defaults import default_of
from sindyjoint.cli.options import AsJson, Output, with_blocks
from sindyjoint.cli.progress import Progress

app = typer.Typer(rich_markup_mode=None)
REPRODUCE = "workflows.reproduce:reproduce"


@app.callback(invoke_without_command=True)
@with_blocks
def reproduce(
    context: typer.Context,
    out: Annotated[
        Path | None,
        typer.Option("--out", help="Folder for report.html, reproduction.md, tables.csv and figures."),
    ] = None,
    *,
    output: Output,
    random_state: Annotated[int, typer.Option(min=0, help="Seed of the sensors' noise.")] = default_of(
        REPRODUCE, "random_state"
    ),
    progress: Progress,
) -> None:
    """Make the paper's tables and figures from virtual tests of its two joints, next to its numbers.

    Everything is simulated, and the text says what cannot be reproduced and why.

    Example: sindyjoint reproduce --out reproduction
    """
    if context.invoked_subcommand is not None:
        return

    find = call(REPRODUCE, random_state, progress.say)
    answer(find, out, output, progress, random_state)


@app.command()
def tables(
    as_json: AsJson = False,
) -> None:
    """Recompute the paper's printed tables from their rows, and test them for dependence on frequency.

    Example: sindyjoint reproduce tables
    """
    from sindyjoint.judgement.paper_tables import PrintedTables, check_tables, table_findings
    from sindyjoint.reporting.results.reproduction import show_checks

    checks = check_tables()
    findings = table_findings(checks)
    if as_json:
        record = PrintedTables(checks, findings).to_dict()
        typer.echo(json.dumps(record, indent=2, allow_nan=False))
    else:
        show_checks(checks, findings)
