"""``sindyjoint reproduce``: the paper's tables and figures from virtual tests."""

from __future__ import annotations

import json
import sys
from pathlib import Path
from typing import Annotated

import typer

from sindyjoint.cli.defaults import default_of
from sindyjoint.cli.options import AsJson
from sindyjoint.cli.progress import Progress, Quiet, Verbose

app = typer.Typer(rich_markup_mode=None)


@app.callback(invoke_without_command=True)
def reproduce(
    context: typer.Context,
    out: Annotated[
        Path | None,
        typer.Option("--out", help="Folder for report.html, reproduction.md, tables.csv and figures."),
    ] = None,
    as_json: AsJson = False,
    random_state: Annotated[int, typer.Option(help="Seed of the sensors' noise.")] = default_of(
        "workflows.reproduce:reproduce", "random_state"
    ),
    quiet: Quiet = False,
    verbose: Verbose = False,
) -> None:
    """Make the paper's tables and figures from virtual tests of its two joints, next to its numbers.

    Everything is simulated, and the text says what cannot be reproduced and why.

    Example: sindyjoint reproduce --out reproduction
    """
    if context.invoked_subcommand is not None:
        return
    from sindyjoint.files.atomic import check_output

    if out is not None:
        check_output(out)
    with Progress(quiet, verbose) as progress:
        from sindyjoint.reporting.output import write_results
        from sindyjoint.reporting.registry import show
        from sindyjoint.workflows.reproduce import reproduce as run

        result = run(random_state, progress.say)
        if out is not None:
            progress.say("drawing")
            write_results(result, out, ["sindyjoint", *sys.argv[1:]], random_state)
        progress.tell(result)
    if as_json:
        typer.echo(json.dumps(result.to_dict(), indent=2, allow_nan=False))
    else:
        show(result)
        if out is not None:
            typer.echo(f"\nreport: {out / 'report.html'}")


@app.command()
def tables(
    as_json: AsJson = False,
) -> None:
    """Recompute the paper's printed tables from their rows, and test them for dependence on frequency.

    Example: sindyjoint reproduce tables
    """
    from sindyjoint.reporting.results.reproduction import show_checks
    from sindyjoint.workflows.paper_tables import check_tables, table_findings

    checks = check_tables()
    findings = table_findings(checks)
    if as_json:
        record = {
            "schema": 1,
            "printed_tables": [check.to_dict() for check in checks],
            "findings": list(findings),
        }
        typer.echo(json.dumps(record, indent=2, allow_nan=False))
    else:
        show_checks(checks, findings)
