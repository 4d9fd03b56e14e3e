"""Limits of what a campaign can show."""

from __future__ import annotations

from dataclasses import dataclass

from sindyjoint.policy import limit

JUDGEMENT = "chosen by judgement"


@dataclass(frozen=True)
class SoundnessPolicy:
    """Limits that decide what is warned of; the meaning of each is in its metadata."""

    same_level: float = limit(
        1.15, "ratio of the ranges of angle below which all runs have one level", source=JUDGEMENT
    )
    same_frequency: float = limit(
        1.02, "ratio of frequencies below which all runs have one", source=JUDGEMENT
    )
    large_drop: float = limit(
        0.25, "share of a record left out as start-up from which it is reported", source=JUDGEMENT
    )
    few_periods: int = limit(
        8, "periods below which a change in time cannot be seen", unit="periods", source=JUDGEMENT
    )
    elastic_share: float = limit(
        0.2,
        "share of the moment's RMS from which the elastic moment has a definite sign",
        source="a small part of the whole may well fall",
    )
    censored_sigmas: float = limit(
        3.0,
        "noise levels from the limit of a saturated channel within which its running mean must not come for a sample "
        "to be used",
        source="noise outwards is cut off there; 1 in 1000 samples at three levels",
    )
    hardly_moving: float = limit(
        0.2, "share of its samples in which a run must move not to be warned of", source=JUDGEMENT
    )


POLICY = SoundnessPolicy()
