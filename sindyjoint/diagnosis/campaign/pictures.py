"""Measured and modelled moments of the runs, before and after effects were added: what pictures are made of."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from sindyjoint.diagnosis.campaign.repair import modelled
from sindyjoint.diagnosis.campaign.rows.run import GapRun
from sindyjoint.diagnosis.effects.fitted import FittedEffect
from sindyjoint.diagnosis.result import RunGap
from sindyjoint.equation.model import JointModel
from sindyjoint.numeric import Array

MOST_RUNS = 12
# Of a long run one stretch, of which curves are drawn, and evenly some of the other rows, for maps.
CURVE_ROWS = 400
CURVE_PERIODS = 2
MOST_ROWS = 1500


def run_gaps(
    rows: Sequence[GapRun], model: JointModel, effects: Sequence[FittedEffect] = (), zero: float = 0.0
) -> tuple[RunGap, ...]:
    """Return up to twelve runs, spread over the campaign, beside a model with effects; long ones thinned.

    Rows are moments of the joint, channels put right: a time shift among the effects is in them already. Angles are as
    measured: ``zero``, from which those of the rows are counted, is added.
    """
    chosen = np.unique(np.linspace(0, len(rows) - 1, min(len(rows), MOST_RUNS)).round().astype(int))
    whole = [rows[i].whole() for i in chosen]
    return tuple(_beside(run, modelled(run, model, effects), zero) for run in whole)


def _beside(run: GapRun, model: Array, zero: float) -> RunGap:
    keep = run.motion.keep
    time = np.asarray(run.motion.step * keep if run.folded else run.motion.time[keep], dtype=np.float64)
    curve = _stretch(run, time)
    part = np.concatenate([curve, _others(time.size, curve)])
    return RunGap(
        run=run.name,
        level=run.level,
        frequency=run.motion.frequency,
        repeats=run.folded,
        time=time[part],
        angle=run.angle[part] + zero,
        rate=run.rate[part],
        measured=run.target[part],
        model=model[part],
        noise=_noise(run),
        curve=curve.size,
    )


def _stretch(run: GapRun, time: Array) -> NDArray[np.intp]:
    """Return the rows of a stretch: the mean period; some periods of a sine; of other runs where most is going on."""
    every = np.arange(time.size)
    if run.folded or time.size < 2:
        return every
    span, periodic = time[-1] - time[0], run.motion.frequency > 0
    length = (
        CURVE_PERIODS / run.motion.frequency if periodic else CURVE_ROWS * float(np.median(np.diff(time)))
    )
    # A sine has settled in the middle half of its run; the stretch that holds most rows is shown.
    low, high = (0.25 * span, 0.75 * span) if periodic else (0.0, max(span - length, 0.0))
    starts = time[0] + np.linspace(low, high, 41)
    first = np.searchsorted(time, starts)
    last = np.searchsorted(time, starts + length, side="right")
    weight = np.ones(time.size) if periodic else run.target**2
    held = np.append(0.0, np.cumsum(weight))
    best = int(np.argmax(held[last] - held[first]))
    return every[first[best] : last[best] : max(1, -(-int(last[best] - first[best]) // CURVE_ROWS))]


def _others(size: int, curve: NDArray[np.intp]) -> NDArray[np.intp]:
    left = np.setdiff1d(np.arange(size), curve)
    return left[:: max(1, -(-left.size // (MOST_ROWS - CURVE_ROWS)))]


def _noise(run: GapRun) -> float:
    """Return the RMS of a row's noise: of a mean period from the covariance of its rows, (F'F)⁻¹."""
    if not run.folded:
        return float(np.sqrt(run.variance))
    lower = np.linalg.inv(run.factor)
    return float(np.sqrt(np.mean(np.sum(lower**2, axis=1))))
