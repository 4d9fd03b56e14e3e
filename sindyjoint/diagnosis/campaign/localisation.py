"""Where a campaign's gap lies: in angle, rate, direction, phase, and in which runs."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np
from numpy.typing import NDArray

from sindyjoint.diagnosis.campaign.regression import GapRegression
from sindyjoint.diagnosis.campaign.run_rows import GapRun
from sindyjoint.diagnosis.localisation import Place, most_telling, weigh_region
from sindyjoint.text import in_words_of


def locate_gap(problem: GapRegression, motion: str = "rotation") -> tuple[Place, ...]:
    """Return the regions that hold most of the gap beyond noise, compared with their share of the samples.

    Of bands that overlap the one that tells most is named.

    Parameters
    ----------
    problem : GapRegression
    motion : {"rotation", "translation"}
        What the words speak of; axes are named ``angle`` and ``rate`` for both.
    """
    sides = in_words_of(motion, "angles")
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
        samples, share = float(mask.mean()), float(excess[mask].sum()) / total
        text = f"{words}: {100 * share:.0f} % of the gap in {100 * samples:.0f} % of the samples"
        places.extend(weigh_region(axis, span, share, samples, text, problem.policy))

    for axis, values, what in (
        ("angle", np.abs(angle), in_words_of(motion, "|angle|")),
        ("rate", np.abs(rate), in_words_of(motion, "|rate|")),
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
    return most_telling(places, problem.policy)


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
