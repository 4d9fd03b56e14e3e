"""``sindyjoint compare``: the term-selection comparison report."""

from __future__ import annotations

import json
import sys
from pathlib import Path
from typing import Annotated

import typer

from sindyjoint.cli.defaults import default_of, given
from sindyjoint.cli.options import JOBS, AcceptOption, AsJson, CampaignPath
from sindyjoint.cli.progress import Progress, Quiet, Verbose
from sindyjoint.cli.unsound import stopped_by_data
from sindyjoint.cli.workers import ClusterOption, JobsOption, WorkersOption

COMPARE = "workflows.compare:compare"


def compare(
    campaign: CampaignPath = None,
    out: Annotated[
        Path | None,
        typer.Option(
            "--out", help="Folder for report.html, comparison.csv, .md, .tex, .json and the inclusion map."
        ),
    ] = None,
    library: Annotated[
        list[str] | None,
        typer.Option(
            "--library", "-l", help="Candidates for methods and frequencies. Repeatable. [extended]"
        ),
    ] = None,
    method: Annotated[
        list[str] | None,
        typer.Option("--method", help="Compare these methods only; the first one leads. Repeatable. [all]"),
    ] = None,
    replicates: Annotated[
        int, typer.Option(help="Resampled campaigns behind the inclusion probabilities.")
    ] = default_of(COMPARE, "replicates"),
    margin: Annotated[
        float,
        typer.Option(help="Relative change of a coefficient over the tested band that would not matter."),
    ] = default_of(COMPARE, "margin"),
    accept: AcceptOption = None,
    as_json: AsJson = False,
    random_state: Annotated[int, typer.Option(help="Seed of everything random.")] = default_of(
        COMPARE, "random_state"
    ),
    jobs: JobsOption = JOBS,
    workers: WorkersOption = None,
    cluster: ClusterOption = None,
    quiet: Quiet = False,
    verbose: Verbose = False,
) -> None:
    """Put the question of the terms to every method, every frequency and every library.

    Exit status 0: a model was found; 1: none was, or the data are unsound; 2: the input is at fault.

    Example: sindyjoint compare tests/campaign.toml --out comparison
    """
    from sindyjoint.files.atomic import check_output

    if out is not None:
        check_output(out)
    with Progress(quiet, verbose) as progress, stopped_by_data(progress, out, as_json):
        from sindyjoint.workflows.compare import compare as run

        result = run(
            campaign,
            **given(library=library, methods=method),
            accept=tuple(accept or ()),
            replicates=replicates,
            margin=margin,
            random_state=random_state,
            progress=progress.say,
            jobs=jobs,
            workers=workers,
            cluster=cluster,
        )
        if out is not None:
            from sindyjoint.reporting.output import write_results

            progress.say("writing the report")
            write_results(result, out, ["sindyjoint", *sys.argv[1:]], random_state)
        progress.tell(result)
    if as_json:
        typer.echo(json.dumps(result.to_dict(), indent=2, allow_nan=False))
    else:
        from sindyjoint.reporting.registry import show

        show(result)
        if out is not None:
            typer.echo(f"\nreport: {out / 'report.html'}")
    raise typer.Exit(0 if result.model.terms else 1)
