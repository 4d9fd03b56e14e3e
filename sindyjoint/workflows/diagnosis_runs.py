"""Measured and modelled moments of the runs, before and after effects were added: what pictures are made of."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from sindyjoint.discovery.model import JointModel
from sindyjoint.discrepancy.gap import GapRun
from sindyjoint.discrepancy.naming import FittedEffect
from sindyjoint.discrepancy.repair import all_columns

Array = NDArray[np.float64]

MOST_RUNS = 12
# Of a long run the first rows, of which curves are drawn, and evenly some of the others, for maps.
FIRST_ROWS = 400
MOST_ROWS = 1500


@dataclass(frozen=True, eq=False)
class RunGap:
    """One run beside its model.

    Parameters
    ----------
    run : str
    level : str or None
    frequency : float
        Hz; zero where the run has none.
    repeats : bool
        Whether the rows are one mean period.
    time, angle, rate : ndarray, shape (m,)
        s, rad, rad/s; of moving samples.
    measured, model : ndarray, shape (m,)
        Transfer moment (with that of the inertia where this is identified), N·m.
    noise : float
        RMS of the noise of a row, N·m.
    """

    run: str
    level: str | None
    frequency: float
    repeats: bool
    time: Array
    angle: Array
    rate: Array
    measured: Array
    model: Array
    noise: float

    @property
    def left(self) -> Array:
        """What the model leaves, N·m, shape (m,)."""
        return self.measured - self.model


def run_gaps(
    rows: Sequence[GapRun], model: JointModel, effects: Sequence[FittedEffect] = ()
) -> tuple[RunGap, ...]:
    """Return up to twelve runs, spread over the campaign, beside a model with effects; long ones thinned.

    Parameters
    ----------
    rows : sequence of GapRun
        Moments of the joint, channels put right.
    model : JointModel
    effects : sequence of FittedEffect
        A time shift among them is in the rows already.
    """
    adding = [e for e in effects if e.effect.enters != "time shift"]
    coefficients = np.concatenate([model.coefficients, *(e.coefficients for e in adding)])
    chosen = np.unique(np.linspace(0, len(rows) - 1, min(len(rows), MOST_RUNS)).round().astype(int))
    return tuple(_beside(rows[i], all_columns(rows[i], model, adding) @ coefficients) for i in chosen)


def _beside(run: GapRun, model: Array) -> RunGap:
    keep, part = run.motion.keep, _part(run.target.size)
    time = np.asarray(run.motion.step * keep if run.folded else run.motion.time[keep], dtype=np.float64)
    return RunGap(
        run=run.name,
        level=run.level,
        frequency=run.motion.frequency,
        repeats=run.folded,
        time=time[part],
        angle=run.angle[part],
        rate=run.rate[part],
        measured=run.target[part],
        model=model[part],
        noise=_noise(run),
    )


def _part(size: int) -> NDArray[np.intp]:
    first = np.arange(min(size, FIRST_ROWS))
    every = -(-max(size - first.size, 1) // (MOST_ROWS - FIRST_ROWS))
    return np.concatenate([first, np.arange(first.size, size, every)])


def _noise(run: GapRun) -> float:
    """Return the RMS of a row's noise: of a mean period from the covariance of its rows, (F'F)⁻¹."""
    if not run.folded:
        return float(np.sqrt(run.variance))
    lower = np.linalg.inv(run.factor)
    return float(np.sqrt(np.mean(np.sum(lower**2, axis=1))))
