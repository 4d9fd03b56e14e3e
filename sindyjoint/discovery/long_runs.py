"""Runs that are too long for memory: force states and factors segment by segment.

Each segment is processed as a separate run: of a sine its harmonics are those of the segment, of any other motion the
segments overlap by what the smoothing kernel takes at their ends, under one cut-off. Their factors are the replicate
blocks whose scatter gives the errors, and merged they are the run's.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from sindyjoint.discovery import Evidence, RunEvidence
from sindyjoint.discovery.delay import shifted
from sindyjoint.discovery.factors import Factor, merge
from sindyjoint.discovery.regression import TermRegression
from sindyjoint.discovery.rows import Rows, factor_of, gather, hierarchy, known_labels, row_arguments
from sindyjoint.equation.catalogue import Catalogue, Reference, as_catalogue
from sindyjoint.equation.evaluation import TermFunction
from sindyjoint.equation.formula import compile_terms
from sindyjoint.equation.terms import ResolvedTerm
from sindyjoint.errors import InputError
from sindyjoint.files.campaign import FEWEST, load_segment
from sindyjoint.inputs import LongRecord, input_names
from sindyjoint.limits import DISCOVERY
from sindyjoint.parallel import Executor, ordered_map
from sindyjoint.record import Campaign
from sindyjoint.states import ForceStates, force_states, group_labels, regression_rows


@dataclass(frozen=True, eq=False)
class Segment:
    """Result of one segment of rows.

    Parameters
    ----------
    factors : tuple of Factor
        One for each of its blocks; none where only the extremes were asked for.
    largest : tuple of float
        Largest angle, rate and moment.
    moving, samples : int
        Rows, and samples of the record they come from.
    failure : str
        Why there is nothing to use in it; empty otherwise.
    """

    factors: tuple[Factor, ...]
    largest: tuple[float, float, float]
    moving: int
    samples: int
    failure: str = ""


def pass_over(
    regressor: TermRegression,
    work: Callable[[Any], Segment],
    tasks: Sequence[Any],
    here: Executor,
    *,
    assumed: Reference | None,
    largest: Callable[[Sequence[Segment]], Reference],
    with_acceleration: bool,
    say: Callable[[str], None],
) -> tuple[tuple[ResolvedTerm, ...], list[Segment], Reference]:
    """Evaluate a regressor's candidates on all segments and add them up.

    Parameters
    ----------
    regressor : TermRegression
    work : callable
        Does one task; to be sent to other processes.
    tasks : sequence of dataclass
        Each says where a segment of rows is read; its ``function`` is replaced by that of the terms to evaluate on it.
    here : Executor
    assumed : Reference or None
        Scales as far as they are known; ``None``: the library refers to none.
    largest : callable
        Gives the scales of all rows once the segments are known.
    with_acceleration : bool
        Whether the inertia is to be identified as a term.
    say : callable

    Returns
    -------
    terms : tuple of ResolvedTerm
    segments : list of Segment
        One per task.
    reference : Reference
        Largest angle, rate and moment of all rows.
    """

    def one_pass(scale: Reference) -> tuple[tuple[ResolvedTerm, ...], list[Segment]]:
        terms = regressor.candidates(scale, with_acceleration)
        names = input_names(regressor.inputs)
        arguments = row_arguments((3 if with_acceleration else 2) + len(names), names)
        function = compile_terms([term.expression for term in terms], arguments)
        with_terms = [replace(task, function=function) for task in tasks]
        return terms, ordered_map(
            here, work, with_terms, done=lambda n: say(f"segments: {n} of {len(tasks)}")
        )

    terms, done = one_pass(assumed or Reference(1.0, 1.0, 1.0))
    reference = largest(done)
    most = 1 + DISCOVERY.large_part
    if assumed is not None and any(
        getattr(reference, name) > most * getattr(assumed, name)
        for name in relative(as_catalogue(regressor.library))
    ):
        say("larger values than assumed: once more under their scale")
        terms, done = one_pass(reference)
    return terms, done, reference


def largest_of(parts: Iterable[Sequence[float]]) -> Reference:
    """Return the largest angle, rate and moment of all parts, each given as three numbers."""
    return Reference(*(max(values) for values in zip(*parts, strict=True)))


def relative(catalogue: Catalogue) -> set[str]:
    """Return the scales of the data that nonlinear parameters of a catalogue are shares of."""
    named = {parameter.relative_to for term in catalogue for parameter in term.parameters}
    return {scale for scale in named if scale is not None}


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
) -> tuple[TermRegression, tuple[int, int]]:
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
    counts : tuple of int
        Moving samples, and all samples.

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

    terms, done, reference = pass_over(
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
    labels, results = group_labels(states), iter(done)
    runs = []
    for i, (state, label) in enumerate(zip(states, labels, strict=True)):
        if i in tasks:
            segments = [next(results) for _ in tasks[i]]
            runs.append(_gather_long(state, label, segments))
        else:
            rows = regression_rows([state], inertia)
            group, run = (np.full(rows.y.size, name, dtype=object) for name in (label, state.run))
            whole, known = Rows(rows.X, rows.y), known_labels(group, run, rows.blocks)
            replicate = whole.again(rows.X_replicate, rows.y_replicate)
            runs += gather(terms, whole, known, replicate, input_names(regressor.inputs)).runs
    evidence = Evidence(tuple(term.id for term in terms), tuple(runs), hierarchy(terms))
    short = [state for i, state in enumerate(states) if i not in tasks]
    counts = (
        sum(int(np.count_nonzero(s.moving)) for s in short) + sum(s.moving for s in done),
        sum(s.n_samples for s in short) + sum(s.samples for s in done),
    )
    shared = all(state.replicate is None for state in states)
    return regressor.fit_evidence(terms, evidence, reference, shared_motion=shared), counts


def work(task: Task) -> Segment:
    """Make the force states of one segment and add them up."""
    run = load_segment(task.whole, task.number, task.margin)
    try:
        states = force_states(run, task.method, task.bandwidth)  # type: ignore[arg-type]
    except InputError as error:
        # A joint that stands still for a while, a channel that is dead there: the other segments remain.
        return Segment((), (0.0, 0.0, 0.0), 0, run.n_samples, str(error))
    rows = regression_rows([shifted(states, task.lag)], task.inertia)
    factors: tuple[Factor, ...] = ()
    if task.function is not None:
        blocks = zip(*(np.array_split(column, task.parts) for column in (*rows.X.T, rows.y)), strict=True)
        factors = tuple(factor_of(task.function, block[:-1], block[-1]) for block in blocks)
    largest = tuple(float(np.max(np.abs(x))) for x in (rows.X[:, 0], rows.X[:, 1], rows.y))
    return Segment(factors, largest, rows.y.size, states.n_samples)  # type: ignore[arg-type]


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
