"""``sindyjoint verify``: a model against measured response."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from sindyjoint.cli.answer import answer, call
from sindyjoint.cli.defaults import default_of
from sindyjoint.cli.options import AcceptOption, AlignOption, Output, with_blocks
from sindyjoint.cli.progress import Progress

VERIFY = "workflows.verify:verify"


@with_blocks
def verify(
    model: Annotated[Path, typer.Argument(metavar="MODEL", help="model.json, or a folder that holds one.")],
    against: Annotated[
        str,
        typer.Argument(
            metavar="RIG|CAMPAIGN",
            help="A rig's TOML file or a shipped rig (pulse-rig, four-panel-wing); or campaign.toml or its folder.",
        ),
    ],
    tolerance: Annotated[
        float, typer.Option(help="Largest response NRMSE beyond the noise floor that passes.")
    ] = default_of(VERIFY, "tolerance"),
    draws: Annotated[
        int,
        typer.Option(help="Sets of coefficients drawn for the band of the simulated response; 0: no band."),
    ] = default_of(VERIFY, "draws"),
    window: Annotated[
        float, typer.Option(help="Time in s between restarts of a joint that nothing pulls back.")
    ] = default_of(VERIFY, "window"),
    free_run: Annotated[
        int | None,
        typer.Option(
            metavar="N",
            help="Simulate each run without restart, its initial state estimated on its first N samples.",
        ),
    ] = None,
    noise: Annotated[
        float | None,
        typer.Option(help="Virtual pulse test: sensor noise as a fraction of the response's RMS. [0.01]"),
    ] = None,
    presliding: Annotated[
        float | None,
        typer.Option(
            help="Virtual pulse test: angle in rad over which the true friction gives way elastically."
        ),
    ] = None,
    loss_factor: Annotated[
        float | None, typer.Option(help="Virtual pulse test: true loss factor of the beams' material.")
    ] = None,
    out: Annotated[
        Path | None, typer.Option("--out", help="Folder for report.html, verification.json and figures.")
    ] = None,
    accept: AcceptOption = None,
    align: AlignOption = False,
    *,
    output: Output,
    random_state: Annotated[int, typer.Option(min=0, help="Seed of draws and sensor noise.")] = default_of(
        VERIFY, "random_state"
    ),
    progress: Progress,
) -> None:
    """Simulate a model and hold it against measured response.

    Against a campaign: the runs marked use = "validate". Against a rig: its recorded runs, sensor by sensor; or the
    response to a pulse that its file names as measured; or a virtual pulse test of the rig as it is written.

    Exit status 0: the model passed; 1: it failed, and the reason is printed; 2: the input is at fault.

    Example: sindyjoint verify results/model.json pulse-rig
    """
    find = call(
        VERIFY, model, against, accept=tuple(accept or ()), align=align, tolerance=tolerance, draws=draws,
        window=window, free_run=free_run, noise=noise, presliding=presliding, loss_factor=loss_factor,
        random_state=random_state, progress=progress.say,
    )  # fmt: skip
    result = answer(find, out, output, progress, random_state, (), against, model)
    raise typer.Exit(0 if result.passed else 1)
