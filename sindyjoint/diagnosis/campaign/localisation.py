"""Where a campaign's gap lies: in angle, rate, direction, phase, and in which runs."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np
from numpy.typing import NDArray

from sindyjoint.diagnosis.campaign.regression import GapRegression
from sindyjoint.diagnosis.campaign.rows.run import GapRun
from sindyjoint.diagnosis.parts import Place, Regions, most_informative
from sindyjoint.text import in_words_of


def locate_gap(problem: GapRegression, motion: str = "rotation") -> tuple[Place, ...]:
    """Return the regions that hold most of the gap beyond noise, compared with their share of the samples.

    Of bands that overlap the most informative one is named; words speak of the kind of motion, axes are called
    ``angle`` and ``rate`` for both.
    """
    sides = in_words_of(motion, "angles")
    excess = np.maximum(problem.residual**2 - 1.0, 0.0)
    if not excess.any():
        return ()
    angle, rate = (
        np.concatenate([getattr(run, name) for run in problem.runs]) / (largest or 1.0)
        for name, largest in (("angle", problem.reference.angle), ("rate", problem.reference.rate))
    )
    regions = Regions(excess, "samples", problem.policy)
    for axis, values, what in (
        ("angle", np.abs(angle), in_words_of(motion, "|angle|")),
        ("rate", np.abs(rate), in_words_of(motion, "|rate|")),
    ):
        for low, high in ((0.0, 0.1), (0.0, 0.25), (0.25, 0.5), (0.5, 0.75), (0.75, 1.01)):
            top = min(high, 1.0)
            words = f"{what} from {100 * low:.0f} % to {100 * top:.0f} % of the largest"
            regions.add(axis, (low, top), words, (values >= low) & (values < high))
    after = angle * rate < 0
    for axis, span, words, mask in (
        ("side", "positive angle", f"at positive {sides}", angle > 0),
        ("side", "negative angle", f"at negative {sides}", angle < 0),
        ("direction", "forward", "in forward motion", rate > 0),
        ("direction", "backward", "in backward motion", rate < 0),
        ("phase", "after reversal", "after the reversals, on the way back to zero", after),
        ("phase", "before reversal", "before the reversals, on the way out", ~after),
    ):
        regions.add(axis, span, words, mask)
    for axis, label, rows in _labelled(problem.runs):
        regions.add(axis, label, f"{axis} {label}", rows)
    return most_informative(regions.found, problem.policy)


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
