"""What a command says on stderr while it works: on a terminal a spinner with the time that remains, else nothing."""

from __future__ import annotations

import re
import sys
import time
from types import TracebackType
from typing import Annotated, Any

import typer

Quiet = Annotated[bool, typer.Option("--quiet", "-q", help="No messages on stderr.")]
Verbose = Annotated[
    bool,
    typer.Option(
        "--verbose", "-v", help="Steps with their times, and the numbers behind the result, on stderr."
    ),
]


COUNT = re.compile(r": (\d+) of (\d+)$")


class Progress:
    """Show the stages: by a spinner where stderr is a terminal, or by a line for each with the time since the start.

    Lines are for ``--verbose`` alone: what is no terminal gets warnings and errors, and what fails fails in one line.

    Parameters
    ----------
    quiet : bool
        Never show anything.
    verbose : bool
        A line per stage, terminal or not and from the start, and what lies behind the result.

    Raises
    ------
    typer.BadParameter
        If both are given.
    """

    def __init__(self, quiet: Quiet = False, verbose: Verbose = False):
        if quiet and verbose:
            raise typer.BadParameter("contradicts --quiet; choose one of them", param_hint="--verbose")
        self.quiet = quiet
        self._verbose, self._stage = verbose, ""
        self._spins = not quiet and not verbose and sys.stderr.isatty()
        self._status: Any = None
        self._start = time.perf_counter()
        self._first: tuple[str, int, float] = ("", 0, 0.0)

    def __enter__(self) -> Progress:
        if self._spins:
            from rich.console import Console

            console = Console(stderr=True)
            self._status = console.status(
                "starting", spinner="line" if console.options.ascii_only else "dots"
            )
            self._status.start()
        if self._status is None and self._verbose:
            self.say("starting")
        return self

    def say(self, stage: str) -> None:
        """Name the stage that begins, or after a colon how far it is: of that lines keep what is said first.

        Of a stage that counts ("simulating: 3 of 12") a terminal shows how long it will take, by the time so far.
        """
        if self._status is not None:
            self._status.update(stage + self._remaining(stage))
            return
        before, self._stage = self._stage, stage.partition(":")[0]
        if self._verbose and self._stage != before:
            seconds = time.perf_counter() - self._start
            print(f"{seconds:7.2f} s  {stage}", file=sys.stderr, flush=True)

    def _remaining(self, stage: str) -> str:
        """Return how long a stage that counts will take; nothing while that is not known."""
        count, now = COUNT.search(stage), time.perf_counter()
        name = stage.partition(":")[0]
        if count is None:
            return ""
        done, planned = int(count[1]), int(count[2])
        known, first, since = self._first
        if known != name or done <= first:
            self._first = (name, done, now)
            return ""
        seconds = (now - since) / (done - first) * (planned - done)
        return f", about {max(seconds, 1):.0f} s more"

    def show_details(self, result: Any) -> None:
        """Show the numbers behind a result, where that was asked for."""
        if self._verbose:
            from sindyjoint.reporting.registry import details

            self.say("done; what lies behind it:")
            for line in details(result):
                print(f"           {line}".rstrip(), file=sys.stderr)

    def __exit__(
        self, kind: type[BaseException] | None, value: BaseException | None, trace: TracebackType | None
    ) -> None:
        if self._status is not None:
            self._status.stop()
