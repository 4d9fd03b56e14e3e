"""Where a gap lies: the regions of the motion that hold more of it than their share of the samples."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from sindyjoint.discrepancy.naming import Problem


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
    runs = problem.runs
    join = {
        name: np.concatenate([getattr(r, name) for r in runs]) for name in ("angle", "rate", "acceleration")
    }
    angle, rate = (
        join["angle"] / (problem.reference.angle or 1.0),
        join["rate"] / (problem.reference.rate or 1.0),
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
                add(axis, rows == label, label, f"{axis} {label}")
    places.sort(key=lambda each: -each[0])
    return tuple(place for _, place in places[:most])
