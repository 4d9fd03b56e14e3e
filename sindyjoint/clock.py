"""Processor time, wherever it is spent: what was asked of a machine, not how busy it is."""

from __future__ import annotations

import os
import time
from collections.abc import Callable
from contextvars import ContextVar
from typing import Any, TypeVar

R = TypeVar("R")


class ProcessorTime:
    """Processor time of this process while it is entered, and of what others did for it.

    Others are those that :func:`sindyjoint.parallel.side_by_side` gives tasks to. Wall time would say how busy a
    machine is, and not what was asked of it.
    """

    def __init__(self) -> None:
        self.elsewhere = 0.0
        self._start = time.process_time()

    @property
    def seconds(self) -> float:
        """Spent so far."""
        return time.process_time() - self._start + self.elsewhere

    def __enter__(self) -> ProcessorTime:
        self.elsewhere, self._start = 0.0, time.process_time()
        self._token = _clocks.set((*_clocks.get(), self))
        return self

    def __exit__(self, *error: object) -> None:
        _clocks.reset(self._token)


_clocks: ContextVar[tuple[ProcessorTime, ...]] = ContextVar("clocks", default=())


def run_timed(function: Callable[..., R], *given: Any) -> tuple[R, float, int]:
    """Return a result, the processor time that its thread took for it, and the process that did it."""
    start = time.thread_time()
    return function(*given), time.thread_time() - start, os.getpid()


def clocks_running() -> tuple[ProcessorTime, ...]:
    """Return the clocks that are entered here."""
    return _clocks.get()
