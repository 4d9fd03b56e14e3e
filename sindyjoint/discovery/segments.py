"""Runs that are too long for memory: force states and factors stretch by stretch.

Each stretch is worked on as a run of its own: of a sine its harmonics are those of the stretch, of any other motion the
stretches overlap by what the smoothing kernel takes at their ends, under one cut-off. Their factors are the replicate
blocks from whose scatter the errors are told, and merged they are the run's.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from sindyjoint.discovery.accumulate import TermSum
from sindyjoint.discovery.delay import shifted
from sindyjoint.discovery.evidence import Evidence, RunEvidence
from sindyjoint.discovery.factors import Factor, merge
from sindyjoint.discovery.rows import RowLabels, gather
from sindyjoint.discovery.tables import exceeded
from sindyjoint.equation.catalogue import Reference, as_catalogue
from sindyjoint.equation.evaluation import TermFunction
from sindyjoint.equation.terms import ResolvedTerm
from sindyjoint.errors import InputError
from sindyjoint.files.campaign import FEWEST, load_stretch
from sindyjoint.parallel import Executor, ordered_map
from sindyjoint.record import Campaign, LongRecord
from sindyjoint.states import ForceStates, force_states, regression_rows
from sindyjoint.states.rows import group_labels

if TYPE_CHECKING:
    from sindyjoint.discovery.estimator import JointRegressor

# Samples of a run above which it is not loaded as a whole. The columns of its harmonics take two kilobytes for each.
LONGEST = 1 << 18


@dataclass(frozen=True)
class Task:
    """One stretch of a long run.

    Parameters
    ----------
    whole : LongRecord
    number : int
        Of the stretch.
    method : {"periodic", "broadband"}
    bandwidth : float or None
        Hz; of a broadband run one for all of its stretches.
    margin : int
        Samples that the kernel takes at either end.
    lag : float
        s, of the moment, to be undone.
    inertia : float or None
    parts : int
        Blocks that its rows are cut into.
    function : TermFunction or None
        Of the terms; None: only the extremes are wanted.
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


@dataclass(frozen=True, eq=False)
class Stretch:
    """What one stretch leaves.

    Parameters
    ----------
    factors : tuple of Factor
        One for each of its blocks.
    largest : tuple of float
        Largest angle, rate and moment among its moving samples.
    moving, samples : int
    failure : str
        Why there is nothing to use in it; empty otherwise.
    """

    factors: tuple[Factor, ...]
    largest: tuple[float, float, float]
    moving: int
    samples: int
    failure: str = ""


@dataclass(frozen=True)
class Tally:
    """Moving samples, and all samples, of a run."""

    moving: int
    samples: int


def has_long_runs(campaign: Campaign) -> bool:
    """Return whether a run of a campaign is longer than what is in memory."""
    return any(run.whole is not None for run in campaign.identification_runs)


def fit_long(
    regressor: JointRegressor,
    campaign: Campaign,
    states: Sequence[ForceStates],
    here: Executor,
    *,
    bandwidth: float | None = None,
    lag: float = 0.0,
    say: Callable[[str], None] = lambda stage: None,
) -> tuple[JointRegressor, tuple[Tally, ...]]:
    """Fit a regressor to a campaign some of whose runs are long.

    Parameters
    ----------
    regressor : JointRegressor
    campaign : Campaign
    states : sequence of ForceStates
        Of the identification runs, of long ones of their first stretch.
    here : Executor
    bandwidth : float, optional
    lag : float
        s, of the moment; already undone in `states`.
    say : callable

    Returns
    -------
    regressor : JointRegressor
    tallies : tuple of Tally
        One per run.

    Raises
    ------
    InputError
        If more than half of a run's stretches cannot be used.
    """
    inertia = campaign.joint.inertia
    tasks = {
        i: _tasks(run.whole, state, bandwidth, lag, inertia)
        for i, (run, state) in enumerate(zip(campaign.identification_runs, states, strict=True))
        if run.whole is not None
    }
    every = [task for group in tasks.values() for task in group]
    say(f"{len(every)} stretches of long runs")

    def one_pass(scale: Reference) -> tuple[tuple[ResolvedTerm, ...], list[Stretch]]:
        terms = regressor.candidates(scale, inertia is None)
        function = _compiled(terms)
        return terms, ordered_map(here, work, [replace(task, function=function) for task in every])

    # The first stretches tell the scale of the others, as a rule.
    looked = _reference(states, [])
    terms, done = one_pass(looked)
    reference = _reference(states, done)
    if exceeded(looked, reference, as_catalogue(regressor.library)):
        say("larger motion than in the first stretches: once more under its scale")
        terms, done = one_pass(reference)
    labels, results = group_labels(states), iter(done)
    runs, tallies = [], []
    for i, (state, label) in enumerate(zip(states, labels, strict=True)):
        if i in tasks:
            stretches = [next(results) for _ in tasks[i]]
            runs.append(_long_evidence(state, label, stretches))
            tallies.append(Tally(sum(s.moving for s in stretches), sum(s.samples for s in stretches)))
        else:
            runs.append(_short_evidence(state, label, terms, inertia))
            tallies.append(Tally(int(np.count_nonzero(state.moving)), state.n_samples))
    evidence = Evidence(tuple(term.id for term in terms), tuple(runs))
    shared = all(state.replicate is None for state in states)
    return regressor.fit_evidence(terms, evidence, reference, shared_motion=shared), tuple(tallies)


def work(task: Task) -> Stretch:
    """Make the force states of one stretch and add them up."""
    run = load_stretch(task.whole, task.number, task.margin)
    try:
        states = force_states(run, task.method, task.bandwidth)  # type: ignore[arg-type]
    except InputError as error:
        # A joint that rests for a while, a channel that is dead there: the other stretches still tell.
        return Stretch((), (0.0, 0.0, 0.0), 0, run.n_samples, str(error))
    rows = regression_rows([shifted(states, task.lag)], task.inertia)
    columns = [np.ascontiguousarray(column) for column in rows.X.T]
    largest = tuple(float(np.max(np.abs(x))) for x in (columns[0], columns[1], rows.y))
    factors = []
    if task.function is not None:
        edges = np.linspace(0, rows.y.size, task.parts + 1).astype(int)
        for start, stop in zip(edges[:-1], edges[1:], strict=True):
            total = TermSum(task.function)
            total.add([column[start:stop] for column in columns], rows.y[start:stop])
            factors.append(total.factor())
    return Stretch(tuple(factors), largest, rows.y.size, states.n_samples)  # type: ignore[arg-type]


def _tasks(
    whole: LongRecord, state: ForceStates, bandwidth: float | None, lag: float, inertia: float | None
) -> list[Task]:
    broadband = state.method == "broadband"
    margin = round(state.dropped * state.sample_rate) if broadband else 0
    band = state.bandwidth if broadband else bandwidth
    parts = -(-FEWEST // whole.n_stretches)
    return [Task(whole, i, state.method, band, margin, lag, inertia, parts) for i in range(whole.n_stretches)]


def _compiled(terms: Sequence[ResolvedTerm]) -> TermFunction:
    from sindyjoint.equation.formula import compile_terms

    return compile_terms([term.expression for term in terms])


def _reference(states: Sequence[ForceStates], stretches: Sequence[Stretch]) -> Reference:
    """Return the largest angle, rate and moment over all that is known."""
    known = [[float(np.max(np.abs(x[s.moving]))) for x in (s.angle, s.rate, s.moment)] for s in states] + [
        list(s.largest) for s in stretches
    ]
    return Reference(*(max(column) for column in zip(*known, strict=True)))


def _long_evidence(state: ForceStates, label: str, stretches: Sequence[Stretch]) -> RunEvidence:
    failures = [s.failure for s in stretches if s.failure]
    if 2 * len(failures) >= len(stretches):
        raise InputError(
            f"run {state.run!r}: {len(failures)} of {len(stretches)} stretches of this long run cannot be used, the "
            f"first because {failures[0]}"
        )
    factors = tuple(factor for s in stretches for factor in s.factors)
    return RunEvidence(state.run, label, merge(factors), factors)


def _short_evidence(
    state: ForceStates, label: str, terms: Sequence[ResolvedTerm], inertia: float | None
) -> RunEvidence:
    rows = regression_rows([state], inertia)
    labels = RowLabels(np.full(rows.y.size, label), np.full(rows.y.size, state.run), rows.blocks)
    return gather(terms, rows.X, rows.y, labels, None, rows.X_replicate, rows.y_replicate).runs[0]
