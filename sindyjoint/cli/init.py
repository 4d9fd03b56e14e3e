"""``sindyjoint init``: a campaign.toml from the files alone."""

from __future__ import annotations

import json
import shlex
import sys
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from sindyjoint.cli.options import AsJson, split_pairs, with_blocks
from sindyjoint.cli.progress import Progress

if TYPE_CHECKING:
    from sindyjoint.files.drafting.assignment import Question
    from sindyjoint.soundness.check import Checked

SHOWN = 8  # findings


@with_blocks
def init(
    folder: Annotated[Path, typer.Argument(metavar="FOLDER", help="Folder with the data files of the runs.")],
    answers: Annotated[
        list[str] | None,
        typer.Option(
            "--set",
            metavar="KEY=VALUE",
            help="What the files do not tell: angle.unit=mrad, rate='1 kHz', force=ch2, inertia='0.02 kg*m^2'; "
            "validate=RUN for runs that no fit shall use. Repeatable.",
        ),
    ] = None,
    yes: Annotated[
        bool,
        typer.Option("--yes", "-y", help="Ask nothing: take the guesses, marked '# guessed' in the file."),
    ] = False,
    force: Annotated[bool, typer.Option("--force", help="Replace the campaign.toml that is there.")] = False,
    as_json: AsJson = False,
    *,
    progress: Progress,
) -> None:
    """Write a campaign.toml for a folder of data files: channels, units, rates, frequencies, levels.

    On a terminal it asks what the files do not tell. At the end the data are checked, and runs.svg shows all runs.

    Example: sindyjoint init virtual --force
    """
    from sindyjoint.described import to_plain
    from sindyjoint.files.drafting.init import init as run

    given = split_pairs(answers, "--set", "KEY=VALUE, such as angle.unit=mrad")
    asks = not yes and sys.stdin.isatty() and sys.stderr.isatty()
    progress.say("reading the files")
    if asks:
        # No spinner runs through what a person is typing.
        progress.end()
    made = run(folder, given, ask=_ask if asks else None, guess=yes, force=force)
    progress.end()
    if not as_json:
        typer.echo(str(made))
    progress.begin()
    checked, picture = _check(made.manifest, force, progress)
    progress.end()
    if as_json:
        record = made.to_dict() | {"check": to_plain(checked.soundness), "picture": str(picture)}
        typer.echo(json.dumps(record, indent=2, ensure_ascii=False))
        return
    soundness = checked.soundness
    typer.echo(f"\nthe data are {soundness.verdict}; all runs in one picture: {picture}")
    telling = [finding for finding in soundness.findings if finding.severity != "note"]
    for finding in telling[:SHOWN]:
        typer.echo(f"  {finding.severity}: {finding.run or 'all runs'}: {finding.extent}")
    if len(telling) > SHOWN:
        typer.echo(f"  and {len(telling) - SHOWN} more")
    typer.echo(f"\nnext: {shlex.join(['sindyjoint', 'discover', str(folder), '--out', 'results'])}")


def _check(manifest: Path, force: bool, progress: Progress) -> tuple[Checked, Path]:
    """Check what was written, and draw all runs beside it."""
    from sindyjoint.documents import refuse_foreign_file
    from sindyjoint.files.atomic import write_bytes
    from sindyjoint.reporting.registry import draw
    from sindyjoint.reporting.results.check_pictures import TOGETHER
    from sindyjoint.reporting.style import figure_bytes
    from sindyjoint.workflows.check import check

    target = manifest.with_name("runs.svg")
    refuse_foreign_file(target, force)
    checked = check(manifest, progress=progress.say)
    progress.say("drawing all runs")
    return checked, write_bytes(target, figure_bytes(draw(TOGETHER, checked), "svg"))


def _ask(question: Question) -> str:
    if question.complaint:
        typer.echo(f"{question.complaint}; once more:", err=True)
    answer: str = typer.prompt(question.text, default=question.guess, err=True)
    return answer
