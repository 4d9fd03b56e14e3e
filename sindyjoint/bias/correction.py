"""Bias that the processing pipeline adds to the coefficients, measured on a synthetic replicate of the campaign.

The discovered model is simulated under the campaign's drive, and its motion goes through the same processing pipeline
as the measured one: the same harmonics are kept, the same kernel smooths, noise of the measured size is added. The
coefficients of the replicate are known, so their change is the bias of the pipeline: harmonics that were cut, noise in
angle and rate, reversals. Noise is added and subtracted in turn: its first power cancels in the mean of such a
pair, and the remainder is bias (antithetic variates; Hammersley and Morton 1956). Noise of the moment causes no
bias and is omitted. Correction by simulation: Efron and Tibshirani, An Introduction to the Bootstrap, 1993, chapter 10.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from sindyjoint.bias.policy import POLICY
from sindyjoint.bias.replicates import Replicate, make_replicates
from sindyjoint.discovery.factors import Factor, merge
from sindyjoint.equation.model import JointModel
from sindyjoint.equation.terms import ResolvedTerm, term_columns
from sindyjoint.errors import InputError, SimulationError
from sindyjoint.measurement.noise import WIDEST
from sindyjoint.numeric import Array, scaled_least_squares
from sindyjoint.record import Campaign
from sindyjoint.response.laws import held_laws
from sindyjoint.states import ForceStates
from sindyjoint.states.periodic import BAND_SHARE
from sindyjoint.states.rows import group_labels

PAIRS = 4
# Where sampling cuts the motion, bias is large and depends on the law: it is measured so often again, of the corrected
# law.
ROUNDS = 3
LEAST_SHARE = 1e-3  # unique share that a term is credited with at least


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
    groups : tuple of str
    by_group, by_group_error : ndarray, shape (groups, k)
        Of the fits to the runs of one group each.
    driven : tuple of str
        For each run, "moment" or "angle": what was prescribed in its synthetic replicate.
    """

    ids: tuple[str, ...]
    pooled: Array
    pooled_error: Array
    groups: tuple[str, ...]
    by_group: Array
    by_group_error: Array
    driven: tuple[str, ...]


Replicated = Callable[[JointModel], Sequence[Replicate]]


def _simulated_runs(campaign: Campaign, states: Sequence[ForceStates]) -> Replicated:
    return lambda model: make_replicates(held_laws(model, states), campaign.identification_runs, states)


def measure_bias(
    model: JointModel,
    terms: Sequence[ResolvedTerm],
    campaign: Campaign,
    states: Sequence[ForceStates],
    pairs: int = PAIRS,
    random_state: Any = 0,
    known: Sequence[ResolvedTerm] = (),
    replicated: Replicated | None = None,
) -> Bias:
    """Return the bias of a model's coefficients on a campaign.

    Parameters
    ----------
    model : JointModel
    terms : sequence of ResolvedTerm
        As they were resolved for the fit; the model's, or more. A term that the model lacks has the coefficient zero:
        what the pipeline makes of it is an artefact.
    campaign : Campaign
    states : sequence of ForceStates
        Of the identification runs, as used for the fit.
    pairs : int
        Pairs of noise realisations of opposite sign; two or more.
    random_state : int, Generator or None
    known : sequence of ResolvedTerm
        Terms of the model whose coefficients were given and not fitted.
    replicated : callable, optional
        What makes the replicates of all states under a model. Default: simulated runs of the joint's own test.

    Raises
    ------
    InputError
        If the model has no terms, or fewer than two pairs are asked for.
    SimulationError
        If the model cannot be simulated over the range of the campaign.
    """
    if not model.terms or pairs < 2:
        raise InputError(
            f"a model of {len(model.terms)} term(s) and {pairs} pair(s) given; expected at least one term and two pairs"
        )
    rng = np.random.default_rng(random_state)
    replicates = (replicated or _simulated_runs(campaign, states))(model)
    given = tuple((term, model[term.id].coefficient) for term in known)
    fits = _Fits(tuple(replicates), tuple(states), tuple(terms), campaign.joint.inertia, given)
    true = np.array([model[term.id].coefficient if term.id in model else 0.0 for term in terms])
    found = []
    for _ in range(pairs):
        noise = [replicate.noise(rng) for replicate in replicates]
        found.append([fits.coefficients(noise, sign) for sign in (1.0, -1.0)])
    means = np.array(found).mean(axis=1) - true  # (pairs, 1 + groups, k)
    mean, error = means.mean(axis=0), means.std(axis=0, ddof=1) / np.sqrt(pairs)
    return Bias(
        ids=tuple(term.id for term in terms),
        pooled=mean[0],
        pooled_error=error[0],
        groups=tuple(dict.fromkeys(group_labels(states))),
        by_group=mean[1:],
        by_group_error=error[1:],
        driven=tuple(replicate.driven for replicate in replicates),
    )


@dataclass(frozen=True, eq=False)
class _Fits:
    """Fits of terms to the replicates of some states; ``given`` terms have their coefficients already."""

    replicates: tuple[Replicate, ...]
    states: tuple[ForceStates, ...]
    terms: tuple[ResolvedTerm, ...]
    inertia: float | None
    given: tuple[tuple[ResolvedTerm, float], ...]

    def coefficients(self, noise: Sequence[Any], sign: float) -> Array:
        """Return the coefficients of all replicates together and of each group separately, shape (1 + groups, k)."""
        labels = group_labels(self.states)
        factors: dict[str, list[Factor]] = {label: [] for label in labels}
        for replicate, label, drawn, state in zip(self.replicates, labels, noise, self.states, strict=True):
            inputs = {name: float(np.mean(values)) for name, values in state.inputs.items()}
            motion, moment = replicate.rows(drawn, sign)
            target = moment - (self.inertia or 0.0) * motion[:, 2]
            if self.given:
                known = term_columns([term for term, _ in self.given], *motion.T, inputs=inputs)
                target = target - known @ [value for _, value in self.given]
            columns = term_columns(self.terms, *motion.T, inputs=inputs)
            factors[label].append(Factor.of(columns, target).scaled(replicate.weight))
        groups = [merge(parts) for parts in factors.values()]
        return np.array([_solve(factor) for factor in (merge(groups), *groups)])


def _solve(factor: Factor) -> Array:
    """Solve by columns of unit norm; a group that does not excite a column gives it no coefficient."""
    return scaled_least_squares(factor.triangle[:, :-1], factor.triangle[:, -1], 1e-12)


@dataclass(frozen=True, eq=False)
class Corrected:
    """A model freed of its measured bias.

    Parameters
    ----------
    model : JointModel
        Coefficients less their bias; standard errors and intervals hold the uncertainty of the correction. The given
        model where the bias could not be measured.
    bias : Bias or None
    reason : str
        Why the bias could not be measured; empty where it was.
    """

    model: JointModel
    bias: Bias | None
    reason: str = ""


def corrected_model(
    model: JointModel,
    terms: Sequence[ResolvedTerm],
    campaign: Campaign,
    states: Sequence[ForceStates],
    known: Sequence[ResolvedTerm] = (),
    moved: Array | None = None,
    replicated: Replicated | None = None,
) -> Corrected:
    """Return a model with its bias taken out.

    Parameters are those of :func:`measure_bias`, whose noise is drawn as it is by default. ``moved``, shape (k,), is by
    how much an earlier correction has moved the coefficients, of which a part stays uncertain, too.
    """
    if not model.terms:
        return Corrected(model, None)
    law, change = model, np.zeros(len(terms))
    try:
        bias = measure_bias(model, terms, campaign, states, known=known, replicated=replicated)
        for _ in range(ROUNDS if any(map(cut_by_sampling, states)) else 0):
            law = _without_bias(model, bias)
            again = measure_bias(law, terms, campaign, states, known=known, replicated=replicated)
            bias, change = again, again.pooled - bias.pooled
    except (SimulationError, InputError) as cause:
        return Corrected(model, None, str(cause))
    if not np.all(np.isfinite([bias.pooled, bias.pooled_error])):
        return Corrected(model, None, "the simulated runs do not determine the coefficients")
    cut = any(map(cut_by_sampling, states))
    uncertain = POLICY.uncertain_share_cut if cut else POLICY.uncertain_share
    extra = bias.pooled_error**2 + (uncertain * bias.pooled) ** 2 + change**2
    if moved is not None:
        extra = extra + (POLICY.uncertain_share * moved) ** 2
    left_over = _left_over(model, states) + max(map(_cut_error, states)) ** 2
    corrected = _without_bias(model, bias)
    covariance = np.array(model.covariance)
    changed = []
    for index, (term, better) in enumerate(zip(model.terms, corrected.terms, strict=True)):
        if term.id not in bias.ids:
            changed.append(term)
            continue
        more = (
            float(extra[bias.ids.index(term.id)])
            + left_over * (term.coefficient / max(term.unique_share, LEAST_SHARE)) ** 2
        )
        error = float(np.sqrt(term.standard_error**2 + more))
        half = term.interval95[1] - term.coefficient
        half *= error / term.standard_error if term.standard_error > 0 else 0.0
        value = better.coefficient
        covariance[index, index] += more
        changed.append(replace(better, standard_error=error, interval95=(value - half, value + half)))
    return Corrected(model.with_terms(changed, covariance), bias)


def _without_bias(model: JointModel, bias: Bias) -> JointModel:
    """Return a model with the bias taken out of its coefficients."""
    shifts = dict(zip(bias.ids, bias.pooled.tolist(), strict=True))
    terms = [replace(term, coefficient=term.coefficient - shifts.get(term.id, 0.0)) for term in model.terms]
    return model.with_terms(terms, np.array(model.covariance))


def _left_over(model: JointModel, states: Sequence[ForceStates]) -> float:
    """Return the variance that a misfit which repeats leaves in a term that carries the whole moment alone, relative.

    With sampling that cuts the motion the residual holds what the series lacks. It is the same in every period, so each
    run has as many independent values of it as its series has numbers.
    """
    values = sum(2 * int(s.series[0].orders[-1]) for s in states if s.series and cut_by_sampling(s))
    return model.fitted.misfit**2 / values if values else 0.0


def _cut_error(state: ForceStates) -> float:
    """Return by which share of the moment a simulation errs in a run, for sampling cuts its motion."""
    if not cut_by_sampling(state):
        return 0.0
    samples = state.sample_rate / state.frequency if state.method == "periodic" and state.frequency else 0.0
    return POLICY.cut_error * min(1.0, POLICY.cut_period / samples if samples else 1.0)


def cut_by_sampling(state: ForceStates) -> bool:
    """Return whether the angle of a run was cut where its sampling ends, and not where it sinks into its noise."""
    if state.method == "periodic":
        return state.bandwidth + 1.5 * (state.frequency or 0.0) > BAND_SHARE * state.sample_rate
    return state.bandwidth >= 0.999 * WIDEST * state.sample_rate
