"""What the way from signals to coefficients does to the coefficients, measured on a twin of the campaign.

The discovered model is simulated under the campaign's own drive, noise of the measured size is added, and the twin
goes through the same chain as the measurement. Its coefficients are known, so what the chain makes of them is its
bias: harmonics that were cut, noise in angle and rate, reversals. Noise is added and subtracted in turn: its first
power cancels in the mean of such a pair, and what is left is bias (antithetic variates; Hammersley and Morton 1956).
Correction by simulation: Efron and Tibshirani, An Introduction to the Bootstrap, 1993, chapter 10.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from sindyjoint.discovery.evidence import Evidence, fit_columns
from sindyjoint.discovery.model import JointModel
from sindyjoint.discovery.rows import RowLabels, gather
from sindyjoint.discovery.terms import ResolvedTerm
from sindyjoint.errors import InputError
from sindyjoint.mechanics.excitation import sampled
from sindyjoint.mechanics.laws import Law
from sindyjoint.mechanics.stickslip import simulate, transfer_moment
from sindyjoint.record import Campaign, Run
from sindyjoint.states import ForceStates, force_states, regression_rows
from sindyjoint.states.harmonics import HarmonicBasis, local_noise, significant_harmonics
from sindyjoint.workflows.model_law import model_law

Array = NDArray[np.float64]

# The drive is simulated from rest; after this many periods a joint whose moment is prescribed has settled.
SETTLING = 3
# Which harmonics pass as significant is a matter of chance in every realisation: four pairs average that out.
PAIRS = 4
FINER = 4  # the drive's samples per sample of the run
BAND_SHARE = 0.4
MOST_HARMONICS = 120


@dataclass(frozen=True, eq=False)
class Bias:
    """The bias of coefficients, measured minus true.

    Parameters
    ----------
    ids : tuple of str
    pooled : ndarray, shape (k,)
        Of the fit to all runs, SI.
    pooled_error : ndarray, shape (k,)
        Its standard error, from the scatter of the pairs.
    noise : ndarray, shape (k,)
        Standard deviation that the noise alone gives the coefficients of the twin.
    groups : tuple of str
    by_group, by_group_error : ndarray, shape (groups, k)
        Of the fits to the runs of one group each; NaN where a group alone does not determine the coefficients.
    driven : tuple of str
        For each run, "moment" or "angle": what was prescribed in its twin.
    """

    ids: tuple[str, ...]
    pooled: Array
    pooled_error: Array
    noise: Array
    groups: tuple[str, ...]
    by_group: Array
    by_group_error: Array
    driven: tuple[str, ...]


@dataclass(frozen=True, eq=False)
class _Twin:
    run: Run
    state: ForceStates
    driven: str


def measure_bias(
    model: JointModel,
    terms: Sequence[ResolvedTerm],
    campaign: Campaign,
    states: Sequence[ForceStates],
    pairs: int = PAIRS,
    random_state: Any = 0,
) -> Bias:
    """Return the bias of a model's coefficients on a campaign.

    Parameters
    ----------
    model : JointModel
    terms : sequence of ResolvedTerm
        As they were resolved for the fit; the model's, or more.
    campaign : Campaign
    states : sequence of ForceStates
        Of the identification runs, as used for the fit.
    pairs : int
        Pairs of noise realisations of opposite sign; two or more.
    random_state : int, Generator or None

    Raises
    ------
    InputError
        If the model has no terms, or fewer than two pairs are asked for.
    SimulationError
        If the model cannot be simulated over the range of the campaign.
    """
    if not model.terms or pairs < 2:
        raise InputError(
            f"a model of {len(model.terms)} term(s) and {pairs} pair(s) given; terms and two pairs are wanted"
        )
    rng = np.random.default_rng(random_state)
    law = model_law(model)
    twins = [_twin(law, run, state) for run, state in zip(campaign.identification_runs, states, strict=True)]
    # A term that the model lacks has the coefficient zero: what the chain makes of it is an artefact.
    true = np.array([model[term.id].coefficient if term.id in model else 0.0 for term in terms])
    pooled, grouped = [], []
    groups: tuple[str, ...] = ()
    for _ in range(pairs):
        noise = [_noise(twin, rng) for twin in twins]
        ends = [_evidence(twins, noise, sign, campaign, terms) for sign in (1.0, -1.0)]
        groups = ends[0].groups
        pooled.append([fit_columns(e, range(len(terms))).coefficients - true for e in ends])
        grouped.append([_by_group(e, len(terms)) - true for e in ends])
    whole, parts = np.array(pooled), np.array(grouped)  # (pairs, 2, k) and (pairs, 2, groups, k)
    means, group_means = whole.mean(axis=1), parts.mean(axis=1)
    return Bias(
        ids=tuple(term.id for term in terms),
        pooled=means.mean(axis=0),
        pooled_error=means.std(axis=0, ddof=1) / np.sqrt(pairs),
        noise=np.sqrt(np.mean(((whole[:, 0] - whole[:, 1]) / 2) ** 2, axis=0)),
        groups=groups,
        by_group=group_means.mean(axis=0),
        by_group_error=group_means.std(axis=0, ddof=1) / np.sqrt(pairs),
        driven=tuple(twin.driven for twin in twins),
    )


def _by_group(evidence: Evidence, count: int) -> Array:
    return np.array([fit_columns(evidence.only([g]), range(count)).coefficients for g in evidence.groups])


def _noise(twin: _Twin, rng: np.random.Generator) -> tuple[Array, Array]:
    n, floor = twin.run.n_samples, twin.state.noise
    return floor.moment * rng.normal(size=n), floor.angle * rng.normal(size=n)


def _evidence(
    twins: Sequence[_Twin],
    noise: Sequence[tuple[Array, Array]],
    sign: float,
    campaign: Campaign,
    terms: Sequence[ResolvedTerm],
) -> Evidence:
    """Return what the chain makes of the twins with their noise."""
    states = []
    for twin, (moment, angle) in zip(twins, noise, strict=True):
        run = replace(twin.run, moment=twin.run.moment + sign * moment, angle=twin.run.angle + sign * angle)
        states.append(force_states(run, twin.state.method))
    rows = regression_rows(states, campaign.joint.inertia)
    labels = RowLabels.of(rows.y.size, rows.groups, rows.runs, rows.blocks)
    return gather(terms, rows.X, rows.y, labels, None, rows.X_replicate, rows.y_replicate)


def _twin(law: Law, run: Run, state: ForceStates) -> _Twin:
    """Return a run of the law, free of noise, under the drive of a measured run.

    The drive is the smoother of the two channels, the one of fewer harmonics: a joint driven by a smooth moment
    sticks and its angle has corners, which only a simulation restores; one driven by a smooth angle has steps in
    its moment.
    """
    drive = None if state.method != "periodic" or law.inertia <= 0 else _smooth_moment(run, state)
    if drive is not None and drive[1] < state.bandwidth * (1 - 1e-9):
        moment, angle = _moment_driven(law, run, state, *drive)
        driven = "moment"
    else:
        moment, _ = transfer_moment(
            law, state.angle, state.rate, run.sample_rate, acceleration=state.acceleration
        )
        angle, driven = state.angle, "angle"
    twin = Run(run.name, moment, angle, run.sample_rate, frequency=state.frequency, level=run.level)
    return _Twin(twin, state, driven)


def _moment_driven(
    law: Law, run: Run, state: ForceStates, series: Any, highest: float
) -> tuple[Array, Array]:
    assert state.frequency is not None
    settle = int(np.ceil(SETTLING * run.sample_rate / state.frequency))
    n = settle + state.n_samples
    rate = run.sample_rate * FINER
    drive = sampled(series(np.arange((n + 2) * FINER) / rate), rate)
    motion = simulate(law, drive, n / run.sample_rate, run.sample_rate, limits=None)
    return motion.moment[settle:n], motion.angle[settle:n]


def _smooth_moment(run: Run, state: ForceStates) -> tuple[Any, float]:
    """Return the significant harmonics of the moment as a function of time, and the highest of them in Hz."""
    assert state.frequency is not None
    signal = run.moment[-state.n_samples :] if state.dropped > 0 else run.moment[: state.n_samples]
    n, rate = signal.size, run.sample_rate
    count = int(np.clip(BAND_SHARE * rate / state.frequency, 1, min(MOST_HARMONICS, (n - 8) // 4)))
    orders = np.arange(1, count + 1)
    lines = np.asarray(orders * state.frequency, dtype=np.float64)
    full = HarmonicBasis.build(np.arange(n) / rate, state.frequency, orders)
    mean, a, b = full.fit(signal)
    variance = local_noise(signal - full.series(mean, a, b), rate, lines, 0.5 * state.frequency)
    keep = significant_harmonics(np.hypot(a, b), np.sqrt(2 * variance / n))
    kept = orders[keep]

    def series(time: Array) -> Array:
        return HarmonicBasis.build(time, state.frequency, kept).series(mean, a[keep], b[keep])  # type: ignore[arg-type]

    return series, float(kept[-1] * state.frequency)


@dataclass(frozen=True, eq=False)
class Corrected:
    """A model freed of its measured bias.

    Parameters
    ----------
    model : JointModel
        Coefficients less their bias; standard errors and intervals hold the uncertainty of the correction.
    bias : Bias
    """

    model: JointModel
    bias: Bias


def corrected_model(
    model: JointModel,
    terms: Sequence[ResolvedTerm],
    campaign: Campaign,
    states: Sequence[ForceStates],
    pairs: int = PAIRS,
    random_state: Any = 0,
) -> Corrected:
    """Return a model with its bias taken out; parameters and errors are those of :func:`measure_bias`."""
    bias = measure_bias(model, terms, campaign, states, pairs, random_state)
    covariance = np.array(model.covariance)
    changed = []
    for index, term in enumerate(model.terms):
        if term.id not in bias.ids:
            changed.append(term)
            continue
        at = bias.ids.index(term.id)
        extra = float(bias.pooled_error[at]) ** 2
        error = float(np.sqrt(term.standard_error**2 + extra))
        quantile = (
            (term.interval95[1] - term.coefficient) / term.standard_error if term.standard_error else 0.0
        )
        value = term.coefficient - float(bias.pooled[at])
        interval = (value - quantile * error, value + quantile * error)
        covariance[index, index] += extra
        changed.append(replace(term, coefficient=value, standard_error=error, interval95=interval))
    rows = tuple(tuple(float(v) for v in row) for row in covariance)
    return Corrected(replace(model, terms=tuple(changed), covariance=rows), bias)
