"""Force states of a quasi-static run, along the path that it travels."""

from __future__ import annotations

import numpy as np

from sindyjoint.measured import white_noise
from sindyjoint.record import Run
from sindyjoint.states.broadband import BLOCKS
from sindyjoint.states.noise import WIDEST
from sindyjoint.states.record import ForceStates, NoiseFloor


def path_states(run: Run) -> ForceStates:
    """Return the force states of a quasi-static run: in the place of time is the path, and the rate is ±1.

    Nothing accelerates. The noise of a sample is that of its neighbours on the same branch: errors of the angle are in
    it, through the slope.

    Parameters
    ----------
    run : Run
        Of which ``quasi_static`` is set: at even steps of the path.
    """
    step = 1 / run.sample_rate
    # A step without motion is the reversal, between the last sample of one branch and the first of the next.
    change = np.diff(run.angle) / step
    after, before = np.append(change, 0.0), np.append(0.0, change)
    rate = np.where(after != 0.0, after, before)
    moving = rate != 0.0
    if run.valid is not None:
        moving &= run.valid
    scatter = white_noise(run.moment[moving]) if run.noise.moment is None else run.noise.moment
    return ForceStates(
        run=run.name,
        frequency=None,
        level=run.level,
        sample_rate=run.sample_rate,
        time=run.time,
        angle=run.angle,
        rate=rate,
        acceleration=np.zeros(run.n_samples),
        moment=run.moment,
        moving=moving,
        block=np.arange(run.n_samples) * BLOCKS // run.n_samples,
        replicate=None,
        noise=NoiseFloor(
            scatter,
            run.noise.angle or 0.0,
            0.0,
            0.0,
            source="spectrum" if run.noise.moment is None else "declared",
        ),
        method="path",
        bandwidth=WIDEST * run.sample_rate,
        dropped=0.0,
        inputs=run.inputs,
    )
