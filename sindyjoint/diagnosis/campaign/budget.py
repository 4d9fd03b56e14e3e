"""What the gap is made of, in parts that add up."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from sindyjoint.diagnosis.campaign.prediction import KINDS, Prediction
from sindyjoint.diagnosis.campaign.ranking import Problem

# A fall of the squared error counts from this many standard deviations of a χ² on; and two kinds are alike within one.
SIGNIFICANT = 3.0
ALIKE = 1.0


@dataclass(frozen=True)
class Budget:
    """The mean square gap, relative to that of the moment, in parts that add up.

    Parameters
    ----------
    state : float
        What a function of (θ, θ̇), any law without memory, predicts of runs that it never saw.
    history : float
        What a law with a memory predicts.
    run : float
        What differs between runs (frequency, time, drift), and what repeats within a run but is predicted by nothing
        that holds for the others.
    processing : float
        What the same chain leaves of the model's own simulation.
    noise : float
        What does not repeat.
    """

    state: float
    history: float
    run: float
    processing: float
    noise: float

    @property
    def total(self) -> float:
        """Sum of the parts."""
        return self.state + self.history + self.run + self.processing + self.noise


def explained_by_state(problem: Problem) -> float:
    """Return the share of χ² that a surface over (θ, θ̇) predicts on rows left out, from 0 to 1."""
    prediction = Prediction(problem)
    before, left = prediction.base, prediction.best("state").error
    return float(np.clip((before - left) / before, 0.0, 1.0)) if before > 0 else 0.0


def shares(problem: Problem, noise: float) -> dict[str, float]:
    """Return what each kind of law explains of the gap beyond noise, from 0 to 1, by kind; their sum is at most one.

    The kind that predicts the runs left out best alone is credited first, the others with what they win on top. Within
    noise of each other a law without memory comes before one with it, and that before one of the run.

    Parameters
    ----------
    problem : Problem
    noise : float
        Share of the mean square gap that is noise, which counts where repetition has not measured it row by row.
    """
    prediction = Prediction(problem)
    repeats = all(run.folded for run in problem.runs)
    before = prediction.base
    deviation = float(np.sqrt(2 * prediction.rows))
    margin = SIGNIFICANT * deviation
    floor = min(float(prediction.rows), before) if repeats else noise * before
    credit = dict.fromkeys(KINDS, 0.0)
    if before - floor <= margin:
        return credit
    left, open_kinds = before, list(KINDS)
    beside: tuple[str, ...] = ()
    while open_kinds:
        tried = {kind: prediction.best(kind, beside) for kind in open_kinds}
        least = min(each.error for each in tried.values())
        kind = next(k for k in KINDS if k in tried and tried[k].error <= least + ALIKE * deviation)
        gain = left - max(tried[kind].error, floor)
        if gain <= margin:
            break
        credit[kind] = gain
        left, beside = max(tried[kind].error, floor), tried[kind].columns
        open_kinds.remove(kind)
    # What repeats and nothing predicts is the run's own. Where nothing repeats it cannot be told from noise.
    if repeats and left - floor > margin:
        credit["run"] += left - floor
    return {kind: value / (before - floor) for kind, value in credit.items()}


def make_budget(
    problem: Problem, total: float, noise: float, processing: float, drift: float = 0.0
) -> Budget:
    """Return the budget of a gap.

    Parameters
    ----------
    problem : Problem
        Without the drift of a channel.
    total, noise, processing, drift : float
        Mean squares relative to the moment's: of the gap, of what does not repeat, of the chain, and of what is gone
        without the drift. Where they are more than the total, they are cut in this order.
    """
    noise = min(noise, total)
    processing = min(processing, total - noise)
    drift = float(np.clip(drift, 0.0, total - noise - processing))
    beyond = total - noise - processing - drift
    credit = shares(problem, noise / total) if beyond > 0 else dict.fromkeys(KINDS, 0.0)
    state, history, run = (beyond * credit[kind] for kind in KINDS)
    # To the last digit the sum is the total.
    return Budget(state, history, run + drift, processing, total - state - history - run - drift - processing)
