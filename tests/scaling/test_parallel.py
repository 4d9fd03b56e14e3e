"""Tasks in one process, in several and on a cluster: the same digits, whatever dies on the way."""

import os
import signal
from pathlib import Path

import numpy as np
import pytest

from sindyjoint.errors import InputError, WorkerError
from sindyjoint.parallel import check_unused, executor, ordered_map
from tests.light_tasks import hears_ctrl_c


def seeded(seed):
    """Do something whose last digits depend on the order of sums."""
    matrix = np.random.default_rng(seed).normal(size=(120, 120))
    return np.linalg.inv(matrix @ matrix.T + np.eye(120)).tobytes()


def mortal(task):
    """Kill the process that works on task 3: once, or whenever it is tried."""
    number, mark, always = task
    if number == 3 and (always or not Path(mark).exists()):
        Path(mark).touch()
        os.kill(os.getpid(), signal.SIGKILL)
    return number


@pytest.fixture(scope="module")
def cluster():
    """Two workers, started once: the address of their scheduler."""
    distributed = pytest.importorskip("distributed", reason="dask[distributed] is not installed")
    with distributed.LocalCluster(
        n_workers=2, threads_per_worker=1, dashboard_address="127.0.0.1:0", silence_logs=60
    ) as local:
        yield local.scheduler_address


def test_the_same_bits_on_one_two_and_four_processes_and_on_dask(cluster):
    ways = ({}, {"jobs": 2}, {"jobs": 4}, {"cluster": cluster})
    results = []
    for way in ways:
        with executor(**way) as workers:
            results.append(ordered_map(workers, seeded, range(6)))
    assert all(result == results[0] for result in results)
    assert len(set(results[0])) == 6


@pytest.mark.parametrize("way", ["jobs", "cluster"])
def test_a_killed_worker_costs_no_result(way, cluster, tmp_path):
    tasks = [(number, str(tmp_path / "mark"), False) for number in range(6)]
    with executor(**({"jobs": 2} if way == "jobs" else {"cluster": cluster})) as workers:
        assert ordered_map(workers, mortal, tasks) == list(range(6))
    assert (tmp_path / "mark").exists()


def test_a_task_that_kills_every_worker_is_given_up_and_the_others_are_not(tmp_path):
    tasks = [(number, str(tmp_path / "mark"), True) for number in range(6)]
    with executor(jobs=2) as workers:
        results = dict(workers(mortal, tasks))
        assert isinstance(results.pop(3), WorkerError)
        assert results == {number: number for number in (0, 1, 2, 4, 5)}
        with pytest.raises(WorkerError, match="task 4 of 6 was given up: 3 workers died on it"):
            ordered_map(workers, mortal, tasks)


@pytest.mark.skipif(not hasattr(signal, "pthread_sigmask"), reason="signals of POSIX")
def test_a_process_hears_no_interruption_from_its_start():
    # One that still loads its libraries would leave a traceback.
    with executor(jobs=2) as workers:
        assert ordered_map(workers, hears_ctrl_c, range(4)) == 4 * [False]
    assert hears_ctrl_c(0)


def test_an_exception_of_a_task_is_raised():
    with executor(jobs=2) as workers, pytest.raises(ZeroDivisionError):
        ordered_map(workers, reciprocal, [1.0, 0.0])


def reciprocal(value):
    return 1.0 / value if value else 1 // 0


@pytest.mark.parametrize(
    ("way", "message"),
    [
        ({"jobs": 0}, "jobs is 0; expected a positive number"),
        ({"workers": 0}, "workers is 0; expected a positive number"),
        ({"jobs": 10**6}, "jobs asks for more than [0-9]+ processes, 32 for each core"),
        (
            {"workers": 10**99},
            "workers asks for more than [0-9]+ processes, 32 for each core",
        ),
        ({"jobs": 2, "workers": 2}, "jobs and workers were given; expected one way"),
        ({"cluster": "nonsense://x"}, "no Dask scheduler answers at 'nonsense://x'"),
    ],
)
def test_what_cannot_be_is_refused(way, message):
    with pytest.raises(InputError, match=message), executor(**way):
        pass
    # Nor is it where no task is handed out.
    with pytest.raises(InputError, match=message):
        check_unused(**{"jobs": 1, "workers": None, "cluster": None, **way})


def test_what_is_not_used_is_said():
    assert [check_unused(1, None, None), check_unused(2, None, None), check_unused(1, 2, None)] == [
        "",
        "",
        "workers",
    ]
