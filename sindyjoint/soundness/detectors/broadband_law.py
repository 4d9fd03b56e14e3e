"""Runs that do not repeat held against each other: one that departs from the law of the others, one that drifts."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from typing import ClassVar

import numpy as np
from numpy.typing import NDArray

from sindyjoint.errors import SindyJointError
from sindyjoint.numeric import Array
from sindyjoint.record import Campaign, Run
from sindyjoint.soundness.cycle import Gains
from sindyjoint.soundness.detectors.common_law import Rows, rows_of_motions, scale_of, solve
from sindyjoint.soundness.detectors.odd_runs import find_odd_runs
from sindyjoint.soundness.detectors.other_scales import find_other_scales
from sindyjoint.soundness.finding import Finding
from sindyjoint.soundness.policy import POLICY
from sindyjoint.soundness.words import Words
from sindyjoint.states.build import force_states
from sindyjoint.states.record import ForceStates

# Samples of each run that are compared, evenly spread, and the parts of a run whose mean residuals are followed.
SAMPLES = 2_400
PARTS = 24


@dataclass(frozen=True, eq=False)
class Samples:
    """Samples of some runs while the joint moves; where a run has fewer than others it stands still.

    Parameters
    ----------
    names : tuple of str
    angle, rate, acceleration, moment : ndarray, shape (r, n)
    part : ndarray of int, shape (r, n)
        In which of the parts of its run a sample lies.
    inputs : ndarray, shape (r, n, k)
        Declared inputs.
    """

    names: tuple[str, ...]
    angle: Array
    rate: Array
    acceleration: Array
    moment: Array
    part: NDArray[np.intp]
    inputs: Array
    repeats: ClassVar[bool] = False
    frequency: ClassVar[None] = None

    @classmethod
    def of(cls, states: Sequence[ForceStates]) -> Samples:
        """Take samples of force states."""
        columns: list[list[Array]] = []
        for each in states:
            every = np.flatnonzero(each.moving)
            kept = every[np.linspace(0, every.size - 1, SAMPLES).astype(int)]
            part = kept * PARTS // each.n_samples
            inputs = np.array([values[kept] for values in each.inputs.values()]).reshape(-1, SAMPLES).T
            columns.append(
                [each.angle[kept], each.rate[kept], each.acceleration[kept], each.moment[kept], part, inputs]
            )
        stacked = [np.array(rows) for rows in zip(*columns, strict=True)]
        angle, rate, acceleration, moment, part, inputs = stacked
        names = tuple(s.run for s in states)
        return cls(names, angle, rate, acceleration, moment, part.astype(np.intp), inputs)

    def __len__(self) -> int:
        return len(self.names)

    def take(self, index: Sequence[int]) -> Samples:
        """Return some of the runs."""
        rows = list(index)
        return Samples(
            tuple(self.names[i] for i in rows),
            self.angle[rows],
            self.rate[rows],
            self.acceleration[rows],
            self.moment[rows],
            self.part[rows],
            self.inputs[rows],
        )

    def scaled(self, moment: Gains = 1.0, angle: Gains = 1.0) -> Samples:
        """Return the runs with their moments and angles times factors, one for each run or one for all."""
        load, turn = np.reshape(moment, (-1, 1)), np.reshape(angle, (-1, 1))
        return replace(
            self,
            moment=load * self.moment,
            angle=turn * self.angle,
            rate=turn * self.rate,
            acceleration=turn * self.acceleration,
        )

    def load(self) -> Array:
        """Return the moment, shape (r, n)."""
        return self.moment

    def motion(self) -> tuple[Array, Array, Array]:
        """Return angle, rate and acceleration, each shape (r, n)."""
        return self.angle, self.rate, self.acceleration


def find_broadband_faults(campaign: Campaign, runs: Sequence[Run], words: Words) -> Iterator[Finding]:
    """Yield runs without a frequency that have another gain or law than the others, and those that drift.

    Parameters
    ----------
    campaign : Campaign
    runs : sequence of Run
        Those that may be looked at.
    words : Words
    """
    alive = [r for r in runs if r.frequency is None and np.ptp(r.moment) > 0 and np.ptp(r.angle) > 0][
        : POLICY.most_broadband
    ]
    try:
        states = [force_states(run) for run in alive]
        samples = Samples.of([s for s in states if np.count_nonzero(s.moving) >= PARTS])
        inertia = campaign.joint.inertia
        scales, samples = find_other_scales(samples, inertia, words)
        yield from scales
        found, alike = find_odd_runs(samples, inertia, words)
        if not len(alike):
            return
        # What drifts departs from the law of the others, too.
        explained = {*alike.names, *(f.run for f in found if f.id != "run_differs")}
        odd = [i for i, name in enumerate(samples.names) if name not in explained]
        drifts = list(_find_drifts(alike, alike, inertia, words))
        drifts += _find_drifts(samples.take(odd), alike, inertia, words) if odd else []
        yield from drifts
        drifting = {f.run for f in drifts}
        yield from (f for f in found if f.run not in drifting)
    # A joint that hardly moves, too short a run, states that are all alike or beyond what squares can hold.
    except (SindyJointError, np.linalg.LinAlgError, ValueError):
        return


def _find_drifts(runs: Samples, alike: Samples, inertia: float | None, words: Words) -> Iterator[Finding]:
    """Yield runs of which the law that the others have in common leaves a straight line over time."""
    scale = scale_of(alike)
    law = solve(rows_of_motions(alike, scale, inertia).products.sum(axis=0))[0]
    rows = rows_of_motions(runs, scale, inertia)
    for index, name in enumerate(runs.names):
        line = _line(rows, law, index, runs.part[index])
        if line is None:
            continue
        channel = _drifting(runs, index)
        yield Finding(
            "drift",
            name,
            channel,
            "biases",
            f"the law of all runs leaves a {words.moment} that drifts over the run, by {100 * abs(line):.2g} % of its "
            "amplitude" + ("" if channel else f"; the zero of {words.moment} or {words.angle} does"),
            "adds to the noise floor and, through the mean, to k2 and the unequal parts of M_F",
            "let the amplifiers warm up, or remove a straight line from the channel before",
        )


def _line(rows: Rows, law: Array, index: int, part: NDArray[np.intp]) -> float | None:
    """Return the drift of a residual over its run, in amplitudes of the moment; None where none stands out."""
    residual = (rows.target[index] - rows.columns[index] @ law) / np.sqrt(2)
    moving = np.any(rows.columns[index] != 0, axis=1)
    count = np.bincount(part[moving], minlength=PARTS)
    known = np.flatnonzero(count >= 5)
    if known.size < PARTS // 2:
        return None
    mean = np.bincount(part[moving], residual[moving], minlength=PARTS)[known] / count[known]
    fit = np.polyfit(known, mean, 1)
    scatter = float(np.std(mean - np.polyval(fit, known)))
    half = known.size // 2
    slopes = [np.polyfit(known[each], mean[each], 1)[0] for each in (slice(None, half), slice(half, None))]
    even = slopes[0] * slopes[1] > 0 and POLICY.even_drift < slopes[0] / slopes[1] < 1 / POLICY.even_drift
    total = float(fit[0]) * PARTS
    stands = abs(total) > POLICY.drift and abs(total) > POLICY.drift_contrast * scatter
    # Of a law that leaves much the mean moves as well, as drive and motion change along a sweep.
    stands &= float(np.var(residual[moving])) - total**2 / 12 < 0.5 * POLICY.drift_left**2
    return total if stands and even else None


def _drifting(alike: Samples, index: int) -> str | None:
    """Return the channel whose mean moves along, in its own amplitude, at least twice as far; None if neither."""
    part = alike.part[index]
    moved = {}
    for name, signal in (("moment", alike.moment[index]), ("angle", alike.angle[index])):
        count = np.maximum(np.bincount(part, minlength=PARTS), 1)
        mean = np.bincount(part, signal, minlength=PARTS) / count
        moved[name] = abs(np.polyfit(np.arange(PARTS), mean, 1)[0]) / max(float(np.std(signal)), 1e-300)
    one, other = sorted(moved, key=moved.__getitem__, reverse=True)
    return one if moved[one] > 2 * moved[other] else None
