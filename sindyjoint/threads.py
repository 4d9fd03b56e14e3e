"""Threads: one for linear algebra on small matrices, the others for blocks of rows; and who hears Ctrl-C."""

from __future__ import annotations

import os
import signal
import threading
from collections.abc import Callable, Iterator, Sequence
from contextlib import ExitStack, contextmanager
from contextvars import ContextVar
from typing import TypeVar

T = TypeVar("T")
R = TypeVar("R")

# Threads that on_threads may take; None: as many as linear algebra has been given.
_threads: ContextVar[int | None] = ContextVar("threads", default=None)


class _Limit:
    """One thread for linear algebra while anyone asks for it; the first sets the limit, the last one lifts it."""

    def __init__(self) -> None:
        self.lock, self.users, self.held = threading.Lock(), 0, ExitStack()

    def enter(self) -> int:
        """Set the limit, and return how many threads there were."""
        from threadpoolctl import ThreadpoolController

        with self.lock:
            found = 1
            if not self.users:
                pools = ThreadpoolController()
                found = max([pool.num_threads for pool in pools.lib_controllers], default=1)
                self.held.enter_context(pools.limit(limits=1))
            self.users += 1
            return found

    def leave(self) -> None:
        with self.lock:
            self.users -= 1
            if not self.users:
                self.held.close()


_limit = _Limit()


@contextmanager
def single_threaded() -> Iterator[None]:
    """Let linear algebra run on one thread, for many small matrices, and :func:`on_threads` have what it had."""
    if _threads.get() is not None and _limit.users:
        # Within another one, in the same thread.
        yield
        return
    found = _limit.enter()
    token = _threads.set(found) if _threads.get() is None else None
    try:
        yield
    finally:
        if token is not None:
            _threads.reset(token)
        _limit.leave()


@contextmanager
def all_cores() -> Iterator[None]:
    """Let :func:`on_threads` have every core, though linear algebra is limited to one from its start."""
    token = _threads.set(len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count())
    try:
        yield
    finally:
        _threads.reset(token)


def on_threads(start: Callable[[], Callable[[T], R]], tasks: Sequence[T]) -> list[R]:
    """Return the results of all tasks, in their order, from as many threads as linear algebra would have taken.

    Parameters
    ----------
    start : callable
        Called once in each thread: returns the function that does one task, with working memory for this thread.
    tasks : sequence
        For compiled code that lets other threads run.
    """
    with single_threaded():
        count, own = min(_threads.get() or 1, len(tasks)), threading.local()
        if count < 2:
            return list(map(start(), tasks))
        from concurrent.futures import ThreadPoolExecutor

        with ThreadPoolExecutor(count, initializer=lambda: setattr(own, "work", start())) as pool:
            return list(pool.map(lambda task: own.work(task), tasks))


@contextmanager
def interruption_held() -> Iterator[None]:
    """Keep Ctrl-C from processes and threads that are begun in the block; here it is heard when the block ends.

    It goes to all processes of a terminal, and the one that handed out the tasks ends the others. A process that heard
    it while it still loaded its libraries would leave a traceback.
    """
    if not hasattr(signal, "pthread_sigmask"):
        yield
        return
    from multiprocessing import resource_tracker

    from joblib.externals.loky.backend import resource_tracker as joblibs_tracker

    # The start of these, before the first process, would let go of what is held.
    resource_tracker.ensure_running()
    joblibs_tracker.ensure_running()
    before = signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT})
    try:
        yield
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, before)
