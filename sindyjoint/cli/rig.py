"""``sindyjoint rig``: a structure with joints in motion."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from sindyjoint.cli.answer import answer, call
from sindyjoint.cli.options import Output, with_blocks
from sindyjoint.cli.progress import Progress


@with_blocks
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
    *,
    output: Output,
    progress: Progress,
) -> None:
    """Simulate a structure with joints: its frequencies, its motion after a pulse, and which joint dissipates how much.

    Example: sindyjoint rig four-panel-wing --out wing
    """
    find = call("workflows.rig:rig_motion", rig, model, progress=progress.say)
    answer(find, out, output, progress, subject=rig, model=model)
