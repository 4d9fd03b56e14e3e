"""Limits of what a campaign can show."""

from __future__ import annotations

from dataclasses import dataclass

from sindyjoint.policy import limit


@dataclass(frozen=True)
class SoundnessPolicy:
    """Limits that decide what is warned of; the meaning of each is in its metadata."""

    same_level: float = limit(1.15, "ratio of the ranges of angle below which all runs have one level")
    same_frequency: float = limit(1.02, "ratio of frequencies below which all runs have one")
    large_drop: float = limit(0.25, "share of a record left out as start-up from which it is reported")
    few_periods: int = limit(8, "periods below which a change in time cannot be seen", unit="periods")
    elastic_share: float = limit(
        0.2,
        "share of the moment's RMS from which the elastic moment has a definite sign",
        source="a small part of the whole may well fall",
    )
    hardly_moving: float = limit(0.2, "share of its samples in which a run must move not to be warned of")


POLICY = SoundnessPolicy()
