"""Runs that do not repeat and drift: what the law that the others have in common leaves is a line over time."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from sindyjoint.numeric import Array
from sindyjoint.soundness.detectors.course import drift_of
from sindyjoint.soundness.finding import Finding
from sindyjoint.soundness.law.common import rows_of, scale_of, solve
from sindyjoint.soundness.law.motions import Motions
from sindyjoint.soundness.policy import POLICY
from sindyjoint.soundness.words import Words

# Parts of a run whose mean residuals are followed, and the fewest samples of one.
PARTS, FEWEST = 24, 5


def find_drifts(runs: Motions, alike: Motions, inertia: float | None, words: Words) -> Iterator[Finding]:
    """Yield runs of which the law that the others have in common leaves a straight line over time.

    Parameters
    ----------
    runs : Motions
        Those that are looked at.
    alike : Motions
        Those that have a law in common.
    inertia : float or None
    words : Words
    """
    scale = scale_of(alike)
    law = solve(rows_of(alike, scale, inertia).products)[0]
    rows = rows_of(runs, scale, inertia)
    for index, name in enumerate(runs.names):
        moving = np.any(rows.columns[index] != 0, axis=1)
        part = (runs.place[index] * PARTS).astype(int)[moving]
        # In amplitudes of a sinusoid.
        residual = ((rows.target[index] - rows.columns[index] @ law) / np.sqrt(2))[moving]
        known = np.flatnonzero(np.bincount(part, minlength=PARTS) >= FEWEST)
        if known.size < PARTS // 2:
            continue
        slope = drift_of(_means(part, residual)[known], POLICY.changed, place=known)
        total = (slope or 0.0) * PARTS
        # Of a law that leaves much the mean moves as well, as drive and motion change along a sweep.
        if slope is None or np.var(residual) - total**2 / 12 > POLICY.nearly**2:
            continue
        moves = {}
        for channel, signal in (("moment", runs.moment[index]), ("angle", runs.angle[index])):
            mean = _means((runs.place[index] * PARTS).astype(int), signal)
            moves[channel] = abs(np.polyfit(np.arange(PARTS), mean, 1)[0]) / max(
                float(np.std(signal)), 1e-300
            )
        # The channel whose own mean moves along, at least twice as far.
        one, other = sorted(moves, key=moves.__getitem__, reverse=True)
        drifting = one if moves[one] > 2 * moves[other] else None
        which = "" if drifting else f"; the zero of {words.of('moment')} or {words.of('angle')} does"
        yield words.finding(
            "drift",
            name,
            drifting,
            "biases",
            f"the law of all runs leaves a {words.of('moment')} that drifts over the run, by {100 * abs(total):.2g} % "
            f"of its amplitude{which}",
            "let the amplifiers warm up, or remove a straight line from the channel before",
        )


def _means(part: Array, values: Array) -> Array:
    count = np.maximum(np.bincount(part, minlength=PARTS), 1)
    return np.asarray(np.bincount(part, values, minlength=PARTS) / count)
