"""What a command says on stderr while it works: the stage, how far it is, how long it will take."""

import re
import signal
import sys
import threading
import time
from typing import Annotated, Any

import typer

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
        self._interrupted = False
        self._restore: Any = None

    def begin(self) -> "Progress":
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
        if self._interrupted:
            raise KeyboardInterrupt
        self._stage = stage
        if self._status is not None:
            self._status.update(self._counted(stage).replace("[", r"\["))
        elif self._speaks:
            self._speak()

    def _interrupt(self, number: int, frame: object) -> None:
        # An error that is raised while Python clears an object, or calls back, ends there with a word on stderr.
        self._interrupted = True
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
