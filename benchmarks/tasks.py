"""The measurements of ``python -m benchmarks``; each runs in a process of its own and prints one line of JSON."""

from __future__ import annotations

import json
import os
import sys
import tempfile
import time
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from statistics import median
from typing import Any

# Fits are timed as they come, with the threads that they take by themselves; all else on one.
if not sys.argv[1:2] or not sys.argv[1].startswith("fit_"):
    for _name in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"):
        os.environ.setdefault(_name, "1")

import numpy as np  # noqa: E402

# Twenty candidates that pysindy has itself: all products of angle and rate up to the fifth degree.
POWERS = [(i, degree - i) for degree in range(1, 6) for i in range(degree, -1, -1)]
TRUTH = {(1, 0): 5.0, (3, 0): -1.5, (0, 1): 0.8, (2, 1): 0.4}
THRESHOLD = 0.02
PEAK = Path("/proc/self/status")


def peak() -> float:
    """Return the largest memory of this process so far, MB. Not ru_maxrss: what the parent used counts there."""
    line = next(line for line in PEAK.read_text().splitlines() if line.startswith("VmHWM"))
    return int(line.split()[1]) / 1024


def timed(work: Callable[[], Any], repeats: int = 1) -> tuple[Any, dict[str, float]]:
    """Return a result and the median of several times, by the clock and by the processor."""
    walls, processors = [], []
    result = None
    for _ in range(repeats):
        wall, cpu = time.perf_counter(), time.process_time()
        result = work()
        walls.append(time.perf_counter() - wall)
        processors.append(time.process_time() - cpu)
    return result, {"seconds": median(walls), "cpu": median(processors)}


def rows(n: int, seed: int = 0) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return scaled angle, rate and moment with 1 % noise."""
    rng = np.random.default_rng(seed)
    angle, rate = rng.uniform(-1, 1, (2, n))
    moment = 0.01 * rng.normal(size=n)
    for (i, j), c in TRUTH.items():
        moment += c * angle**i * rate**j
    return angle, rate, moment


def terms() -> Any:
    """Return the candidates as one program."""
    from sindyjoint.equation.formula import compile_terms, parse_formula

    return compile_terms([parse_formula(f"theta**{i}*omega**{j}") for i, j in POWERS])


def thresholded(triangle: np.ndarray) -> np.ndarray:
    """Return what pysindy's STLSQ (alpha = 0) finds, from a triangular factor instead of the rows."""
    X, y = triangle[:, :-1], triangle[:, -1]
    kept = np.ones(X.shape[1], dtype=bool)
    for _ in range(20):
        found = np.zeros(X.shape[1])
        found[kept] = np.linalg.lstsq(X[:, kept], y, rcond=None)[0]
        smaller = np.abs(found) >= THRESHOLD
        if np.array_equal(smaller, kept):
            break
        kept = smaller
    return found


def table(n: int, folder: str) -> dict[str, Any]:
    """Write a table of scaled force states, angle, rate and moment, that is never in memory as a whole."""
    path, step = Path(folder) / f"rows-{n}.npy", 1_000_000
    if path.exists():
        return {"path": str(path)}
    with path.open("wb") as file:
        np.lib.format.write_array_header_1_0(file, {"descr": "<f8", "fortran_order": False, "shape": (n, 3)})
        for number, start in enumerate(range(0, n, step)):
            np.column_stack(rows(min(step, n - start), number)).tofile(file)
    return {"path": str(path)}


def states_of(path: str) -> tuple[np.ndarray, np.ndarray]:
    """Return angle and rate as a matrix, and the moment, in memory."""
    data = np.load(path)
    return data[:, :2].copy(), data[:, 2].copy()


def fit_ours(n: int, path: str, where: str) -> dict[str, Any]:
    """Fit by the public door: ``JointRegressor`` from arrays, or ``discover_rows`` from a table on disk."""
    from sindyjoint import JointRegressor
    from sindyjoint.discovery.long_tables import discover_rows

    if where == "memory":
        X, y = states_of(path)
        work = lambda: JointRegressor(library="extended").fit(X, y)  # noqa: E731
    else:
        columns = {"angle": 1, "rate": 2, "moment": 3}
        work = lambda: discover_rows(path, "extended", columns=columns)  # noqa: E731
    work()  # compiled, and catalogues read
    found, spent = timed(work, 5)
    return {**spent, "peak": peak(), "coefficients": dict(zip(found.selected_, kept(found), strict=True))}


def kept(found: Any) -> list[float]:
    """Return the coefficients of the terms that a regressor found."""
    return [float(c) for term, c in zip(found.terms_, found.coef_, strict=True) if term.id in found.selected_]


def fit_pysindy(n: int, path: str) -> dict[str, Any]:
    """Fit by pysindy with the same library, from arrays in memory; reading them is not counted."""
    import pysindy

    from sindyjoint import TermLibrary

    X, y = states_of(path)

    def work() -> Any:
        optimizer = pysindy.STLSQ(threshold=THRESHOLD, alpha=0.0)
        return pysindy.SINDy(optimizer, feature_library=TermLibrary("extended")).fit(
            X, 1e-3, x_dot=y[:, None]
        )

    work()
    model, spent = timed(work, 5)
    physical = model.feature_library.physical_coefficients(model.coefficients())[0]
    named = dict(zip(model.feature_library.get_feature_names(), physical.tolist(), strict=True))
    return {**spent, "peak": peak(), "coefficients": {name: c for name, c in named.items() if c}}


def limits() -> dict[str, Any]:
    """Return what this machine can do: rates of dgemm and dsyrk, and of reading memory."""
    from scipy.linalg.blas import dsyrk

    rng = np.random.default_rng(0)
    square = rng.normal(size=(1500, 1500))
    _, gemm = timed(lambda: square @ square, 5)
    wide = np.asfortranarray(rng.normal(size=(20_000, 500)))
    _, large = timed(lambda: dsyrk(1.0, wide, trans=1), 5)
    block = np.asfortranarray(rng.normal(size=(4096, 21)))
    _, small = timed(lambda: [dsyrk(1.0, block, trans=1) for _ in range(100)], 20)
    memory = rng.normal(size=20_000_000)
    _, stream = timed(memory.sum, 5)
    return {
        "dgemm GFlop/s": 2 * 1500**3 / gemm["seconds"] / 1e9,
        "dsyrk GFlop/s, 20000 x 500": 20_000 * 500 * 501 / large["seconds"] / 1e9,
        "dsyrk ns per row of 21 columns in cache": small["seconds"] / 409_600 * 1e9,
        "dsyrk cpu ns per row": small["cpu"] / 409_600 * 1e9,
        "memory GB/s": memory.nbytes / stream["seconds"] / 1e9,
    }


def disk(n: int, folder: str) -> dict[str, Any]:
    """Stream a table from disk into a factor, and, as the limit, its bytes into nothing."""
    from sindyjoint.discovery.long_tables import RowTask, run_rows

    path = Path(folder) / f"rows-{n}.npy"
    task = RowTask(path, (1, 2, 3), 0, n, None, terms())
    run_rows(RowTask(path, (1, 2, 3), 0, 9000, None, task.function))  # compiled before

    def read() -> None:
        buffer = bytearray(1 << 22)
        with path.open("rb", buffering=0) as file:
            while file.readinto(buffer):
                pass

    _, bytes_only = timed(read)
    # What a first call alone pays is not to be seen in the growth.
    result, spent = timed(lambda: run_rows(task), 1 if n > 10_000_000 else 3)
    return {**spent, "peak": peak(), "rows": n, "reading": bytes_only["seconds"],
            "coefficients": thresholded(result.factors[0].triangle).tolist()}  # fmt: skip


def statistics(n: int, folder: str) -> dict[str, Any]:
    """Cost of leave-one-frequency-out and of the selection in 500 resampled campaigns on top of the single pass."""
    from sindyjoint.discovery import Evidence, RunEvidence
    from sindyjoint.discovery.factors import merge
    from sindyjoint.discovery.long_tables import RowTask, run_rows
    from sindyjoint.discovery.uncertainty import cross_validate, inclusion

    path = Path(folder) / f"rows-{n}.npy"
    function = terms()
    run_rows(RowTask(path, (1, 2, 3), 0, 9000, None, function))
    edges = np.linspace(0, n, 6 * 16 + 1).astype(int).tolist()

    def one_pass() -> Evidence:
        parts = [
            run_rows(RowTask(path, (1, 2, 3), a, b, None, function)).factors[0]
            for a, b in zip(edges[:-1], edges[1:], strict=True)
        ]
        runs = [
            RunEvidence(
                f"run {i}",
                f"{i + 1} Hz",
                merge(parts[16 * i : 16 * i + 16]),
                tuple(parts[16 * i : 16 * i + 16]),
            )
            for i in range(6)
        ]
        return Evidence(tuple(f"t{i}{j}" for i, j in POWERS), tuple(runs))

    evidence, single = timed(one_pass)

    def refits() -> list[np.ndarray]:
        return [
            thresholded(factor.triangle) for factor in Evidence(evidence.ids, evidence.runs).training.values()
        ]

    _, left_out = timed(refits, 3)
    cross_validate(evidence)
    folds, anew = timed(lambda: cross_validate(evidence), 3)
    _, drawn = timed(lambda: inclusion(evidence, 500, random_state=0), 3)
    return {"single pass": single, "leave one frequency out": left_out, "bootstrap of 500": drawn, "peak": peak(),
            "discovery anew in each fold": anew, "folds agree": folds.unanimous}  # fmt: skip


def statistics_pysindy(n: int) -> dict[str, Any]:
    """Six folds and 500 replicates by refits of pysindy."""
    import pysindy
    from sklearn.model_selection import LeaveOneGroupOut

    angle, rate, moment = rows(n)
    states = np.column_stack([angle, rate])

    def refit(index: np.ndarray) -> None:
        library = pysindy.PolynomialLibrary(degree=5, include_bias=False)
        model = pysindy.SINDy(
            optimizer=pysindy.STLSQ(threshold=THRESHOLD, alpha=0.0), feature_library=library
        )
        model.fit(states[index], 1e-3, x_dot=moment[index, None])

    _, single = timed(lambda: refit(np.arange(n)))
    groups = np.arange(n) * 6 // n
    _, left_out = timed(
        lambda: [refit(train) for train, _ in LeaveOneGroupOut().split(states, groups=groups)]
    )
    rng = np.random.default_rng(0)
    _, drawn = timed(lambda: [refit(rng.integers(0, n, n)) for _ in range(500)])
    return {"single pass": single, "leave one frequency out": left_out, "bootstrap of 500": drawn}


def best_subset(n: int) -> dict[str, Any]:
    """Best sets of five of twelve candidates: ours from the factor, and every set by a refit of scikit-learn."""
    from itertools import combinations

    from sklearn.linear_model import LinearRegression

    from sindyjoint.discovery.best_subset import best_subsets
    from sindyjoint.discovery.factors import Factor

    angle, rate, moment = rows(n)
    columns = np.column_stack([angle**i * rate**j for i, j in POWERS[:12]])
    best_subsets(Factor.of(columns[:500], moment[:500]))  # compiled before
    _, ours = timed(lambda: best_subsets(Factor.of(columns, moment)), 3)
    sets = list(combinations(range(12), 5))
    _, theirs = timed(
        lambda: [LinearRegression(fit_intercept=False).fit(columns[:, s], moment) for s in sets]
    )
    return {
        "ours": ours,
        "ours finds": "the best set of every size",
        "scikit-learn": theirs,
        "sets": len(sets),
    }


def simulation() -> dict[str, Any]:
    """One joint at 1e-4 relative error: ours, and solve_ivp with events; and a chain of panels beside OpenSees."""
    sys.path.insert(0, str(Path(__file__).parent))
    import bench_simulation as bench
    from hybrid_reference import solve_stick_slip

    from sindyjoint.mechanics import INTER_PANEL
    from sindyjoint.mechanics.stickslip import simulate

    run = lambda: simulate(INTER_PANEL, bench.DRIVE, bench.DURATION, bench.RATE, rtol=1e-4)  # noqa: E731
    run()
    _, ours = timed(run, 5)
    instants = np.arange(int(bench.DURATION * bench.RATE)) / bench.RATE
    drive = lambda t: bench.AMPLITUDE * np.sin(2 * np.pi * bench.FREQUENCY * t)  # noqa: E731
    _, theirs = timed(
        lambda: solve_stick_slip(INTER_PANEL, drive, bench.DURATION, instants, rtol=1e-4, method="RK45")
    )
    record = {"one joint, 10 s": ours, "solve_ivp": theirs}
    try:
        import pytest
        from test_structure import chain, opensees_pulse, respond

        from sindyjoint.mechanics import PaperLaw
        from sindyjoint.mechanics.excitation import pulse

        structure = chain(PaperLaw(k1=6066.0))
        respond(structure, pulse(65.0, 0.005), duration=5.0)
        record["chain, 5 s"] = timed(lambda: respond(structure, pulse(65.0, 0.005), duration=5.0), 3)[1]
        record["OpenSees"] = timed(lambda: opensees_pulse(None))[1]
    except (ImportError, pytest.skip.Exception) as error:
        record["OpenSees"] = str(error)
    return record


def repeated(campaign: Any, times: int) -> Any:
    """Return a campaign whose runs, of whole periods, are so many times as long."""
    runs = [
        replace(run, moment=np.tile(run.moment, times), angle=np.tile(run.angle, times))
        for run in campaign.runs
    ]
    return campaign.with_runs(tuple(runs))


def workflows() -> dict[str, Any]:
    """Discovery, diagnosis and report of the built-in virtual test, warm, with a profile."""
    import cProfile
    import pstats

    from sindyjoint.files import write_campaign
    from sindyjoint.mechanics.virtual import virtual_campaign
    from sindyjoint.reporting import write_results
    from sindyjoint.workflows.diagnose import diagnose
    from sindyjoint.workflows.discover import discover

    campaign = virtual_campaign(random_state=0)
    with tempfile.TemporaryDirectory() as folder:
        write_campaign(campaign, Path(folder) / "campaign")
        found = discover(campaign)
        found, warm = timed(lambda: discover(campaign), 3)
        _, report = timed(lambda: write_results(found, Path(folder) / "out"), 2)
        _, named = timed(lambda: diagnose(campaign))
        spent = [timed(lambda long=repeated(campaign, n): discover(long))[1]["cpu"] for n in (1, 11)]
        profile = cProfile.Profile()
        profile.runcall(discover, Path(folder) / "campaign")
    rows_of = pstats.Stats(profile).get_stats_profile().func_profiles.items()  # type: ignore[attr-defined]
    top = sorted(rows_of, key=lambda item: -item[1].tottime)[:12]
    return {
        "discover, warm": warm,
        "a further sample": (spent[1] - spent[0]) / (10 * sum(run.n_samples for run in campaign.runs)),
        "diagnose": named,
        "report": report,
        "profile": [f"{p.tottime:.3f} s in {name} ({Path(p.file_name).name})" for name, p in top],
    }


TASKS = {task.__name__: task for task in (table, fit_ours, fit_pysindy, limits, disk, statistics, statistics_pysindy,
                                          best_subset, simulation, workflows)}  # fmt: skip

if __name__ == "__main__":
    name, *arguments = sys.argv[1:]
    given = [int(a) if a.isdigit() else a for a in arguments]
    print(json.dumps(TASKS[name](*given)))
