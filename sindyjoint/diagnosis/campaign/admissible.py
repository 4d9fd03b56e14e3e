"""Which laws physics admits: sliders that yield, friction that opposes motion, no energy from nothing."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from sindyjoint.diagnosis.campaign.repair import FRICTION, Repaired, all_columns
from sindyjoint.diagnosis.campaign.rows.run import GapRun
from sindyjoint.diagnosis.effects.fitted import FittedEffect
from sindyjoint.diagnosis.policy import CAMPAIGN, DiagnosisPolicy
from sindyjoint.text import spelled

SLOW = 0.05  # of the largest rate: below it a sign is noise


def yield_complaint(fitted: FittedEffect, runs: Sequence[GapRun], policy: DiagnosisPolicy = CAMPAIGN) -> str:
    """Return whether a slider sticks along most of the way of the measured motion: it is then a spring, and no slider.

    Of sliders with a sharp limit: smooth hysteresis dissipates long before it yields. Half-cycles count by their
    stroke: between pulls a motion that hardly moves turns round many times.
    """
    if all(state.limit is None for state in fitted.variant.states):
        return ""
    limit = float(np.min(fitted.variant.limits(np.asarray(fitted.values, dtype=np.float64))))
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
