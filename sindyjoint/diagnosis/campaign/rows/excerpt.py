"""Windows of a long run, in which the nonlinear parameters of effects with a memory are searched.

An internal state is integrated along the whole record, for every trial of its parameters. Some windows, spread evenly,
are nearly as informative; the first quarter of each lets the state forget the seam before it.
"""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from sindyjoint.diagnosis.campaign.rows.run import GapRun

WINDOWS = 8
WARM_UP = 0.25


def excerpt(run: GapRun, share: float) -> tuple[GapRun, NDArray[np.intp]]:
    """Return a run that does not repeat, cut to a share of its record, and which of its rows are left.

    Neighbouring rows of a window keep their covariance; that with rows that are cut away is left out.
    """
    motion = run.motion
    every = np.arange(run.target.size)
    length = int(share * motion.angle.size / WINDOWS) // motion.follow * motion.follow
    if run.folded or run.half_cycles is not None or motion.repeats or share >= 1 or length < 2:
        return run, every
    # On the samples that the integration of the whole record steps over, too.
    first = np.linspace(0, motion.angle.size - length, WINDOWS).astype(int) // motion.follow * motion.follow
    pieces = [slice(start, start + length) for start in first]
    within = [(motion.keep >= s.start + WARM_UP * length) & (motion.keep < s.stop) for s in pieces]
    rows = np.concatenate([every[mask] for mask in within])
    if rows.size < run.target.size * share / 4:
        return run, every
    keep = np.concatenate(
        [motion.keep[mask] - s.start + place * length
         for place, (mask, s) in enumerate(zip(within, pieces, strict=True))]
    )  # fmt: skip
    names = ("angle", "rate", "acceleration", "time", "moment_rate", "moment_slope")
    cut: dict[str, Any] = {name: np.concatenate([getattr(motion, name)[s] for s in pieces]) for name in names}
    cut["inputs"] = {name: np.concatenate([v[s] for s in pieces]) for name, v in motion.inputs.items()}
    factor = run.factor[:, rows].copy()
    # A band that reaches over a seam belongs to other rows.
    for band in range(1, factor.shape[0]):
        factor[band, : rows.size - band][rows[band:] - rows[:-band] != band] = 0.0
    later = replace(
        run, motion=replace(motion, keep=keep, **cut), target=run.target[rows], factor=factor, sigma=run.sigma[rows],
        band=None, processing=None,
    )  # fmt: skip
    return later, rows
