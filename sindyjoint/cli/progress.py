"""Progress on stderr, only where a person looks at a terminal."""

from __future__ import annotations

import sys
from types import TracebackType
from typing import Any


class Progress:
    """A spinner with the name of the stage; silent where stderr is not a terminal.

    Parameters
    ----------
    quiet : bool
        Never show anything.
    """

    def __init__(self, quiet: bool = False):
        self._active = not quiet and sys.stderr.isatty()
        self._status: Any = None

    def __enter__(self) -> Progress:
        if self._active:
            from rich.console import Console

            self._status = Console(stderr=True).status("starting")
            self._status.start()
        return self

    def say(self, stage: str) -> None:
        """Show the name of the stage that begins."""
        if self._status is not None:
            self._status.update(stage)

    def __exit__(
        self, kind: type[BaseException] | None, value: BaseException | None, trace: TracebackType | None
    ) -> None:
        if self._status is not None:
            self._status.stop()
