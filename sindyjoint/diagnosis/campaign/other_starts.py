"""Other starts of a search: the model that discovery finds, channels whose delay is removed, the joint's own zero.

A law that lacks what discovery can find is given effects in its place, and a delay is taken for a law. Neither can be
seen while the search goes on; it can be seen at its end, by what remains of the gap.

So can the joint's own zero, where its kinks and its even and odd laws have their middle. The five terms and a constant
are closed under a shift of the displacement (Taylor); a clearance, a stop, or a damping that grows with the angle are
not. With a sensor's zero elsewhere they are described by several effects at the wrong place. The zero is therefore
searched at which one effect of angle and rate, beside terms and constant, explains most. That zero is found beside a
law that lacks what the search finds later, and with a constant beside it that says nearly the same: by as much as it is
wrong a constant moment seems to be there, M_0 = k1·Δθ_0. It is therefore fitted with everything else once the law is
there.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from sindyjoint.diagnosis.campaign import GapRun
from sindyjoint.diagnosis.campaign.gap import gap_of
from sindyjoint.diagnosis.campaign.measure import CampaignEvidence, score_of
from sindyjoint.diagnosis.campaign.numbers import number_columns
from sindyjoint.diagnosis.campaign.regression import stack
from sindyjoint.diagnosis.campaign.repair import (
    Repaired,
    least_squares,
    modelled,
    refit,
    refit_nonlinear,
    rest_angle,
    without,
)
from sindyjoint.diagnosis.campaign.start import Work, belief_in, first_model
from sindyjoint.diagnosis.effects import Effect
from sindyjoint.diagnosis.effects.fitted import FittedEffect
from sindyjoint.diagnosis.evidence import Ranking
from sindyjoint.diagnosis.result import Gap, Step
from sindyjoint.discovery.delay import ChannelDelay, columns_of, competing_delay, find_delay, shifted
from sindyjoint.discovery.regression import TermRegression
from sindyjoint.equation.candidates import rate_free
from sindyjoint.equation.catalogue import default_candidates
from sindyjoint.equation.model import INERTIA, JointModel, ModelTerm
from sindyjoint.errors import InputError
from sindyjoint.numeric import DIFFERENCE, Array
from sindyjoint.policy import SHARED
from sindyjoint.states import ForceStates, moment_floor, regression_rows

# The problem of a campaign is made of this module's functions: its class, which imports them, cannot be named here.
Problem = Any


def with_delay(problem: Problem) -> tuple[Work, Ranking[FittedEffect]] | None:
    """Return the rows with the delay between the channels removed, and that delay; None if there is none."""
    effect = next((e for e in problem.candidates if e.enters == "time shift"), None)
    work = problem.work
    lag = None if effect is None else _delay(problem)
    if effect is None or lag is None:
        return None
    delay = FittedEffect(effect, effect.variants[0], np.empty(0), np.array([lag.time]), 0.0)
    belief = belief_in(lag.time / lag.standard_error)
    aligned = work.again(work.model, (), tuple(shifted(s, lag.time) for s in work.states))
    model = refit(aligned.rows, work.model, ()).model
    return replace(aligned, model=model), Ranking((delay,), (belief,), 1 - belief, (delay,))


def _delay(problem: Problem) -> ChannelDelay | None:
    """Return the delay that stands out under any joint's law, or else under the terms that discovery finds.

    What these lack looks like a delay: with it they must leave little beside the noise, or it stands out of what they
    lack and of how runs differ.
    """
    work = problem.work
    inertia = work.campaign.joint.inertia
    lag = find_delay(work.states, inertia, work.campaign.inputs)
    if lag is None or not lag.stands_out:
        found = _regressed(problem)
        terms = [] if found is None else [term for term in found.terms_ if term.id in found.model_]
        try:
            lag = competing_delay(work.states, columns_of(terms), inertia) if terms else None
        except np.linalg.LinAlgError:  # terms that depend on each other
            return None
        known = SHARED.clearly * moment_floor(work.states, inertia or 0.0).moment
        if lag is None or not (lag.significant or lag.residual_rms <= known):
            return None
    return lag if lag is not None and lag.stands_out and not lag.at_limit else None


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
        model = first_model(campaign, work.states, without(model, denied), None, policy).model
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
    work, steps = problem.work, list[Step]()
    ordered = sorted(extra, key=lambda term: -term.unique_share)
    for place, term in enumerate(ordered, 1):
        later = {each.id for each in ordered[place:]}
        # Without those that come later, the others fitted anew.
        smaller = refit(work.rows, without(work.model, later), ()).model if later else None
        after = problem.gap if smaller is None else gap_of(work, smaller, ())
        belief = belief_in(term.coefficient / max(term.standard_error, 1e-300))
        numbers, units = {term.symbol: term.coefficient}, {term.symbol: term.unit}
        steps.append(Step(term.id, term.family, (term.id,), belief, (), numbers, (), before, after, units))
        before = after
    if steps:
        steps[0] = replace(steps[0], terms_dropped=dropped)
    return tuple(steps)


CONSTANT, ZERO = "constant_moment", "angle_offset"
# Zeros that are tried, as shares of the largest angle, about that of the terms and a constant; then half as far apart.
REACH, POINTS, HALVINGS = 0.16, 9, 6


def zero_start(straight: Problem, last: Problem) -> tuple[Problem, tuple[Step, ...]] | None:
    """Return the problem with its displacement counted from the joint's own zero, and that step.

    None where the search that ended in ``last`` found no zero error, or nothing beside one that has a middle.
    """
    zeros = [e for e in last.found if e.name in (CONSTANT, ZERO)]
    others = [e for e in last.found if e.family != "measurement"]
    constant = next((e for e in straight.candidates if e.id == CONSTANT), None)
    offset = next((e for e in straight.candidates if e.id == ZERO), None)
    # A corner on one side, wherever it lies, would take the place of a zero.
    fixed = [
        replace(e, variants=tuple(v for v in e.variants if not v.has_special)) for e in straight.candidates
    ]
    centred = [e for e in fixed if has_middle(e)]
    # An odd and an even law beside each other may be one law about another middle.
    centres = [e for e in last.found if e.name in {each.id for each in centred}]
    if not (zeros or len(centres) > 1) or constant is None or offset is None or not centred:
        return None
    if not others and last.gap.moment <= straight.policy.clearly * last.noise_floor.moment:
        return None
    beside = [e for e in others if e.effect.enters == "moment" and e not in centres]
    middle, gain, least = _best_zero(last.work, beside, constant, centred)
    if not middle or gain < least:
        return None
    later = counted_from(straight, middle)
    fitted = FittedEffect(offset, offset.variants[0], np.empty(0), np.array([middle]), gain)
    step = Step(
        ZERO,
        offset.family,
        (ZERO,),
        float(1 / (1 + np.exp(-min(gain, 1e3)))),
        (),
        fitted.parameters,
        (),
        straight.gap,
        later.gap,
        straight.units(fitted),
    )
    return later, (step,)


def has_middle(effect: Effect) -> bool:
    """Return whether an effect is a function of angle and rate that a shift of the angle changes."""
    return effect.enters == "moment" and all(
        not v.states and "theta" in v.uses and v.uses <= {"theta", "omega", *v.names} for v in effect.variants
    )


def _best_zero(
    work: Work, beside: Sequence[FittedEffect], constant: Effect, candidates: Sequence[Effect]
) -> tuple[float, float, float]:
    """Return the zero at which one candidate explains most, its score over that without a shift, and what is chance."""
    largest = max(float(np.abs(run.angle).max()) for run in work.plain)

    def best_at(zero: float, effects: Sequence[Effect]) -> tuple[float, str, float]:
        rows = [shifted_run(run, zero) for run in work.plain]
        search = CampaignEvidence(rows, work.model, [constant, *effects], beside).search()
        always = search.chosen([each for each in search.candidates if each.name == constant.id])
        later = search.extended(always)
        if not later:
            return always.score.total, "", search.limits[0]
        return later[0].score.total, later[0].members[-1].name, search.limits[0]

    rest = rest_angle(work.plain, work.model)
    begin = float(np.mean([run.motion.angle.mean() for run in work.plain])) if rest is None else rest
    spacing = REACH * largest / (POINTS // 2)
    places = [begin + spacing * k for k in range(-(POINTS // 2), POINTS // 2 + 1)]
    known = {place: best_at(place, candidates) for place in places}
    best = max(known, key=lambda place: known[place][0])
    last = [e for e in candidates if e.id == known[best][1]]
    for _ in range(HALVINGS):
        spacing /= 2
        known.update({place: best_at(place, last) for place in (best - spacing, best + spacing)})
        best = max(known, key=lambda place: known[place][0])
    score, _, least = known[best]
    return best, score - best_at(0.0, candidates)[0], least


def shifted_run(run: GapRun, zero: float) -> GapRun:
    """Return a run with its displacement counted from another zero."""
    motion = run.motion
    return replace(run, motion=replace(motion, angle=motion.angle - zero, centre=motion.centre - zero))


def counted_from(straight: Problem, zero: float, repaired: Repaired | None = None) -> Problem:
    """Return the problem of the same runs with every displacement counted from another zero.

    With a law ``repaired`` about that zero; default: its model, fitted anew, without effects.
    """
    work, policy = straight.work, straight.policy
    campaign = work.campaign.with_runs(
        tuple(replace(r, angle=r.angle - zero, source=None) for r in work.campaign.runs)
    )
    runs = [replace(r, angle=r.angle - zero, source=None) for r in work.runs]
    states = [_counted(s, zero) for s in work.states]
    if repaired is None:
        repaired = Repaired(first_model(campaign, states, work.model, None, policy).model, ())
    later = Work.build(campaign, runs, states, work.groups, repaired.model, repaired.effects, policy)
    if repaired.effects:
        # Rows have their weights by the law that they are about.
        again = refit(later.rows, repaired.model, repaired.effects, drops=False)
        repaired = replace(again, dropped=straight.dropped)
    return replace(
        straight,
        work=replace(later, model=repaired.model),
        repaired=repaired,
        zero=straight.zero + zero,
        candidates=tuple(each for each in straight.candidates if each.id != ZERO),
        states=tuple(_counted(s, zero) for s in straight.states),
    )


def _counted(states: ForceStates, zero: float) -> ForceStates:
    lead, replicate = states.lead, states.replicate
    return replace(
        states,
        angle=states.angle - zero,
        lead=None if lead is None else (lead[0] - zero, lead[1]),
        replicate=None if replicate is None else (replicate[0] - zero, *replicate[1:]),
    )


# Steps of Gauss and Newton, of which the last is below this share of the zero's standard error.
ROUNDS, SMALL_STEP = 6, 0.1


def with_zero_fitted(problem: Problem) -> tuple[Problem, bool]:
    """Return the problem with its zero fitted beside the law, and whether a constant moment went by it.

    A constant stays where it wins beside the zero that is best without it; the zero is then fitted beside both, if the
    law has effects that know where its middle is.
    """
    constant = next((e for e in problem.found if e.name == CONSTANT), None)
    others = tuple(e for e in problem.found if e is not constant)
    without = _fitted(problem, others)
    if constant is None:
        return without, False
    both = _fitted(problem, problem.found) if any(has_middle(e.effect) for e in others) else problem
    scores = [score_of(p.work.plain, p.repaired.model, p.found).total for p in (both, without)]
    stays = scores[0] - scores[1] > -np.log(problem.policy.chance)
    return (both, False) if stays else (without, True)


def _fitted(problem: Problem, effects: Sequence[FittedEffect]) -> Problem:
    """Return the problem with these effects, all numbers and the zero fitted together."""
    work, model = problem.work, problem.repaired.model
    shifts = [e for e in effects if e.shifts]
    adding: Sequence[FittedEffect] = [e for e in effects if not e.shifts]
    total, error, chi_square = 0.0, 0.0, np.inf
    best: Repaired | None = None
    for _ in range(ROUNDS):
        rows = [shifted_run(run, total) for run in work.rows]
        adding = refit_nonlinear(rows, model, adding, work.policy)
        fitted = refit(rows, model, adding, drops=False)
        step, its_error, misfit = _zero_step(rows, fitted.model, fitted.effects)
        if not misfit < chi_square:
            break
        found, best, error, chi_square = total, fitted, its_error, misfit
        if abs(step) < SMALL_STEP * error:
            break
        total += step
    assert best is not None
    later = counted_from(problem, found, best)
    repaired = replace(later.repaired, effects=(*shifts, *later.repaired.effects))
    return replace(later, repaired=repaired, zero_error=error)


def _zero_step(
    rows: Sequence[GapRun], model: JointModel, effects: Sequence[FittedEffect]
) -> tuple[float, float, float]:
    """Return the step of the zero by linearisation of all numbers, its standard error, and χ² as it is."""
    largest = max(float(np.abs(run.angle).max()) for run in rows)
    columns = stack(rows, lambda run: _columns(run, model, effects, DIFFERENCE * largest))
    residual = np.concatenate([run.white(run.target - modelled(run, model, effects)) for run in rows])
    numbers, covariance = least_squares(columns, residual)
    step = float(np.clip(numbers[0], -largest, largest))
    return step, float(np.sqrt(covariance[0, 0])), float(residual @ residual)


def _columns(run: GapRun, model: JointModel, effects: Sequence[FittedEffect], difference: float) -> Array:
    """Return the derivatives of a run's moment by the zero from which its displacement is counted, and all numbers."""
    low, high = (modelled(shifted_run(run, by), model, effects) for by in (-difference, difference))
    return np.column_stack([(high - low) / (2 * difference), number_columns(run, model, effects)])
