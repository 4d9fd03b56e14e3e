"""Runs held against the others: the law that all other runs have in common, and the one that departs from it."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from itertools import combinations
from typing import TypeVar

import numpy as np
from numpy.typing import NDArray

from sindyjoint.numeric import Array
from sindyjoint.soundness.cycle import Cycles
from sindyjoint.soundness.detectors.common_law import (
    Motions,
    Rows,
    Scale,
    rms,
    rows_of_motions,
    scale_of,
    solve,
)
from sindyjoint.soundness.finding import Finding
from sindyjoint.soundness.policy import POLICY
from sindyjoint.soundness.words import Words

M = TypeVar("M", bound=Motions)
# Directions in which the motion that runs cover is bounded.
HULL = 32


@dataclass(frozen=True, eq=False)
class OddRuns:
    """Runs that depart from the law of the others.

    Parameters
    ----------
    index : tuple of int
    departure : float
        Least RMS that the law of the others leaves of one of their moments, in parts of it.
    common : float
        RMS that this law leaves of the others.
    """

    index: tuple[int, ...]
    departure: float
    common: float


def odd_runs(rows: Rows, size: int) -> OddRuns | None:
    """Return the runs, ``size`` of them, without which the others have a law in common as they have not with them."""
    products = rows.products
    count = len(products)
    everything = float(np.sqrt(solve(products.sum(axis=0))[1] / count))
    if everything < POLICY.run_departure / np.sqrt(count):
        return None
    best: OddRuns | None = None
    for index in combinations(range(count), size):
        others = np.delete(
            products, index, axis=0
        )  # not a difference of sums: one run may be a thousand times as large
        law, rest = solve(others.sum(axis=0))
        common = float(np.sqrt(rest / len(others)))
        if best is None or common < best.common:
            best = OddRuns(index, min(rows.left_by(law, i) for i in index), common)
    if best is None:
        return None
    alike = best.common < min(POLICY.common_misfit, POLICY.common_gain * everything)
    apart = best.departure > max(POLICY.run_departure, POLICY.run_contrast * best.common)
    return best if alike and apart else None


def find_odd_runs(cycles: M, inertia: float | None, words: Words) -> tuple[list[Finding], M]:
    """Return findings on runs that differ from the others, with what explains it, and the cycles of the others."""
    remaining = list(range(len(cycles)))
    odd: list[int] = []
    common = 0.0
    while len(remaining) >= POLICY.fewest_compared and len(odd) <= len(cycles) // 3:
        others = cycles.take(remaining)
        rows = rows_of_motions(others, scale_of(others), inertia)
        found = odd_runs(rows, 1)
        if found is None and len(remaining) >= 2 * POLICY.fewest_compared:
            found = odd_runs(rows, 2)  # two runs that have each other's channel
        if found is None:
            break
        common = found.common
        odd += [remaining[i] for i in found.index]
        remaining = [r for r in remaining if r not in odd]
    others = cycles.take(remaining)
    if not odd or len(remaining) < 2:
        return [], others
    held = Held(cycles, tuple(remaining), inertia, common)
    found_odd = [_describe(cycles.take([i]), held, words) for i in odd]
    return [
        f for i, f in zip(odd, found_odd, strict=True) if f.id != "run_differs" or held.departs(i)
    ], others


@dataclass(frozen=True, eq=False)
class Held:
    """Runs held against the law of some of them.

    Parameters
    ----------
    runs : Motions
    alike : tuple of int
        Those that have a law in common.
    inertia : float or None
    common : float
        RMS that their law leaves of them.
    """

    runs: Motions
    alike: tuple[int, ...]
    inertia: float | None
    common: float

    @cached_property
    def scale(self) -> Scale:
        """Scale of the runs that are alike."""
        return scale_of(self.runs.take(self.alike))

    @cached_property
    def law(self) -> Array:
        """Coefficients of their law."""
        return self.law_of(self.alike)

    def law_of(self, index: Sequence[int]) -> Array:
        """Return the coefficients of the law of some runs."""
        return solve(self.rows(index).products.sum(axis=0))[0]

    def rows(self, index: Sequence[int]) -> Rows:
        """Return rows of some runs."""
        return self.rows_of(self.runs.take(index))

    def rows_of(self, runs: Motions) -> Rows:
        """Return rows of runs."""
        return rows_of_motions(runs, self.scale, self.inertia)

    def left_of(self, run: Motions) -> float:
        """Return the RMS that the law leaves of a single run, in parts of its moment's."""
        return self.rows_of(run).left_by(self.law, 0)

    def departs(self, run: int) -> bool:
        """Return whether a run departs where the others can say what is expected, and its kin does not depart alike.

        No law that was fitted holds beyond the motion that it was fitted to, two runs leave open which of three is odd,
        and what all runs of a frequency show is the joint's. A few rows at the steps of friction are no departure.
        """
        swing = np.ptp(self.runs.motion()[0], axis=1)
        if not 1 < POLICY.another_scale * swing[run] / np.median(swing) < POLICY.another_scale**2:
            return True
        rows, covered = self.rows([run]), self._covered(run)
        if len(self.alike) < POLICY.fewest_compared or np.mean(covered) < POLICY.compared_rows:
            return False
        left = np.sort(np.abs(rows.target[0] - rows.columns[0] @ self.law)[covered])
        within = rms(left[: int(np.ceil((1 - POLICY.stray_rows) * left.size))])
        return within > max(POLICY.run_departure, POLICY.run_contrast * self.common) and not self._kin_too(
            run
        )

    def _covered(self, run: int) -> NDArray[np.bool_]:
        """Return the rows whose angle and rate lie in the convex hull of the others', and inputs in their range.

        None where no other run has as small an amplitude: a law with memory depends on it.
        """
        turn = np.linspace(0, 2 * np.pi, HULL, endpoint=False)
        ways = np.stack([np.cos(turn) / self.scale.angle, np.sin(turn) / self.scale.rate])
        angle, rate, _ = self.runs.take([run]).motion()
        others, their_rate, _ = self.runs.take(self.alike).motion()
        furthest = (np.stack([others.ravel(), their_rate.ravel()], axis=1) @ ways).max(axis=0)
        inside: NDArray[np.bool_] = np.all(np.stack([angle[0], rate[0]], axis=1) @ ways <= furthest, axis=1)
        low, high = np.reshape(self.scale.inputs, (-1, 2)).T
        own = self.runs.inputs[run]
        inside &= np.all((own >= low) & (own <= high), axis=1)
        smallest = float(np.ptp(others, axis=1).min())
        return inside & (smallest <= POLICY.same_level * float(np.ptp(angle)))

    def _kin_too(self, run: int) -> bool:
        """Return whether all other runs of its frequency depart from the law of other frequencies as well."""
        if self.runs.frequency is None:
            return False
        ratio = self.runs.frequency / self.runs.frequency[run]
        same = np.maximum(ratio, 1 / ratio) < POLICY.same_frequency
        kin = [i for i in np.flatnonzero(same).tolist() if i != run]
        rest = [i for i in self.alike if not same[i]]
        if not kin or len(rest) < 2:
            return False
        law = self.law_of(rest)
        left = [self.rows([i]).left_by(law, 0) for i in (run, *kin)]
        return min(left[1:]) > POLICY.kin_departs * left[0]


def _describe(run: Motions, held: Held, words: Words) -> Finding:
    """Return the finding: the factor on moment or angle that restores the law, a delay that does, or that none does."""
    rows = held.rows_of(run)
    expected, target = rows.columns[0] @ held.law, rows.target[0]
    moment_gain = float(target @ expected / max(float(expected @ expected), 1e-300))
    after_moment = rms(target - moment_gain * expected)
    angle_gain, after_angle = _best_angle_gain(run, held)
    departure = rms(target - expected)
    explained = POLICY.gain_explains * min(departure, 1.0)
    if min(after_moment, after_angle) > explained:
        time, after_delay = _best_delay(run, held)
        late = after_delay <= explained
        lags = f"; they agree where it comes {1e3 * abs(time):.3g} ms {'earlier' if time > 0 else 'later'}"
        return Finding(
            "channel_delay" if late else "run_differs",
            run.names[0],
            "moment" if late else None,
            "biases",
            f"the law of the other runs leaves {100 * departure:.3g} % of its {words.moment}, of theirs "
            f"{100 * held.common:.2g} %{lags if late else ''}",
            "the coefficients (k1, k3, c1, M_F) are a mean of two joints or two set-ups",
            "look at what was changed before that run; leave it out, or diagnose it apart",
        )
    on_moment = after_moment <= after_angle
    gain = moment_gain if on_moment else angle_gain
    name = "moment" if on_moment else "angle"
    if gain < 0:
        return Finding(
            "reversed_sign",
            run.names[0],
            name,
            "stops",
            f"its {words.of(name)} is that of the other runs times {gain:.3g}",
            "k1, c1 and M_F of this run have the other sign",
            "reverse the channel (gain = -1), or leave the run out",
        )
    return Finding(
        "gain_differs",
        run.names[0],
        name,
        "biases" if 0.6 < gain < 1.6 else "stops",
        f"its {words.of(name)} is {gain:.4g} times what the law of the other runs has for it (they agree within "
        f"{100 * held.common:.2g} %, it departs by {100 * departure:.3g} %)",
        "k1, k3, c1 and M_F are drawn towards that run",
        "compare gain and unit of that run with the others'; correct it or leave it out",
    )


def _best_angle_gain(run: Motions, held: Held) -> tuple[float, float]:
    """Return the factor of the angle under which the law fits best, and the RMS that it then leaves."""
    size = float(np.abs(run.motion()[0]).max()) / held.scale.angle
    grid = np.concatenate([np.geomspace(0.5, 2.0, 25), np.geomspace(0.2, 5.0, 25) * size, [-1.0]])
    return _least(lambda gain: held.left_of(run.scaled(angle=1 / gain)), grid, lambda at, width: at * width)


def _best_delay(run: Motions, held: Held) -> tuple[float, float]:
    """Return by how much the moment of a steady run lags, s, by the law, and the RMS that remains without the lag."""
    if not isinstance(run, Cycles):
        return 0.0, np.inf
    longest = 0.1 / float(run.frequency[0])

    def left(time: float) -> float:
        return held.left_of(replace(run, moment=run.moment * np.exp(2j * np.pi * run.lines * time)))

    return _least(left, longest * np.linspace(-1, 1, 21), lambda at, width: 2 * longest * width)


def _least(
    left: Callable[[float], float], grid: Array, reach: Callable[[float, float], float]
) -> tuple[float, float]:
    """Return where a function of one number is least, by ever finer grids, and its value there."""
    best = float(min(grid, key=left))
    for width in (0.06, 0.02, 0.007):
        best = float(min(best + reach(best, width) * np.linspace(-1, 1, 7), key=left))
    return best, left(best)
