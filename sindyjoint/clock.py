"""What a task may cost of the machine: processor time and work, wherever they are spent, and threads.

A stage that may take long is given a :class:`Portion`. What it does in many small pieces, trials of a regression or
simulations, is counted as it is done (:func:`spend`), and ends where the portion is used up. Nobody in between has to
know.
"""

import math
import os
import signal
import threading
import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import ExitStack, contextmanager
from contextvars import ContextVar, copy_context
from typing import Any, Self, TypeVar

R = TypeVar("R")
Other = TypeVar("Other")


class Spent(Exception):
    """What a stage may cost is used up.

    It is no error of the package: the stage that has the portion ends with what it has.
    """

    def __init__(self, portion: "Portion") -> None:
        super().__init__(portion.stopped)
        self.portion = portion


class Portion:
    """What a stage may cost: work that is counted alike on every machine, and processor time as a last resort.

    A task whose work is more than what remains ends without a result, whatever it was about when that came out: who did
    which part of it first, and on how many processors, makes no difference. Processor time is that of this process
    while the portion is entered, and of those that :func:`sindyjoint.parallel.side_by_side` gives tasks to: wall time
    would say how busy a machine is, and not what was asked of it.

    Parameters
    ----------
    work : float
        What may be done, in samples that a trial goes along; see :func:`spend`.
    seconds : float
        Processor time after which nothing more is begun.

    Attributes
    ----------
    stopped : str
        Why it ended, in words; empty while it has not.
    left_out : list of str
        What was not finished or not begun.
    """

    def __init__(self, work: float = math.inf, seconds: float = math.inf) -> None:
        self.most_work, self.most_seconds = work, seconds
        self.stopped = ""
        self.left_out: list[str] = []
        self.work = self.elsewhere = self._before = 0.0
        self._start: float | None = None
        self._counting = threading.Lock()

    @property
    def seconds(self) -> float:
        """Spent so far, in all its tasks."""
        now = 0.0 if self._start is None else time.process_time() - self._start
        return self._before + now + self.elsewhere

    def count(self, work: float, elsewhere: float = 0.0) -> None:
        """Count work that was done, and processor time of others for it; Spent where that was all that may be."""
        with self._counting:
            self.work += work
            self.elsewhere += elsewhere
        if self.work >= self.most_work:
            self.stopped = "after as much work as is allowed on any machine"
        elif not self.stopped and self.seconds >= self.most_seconds:
            self.stopped = f"after {self.seconds:.0f} s of processor time"
        if self.stopped:
            raise Spent(self)

    def do(self, task: Callable[[], R], otherwise: Other, what: str) -> R | Other:
        """Return the result of a task, or something else where the portion is used up before that ends.

        Parameters
        ----------
        task : callable
        otherwise : object
        what : str
            What is then left out; empty where that need not be said.
        """
        try:
            with self:
                self.count(0.0)
                return task()
        except Spent as spent:
            if spent.portion is not self:
                raise
        if what and what not in self.left_out:
            self.left_out.append(what)
        return otherwise

    def __enter__(self) -> Self:
        self._start = time.process_time()
        self._token = PORTIONS.set((*PORTIONS.get(), self))
        return self

    def __exit__(self, *error: object) -> None:
        self._before, self._start = self.seconds - self.elsewhere, None
        PORTIONS.reset(self._token)


#: Those that are entered here.
PORTIONS: ContextVar[tuple[Portion, ...]] = ContextVar("portions", default=())


def spend(samples: float) -> None:
    """Count a piece of work of the stage that is running; Spent where its portion is used up.

    A piece is a trial of numbers along recorded samples, or a simulation, of which each step counts
    :data:`STEP_SAMPLES` samples.
    """
    for portion in PORTIONS.get():
        portion.count(samples)


#: Samples of a trial that take as long as one step of a simulation, about.
STEP_SAMPLES = 5.0


# What a task in another process may cost: work and processor time, s, that remain of the least portion, and the number
# of the process that gives it, which counts for itself.
Allowance = tuple[float, float, int]


def allowance(portions: Sequence[Portion]) -> Allowance:
    """Return what remains of some portions."""
    work = min((portion.most_work - portion.work for portion in portions), default=math.inf)
    return work, min((p.most_seconds - p.seconds for p in portions), default=math.inf), os.getpid()


def run_timed(function: Callable[..., R], given: Allowance, *arguments: Any) -> tuple[R, float, float]:
    """Return a result, and work and processor time where another process than the one of the allowance did it.

    The result is None where the allowance was used up.
    """
    work, seconds, process = given
    if os.getpid() == process:
        return function(*arguments), 0.0, 0.0
    start, portion = time.thread_time(), Portion(work, seconds)
    result: Any = portion.do(lambda: function(*arguments), None, "")
    return result, portion.work, time.thread_time() - start


T = TypeVar("T")


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


def on_threads(work: Callable[[T], R], tasks: Sequence[T]) -> list[R]:
    """Return the results of all tasks, in their order, from as many threads as linear algebra would have taken.

    Parameters
    ----------
    work : callable
        Does one task in compiled code that lets other threads run. Portions are those of every thread.
    tasks : sequence
    """
    with single_threaded():
        count = min(_threads.get() or 1, len(tasks))
        if count < 2:
            return list(map(work, tasks))
        from concurrent.futures import ThreadPoolExecutor

        with ThreadPoolExecutor(count) as pool:
            begun = [pool.submit(copy_context().run, work, task) for task in tasks]
            return [each.result() for each in begun]


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
