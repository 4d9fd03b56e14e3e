"""What every command does with its result: find it, write it, print it."""

from __future__ import annotations

import json
from collections.abc import Callable, Sequence
from dataclasses import replace
from importlib import import_module
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypeVar

import typer

from sindyjoint.cli.options import Output
from sindyjoint.cli.progress import Progress
from sindyjoint.errors import UnsoundError
from sindyjoint.trust import PLACES, Places

if TYPE_CHECKING:
    from sindyjoint.record import Campaign

R = TypeVar("R")
# What all kinds of result write.
COMMON = ("report.html", "model.json", "figures/data.json")


class Interrupted(Exception):
    """Ctrl-C in a command that has more to say than that."""


def answer(
    find: Callable[[], R],
    out: Path | None,
    output: Output,
    progress: Progress,
    seed: object = None,
    files: Sequence[Path | str] = (),
    subject: Path | str | None = None,
    model: Path | None = None,
    good: Callable[[R], object] = lambda result: True,
) -> R:
    """Find a result, write it into a folder if one is given, print it, and say where its page lies.

    Next steps name the campaign or rig that it is of, and the model that was given. Where the data are too much at
    fault to go on, that is done with their check, and the exit status is 1, as of a result that is not ``good``.
    """
    if (places := PLACES.get()) is not None:
        PLACES.set(replace(places, subject=str(subject or ""), model=str(model or "")))
    used = [each for each in (model, subject, *files) if each and Path(each).exists()]
    if out is not None:
        check_place(out, output.force)
    stopped = False
    # Not before the output is known to be writable: the imports take two seconds.
    result: Any
    try:
        result = find()
    except UnsoundError as error:
        result, stopped = error.check, True
    place_results(result, out or (places or Places()).results, kept=out is not None)
    place = write(result, out, progress, seed, used, output.force)
    progress.show_details(result)
    progress.end()
    if output.as_json:
        typer.echo(json.dumps(result.to_dict(), indent=2, allow_nan=False))
    else:
        from sindyjoint.reporting.registry import show

        show(result)
        if place is not None:
            typer.echo(f"\nreport: {place / 'report.html'}")
    if stopped or not good(result):
        raise typer.Exit(1)
    return result


def call(function: str, *arguments: Any, **options: Any) -> Callable[[], Any]:
    """Return a call of a function of the package, such as ``"workflows.discover:check"``, imported when it is made."""

    def made() -> Any:
        module, _, name = function.partition(":")
        return getattr(import_module(f"sindyjoint.{module}"), name)(*arguments, **options)

    return made


def read(campaign: Path | None, longest: int | None = None) -> Campaign | None:
    """Read a campaign before the imports of the search that it is for: what is wrong with it takes no second to say."""
    if campaign is None:
        return None
    from sindyjoint.files import load_campaign

    return load_campaign(campaign, longest)


def write(
    result: Any,
    out: Path | None,
    progress: Progress,
    seed: object = None,
    files: Sequence[Path | str] = (),
    force: bool = False,
) -> Path | None:
    """Write a result into a folder, if one is given, and return where it stands."""
    if out is None:
        return None
    from sindyjoint.reporting.output import write_results

    progress.say("writing the report")
    typed = place_results(result, out, kept=True)
    return write_results(result, out, typed, seed, files, force)


def place_results(result: Any, out: Path | str, kept: bool) -> tuple[str, ...]:
    """Say where a result is written, or would be, for the steps that it advises; return the command as it was typed."""
    from sindyjoint.reporting.output import place_of
    from sindyjoint.reporting.registry import view_of_type

    if (places := PLACES.get()) is None:
        return ()
    PLACES.set(replace(places, results=str(place_of(view_of_type(result).folder, out)), kept=kept))
    return places.typed


def check_place(out: Path, force: bool) -> None:
    """Check before any long work that a folder can be written, and that nothing of the user stands in the way."""
    from sindyjoint.documents import kind_of_results
    from sindyjoint.files.atomic import check_output, refuse_foreign

    check_output(out)
    if not force:
        refuse_foreign(out, COMMON, kind_of_results(out))
