"""What each kind of law predicts of a campaign's gap: the shares of its budget."""

from __future__ import annotations

import numpy as np

from sindyjoint.diagnosis.budget import Budget, divide_gap
from sindyjoint.diagnosis.campaign.regression import GapRegression
from sindyjoint.diagnosis.campaign.unnamed.prediction import KINDS, Prediction


def shares(problem: GapRegression, noise: float, measured: bool = False) -> dict[str, float]:
    """Return what each kind of law explains of the gap beyond noise, from 0 to 1, by kind; their sum is at most one.

    The kind that predicts the runs left out best alone is credited first, the others with what they win on top. Within
    noise of each other a law without memory comes before one with it, and that before one of the run. ``noise`` is the
    share of the mean square gap that is noise, which counts where repetition has not measured it row by row; it is
    ``measured`` where neighbouring samples of a path show it.
    """
    prediction = Prediction(problem)
    before = prediction.base
    deviation = float(np.sqrt(2 * prediction.rows))
    margin = problem.policy.significant_fall * deviation
    floor = min(float(prediction.rows), before) if problem.repeats else noise * before
    credit = dict.fromkeys(KINDS, 0.0)
    if before - floor <= margin:
        return credit
    residual, open_kinds = before, list(KINDS)
    beside: tuple[str, ...] = ()
    while open_kinds:
        tried = {kind: prediction.best(kind, beside) for kind in open_kinds}
        least = min(each.error for each in tried.values())
        kind = next(
            k for k in KINDS if k in tried and tried[k].error <= least + problem.policy.alike * deviation
        )
        gain = residual - max(tried[kind].error, floor)
        if gain <= margin:
            break
        credit[kind] = gain
        residual, beside = max(tried[kind].error, floor), tried[kind].columns
        open_kinds.remove(kind)
    # What repeats and nothing predicts is the run's own. Where nothing repeats it cannot be distinguished from noise,
    # unless that is known.
    if (problem.repeats or measured) and residual - floor > margin:
        credit["run"] += residual - floor
    return {kind: value / (before - floor) for kind, value in credit.items()}


def make_budget(
    problem: GapRegression,
    total: float,
    noise: float,
    processing: float,
    drift: float = 0.0,
    measured: bool = False,
) -> Budget:
    """Return the budget of a gap, of which the regression (without the drift of a channel) explains shares."""
    return divide_gap(total, noise, processing, lambda share: shares(problem, share, measured), drift)
