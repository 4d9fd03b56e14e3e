"""Where a gap lies: regions that hold more of it than their share of the samples."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from sindyjoint.diagnosis.policy import DiagnosisPolicy

Span = tuple[float, float] | str


@dataclass(frozen=True)
class Place:
    """A region that holds more of the gap than its share of the samples."""

    axis: str
    range: Span
    share: float
    words: str


class Regions:
    """The regions of some samples that hold more of a gap than their share of them, each with its information.

    Parameters
    ----------
    excess : ndarray, shape (n,)
        Square of the gap beyond noise at each sample; not all zero.
    samples : str
        What the samples are called.
    policy : DiagnosisPolicy
    """

    def __init__(self, excess: NDArray[np.float64], samples: str, policy: DiagnosisPolicy) -> None:
        self.found: list[tuple[float, Place]] = []
        self._excess, self._samples, self._policy = excess, samples, policy
        self._total = float(excess.sum())

    def add(self, axis: str, span: Span, words: str, mask: NDArray[np.bool_]) -> None:
        """Keep the region of some samples, if it is informative enough."""
        samples, share = float(mask.mean()), float(self._excess[mask].sum()) / self._total
        text = f"{words}: {100 * share:.0f} % of the gap in {100 * samples:.0f} % of the {self._samples}"
        self.weigh(axis, span, share, samples, text)

    def weigh(self, axis: str, span: Span, share: float, samples: float, words: str) -> None:
        """Keep a region by its shares of gap and samples, if it is informative enough: share·ln(share / samples)."""
        if share > self._policy.region_share and share > self._policy.region_excess * samples:
            telling = share * float(np.log(share / max(samples, 1e-3)))
            self.found.append((telling, Place(axis, span, share, words)))


def most_informative(
    regions: Iterable[tuple[float, Place]], policy: DiagnosisPolicy, one_per_axis: bool = False
) -> tuple[Place, ...]:
    """Return the most informative regions; of one axis bands that do not overlap, or the first one only."""
    kept: list[Place] = []
    for _, place in sorted(regions, key=lambda each: -each[0]):
        same = [other for other in kept if other.axis == place.axis]
        if not any(one_per_axis or _overlap(other.range, place.range) for other in same):
            kept.append(place)
    return tuple(kept[: policy.most_regions])


def _overlap(first: Span, second: Span) -> bool:
    if isinstance(first, str) or isinstance(second, str):
        return False
    return max(first[0], second[0]) < min(first[1], second[1])
