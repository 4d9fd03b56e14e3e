"""Where a gap lies: regions that hold more of it than their share of the samples."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import dataclass

import numpy as np

from sindyjoint.diagnosis.policy import DiagnosisPolicy


@dataclass(frozen=True)
class Place:
    """A region that holds more of the gap than its share of the samples."""

    axis: str
    range: tuple[float, float] | str
    share: float
    words: str


def weigh_region(
    axis: str,
    span: tuple[float, float] | str,
    share: float,
    samples: float,
    words: str,
    policy: DiagnosisPolicy,
) -> Iterator[tuple[float, Place]]:
    """Yield the region and how much it tells, if it tells enough: share·ln(share / samples).

    Parameters
    ----------
    axis : str
    span : (float, float) or str
    share, samples : float
        Of the gap, and of the samples, from 0 to 1.
    words : str
        What is told of it.
    policy : DiagnosisPolicy
    """
    if share > policy.region_share and share > policy.region_excess * samples:
        yield share * float(np.log(share / max(samples, 1e-3))), Place(axis, span, share, words)


def most_telling(
    regions: Iterable[tuple[float, Place]], policy: DiagnosisPolicy, one_per_axis: bool = False
) -> tuple[Place, ...]:
    """Return the regions that tell most; of one axis bands that do not overlap, or the first one only."""
    kept: list[Place] = []
    for _, place in sorted(regions, key=lambda each: -each[0]):
        same = [other for other in kept if other.axis == place.axis]
        if not any(one_per_axis or _overlap(other.range, place.range) for other in same):
            kept.append(place)
    return tuple(kept[: policy.most_regions])


def _overlap(first: tuple[float, float] | str, second: tuple[float, float] | str) -> bool:
    if isinstance(first, str) or isinstance(second, str):
        return False
    return max(first[0], second[0]) < min(first[1], second[1])
