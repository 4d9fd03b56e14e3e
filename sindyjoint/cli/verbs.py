"""Commands that put one question each: check, compare, changed, verify, rig, reproduce, batch."""

from __future__ import annotations

import json
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from sindyjoint.cli.answer import AsJson, Interrupted, Output, Progress, answer, call, read
from sindyjoint.cli.options import (
    AcceptOption,
    AlignOption,
    CampaignPath,
    CandidatesOption,
    Finding,
    Work,
    given,
    with_blocks,
)
from sindyjoint.limits import DISCOVERY, JUDGEMENT
from sindyjoint.text import printable

if TYPE_CHECKING:
    from sindyjoint.reporting.output import CampaignFiles
    from sindyjoint.workflows.joints import CampaignRecord


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

    Example: sindyjoint check --out soundness
    """
    find = call("workflows.check:check", campaign, **given(accept=accept), progress=progress.say)
    answer(find, out, output, progress, subject=campaign, good=lambda result: not result.stopping)


@with_blocks
def compare(
    campaign: CampaignPath = None,
    out: Annotated[
        Path | None,
        typer.Option(
            "--out", help="Folder for report.html, comparison.csv, .md, .tex, .json and the inclusion map."
        ),
    ] = None,
    model: Annotated[
        Path | None,
        typer.Option(help="model.json, or a folder with one: a model to hold against the same runs."),
    ] = None,
    library: Annotated[
        list[str] | None,
        typer.Option(
            "--library", "-l", help="Candidates for methods and frequencies. Repeatable. [extended]"
        ),
    ] = None,
    method: Annotated[
        list[str] | None,
        typer.Option(
            "--method",
            help="Compare these methods only, and 'weak' for the weak form; the first one leads. Repeatable. [all]",
        ),
    ] = None,
    replicates: Annotated[
        int, typer.Option(help="Resampled campaigns behind the inclusion probabilities.")
    ] = 500,
    margin: Annotated[
        float,
        typer.Option(help="Relative change of a coefficient over the tested band that would not matter."),
    ] = DISCOVERY.margin,
    accept: AcceptOption = None,
    align: AlignOption = False,
    *,
    output: Output,
    random_state: Annotated[int, typer.Option(min=0, help="Seed of everything random.")] = 0,
    work: Work,
    progress: Progress,
) -> None:
    """Put the question of the terms to every method, every frequency and every library.

    Exit status 0: a model was found; 1: none was, or the data are unsound; 2: the input is at fault.

    Example: sindyjoint compare --out comparison
    """

    def find() -> Any:
        return call(
            "workflows.compare:compare", read(campaign, in_segments=True), model=model, align=align,
            replicates=replicates, margin=margin, rng=random_state, progress=progress.say, **vars(work),
            **given(library=library, methods=method, accept=accept),
        )()  # fmt: skip

    answer(
        find, out, output, progress, random_state, (), campaign, model, good=lambda result: result.model.terms
    )


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
    ] = JUDGEMENT.margin,
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

    First: sindyjoint simulate --out before; sindyjoint simulate --random-state 1 --out after

    Example: sindyjoint changed before after --margin 0.05
    """
    find = call(
        "workflows.compare:changed", before, after, margin=margin, same_sensors=same_sensors, **given(accept=accept),
        rng=random_state, progress=progress.say,
    )  # fmt: skip
    answer(find, out, output, progress, random_state, (before, after), good=lambda result: not result.changed)


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
    ] = JUDGEMENT.tolerated,
    draws: Annotated[
        int,
        typer.Option(help="Sets of coefficients drawn for the band of the simulated response; 0: no band."),
    ] = 20,
    window: Annotated[
        float, typer.Option(help="Time in s between restarts of a joint that nothing pulls back.")
    ] = 1.0,
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
    random_state: Annotated[int, typer.Option(min=0, help="Seed of draws and sensor noise.")] = 0,
    progress: Progress,
) -> None:
    """Simulate a model and hold it against measured response.

    Against a campaign: the runs marked use = "validate". Against a rig: its recorded runs, sensor by sensor; or the
    response to a pulse that its file names as measured; or a virtual pulse test of the rig as it is written.

    Exit status 0: the model passed; 1: it failed, and the reason is printed; 2: the input is at fault.

    First: sindyjoint discover --out results

    Example: sindyjoint verify results/model.json pulse-rig
    """
    find = call(
        "workflows.verify:verify", model, against, **given(accept=accept), align=align, tolerance=tolerance,
        draws=draws, window=window, free_run=free_run, noise=noise, presliding=presliding, loss_factor=loss_factor,
        rng=random_state, progress=progress.say,
    )  # fmt: skip
    answer(find, out, output, progress, random_state, (), against, model, good=lambda result: result.passed)


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
    find = call("workflows.simulate:rig_motion", rig, model, progress=progress.say)
    answer(find, out, output, progress, subject=rig, model=model)


reproductions = typer.Typer(rich_markup_mode=None)


@reproductions.callback(invoke_without_command=True)
@with_blocks
def reproduce(
    context: typer.Context,
    out: Annotated[
        Path | None,
        typer.Option("--out", help="Folder for report.html, reproduction.md, tables.csv and figures."),
    ] = None,
    *,
    output: Output,
    random_state: Annotated[int, typer.Option(min=0, help="Seed of the sensors' noise.")] = 0,
    progress: Progress,
) -> None:
    """Make the paper's tables and figures from virtual tests of its two joints, next to its numbers.

    Everything is simulated, and the text says what cannot be reproduced and why.

    Example: sindyjoint reproduce --out reproduction
    """
    if context.invoked_subcommand is not None:
        return

    find = call("workflows.reproduce:reproduce", random_state, progress.say)
    answer(find, out, output, progress, random_state)


@reproductions.command()
def tables(
    as_json: AsJson = False,
) -> None:
    """Recompute the paper's printed tables from their rows, and test them for dependence on frequency.

    Example: sindyjoint reproduce tables
    """
    from sindyjoint.judgement.paper_tables import PrintedTables, check_tables, table_findings
    from sindyjoint.reporting.registry import show

    checks = check_tables()
    printed = PrintedTables(checks, table_findings(checks))
    if as_json:
        typer.echo(json.dumps(printed.to_dict(), indent=2, allow_nan=False))
    else:
        show(printed)


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

    First: sindyjoint simulate --out virtual

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
        "rng": random_state,
    }
    if verify_only:
        written = _files_of_batch(reports, diagnose)
        faults = call("workflows.batch:verify_batch", campaigns, out, write=written, **options)()
        _print_faults(faults, out, output.as_json)
        raise typer.Exit(1 if faults else 0)

    def find() -> Any:
        options["write"] = _files_of_batch(reports, diagnose)
        return _run_batch(campaigns, out, progress, {**options, **vars(work)})

    answer(find, out, output, progress, random_state, good=lambda result: result.complete)


def _files_of_batch(reports: bool, diagnose: bool) -> CampaignFiles | None:
    """Return what writes the files of each campaign."""
    from sindyjoint.reporting.output import CampaignFiles

    extras = ("reports",) * reports + ("diagnosis",) * diagnose
    return CampaignFiles(extras) if extras else None


def _run_batch(campaigns: list[str], out: Path, progress: Progress, options: dict[str, Any]) -> Any:
    """Discover the joints of all campaigns; what is broken is reported at once."""
    call("reporting.output:place_of", "batch", out)()

    def report(record: CampaignRecord) -> None:
        if record.status == "broken" and not progress.quiet:
            typer.echo(printable(f"sindyjoint: {record.id}: {record.reason}"), err=True)

    try:
        return call(
            "workflows.batch:batch", campaigns, out, progress=progress.say, on_record=report, **options
        )()
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
