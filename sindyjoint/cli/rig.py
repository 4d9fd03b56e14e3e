"""``sindyjoint rig``: a structure with joints in motion."""

from __future__ import annotations

import json
import sys
from pathlib import Path
from typing import Annotated

import typer

from sindyjoint.cli.options import AsJson
from sindyjoint.cli.progress import Progress, Quiet, Verbose


def rig(
    rig: Annotated[
        str,
        typer.Argument(
            metavar="RIG", help="A rig's TOML file, or a shipped rig: pulse-rig, four-panel-wing."
        ),
    ],
    model: Annotated[
        Path | None, typer.Option(help="model.json, or a folder with one, for the joints that it stands for.")
    ] = None,
    out: Annotated[
        Path | None, typer.Option("--out", help="Folder for report.html, rig.json, response.csv and figures.")
    ] = None,
    as_json: AsJson = False,
    quiet: Quiet = False,
    verbose: Verbose = False,
) -> None:
    """Simulate a structure with joints: its frequencies, its motion after a pulse, and which joint dissipates how much.

    Example: sindyjoint rig four-panel-wing --out wing
    """
    from sindyjoint.files.atomic import check_output

    if out is not None:
        check_output(out)
    with Progress(quiet, verbose) as progress:
        from sindyjoint.workflows.rig import rig_motion

        result = rig_motion(rig, model, progress=progress.say)
        if out is not None:
            from sindyjoint.reporting.output import write_results

            progress.say("writing the results")
            files = [path for path in (model, Path(rig)) if path is not None]
            write_results(result, out, ["sindyjoint", *sys.argv[1:]], files=files)
        progress.tell(result)
    if as_json:
        typer.echo(json.dumps(result.to_dict(), indent=2, allow_nan=False))
    else:
        from sindyjoint.reporting.registry import show

        show(result)
        if out is not None:
            typer.echo(f"\nreport: {out / 'report.html'}")
