"""Another model to start a search from, the one that discovery finds; and channels whose delay is removed first.

A law that lacks what discovery can find is given effects in its place, and a delay is taken for a law. Neither can be
seen while the search goes on; it can be seen at its end, by what remains of the gap.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

import numpy as np

from sindyjoint.diagnosis.campaign.gap import gap_of
from sindyjoint.diagnosis.campaign.repair import Repaired, refit
from sindyjoint.diagnosis.campaign.start import first_model
from sindyjoint.diagnosis.effects.fitted import FittedEffect
from sindyjoint.diagnosis.problem import Say
from sindyjoint.diagnosis.result import Gap, Step
from sindyjoint.discovery.delay import ChannelDelay, columns_of, competing_delay, find_delay, shifted
from sindyjoint.equation.candidates import rate_free
from sindyjoint.equation.catalogue import default_candidates
from sindyjoint.equation.model import INERTIA, JointModel, ModelTerm
from sindyjoint.errors import InputError
from sindyjoint.policy import SHARED
from sindyjoint.states import regression_rows
from sindyjoint.states.floor import moment_floor

if TYPE_CHECKING:
    from sindyjoint.discovery.regression import TermRegression

# The problem of a campaign is made of this module's functions: its class, which imports them, cannot be named here.
Problem = Any


def other_starts(
    straight: Problem, last: Problem, say: Say
) -> Iterator[tuple[Problem, tuple[Step, ...], str]]:
    """Yield the terms that discovery finds as a start, with steps and words.

    Only where the gap is not far above that of ``last``, where the search ended so far, another one is worth it.
    """
    say("discovering the terms")
    found = discovered(straight)
    if found and found[0].gap.moment <= (1 + straight.policy.minor_share) * last.gap.moment:
        yield *found, "the terms that discovery finds"


@dataclass(frozen=True, eq=False)
class Aligned:
    """A problem whose channels were aligned first.

    Parameters
    ----------
    problem : Problem
    delay : FittedEffect
    belief : float
        Probability that there is one.
    """

    problem: Problem
    delay: FittedEffect
    belief: float


def with_delay(problem: Problem) -> Aligned | None:
    """Return the problem with the delay between its channels removed; None if there is no delay."""
    effect = next((e for e in problem.candidates if e.enters == "time shift"), None)
    work = problem.work
    lag = None if effect is None else _delay(problem)
    if effect is None or lag is None:
        return None
    delay = FittedEffect(effect, effect.variants[0], np.empty(0), np.array([lag.time]), 0.0)
    aligned = work.again(work.model, (), tuple(shifted(s, lag.time) for s in work.states))
    model = refit(aligned.rows, work.model, ()).model
    later = replace(problem, work=replace(aligned, model=model), repaired=Repaired(model, (delay,)))
    return Aligned(later, delay, _belief(lag.time / lag.standard_error))


def _delay(problem: Problem) -> ChannelDelay | None:
    """Return the delay that stands out under any joint's law, or else under the terms that discovery finds.

    What these lack looks like a delay: with it they must leave little beside the noise.
    """
    work = problem.work
    inertia = work.campaign.joint.inertia
    lag = find_delay(work.states, inertia, work.campaign.inputs)
    if lag is None or not lag.stands_out:
        found = _regressed(problem)
        terms = [] if found is None else [term for term in found.terms_ if term.id in found.model_]
        lag = competing_delay(work.states, columns_of(terms), inertia) if terms else None
        if (
            lag is None
            or not lag.residual_rms <= SHARED.clearly * moment_floor(work.states, inertia or 0.0).moment
        ):
            return None
    return lag if lag is not None and lag.stands_out and not lag.at_limit else None


def _belief(ratio: float) -> float:
    """Return the probability that a number of so many standard errors is not zero."""
    return float(1 / (1 + np.exp(-0.5 * min(ratio**2, 1e3))))


def _regressed(problem: Problem) -> TermRegression | None:
    """Return the regression of what discovery would offer on the states of a problem; None where it cannot be made."""
    from sindyjoint.discovery.regression import TermRegression

    work, campaign = problem.work, problem.work.campaign
    largest = max(float(np.abs(s.angle).max()) for s in work.states)
    catalogue = default_candidates(largest, campaign.joint.motion)
    catalogue = rate_free(catalogue) if campaign.quasi_static else catalogue
    regressor = TermRegression(catalogue, motion=campaign.joint.motion)
    rows = regression_rows(work.states, campaign.joint.inertia, with_inputs=False)
    try:
        return regressor.fit(**rows.fit_arguments())
    except (InputError, np.linalg.LinAlgError):
        return None


def discovered(problem: Problem) -> tuple[Problem, tuple[Step, ...]] | None:
    """Return the problem with the terms that discovery finds on its states, and a step for each beyond its model's.

    None where discovery finds none, or those of the model.
    """
    work = problem.work
    campaign, policy = work.campaign, problem.policy
    regressor = _regressed(problem)
    if regressor is None:
        return None
    known = set(work.model.ids)
    if not regressor.model_.terms or set(regressor.model_.ids) <= known:
        return None
    model = first_model(campaign, work.states, regressor.model_, None, policy).model
    positive = {e.id for e in problem.candidates if e.variants[0].columns[0].positive}
    denied = {t.id for t in model.terms if t.id in positive - known and t.coefficient < 0}
    if denied:
        model = first_model(campaign, work.states, _without(model, denied), None, policy).model
    later = problem.with_model(model)
    extra = [t for t in model.terms if t.id not in known and t.id != INERTIA]
    dropped = tuple(sorted(known - set(model.ids)))
    return later, _steps(later, problem.gap, extra, dropped)


def _steps(
    problem: Problem,
    before: Gap,
    extra: list[ModelTerm],
    dropped: tuple[str, ...],
) -> tuple[Step, ...]:
    """Return a step for each further term, in order of what it carries alone, with the gap of the law so far."""
    steps: list[Step] = []
    ordered = sorted(extra, key=lambda term: -term.unique_share)
    for place, term in enumerate(ordered, 1):
        later = {each.id for each in ordered[place:]}
        after = problem.gap if not later else _gap_without(problem, later)
        belief = _belief(term.coefficient / max(term.standard_error, 1e-300))
        numbers, units = {term.symbol: term.coefficient}, {term.symbol: term.unit}
        steps.append(replace(_step(term.id, term.family, numbers, units, before, after), probability=belief))
        before = after
    if steps:
        steps[0] = replace(steps[0], terms_dropped=dropped)
    return tuple(steps)


def _gap_without(problem: Problem, ids: set[str]) -> Gap:
    """Return the gap of the model without some terms, the others fitted anew."""
    work = problem.work
    smaller = _without(work.model, ids)
    return gap_of(work, refit(work.rows, smaller, ()).model, ())


def _without(model: JointModel, ids: set[str]) -> JointModel:
    keep = [i for i, term in enumerate(model.terms) if term.id not in ids]
    covariance = tuple(tuple(model.covariance[i][j] for j in keep) for i in keep) if model.covariance else ()
    return replace(model, terms=tuple(model.terms[i] for i in keep), covariance=covariance)


def _step(
    effect: str, family: str, numbers: dict[str, float], units: dict[str, str], before: Gap, after: Gap
) -> Step:
    return Step(effect, family, (effect,), 1.0, (), numbers, (), before, after, units)
