"""Runs that are too long for memory: force states and factors segment by segment.

Each segment is processed as a separate run: of a sine its harmonics are those of the segment, of any other motion the
segments overlap by what the smoothing kernel takes at their ends, under one cut-off. Their factors are the replicate
blocks whose scatter gives the errors, and merged they are the run's.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from sindyjoint.discovery.delay import shifted
from sindyjoint.discovery.evidence import Evidence, RunEvidence
from sindyjoint.discovery.factors import Factor, merge
from sindyjoint.discovery.large.passes import Segment, largest_of, pass_over
from sindyjoint.discovery.rows import RowLabels, Rows, gather, hierarchy, run_factors
from sindyjoint.equation.evaluation import TermFunction
from sindyjoint.equation.terms import ResolvedTerm
from sindyjoint.errors import InputError
from sindyjoint.files.campaign import FEWEST, load_segment
from sindyjoint.inputs import LongRecord, input_names
from sindyjoint.parallel import Executor
from sindyjoint.record import Campaign
from sindyjoint.states import ForceStates, force_states, regression_rows
from sindyjoint.states.rows import group_labels

if TYPE_CHECKING:
    from sindyjoint.discovery.regression import TermRegression


@dataclass(frozen=True)
class Task:
    """One segment of a long run.

    Parameters
    ----------
    whole : LongRecord
    number : int
        Of the segment.
    method : {"periodic", "broadband"}
    bandwidth : float or None
        Hz; of a broadband run one for all of its segments.
    margin : int
        Samples that the kernel takes at either end.
    lag : float
        s, of the moment, to be undone.
    inertia : float or None
    parts : int
        Blocks that its rows are cut into.
    function : TermFunction or None
        Of the terms; None: only the extremes are needed.
    """

    whole: LongRecord
    number: int
    method: str
    bandwidth: float | None
    margin: int
    lag: float
    inertia: float | None
    parts: int = 1
    function: TermFunction | None = None


@dataclass(frozen=True)
class SampleCount:
    """Moving samples, and all samples, of a run."""

    moving: int
    samples: int


def has_long_runs(campaign: Campaign) -> bool:
    """Return whether a run of a campaign is longer than what is in memory."""
    return any(run.whole is not None for run in campaign.identification_runs)


def fit_long(
    regressor: TermRegression,
    campaign: Campaign,
    states: Sequence[ForceStates],
    here: Executor,
    *,
    bandwidth: float | None = None,
    lag: float = 0.0,
    say: Callable[[str], None] = lambda stage: None,
) -> tuple[TermRegression, tuple[SampleCount, ...]]:
    """Fit a regressor to a campaign some of whose runs are long.

    Parameters
    ----------
    regressor : TermRegression
    campaign : Campaign
    states : sequence of ForceStates
        Of the identification runs, of long ones of their first segment.
    here : Executor
    bandwidth : float, optional
    lag : float
        s, of the moment; already undone in `states`.
    say : callable

    Returns
    -------
    regressor : TermRegression
    counts : tuple of SampleCount
        One per run.

    Raises
    ------
    InputError
        If more than half of a run's segments cannot be used.
    """
    inertia = campaign.joint.inertia
    tasks = {
        i: _make_tasks(run.whole, state, bandwidth, lag, inertia)
        for i, (run, state) in enumerate(zip(campaign.identification_runs, states, strict=True))
        if run.whole is not None
    }
    every = [task for group in tasks.values() for task in group]
    say(f"{len(every)} segments of long runs")

    passed = pass_over(
        regressor,
        work,
        every,
        here,
        # The first segments usually give the scale of the others.
        assumed=largest_of(map(_find_extremes, states)),
        largest=lambda done: largest_of([*map(_find_extremes, states), *(s.largest for s in done)]),
        with_acceleration=inertia is None,
        say=say,
    )
    terms, done, reference = passed.terms, passed.segments, passed.reference
    labels, results = group_labels(states), iter(done)
    runs, counts = [], []
    for i, (state, label) in enumerate(zip(states, labels, strict=True)):
        if i in tasks:
            segments = [next(results) for _ in tasks[i]]
            runs.append(_gather_long(state, label, segments))
            counts.append(SampleCount(sum(s.moving for s in segments), sum(s.samples for s in segments)))
        else:
            runs.append(_gather_short(state, label, terms, inertia, input_names(regressor.inputs)))
            counts.append(SampleCount(int(np.count_nonzero(state.moving)), state.n_samples))
    evidence = Evidence(tuple(term.id for term in terms), tuple(runs), hierarchy(terms))
    shared = all(state.replicate is None for state in states)
    return regressor.fit_evidence(terms, evidence, reference, shared_motion=shared), tuple(counts)


def work(task: Task) -> Segment:
    """Make the force states of one segment and add them up."""
    run = load_segment(task.whole, task.number, task.margin)
    try:
        states = force_states(run, task.method, task.bandwidth)  # type: ignore[arg-type]
    except InputError as error:
        # A joint that stands still for a while, a channel that is dead there: the other segments remain.
        return Segment((), (0.0, 0.0, 0.0), 0, run.n_samples, str(error))
    rows = regression_rows([shifted(states, task.lag)], task.inertia)
    factors: list[Factor] = []
    if task.function is not None:
        edges = np.linspace(0, rows.y.size, task.parts + 1).astype(int)
        every = Rows(rows.X, rows.y)
        blocks = [every[start:stop] for start, stop in zip(edges[:-1], edges[1:], strict=True)]
        (factors,) = run_factors(task.function, [blocks])
    largest = tuple(float(np.max(np.abs(x))) for x in (rows.X[:, 0], rows.X[:, 1], rows.y))
    return Segment(tuple(factors), largest, rows.y.size, states.n_samples)  # type: ignore[arg-type]


def _make_tasks(
    whole: LongRecord, state: ForceStates, bandwidth: float | None, lag: float, inertia: float | None
) -> list[Task]:
    broadband = state.method == "broadband"
    margin = round(state.dropped * state.sample_rate) if broadband else 0
    band = state.bandwidth if broadband else bandwidth
    parts = -(-FEWEST // whole.n_stretches)
    return [Task(whole, i, state.method, band, margin, lag, inertia, parts) for i in range(whole.n_stretches)]


def _find_extremes(state: ForceStates) -> list[float]:
    """Return the largest angle, rate and moment of the moving samples."""
    return [float(np.max(np.abs(x[state.moving]))) for x in (state.angle, state.rate, state.moment)]


def _gather_long(state: ForceStates, label: str, segments: Sequence[Segment]) -> RunEvidence:
    failures = [s.failure for s in segments if s.failure]
    if 2 * len(failures) >= len(segments):
        raise InputError(
            f"run {state.run!r}: {len(failures)} of {len(segments)} segments of this long run cannot be used, the "
            f"first because {failures[0]}"
        )
    factors = tuple(factor for s in segments for factor in s.factors)
    return RunEvidence(state.run, label, merge(factors), factors)


def _gather_short(
    state: ForceStates,
    label: str,
    terms: Sequence[ResolvedTerm],
    inertia: float | None,
    inputs: Sequence[str] = (),
) -> RunEvidence:
    rows = regression_rows([state], inertia)
    group, run = (np.full(rows.y.size, name, dtype=object) for name in (label, state.run))
    labels = RowLabels.labelled(group, run, rows.blocks)
    whole = Rows(rows.X, rows.y)
    return gather(terms, whole, labels, whole.again(rows.X_replicate, rows.y_replicate), inputs).runs[0]
