"""``sindyjoint changed``: two tests of one joint."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from sindyjoint.cli.answer import answer, call
from sindyjoint.cli.defaults import default_of
from sindyjoint.cli.options import AcceptOption, Output, with_blocks
from sindyjoint.cli.progress import Progress

CHANGED = "workflows.changed:changed"


@with_blocks
def changed(
    before: Annotated[
        Path,
        typer.Argument(
            metavar="BEFORE", help="model.json, campaign.toml, or a folder with one.", show_default=False
        ),
    ],
    after: Annotated[
        Path, typer.Argument(metavar="AFTER", help="The same of the later test.", show_default=False)
    ],
    margin: Annotated[
        float, typer.Option(help="Relative change of a coefficient that would not matter.")
    ] = default_of(CHANGED, "margin"),
    same_sensors: Annotated[
        bool,
        typer.Option(
            "--same-sensors",
            help="Sensors and calibration were the same: declared gain_uncertainty is no part of the difference.",
        ),
    ] = False,
    out: Annotated[
        Path | None, typer.Option("--out", help="Folder for report.html, changed.json and the figure.")
    ] = None,
    accept: AcceptOption = None,
    *,
    output: Output,
    random_state: Annotated[int, typer.Option(min=0, help="Seed of what resamples.")] = 0,
    progress: Progress,
) -> None:
    """Has the joint changed? Two results or campaigns of it, coefficient by coefficient, beyond noise and calibration.

    Exit status 0: no change is seen; 1: changed; 2: the input is at fault.

    Example: sindyjoint changed before after --margin 0.05
    """
    find = call(
        CHANGED, before, after, margin=margin, same_sensors=same_sensors, accept=tuple(accept or ()),
        random_state=random_state, progress=progress.say,
    )  # fmt: skip
    result = answer(find, out, output, progress, random_state, (before, after))
    raise typer.Exit(1 if result.changed else 0)
