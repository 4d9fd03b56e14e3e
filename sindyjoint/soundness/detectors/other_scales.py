"""Runs in another unit than the others: a factor that units are mistaken by, or a sign, restores the common law."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import TypeVar

import numpy as np
from numpy.typing import NDArray

from sindyjoint.numeric import Array
from sindyjoint.soundness.detectors.common_law import Motions, rows_of_motions, scale_of, solve
from sindyjoint.soundness.finding import Finding
from sindyjoint.soundness.policy import POLICY
from sindyjoint.soundness.words import Words

M = TypeVar("M", bound=Motions)
# What units are mistaken by: degrees, thousandths, kgf, lbf, inches.
MISTAKES = {
    "rad and deg": 180 / np.pi,
    "a unit and its thousandth": 1e3,
    "N and kgf": 9.80665,
    "N and lbf": 4.4482216,
    "mm and inch": 25.4,
}
# Places at which runs are parted by their stiffness, and mistakes that are tried at each.
SPLITS, NEAREST = 3, 2


@dataclass(frozen=True, eq=False)
class OtherScale:
    """Runs of which one channel is another factor times what it is.

    Parameters
    ----------
    group : ndarray of bool, shape (r,)
    channel : str
    factor : float
    left : float
        RMS that one law leaves of all runs without that factor, in parts of their moments'.
    """

    group: NDArray[np.bool_]
    channel: str
    factor: float
    left: float


def find_other_scales(runs: M, inertia: float | None, words: Words) -> tuple[list[Finding], M]:
    """Return findings on the runs, half of them at most, that are in another unit than the rest, and the rest."""
    if len(runs) < POLICY.fewest_compared:
        return [], runs
    before = _misfit(runs, inertia)
    if before < POLICY.run_departure / np.sqrt(len(runs)):
        return [], runs
    tried = [
        OtherScale(group, channel, factor, _misfit(_without(runs, group, channel, factor), inertia))
        for group, channel, factor in _hypotheses(runs)
    ]
    best = min(tried, key=lambda one: one.left, default=None)
    if best is None or best.left > min(POLICY.common_misfit, POLICY.common_gain * before):
        return [], runs
    found = [
        _describe(name, best, before, words) for name, odd in zip(runs.names, best.group, strict=True) if odd
    ]
    return found, runs.take(np.flatnonzero(~best.group).tolist())


def _hypotheses(runs: Motions) -> Iterator[tuple[NDArray[np.bool_], str, float]]:
    """Yield groups of runs, a channel, and what it may be multiplied by: groups parted by sign or by size of M/θ.

    The size of M/θ is no proof, for a joint's stiffness depends on the level: it says where to look, the law decides.
    """
    load, angle = runs.load(), runs.motion()[0]
    load, angle = (x - x.mean(axis=1, keepdims=True) for x in (load, angle))
    down = np.mean(load * angle, axis=1) < 0
    if 0 < down.sum() < len(runs):
        yield down if down.sum() <= len(runs) / 2 else ~down, "moment", -1.0
    size = np.log(np.maximum(np.std(load, axis=1), 1e-300) / np.maximum(np.std(angle, axis=1), 1e-300))
    order = np.sort(size)
    known = np.array(list(MISTAKES.values()))
    for at in np.argsort(-np.diff(order))[:SPLITS]:
        above = size > order[at]
        group = above if above.sum() <= len(runs) / 2 else ~above
        apart = float(np.median(size[group]) - np.median(size[~group]))
        for factor in known[np.argsort(np.abs(np.log(known) - abs(apart)))[:NEAREST]]:
            yield group, "moment", float(factor ** np.sign(apart))
            yield group, "angle", float(factor ** -np.sign(apart))


def _without(runs: M, group: NDArray[np.bool_], channel: str, factor: float) -> M:
    gains: Array = np.where(group, 1 / factor, 1.0)
    return runs.scaled(moment=gains) if channel == "moment" else runs.scaled(angle=gains)


def _misfit(runs: Motions, inertia: float | None) -> float:
    """Return the RMS that one law leaves of runs, in parts of their moments'."""
    rows = rows_of_motions(runs, scale_of(runs), inertia)
    return float(np.sqrt(solve(rows.products.sum(axis=0))[1] / len(runs)))


def _describe(run: str, other: OtherScale, before: float, words: Words) -> Finding:
    channel = words.of(other.channel)
    count = int(other.group.sum())
    alike = f"; so are {count} of {other.group.size} runs" if count > 1 else ""
    fits = f"one law then leaves {100 * other.left:.2g} % of the {words.moment}, {100 * before:.2g} % without"
    if other.factor < 0:
        return Finding(
            "reversed_sign",
            run,
            other.channel,
            "stops",
            f"its {channel} has the other sign than in the other runs{alike}: {fits}",
            "k1, c1 and M_F of this run have the other sign",
            "reverse the channel (gain = -1), or leave the run out",
        )
    ratio = max(other.factor, 1 / other.factor)
    mistake = next(name for name, factor in MISTAKES.items() if np.isclose(factor, ratio))
    return Finding(
        "gain_differs",
        run,
        other.channel,
        "stops",
        f"its {channel} is {other.factor:.4g} times that of the other runs, as {mistake} are{alike}: {fits}",
        "k1, k3, c1 and M_F are those of two scales",
        f"give the {channel} of these runs the unit of the others, or the others theirs",
    )
