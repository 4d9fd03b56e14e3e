"""Where a gap lies: the regions of the motion that hold more of it than their share of the samples."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from sindyjoint.diagnosis.campaign.ranking import Problem
from sindyjoint.diagnosis.campaign.run_rows import GapRun


@dataclass(frozen=True)
class Place:
    """A region that holds more of the gap than its share of the samples."""

    axis: str
    range: tuple[float, float] | str
    share: float
    words: str


# What a place is called, by kind of motion: angle and rate, several angles.
NAMES = {
    "rotation": ("angle", "rate", "angles"),
    "translation": ("displacement", "velocity", "displacements"),
}


def where(problem: Problem, motion: str = "rotation", most: int = 4) -> tuple[Place, ...]:
    """Return the regions that hold most of the gap beyond noise, compared with their share of the samples.

    Of bands that overlap the one that tells most is named.

    Parameters
    ----------
    problem : Problem
    motion : {"rotation", "translation"}
        What the words speak of; axes are named ``angle`` and ``rate`` for both.
    most : int
    """
    angle_name, rate_name, sides = NAMES[motion]
    excess = np.maximum(problem.residual**2 - 1.0, 0.0)
    total = float(excess.sum())
    if total <= 0:
        return ()
    angle, rate = (
        np.concatenate([getattr(run, name) for run in problem.runs]) / (largest or 1.0)
        for name, largest in (("angle", problem.reference.angle), ("rate", problem.reference.rate))
    )
    places: list[tuple[float, Place]] = []

    def add(axis: str, mask: NDArray[np.bool_], span: tuple[float, float] | str, words: str) -> None:
        rows = float(mask.mean())
        share = float(excess[mask].sum()) / total
        if 0 < rows < 0.95 and share > 1.3 * rows and share > 0.15:
            text = f"{words}: {100 * share:.0f} % of the gap in {100 * rows:.0f} % of the samples"
            places.append((share * np.log(share / rows), Place(axis, span, share, text)))

    for axis, values, what in (
        ("angle", np.abs(angle), f"|{angle_name}|"),
        ("rate", np.abs(rate), f"|{rate_name}|"),
    ):
        for low, high in ((0.0, 0.1), (0.0, 0.25), (0.25, 0.5), (0.5, 0.75), (0.75, 1.01)):
            mask = (values >= low) & (values < high)
            add(
                axis,
                mask,
                (low, min(high, 1.0)),
                f"{what} from {100 * low:.0f} % to {100 * min(high, 1.0):.0f} % of the largest",
            )
    add("side", angle > 0, "positive angle", f"at positive {sides}")
    add("side", angle < 0, "negative angle", f"at negative {sides}")
    add("direction", rate > 0, "forward", "in forward motion")
    add("direction", rate < 0, "backward", "in backward motion")
    after = angle * rate < 0
    add("phase", after, "after reversal", "after the reversals, on the way back to zero")
    add("phase", ~after, "before reversal", "before the reversals, on the way out")
    for axis, label, rows in _labelled(problem.runs):
        add(axis, rows, label, f"{axis} {label}")
    places.sort(key=lambda each: -each[0])
    return tuple(_apart([place for _, place in places])[:most])


def _labelled(runs: Sequence[GapRun]) -> Iterator[tuple[str, str, NDArray[np.bool_]]]:
    """Yield each frequency, level and run by name, and which rows are of it."""
    for axis, labels in (
        ("frequency", [f"{r.motion.frequency:.3g} Hz" if r.motion.frequency else "" for r in runs]),
        ("level", [r.level or "" for r in runs]),
        ("run", [r.name for r in runs]),
    ):
        rows = np.concatenate(
            [np.full(r.target.size, label, dtype=object) for r, label in zip(runs, labels, strict=True)]
        )
        for label in dict.fromkeys(labels):
            if label:
                yield axis, label, rows == label


def _apart(places: Sequence[Place]) -> list[Place]:
    """Return the places less those whose band lies in, or around, one that comes before."""
    kept: list[Place] = []
    for place in places:
        if not any(other.axis == place.axis and _nested(other.range, place.range) for other in kept):
            kept.append(place)
    return kept


def _nested(first: tuple[float, float] | str, second: tuple[float, float] | str) -> bool:
    if isinstance(first, str) or isinstance(second, str):
        return False
    return max(first[0], second[0]) < min(first[1], second[1])
