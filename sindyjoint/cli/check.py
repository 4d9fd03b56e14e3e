"""``sindyjoint check``: are the data sound."""

from __future__ import annotations

import json
import sys
from pathlib import Path
from typing import Annotated

import typer

from sindyjoint.cli.options import AcceptOption, AsJson, CampaignPath
from sindyjoint.cli.progress import Progress, Quiet, Verbose


def check(
    campaign: CampaignPath = None,
    accept: AcceptOption = None,
    out: Annotated[
        Path | None,
        typer.Option("--out", help="Folder for report.html, check.json, findings.csv and figures."),
    ] = None,
    as_json: AsJson = False,
    quiet: Quiet = False,
    verbose: Verbose = False,
) -> None:
    """Check the data: saturation, spikes, dropouts, delay, units, coverage; with a picture of every channel.

    The same check runs at the start of discover, compare, diagnose, verify and batch.

    Exit status 0: sound, or doubtful; 1: unsound, so that no model is made, unless all that stops is accepted; 2: the
    input is at fault.

    Example: sindyjoint check tests/campaign.toml --out soundness
    """
    from sindyjoint.files.atomic import check_output

    if out is not None:
        check_output(out)
    with Progress(quiet, verbose) as progress:
        from sindyjoint.workflows.check import check as run

        result = run(campaign, tuple(accept or ()), progress=progress.say)
        if out is not None:
            progress.say("writing the report")
            from sindyjoint.reporting.output import write_results

            write_results(result, out, ["sindyjoint", *sys.argv[1:]])
        progress.tell(result)
    if as_json:
        typer.echo(json.dumps(result.to_dict(), indent=2, allow_nan=False))
    else:
        from sindyjoint.reporting.registry import show

        show(result)
        if out is not None:
            typer.echo(f"\nreport: {out / 'report.html'}")
    raise typer.Exit(1 if result.stopping else 0)
