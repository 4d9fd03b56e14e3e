"""``sindyjoint init``: a campaign.toml from the files alone."""

from __future__ import annotations

import json
import sys
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from sindyjoint.cli.options import AsJson

if TYPE_CHECKING:
    from sindyjoint.files.drafting.dialogue import Question


def init(
    folder: Annotated[Path, typer.Argument(metavar="FOLDER", help="Folder with the data files of the runs.")],
    answers: Annotated[
        list[str] | None,
        typer.Option(
            "--set",
            metavar="KEY=VALUE",
            help="What the files do not tell: angle.unit=mrad, rate='1 kHz', force=ch2, motion=rotation. Repeatable.",
        ),
    ] = None,
    yes: Annotated[
        bool,
        typer.Option("--yes", "-y", help="Ask nothing: take the guesses, marked '# guessed' in the file."),
    ] = False,
    force: Annotated[bool, typer.Option("--force", help="Replace the campaign.toml that is there.")] = False,
    as_json: AsJson = False,
) -> None:
    """Write a campaign.toml for a folder of data files: channels, units, rates, frequencies, levels.

    On a terminal it asks what the files do not tell.

    Example: sindyjoint init virtual --force
    """
    from sindyjoint.errors import InputError
    from sindyjoint.files.drafting.init import init as run

    given = {}
    for answer in answers or []:
        key, separator, value = answer.partition("=")
        if not separator or not value.strip():
            raise InputError(f"--set {answer!r}: expected KEY=VALUE, such as angle.unit=mrad")
        given[key.strip()] = value.strip()
    asks = not yes and sys.stdin.isatty() and sys.stderr.isatty()
    made = run(folder, given, ask=_ask if asks else None, guess=yes, force=force)
    if as_json:
        typer.echo(json.dumps(made.to_dict(), indent=2, ensure_ascii=False))
    else:
        typer.echo(str(made))
        typer.echo(f"\nnext: sindyjoint check {folder}")


def _ask(question: Question) -> str:
    if question.complaint:
        typer.echo(f"{question.complaint}; once more:", err=True)
    answer: str = typer.prompt(question.text, default=question.guess, err=True)
    return answer
