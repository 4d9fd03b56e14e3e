"""Tables of force states larger than memory: one pass over the rows, a segment at a time, on several processes.

The result is that of :class:`~sindyjoint.JointRegressor` on the same rows in memory. Where nonlinear parameters of a
library are shares of the largest angle or rate, and these are not given, they are shares of the largest in a part of
the rows (of Parquet files, in the statistics of the file). Only where the pass then
meets values that are larger by more than the policy allows, a second one follows under those.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from sindyjoint.discovery import Evidence, RunEvidence
from sindyjoint.discovery.factors import merge
from sindyjoint.discovery.long_runs import Segment, largest_of, pass_over, relative
from sindyjoint.discovery.rows import PARTS, SEGMENTS, factor_of
from sindyjoint.equation.catalogue import Reference, as_catalogue
from sindyjoint.equation.evaluation import TermFunction
from sindyjoint.errors import InputError
from sindyjoint.files.readers import Table, open_blocks
from sindyjoint.parallel import executor, ordered_map

if TYPE_CHECKING:
    from sindyjoint.discovery.estimator import JointRegressor


# Rows read at once: a few megabytes.
READ = 1 << 17
COLUMNS = {"angle": "angle", "rate": "rate", "moment": "moment"}


@dataclass(frozen=True)
class RowTask:
    """A segment of rows of one file.

    Parameters
    ----------
    path : Path
    columns : tuple of str or int
        Angle, rate, moment, and the acceleration where it is there.
    start, stop : int
    inertia : float or None
        kg·m²: its moment is taken from the measured one.
    function : TermFunction or None
        Of the terms; None: only the extremes are needed.
    size : int
        Rows read at once.
    """

    path: Path
    columns: tuple[str | int, ...]
    start: int
    stop: int
    inertia: float | None
    function: TermFunction | None
    size: int = READ


# Name, group, file and edges of the blocks of a run.
RunSegments = tuple[str, str, Path, list[int]]


def discover_rows(
    files: str | Path | Sequence[str | Path],
    library: Any = "extended",
    *,
    columns: Mapping[str, str | int] | None = None,
    groups: Sequence[str] | None = None,
    inertia: float | None = None,
    reference: Reference | None = None,
    size: int = READ,
    jobs: int = 1,
    workers: int | None = None,
    cluster: str | None = None,
    progress: Callable[[str], None] | None = None,
    **options: Any,
) -> JointRegressor:
    """Find the terms of a joint from files of moving force states that need not fit into memory.

    Parameters
    ----------
    files : path or sequence of paths
        CSV, Parquet, Feather, HDF5, MATLAB v7.3, TDMS or NPY, in SI units. Each file is a run; a single one is cut into
        four segments.
    library : str, Path, Catalogue, or sequence of these
    columns : mapping, optional
        Which column is ``angle``, ``rate``, ``moment`` and, if there, ``acceleration``: names, or numbers from 1.
        Default: by these names, without the acceleration.
    groups : sequence of str, optional
        Of each file: what is held out together. Default: each file by itself.
    inertia : float, optional
        kg·m². With it and an acceleration, I·θ̈ is taken from the moment; with an acceleration and without it, the
        inertia is identified as a term; without an acceleration the moment is the transfer moment.
    reference : Reference, optional
        Largest angle and rate, if known; spares a scan of the rows where the library refers to them, and perhaps a
        second pass.
    size : int
        Rows read at once; memory is some hundred bytes for each.
    jobs, workers, cluster
        See :func:`~sindyjoint.parallel.executor`.
    progress : callable, optional
    **options
        Parameters of :class:`~sindyjoint.JointRegressor`.

    Returns
    -------
    JointRegressor
        Fitted.

    Raises
    ------
    InputError
        For files that cannot be read in segments, columns that are missing, or values that are not finite.

    Examples
    --------
    >>> import sindyjoint
    >>> rng = np.random.default_rng(0)
    >>> angle, rate = rng.normal(0, 4e-4, 4000), rng.normal(0, 0.01, 4000)
    >>> moment = 6000 * angle + 1.9 * np.sign(rate) + 0.01 * rng.normal(size=4000)
    >>> np.save("rows.npy", np.column_stack([angle, rate, moment]))
    >>> sindyjoint.discover_rows("rows.npy", "paper", columns={"angle": 1, "rate": 2, "moment": 3}).selected_
    ('linear_stiffness', 'coulomb_friction')
    """
    from sindyjoint.discovery.estimator import JointRegressor

    say = progress or (lambda stage: None)
    keys = dict(COLUMNS if columns is None else columns)
    paths = [Path(files)] if isinstance(files, str | Path) else [Path(file) for file in files]
    names = tuple(keys[key] for key in ("angle", "rate", "moment"))
    names += (keys["acceleration"],) if "acceleration" in keys else ()
    if inertia is not None and "acceleration" not in keys:
        raise InputError(
            "inertia was given and columns name no acceleration; give both, or the transfer moment"
        )
    regressor = JointRegressor(as_catalogue(library), **options)
    regressor.check_parameters()
    runs = _segments(paths, groups)
    tasks = [
        RowTask(path, names, start, stop, inertia, None, size)
        for _, _, path, edges in runs
        for start, stop in zip(edges[:-1], edges[1:], strict=True)
    ]
    with executor(jobs, workers, cluster) as here:
        assumed = reference
        if assumed is None and relative(as_catalogue(library)):
            say("scanning the largest values")
            assumed = _read_stated_scales(paths, names, inertia) or largest_of(
                part.largest for part in ordered_map(here, run_rows, _pieces(paths, tasks[0]))
            )

        say("accumulating factors")
        terms, segments, largest = pass_over(
            regressor,
            run_rows,
            tasks,
            here,
            assumed=assumed,
            largest=lambda done: reference or largest_of(part.largest for part in done),
            with_acceleration=len(names) == 4 and inertia is None,
            say=say,
        )
    say("selecting terms")
    factors = iter(factor for part in segments for factor in part.factors)
    evidence = []
    for name, group, _, edges in runs:
        blocks = tuple(next(factors) for _ in edges[1:])
        evidence.append(RunEvidence(name, group, merge(blocks), blocks))
    ids = tuple(term.id for term in terms)
    return regressor.fit_evidence(terms, Evidence(ids, tuple(evidence)), largest)


def _read_stated_scales(
    paths: Sequence[Path], names: Sequence[str | int], inertia: float | None
) -> Reference | None:
    """Return the largest angle, rate and moment that the files themselves state; None where one does not."""
    if inertia is not None:  # what they state of the moment is not what is fitted
        return None
    stated = [[_open_file(path).largest(name) for name in names[:3]] for path in paths]
    known = [[value for value in values if value is not None] for values in stated]
    return largest_of(known) if known == stated else None


def _pieces(paths: Sequence[Path], like: RowTask) -> list[RowTask]:
    """Return pieces spread evenly over each file; of a small one, all of it."""
    tasks = []
    for path in paths:
        rows = _open_file(path).rows
        # Sixteen, of so many rows together.
        piece = -(-min(rows, READ) // 16)
        starts = np.linspace(0, rows - piece, 16).astype(int).tolist()
        tasks += [replace(like, path=path, start=start, stop=start + piece) for start in starts]
    return tasks


def run_rows(task: RowTask) -> Segment:
    """Work through a segment of rows."""
    source = _open_file(task.path)
    factors = []
    largest = np.zeros(3)
    for start in range(task.start, task.stop, task.size):
        table = source.table(start, min(start + task.size, task.stop))
        angle, rate, moment, *more = table.columns(task.columns)
        if not moment.size:
            continue
        if more and task.inertia is not None:
            moment = moment - task.inertia * more[0]
        largest = np.maximum(largest, [np.max(np.abs(x)) for x in (angle, rate, moment)])
        if task.function is not None:
            states = (angle, rate, *more) if task.inertia is None else (angle, rate)
            factors.append(factor_of(task.function, states, moment))
    top = (float(largest[0]), float(largest[1]), float(largest[2]))
    rows = task.stop - task.start
    return Segment((merge(factors),) if factors else (), top, rows, rows)


def _segments(paths: Sequence[Path], groups: Sequence[str] | None) -> list[RunSegments]:
    """Return name, group, file and edges of the blocks of every run."""
    if groups is not None and len(groups) != len(paths):
        raise InputError(f"{len(groups)} group(s) for {len(paths)} file(s); expected one each")
    found = []
    for number, path in enumerate(paths):
        rows = _open_file(path).rows
        if rows < len(PARTS) * SEGMENTS * 2:
            raise InputError(f"{path}: {rows} rows; expected at least {len(PARTS) * SEGMENTS * 2}")
        if len(paths) == 1:
            ends = _edges(0, rows, len(PARTS))
            pairs = zip(ends[:-1], ends[1:], strict=True)
            found += [(str(i), str(i), path, _edges(a, b, SEGMENTS)) for i, (a, b) in enumerate(pairs)]
        else:
            name = path.stem if sum(other.stem == path.stem for other in paths) == 1 else str(path)
            found.append((name, groups[number] if groups else name, path, _edges(0, rows, SEGMENTS)))
    return found


def _edges(start: int, stop: int, parts: int) -> list[int]:
    """Cut rows so that row i is in part i·parts // n."""
    n = stop - start
    return [start + -(-part * n // parts) for part in range(parts + 1)]


def _open_file(path: Path) -> Table:
    blocks = open_blocks(path)
    if blocks is None:
        raise InputError(
            f"{path}: cannot be read in segments; expected CSV, Parquet, Feather, HDF5, MATLAB v7.3, TDMS or NPY for "
            "a table of force states"
        )
    return blocks
