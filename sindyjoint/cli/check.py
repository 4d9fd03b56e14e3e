"""``sindyjoint check``: are the data sound."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from sindyjoint.cli.answer import answer, call
from sindyjoint.cli.options import AcceptOption, Output, with_blocks
from sindyjoint.cli.progress import Progress


@with_blocks
def check(
    campaign: Annotated[
        Path | None,
        typer.Argument(
            metavar="CAMPAIGN|RIG",
            help="campaign.toml or rig.toml, or the folder with it. Without it: the built-in virtual test of the "
            "inter-panel joint.",
            show_default=False,
        ),
    ] = None,
    accept: AcceptOption = None,
    out: Annotated[
        Path | None,
        typer.Option("--out", help="Folder for report.html, check.json, findings.csv and figures."),
    ] = None,
    *,
    output: Output,
    progress: Progress,
) -> None:
    """Check the data: saturation, spikes, dropouts, delay, units, coverage; with a picture of every channel.

    Of a rig.toml with sensors and runs, the sensors are held against each other through the structure, too: gain, sign,
    delay, exchanged columns. The same check runs at the start of discover, compare, diagnose, verify and batch.

    Exit status 0: sound, or doubtful; 1: unsound, so that no model is made, unless all that stops is accepted; 2: the
    input is at fault.

    Example: sindyjoint check virtual --out soundness
    """
    find = call("workflows.check:check", campaign, tuple(accept or ()), progress=progress.say)
    result = answer(find, out, output, progress, subject=campaign)
    raise typer.Exit(1 if result.stopping else 0)
