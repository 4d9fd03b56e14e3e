"""``sindyjoint batch``: many campaigns, one table and one page over all of them."""

from __future__ import annotations

import json
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from sindyjoint.cli.answer import Interrupted, answer
from sindyjoint.cli.defaults import given
from sindyjoint.cli.options import AcceptOption, CandidatesOption, Finding, Output, Work, with_blocks
from sindyjoint.cli.progress import Progress
from sindyjoint.text import printable

if TYPE_CHECKING:
    from sindyjoint.reporting.output import CampaignFiles
    from sindyjoint.workflows.joints.record import CampaignRecord
    from sindyjoint.workflows.joints.summary import Batch


@with_blocks
def batch(
    campaigns: Annotated[
        list[str],
        typer.Argument(
            metavar="FOLDER|GLOB", help="Folder to search for campaign.toml, or a pattern of such."
        ),
    ],
    out: Annotated[
        Path, typer.Option("--out", help="Folder for the table, the page, and a folder per campaign.")
    ],
    library: CandidatesOption = None,
    accept: AcceptOption = None,
    reports: Annotated[
        bool,
        typer.Option("--reports", help="A full report for each campaign, too; takes three times as long."),
    ] = False,
    diagnose: Annotated[
        bool, typer.Option("--diagnose", help="What each joint's model lacks, too, in the folder diagnosis.")
    ] = False,
    verify_only: Annotated[
        bool,
        typer.Option(
            "--verify-only", help="Only hold a finished batch against its inputs and hashes; write nothing."
        ),
    ] = False,
    *,
    work: Work,
    output: Output,
    finding: Finding,
    random_state: Annotated[int | None, typer.Option(min=0, help="Seed of each campaign. [0]")] = None,
    progress: Progress,
) -> None:
    """Discover the joints of many campaigns; hold them against each other: outliers, trends.

    Results are written as they come. Run again after an interruption, it keeps what is done and unchanged.

    Exit status 0: a model was found in every campaign, or with --verify-only everything is as it was written; 1: in
    some none was, or some are broken or changed; 2: the input is at fault.

    Example: sindyjoint batch virtual --out joints --jobs 2
    """
    if verify_only and (work.workers is not None or work.cluster is not None):
        raise typer.BadParameter(
            "the check runs in this process; leave out --workers and --cluster", param_hint="--verify-only"
        )
    options = {
        **given(library=library),
        **finding.arguments(),
        "accept": tuple(accept or ()),
        "random_state": random_state,
    }
    if verify_only:
        from sindyjoint.workflows.batch import verify_batch

        faults = verify_batch(campaigns, out, write=_files(reports, diagnose), **options)
        _print_faults(faults, out, output.as_json)
        raise typer.Exit(1 if faults else 0)

    def find() -> Batch:
        options["write"] = _files(reports, diagnose)
        return _run(campaigns, out, progress, {**options, **work.arguments()})

    result = answer(find, out, output, progress, random_state)
    raise typer.Exit(0 if result.complete else 1)


def _files(reports: bool, diagnose: bool) -> CampaignFiles | None:
    """Return what writes the files of each campaign."""
    from sindyjoint.reporting.output import CampaignFiles

    return CampaignFiles(reports, diagnose) if reports or diagnose else None


def _run(campaigns: list[str], out: Path, progress: Progress, options: dict[str, Any]) -> Batch:
    """Discover the joints of all campaigns; what is broken is reported at once."""
    from sindyjoint.reporting.output import place_of
    from sindyjoint.workflows.batch import batch

    place_of("batch", out)

    def report(record: CampaignRecord) -> None:
        if record.status == "broken" and not progress.quiet:
            typer.echo(printable(f"sindyjoint: {record.id}: {record.reason}"), err=True)

    try:
        return batch(campaigns, out, progress=progress.say, on_record=report, **options)
    except KeyboardInterrupt:
        raise Interrupted("the same command goes on where this one stopped") from None


def _print_faults(faults: Sequence[tuple[str, str]], out: Path, as_json: bool) -> None:
    """Print what of a batch is not as it was written."""
    if as_json:
        record = {"schema": 1, "faults": [{"campaign": id, "fault": fault} for id, fault in faults]}
        typer.echo(json.dumps(record, indent=2))
        return
    for id, fault in faults:
        typer.echo(printable(f"{id or out}: {fault}"))
    typer.echo(f"{out}: {f'{len(faults)} fault(s)' if faults else 'everything is as it was written'}")
