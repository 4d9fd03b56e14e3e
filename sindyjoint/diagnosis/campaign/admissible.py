"""Which effects physics admits: friction that opposes motion, numbers within their range, no energy from nothing."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from sindyjoint.diagnosis.campaign.candidates import refine_effect
from sindyjoint.diagnosis.campaign.gap import moment_gap_beside
from sindyjoint.diagnosis.campaign.regression import (
    GapRegression,
    evidence_scale,
    rank_effects,
    wrong_signs,
)
from sindyjoint.diagnosis.campaign.repair import FRICTION, Repaired, all_columns
from sindyjoint.diagnosis.campaign.rows.run import GapRun
from sindyjoint.diagnosis.effects.fitted import FittedEffect
from sindyjoint.diagnosis.inadmissible import Inadmissible
from sindyjoint.diagnosis.policy import CAMPAIGN, DiagnosisPolicy
from sindyjoint.diagnosis.ranking import Ranking, weights_of
from sindyjoint.equation.terms import Parameter, Reference
from sindyjoint.text import spelled

# The problem of a campaign is made of this module's functions: its class, which imports them, cannot be named here.
Problem = Any

YIELD = "theta_y"  # what the angle at which a slider yields is called in the catalogue
SLOW = 0.05  # of the largest rate: below it a sign is noise


def number_complaint(fitted: FittedEffect, reference: Reference, policy: DiagnosisPolicy) -> str:
    """Return which nonlinear parameter of an effect stands at the end of its range; empty if none does.

    The data then ask for a value beyond it: another effect, or a limiting form that has a name of its own. An end that
    the catalogue calls open (a ramp that is a step) may be reached.
    """
    for parameter, end in _ends_reached(fitted, reference, policy):
        return f"{parameter.name} of {spelled(fitted.name)} stands at the {end} end of its range"
    return ""


def _ends_reached(
    fitted: FittedEffect, reference: Reference, policy: DiagnosisPolicy
) -> Iterator[tuple[Parameter, str]]:
    """Yield the nonlinear parameters that stand at an end of their range which is not open, and which end."""
    for parameter, value, (low, high) in zip(
        fitted.variant.parameters, fitted.values, fitted.variant.bounds(reference), strict=True
    ):
        margin = policy.bound_margin * np.log(high / low)
        for end, distance in {"lower": np.log(value / low), "upper": np.log(high / value)}.items():
            if distance < margin and parameter.open != end:
                yield parameter, end


def wrong_sign_doubt(
    problem: Problem, fitted: Sequence[FittedEffect], denied: FittedEffect | None
) -> tuple[Inadmissible, ...]:
    """Return the candidate with a sign that the catalogue denies where it leads all others by more than a class.

    By the evidence by which candidates are ranked, and its gap on what is left out of the fit.
    """
    rows, policy = problem.regression, problem.policy
    if denied is None:
        return ()
    weights = weights_of(denied.gain, evidence_scale(rows, [denied]), policy)

    def evidence(each: FittedEffect) -> float:
        return weights.per_gain * each.gain - weights.price * rows.choices(each.variant)

    if evidence(denied) <= max(map(evidence, fitted)) + policy.rival_nats:
        return ()
    after = moment_gap_beside(problem.work, problem.repaired, denied, problem.gap)
    signs = " and ".join(wrong_signs(denied.variant, denied.coefficients))
    complaint = f"its {signs} would be negative"
    return (Inadmissible(denied.name, complaint, problem.gap, after),)


def off_the_ends(problem: GapRegression, ranking: Ranking[FittedEffect]) -> Ranking[FittedEffect]:
    """Return a ranking whose members stand off the ends of their ranges where the data do not ask for these.

    Along a ridge a search runs to the end for next to nothing. A member is refitted well inside its range, and stays
    there if that costs no more evidence than separates a class. One at the end where it becomes a special case of its
    own, which has a name, is refitted in the middle of that range: where its usual form costs no more either, these
    data could not have shown it, and it stays beside its special case.
    """
    fitted = list(ranking.fitted)
    for member in ranking.members:
        inside = off_its_ends(problem, member, fitted)
        fitted[fitted.index(member)] = inside
    return ranking if fitted == list(ranking.fitted) else rank_effects(problem, fitted)


def off_its_ends(
    problem: GapRegression, fitted: FittedEffect, rivals: Sequence[FittedEffect] = ()
) -> FittedEffect:
    """Return an effect well inside the ranges of its numbers where that costs next to nothing, or as it is.

    At the end where it becomes a special case of its own it moves beside ``rivals`` only, as one of them.
    """
    policy, reference = problem.policy, problem.reference
    ends = list(_ends_reached(fitted, reference, policy))
    special = any(parameter.special == end for parameter, end in ends)
    if not ends or (special and not rivals):
        return fitted
    everyone = rivals or [fitted]
    weights = weights_of(max(f.gain for f in everyone), evidence_scale(problem, everyone), policy)
    inside = refine_effect(problem, replace(fitted, within=_inner_bounds(fitted, reference, policy)))
    return inside if weights.per_gain * (fitted.gain - inside.gain) <= policy.rival_nats else fitted


def _inner_bounds(fitted: FittedEffect, reference: Reference, policy: DiagnosisPolicy) -> NDArray[np.float64]:
    """Return the ranges of nonlinear parameters without a share at each end that is not open."""
    bounds = fitted.variant.bounds(reference)
    length = np.log(bounds[:, 1] / bounds[:, 0])
    for place, parameter in enumerate(fitted.variant.parameters):
        for side, (end, sign) in enumerate((("lower", 1.0), ("upper", -1.0))):
            share = policy.special_margin if parameter.special == end else policy.inner_margin
            bounds[place, side] *= 1.0 if parameter.open == end else np.exp(sign * share * length[place])
    return bounds


def yield_complaint(fitted: FittedEffect, runs: Sequence[GapRun], policy: DiagnosisPolicy = CAMPAIGN) -> str:
    """Return whether a slider sticks along most of the way of the measured motion: it is then a spring, and no slider.

    Of sliders with a sharp limit: smooth hysteresis dissipates long before it yields. Half-cycles count by their
    stroke: between pulls a motion that hardly moves turns round many times.
    """
    if YIELD not in fitted.variant.names or all(state.limit is None for state in fitted.variant.states):
        return ""
    limit = fitted.values[fitted.variant.names.index(YIELD)]
    strokes = np.concatenate([np.abs(np.diff(_reversals(run))) for run in runs] or [np.empty(0)])
    stuck = float(strokes[strokes / 2 < limit].sum() / max(strokes.sum(), 1e-300))
    if stuck > policy.sticking_share:
        return (
            f"{spelled(fitted.name)} would not yield along {100 * stuck:.0f} % of the way: that is a spring"
        )
    return ""


def _reversals(run: GapRun) -> NDArray[np.float64]:
    """Return the angles at which a run's motion turns round."""
    angle, rate = run.motion.angle, run.motion.rate
    fast = np.flatnonzero(np.abs(rate) > SLOW * np.max(np.abs(rate), initial=0.0))
    turns = np.flatnonzero(np.diff(np.sign(rate[fast])) != 0)
    return angle[(fast[turns] + fast[turns + 1]) // 2]


def law_complaint(repaired: Repaired, runs: Sequence[GapRun], policy: DiagnosisPolicy) -> str:
    """Return what a model with effects does along the measured motion that no joint can; empty if nothing.

    Dry friction that pushes, or a joint that gives off energy: ∮ M dθ < 0 over all runs.
    """
    model, effects = repaired.model, repaired.effects
    families = [t.family for t in model.terms]
    families += [e.family for e in effects for _ in e.variant.columns]
    numbers = np.concatenate([model.coefficients, *(e.coefficients for e in effects)])
    dry = np.array([family == FRICTION for family in families])
    forced = [run for run in runs if run.half_cycles is None]
    if not forced:
        return ""
    columns = np.vstack([all_columns(run, model, effects) for run in forced])
    rate = np.concatenate([run.rate for run in forced])
    least = -policy.admissible_share * model.fitted.moment_rms
    if dry.any():
        share = float(np.mean((columns[:, dry] @ numbers[dry]) * np.sign(rate) < least))
        if share > policy.pushing_share:
            return f"dry friction would push along the motion in {100 * share:.0f} % of the time"
    if float(np.mean((columns @ numbers) * rate)) < least * float(np.sqrt(np.mean(rate**2))):
        return "the joint would give off energy over all runs"
    return ""
