"""Which sliders physics admits: those that yield."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

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
