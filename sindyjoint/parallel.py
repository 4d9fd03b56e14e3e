"""Tasks on one process, on several of this machine (joblib), or on a Dask cluster: the same result to the last bit.

A task is a picklable function of one picklable argument and knows its own seed; results come back with the task's
number, so what is merged in that order does not depend on who worked when. Linear algebra runs on one thread within a
task: threads would change the order of sums, and the tasks already keep every core busy. Matrices are small here; the
threads that linear algebra would have had are given to blocks of rows instead (:func:`sindyjoint.clock.on_threads`).

A worker that dies (out of memory) costs no result: its task is done again, and given up after three; a
:class:`~sindyjoint.errors.WorkerError` is then its result.
"""

import os
import signal
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager, suppress
from contextvars import ContextVar
from functools import partial
from typing import Any, TypeVar

from sindyjoint.clock import (
    PORTIONS,
    allowance,
    interruption_held,
    on_threads,
    run_timed,
    single_threaded,
)
from sindyjoint.errors import InputError, MissingExtraError, WorkerError, refuse

T = TypeVar("T")
R = TypeVar("R")

# Processes on each core of this machine, at most: many more only take its memory.
PROCESSES_A_CORE = 32
# As Dask's allowed-failures: so many workers may die on one task before it is given up.
ATTEMPTS = 3

# Of the workers started here. Dask's sampling profiler, its order to the C library to hand every 64 KB back to the
# system, whose pages are then cleared anew for the next array, and its looks at the machine, up to fifty a second, each
# of which takes the interpreter from the task in hand, took a sixth of a worker's time.
WORKER_SETTINGS = {
    "distributed.worker.profile.enabled": False,
    "distributed.worker.memory.monitor-interval": "1s",
    "distributed.admin.tick.interval": "1s",
    "distributed.admin.system-monitor.interval": "5s",
    "distributed.admin.system-monitor.disk": False,
    "distributed.admin.system-monitor.gil.enabled": False,
    "distributed.nanny.pre-spawn-environ.MALLOC_TRIM_THRESHOLD_": None,
}


def _lost() -> WorkerError:
    """Return what stands for the result of a task whose workers died."""
    return WorkerError(f"{ATTEMPTS} workers died on it, one after the other (killed, or out of memory)")


# Whatever runs tasks: of a function and tasks it yields the number of each task and ``function(task)`` as it ends, in
# any order. An exception of a task is raised.
Executor = Callable[..., Iterator[tuple[int, Any]]]


def ordered_map(
    executor: Executor,
    function: Callable[..., R],
    tasks: Sequence[T],
    done: Callable[[int], None] | None = None,
) -> list[R]:
    """Return the results of all tasks in the order of the tasks.

    Parameters
    ----------
    executor : Executor
    function : callable
        Of one task; to be sent to other processes, with whatever it closes over.
    tasks : sequence
    done : callable, optional
        Called with the number of results after each of them.

    Raises
    ------
    WorkerError
        If a task was lost; whatever a task raises.
    """
    results: dict[int, R] = {}
    for number, result in executor(function, tasks):
        if isinstance(result, WorkerError):
            raise WorkerError(
                f"task {number + 1} of {len(tasks)} was given up: {result}; give it more memory"
            )
        results[number] = result
        if done is not None:
            done(len(results))
    return [results[number] for number in range(len(tasks))]


_here: ContextVar[Executor | None] = ContextVar("executor", default=None)


def side_by_side(function: Callable[..., R], tasks: Sequence[T], threads: bool = True) -> list[R]:
    """Return the results of all tasks in their order, from where :func:`spread` has them run.

    For tasks that lie deep inside an analysis; see :func:`ordered_map`. Without :func:`spread` they run on threads, or
    with ``threads=False`` one after the other.
    """
    there = _here.get() or (_threads if threads else _serial)
    portions = PORTIONS.get()
    if not portions:
        return ordered_map(there, function, tasks)
    timed = ordered_map(there, partial(run_timed, function, allowance(portions)), tasks)
    for portion in portions:
        portion.count(sum(work for _, work, _ in timed), sum(seconds for _, _, seconds in timed))
    # Where an allowance was used up, so was the portion, which has said so.
    return [result for result, _, _ in timed]


@contextmanager
def spread(jobs: int = 1, workers: int | None = None, cluster: str | None = None) -> Iterator[None]:
    """Have :func:`side_by_side` run its tasks on processes or a cluster; with ``jobs=1`` they stay in this process.

    Parameters and errors are those of :func:`executor`.
    """
    with executor(jobs, workers, cluster) as found:
        token = _here.set(None if found is _serial else found)
        try:
            yield
        finally:
            _here.reset(token)


@contextmanager
def executor(jobs: int = 1, workers: int | None = None, cluster: str | None = None) -> Iterator[Executor]:
    """Give what runs tasks, and end its processes afterwards.

    Parameters
    ----------
    jobs : int
        Processes of this machine by joblib; -1: one for each core; 1: this process, or what :func:`spread` gives.
    workers : int, optional
        Start a Dask cluster of so many worker processes on this machine.
    cluster : str, optional
        Address of a running Dask scheduler, such as ``"tcp://10.0.0.7:8786"``; its workers need this package and the
        same file system.

    Raises
    ------
    InputError
        For more than one of these, numbers that cannot be, or a cluster that does not answer.
    MissingExtraError
        Without Dask distributed.
    """
    _check_way(jobs, workers, cluster)
    if workers is not None or cluster is not None:
        with _dask(workers, cluster) as client:
            yield partial(_on_dask, client)
    elif jobs == 1:
        # Once for all tasks: looking for the libraries takes milliseconds.
        with single_threaded():
            yield _here.get() or _serial
    else:
        with _processes():
            yield partial(_on_processes, jobs)


def check_unused(jobs: int, workers: int | None, cluster: str | None) -> str:
    """Refuse what :func:`executor` would refuse, where its tasks stay in this process; say what is then not used."""
    _check_way(jobs, workers, cluster)
    if cluster is not None:
        with _dask(None, cluster):
            return "cluster"
    return "" if workers is None else "workers"


def _check_way(jobs: int, workers: int | None, cluster: str | None) -> None:
    ways = {"jobs": jobs != 1, "workers": workers is not None, "cluster": cluster is not None}
    given = [name for name, on in ways.items() if on]
    most = PROCESSES_A_CORE * (os.cpu_count() or 1)
    refuse(
        [
            (len(given) > 1, f"{' and '.join(given)} were given; expected one way to run the tasks"),
            (jobs != -1 and jobs < 1, f"jobs is {jobs}; expected a positive number, or -1 for one per core"),
            (workers is not None and workers < 1, f"workers is {workers}; expected a positive number"),
            *(
                (
                    count > most,
                    f"{name} asks for more than {most} processes, {PROCESSES_A_CORE} for each core",
                )
                for name, count in (("jobs", jobs), ("workers", workers or 0))
            ),
        ]
    )


def _serial(function: Callable[..., R], tasks: Sequence[T]) -> Iterator[tuple[int, R]]:
    """Run one task after the other, here."""
    for number, task in enumerate(tasks):
        yield number, _run(function, task)


def _threads(function: Callable[..., R], tasks: Sequence[T]) -> Iterator[tuple[int, R]]:
    """Run tasks on threads of this process: for tasks that mostly wait for compiled code."""
    yield from enumerate(on_threads(function, tasks))


def _on_processes(
    jobs: int, function: Callable[..., R], tasks: Sequence[T]
) -> Iterator[tuple[int, R | WorkerError]]:
    """Run tasks on processes of this machine."""
    from concurrent.futures.process import BrokenProcessPool

    from joblib import Parallel, delayed

    def pool(numbers: Sequence[int], jobs: int) -> Iterator[tuple[int, R]]:
        given = [delayed(_run_numbered)(function, n, tasks[n], os.getpid()) for n in numbers]
        with interruption_held():
            return iter(Parallel(n_jobs=jobs, batch_size=1, return_as="generator_unordered")(given))

    def isolated(number: int) -> R | WorkerError:
        for _ in range(ATTEMPTS - 1):
            # Two, for with one joblib would run it in this very process.
            with suppress(BrokenProcessPool):
                return next(pool([number], 2))[1]
        return _lost()

    waiting = list(range(len(tasks)))
    while waiting:
        try:
            for number, result in pool(waiting, jobs):
                waiting.remove(number)
                yield number, result
        except BrokenProcessPool:
            # One of the tasks that were under way ended its process: each of them tries again by itself, so
            # that one that does it every time takes no other down.
            for number in waiting[: 2 * jobs if jobs > 0 else len(waiting)]:
                waiting.remove(number)
                yield number, isolated(number)


def _on_dask(
    client: Any, function: Callable[..., R], tasks: Sequence[T]
) -> Iterator[tuple[int, R | WorkerError]]:
    """Run tasks on a Dask cluster, whose scheduler sends the task of a dead worker to another one."""
    from distributed import KilledWorker, as_completed

    futures = [client.submit(_run, function, task, pure=False) for task in tasks]
    number_of = {future.key: number for number, future in enumerate(futures)}
    try:
        for future in as_completed(futures, loop=client.loop):
            try:
                yield number_of[future.key], future.result()
            except KilledWorker:
                yield number_of[future.key], _lost()
            future.release()
    finally:
        client.cancel(futures, force=True)


def _run_numbered(function: Callable[..., R], number: int, task: T, home: int) -> tuple[int, R]:
    if os.getpid() != home:
        with suppress(ValueError):  # where it cannot be held
            signal.signal(signal.SIGINT, signal.SIG_IGN)
    return number, _run(function, task)


def _run(function: Callable[..., R], task: T) -> R:
    with single_threaded():
        return function(task)


@contextmanager
def _processes() -> Iterator[None]:
    """End joblib's processes when the block ends; at once after an interruption."""
    import warnings

    from joblib.externals.loky import get_reusable_executor

    try:
        with warnings.catch_warnings():
            warnings.filterwarnings("ignore", r"\d+ tasks which were still being processed", UserWarning)
            yield
    # Ctrl-C above all: else the processes would end their tasks first.
    except BaseException:
        get_reusable_executor(kill_workers=True).shutdown(wait=False, kill_workers=True)
        raise
    get_reusable_executor().shutdown(wait=True)


@contextmanager
def _dask(workers: int | None, address: str | None) -> Iterator[Any]:
    try:
        import dask
        from distributed import Client, LocalCluster
    except ImportError as error:
        raise MissingExtraError(
            'workers and clusters need Dask; run: pip install "sindyjoint[cluster]"'
        ) from error
    if address is not None:
        try:
            client = Client(address, timeout="10s", set_as_default=False)
        except (OSError, ValueError, TimeoutError) as error:
            reason = " ".join(str(error).split()) or type(error).__name__
            raise InputError(
                f"no Dask scheduler answers at {address!r} ({reason:.100}); start one with 'dask scheduler'"
            ) from error
        with client:
            yield client
        return
    with (
        dask.config.set(WORKER_SETTINGS),
        LocalCluster(
            n_workers=workers,
            threads_per_worker=1,
            processes=True,
            # On any free port of this machine: None would mean 8787 on all of its addresses, or a warning.
            dashboard_address="127.0.0.1:0",
            silence_logs=60,  # above CRITICAL: a killed worker is reported by its task, if at all
        ) as local,
        Client(local, set_as_default=False) as client,
    ):
        yield client
