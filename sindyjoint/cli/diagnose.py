"""``sindyjoint diagnose``: where simulation and measurement disagree, and what is missing."""

from __future__ import annotations

import json
import sys
from pathlib import Path
from typing import Annotated

import typer

from sindyjoint.cli.progress import Progress


def diagnose(
    campaign: Annotated[
        Path | None,
        typer.Argument(
            metavar="CAMPAIGN",
            help="campaign.toml or its folder. Without it: a virtual test with an effect hidden by the seed.",
            show_default=False,
        ),
    ] = None,
    model: Annotated[
        Path | None,
        typer.Option(help="model.json, or a folder with one, to start from. [the paper's five terms]"),
    ] = None,
    base: Annotated[
        list[str] | None,
        typer.Option(
            "--base", help="Catalogue of the terms to start from, without a model. Repeatable. [paper]"
        ),
    ] = None,
    library: Annotated[
        list[Path] | None, typer.Option("--library", "-l", help="A TOML file of further effects. Repeatable.")
    ] = None,
    max_effects: Annotated[int, typer.Option(min=1, help="Most effects to add.")] = 3,
    hold_out: Annotated[
        list[str] | None, typer.Option("--hold-out", help="Name of a run to keep out of the fit. Repeatable.")
    ] = None,
    out: Annotated[
        Path | None, typer.Option("--out", help="Folder for diagnosis.json, model.json and figures.")
    ] = None,
    as_json: Annotated[bool, typer.Option("--json", help="Print the result as JSON.")] = False,
    random_state: Annotated[int | None, typer.Option(help="Seed of the virtual test. [0]")] = None,
    quiet: Annotated[bool, typer.Option("--quiet", "-q", help="No messages on stderr.")] = False,
) -> None:
    """Find where model and measurement disagree, name what is missing, add it, show the gap shrink.

    Exit status 0: effects were named, or nothing is missing; 1: something is missing that no effect explains; 2: the
    input is at fault.

    Example: sindyjoint diagnose tests/campaign.toml --model results/model.json --out diagnosis
    """
    from sindyjoint.files.atomic import check_output

    if out is not None:
        check_output(out)
    with Progress(quiet) as progress:
        from sindyjoint.workflows.diagnose import diagnose as run
        from sindyjoint.workflows.model_file import read_model

        result = run(
            campaign,
            None if model is None else read_model(model),
            base=base or "paper",
            library=tuple(library or ()),
            max_effects=max_effects,
            hold_out=tuple(hold_out or ()),
            random_state=random_state,
            progress=progress.say,
        )
        if out is not None:
            progress.say("writing the report")
            from sindyjoint.reporting.diagnosis import write_diagnosis

            files = [path for path in (model, campaign) if path is not None]
            write_diagnosis(result, out, ["sindyjoint", *sys.argv[1:]], random_state, files)
    if as_json:
        typer.echo(json.dumps(result.to_dict(), indent=2, allow_nan=False))
    else:
        from sindyjoint.reporting.diagnosis import show_diagnosis

        show_diagnosis(result)
    raise typer.Exit(1 if result.verdict == "unknown" else 0)
