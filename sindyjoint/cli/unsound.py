"""What a command does where the data are too much at fault to go on: it shows the check, and ends with status 1."""

from __future__ import annotations

import json
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import typer

from sindyjoint.cli.progress import Progress
from sindyjoint.errors import UnsoundError


@contextmanager
def stopped_by_data(progress: Progress, out: Path | None, as_json: bool) -> Iterator[None]:
    """Print and write the check that stops what is done within, and leave with status 1."""
    try:
        yield
    except UnsoundError as error:
        check = error.check
        if out is not None:
            from sindyjoint.reporting.output import write_results

            write_results(check, out, ["sindyjoint", *sys.argv[1:]])
        progress.tell(check)
        if as_json:
            typer.echo(json.dumps(check.to_dict(), indent=2, allow_nan=False))
        else:
            from sindyjoint.reporting.registry import show

            show(check)
        raise typer.Exit(1) from None
