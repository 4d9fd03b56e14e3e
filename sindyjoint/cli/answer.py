"""What every command does with its result: it says on stderr how far the work is, writes the result, prints it."""

from __future__ import annotations

import json
import re
import signal
import sys
import threading
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from importlib import import_module
from pathlib import Path
from typing import Annotated, Any, TypeVar

import typer

from sindyjoint.errors import UnsoundError
from sindyjoint.trust import PLACES, Places

R = TypeVar("R")
ForceOption = Annotated[
    bool,
    typer.Option(
        "--force", help="Replace files in --out that were not written by this command, or were changed since."
    ),
]
AsJson = Annotated[bool, typer.Option("--json", help="Print the result as JSON.")]
# What all kinds of result write.
COMMON = ("report.html", "model.json", "figures/data.json")


@dataclass(frozen=True)
class Output:
    """What is done with a result: the options of every command that writes one."""

    force: ForceOption = False
    as_json: AsJson = False


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


def read(campaign: Path | None, in_segments: bool = False) -> Any:
    """Read a campaign before the imports of the search that it is for: what is wrong with it takes no second to say."""
    if campaign is None:
        return None
    from sindyjoint.files.campaign import LONGEST, load_campaign

    return load_campaign(campaign, LONGEST if in_segments else None)


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


Quiet = Annotated[bool, typer.Option("--quiet", "-q", help="Nothing on stderr but warnings and errors.")]
Verbose = Annotated[
    bool,
    typer.Option(
        "--verbose", "-v", help="All steps with their times, and the numbers behind the result, on stderr."
    ),
]


COUNT = re.compile(r": (\d+) of (\d+)$")
# Seconds after which a command off a terminal says what it does. What ends before says nothing, as most bad input.
PATIENCE = 0.7
FIRST = "loading"
BAR = 12


class Progress:
    """Show the stages: by a spinner where stderr is a terminal, or by a line for each with the time since the start.

    Lines begin within a second of the command: of what is done by then there are none.

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
        self._verbose, self._stage = verbose, FIRST
        # Whether stages have lines by now, and the last one that has.
        self._speaks, self._said = verbose, ""
        self._spins = not quiet and not verbose and sys.stderr.isatty()
        self._status: Any = None
        self._start = time.perf_counter()
        self._first: tuple[str, int, float] = ("", 0, 0.0)
        self._timer: threading.Timer | None = None
        self.interrupted = False
        self._restore: Any = None

    def begin(self) -> Progress:
        """Begin to show what happens, and to heed Ctrl-C at the next stage where Python loses it."""
        main = threading.current_thread() is threading.main_thread()
        if main and signal.getsignal(signal.SIGINT) is signal.default_int_handler:
            self._restore = signal.signal(signal.SIGINT, self._interrupt)
        if self._spins:
            from rich.console import Console

            console = Console(stderr=True)
            self._status = console.status(FIRST, spinner="line" if console.options.ascii_only else "dots")
            self._status.start()
        elif self._verbose:
            self.say(FIRST)
        elif not self.quiet:
            self._timer = threading.Timer(PATIENCE, self._speak)
            self._timer.daemon = True
            self._timer.start()
        return self

    def say(self, stage: str) -> None:
        """Name the stage that begins, or after a colon how far it is: of that lines keep what is said first.

        Of a stage that counts ("simulating: 3 of 12") a terminal shows how long it will take, by the time so far.
        """
        if self.interrupted:
            raise KeyboardInterrupt
        self._stage = stage
        if self._status is not None:
            self._status.update(self._counted(stage).replace("[", r"\["))
        elif self._speaks:
            self._speak()

    def _interrupt(self, number: int, frame: object) -> None:
        # An error that is raised while Python clears an object, or calls back, ends there with a word on stderr.
        self.interrupted = True
        raise KeyboardInterrupt

    def _speak(self) -> None:
        """Print the stage on a line, unless it has one; from now on each has."""
        self._speaks, stage = True, self._stage
        name = stage.partition(":")[0]
        if name != self._said:
            self._said = name
            print(f"{time.perf_counter() - self._start:7.2f} s  {stage}", file=sys.stderr, flush=True)

    def _counted(self, stage: str) -> str:
        """Return a stage that counts with a bar, and how long it will take as soon as that is known."""
        count, now = COUNT.search(stage), time.perf_counter()
        name = stage.partition(":")[0]
        if count is None:
            return stage
        done, planned = int(count[1]), int(count[2])
        filled = BAR * done // max(planned, 1)
        told = f"[{'#' * filled}{'.' * (BAR - filled)}] {stage}"
        known, first, since = self._first
        if known != name or done <= first:
            self._first = (name, done, now)
            return told
        seconds = (now - since) / (done - first) * (planned - done)
        return f"{told}, about {max(seconds, 1):.0f} s more"

    def show_details(self, result: Any) -> None:
        """Show the numbers behind a result, where that was asked for."""
        if self._verbose:
            from sindyjoint.reporting.registry import details

            self.say("done; what lies behind it:")
            for line in details(result):
                print(f"           {line}".rstrip(), file=sys.stderr)

    def end(self) -> None:
        """Show nothing more: what is printed from now on stands alone, and an error is the last line."""
        if self._restore is not None:
            signal.signal(signal.SIGINT, self._restore)
            self._restore = None
        if self._timer is not None:
            self._timer.cancel()
            self._timer.join()  # it may be about to print
        if self._status is not None:
            self._status.stop()
            self._status = None
