"""What every command does with its result: find it, write it, tell of it, print it."""

from __future__ import annotations

import json
import sys
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any, TypeVar

import typer

from sindyjoint.cli.progress import Progress
from sindyjoint.errors import UnsoundError

R = TypeVar("R")


class Interrupted(Exception):
    """Ctrl-C in a command that has more to tell than that."""


def answer(
    find: Callable[[Progress], R],
    out: Path | None,
    as_json: bool,
    progress: Progress,
    seed: object = None,
    files: Sequence[Path | str] = (),
    written: str = "report: report.html",
) -> R:
    """Find a result, write it into a folder if one is given, and print it; ``written`` tells of what lies there.

    Where the data are too much at fault to go on, that is done with their check, and the exit status is 1.
    """
    from sindyjoint.files.atomic import check_output

    if out is not None:
        check_output(out)
    stopped = False
    with progress:
        # Not before the output is known to be writable: the imports take two seconds.
        result: Any
        try:
            result = find(progress)
        except UnsoundError as error:
            result, stopped = error.check, True
        write(result, out, progress, seed, files)
        progress.tell(result)
    if as_json:
        typer.echo(json.dumps(result.to_dict(), indent=2, allow_nan=False))
    else:
        from sindyjoint.reporting.registry import show

        show(result)
        if out is not None and written:
            label, _, name = written.partition(": ")
            typer.echo(f"\n{label}: {out / name}")
    if stopped:
        raise typer.Exit(1)
    found: R = result
    return found


def write(
    result: Any, out: Path | None, progress: Progress, seed: object = None, files: Sequence[Path | str] = ()
) -> None:
    """Write a result into a folder, if one is given."""
    if out is not None:
        from sindyjoint.reporting.output import write_results

        progress.say("writing the report")
        write_results(result, out, ["sindyjoint", *sys.argv[1:]], seed, files)
