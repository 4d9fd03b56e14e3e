"""Limits of the comparison of many joints."""

from __future__ import annotations

from dataclasses import dataclass

from sindyjoint.policy import limit


@dataclass(frozen=True)
class BatchPolicy:
    """Limits that decide which joints stand out and what is a trend; the meaning of each is in its metadata."""

    level: float = limit(
        0.05, "level of outliers and trends, over all that was looked for", source="convention"
    )
    fewest_joints: int = limit(
        5,
        "fewest joints of which a scatter is reported",
        source="with fewer it cannot be distinguished from chance",
    )
    rejected: float = limit(
        0.0027,
        "probability of a joint under the robust distribution below which it does not join the first estimate",
        source="three standard deviations",
    )


POLICY = BatchPolicy()
