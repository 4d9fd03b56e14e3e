"""Limits of what channels show of their noise."""

from dataclasses import dataclass

from sindyjoint.policy import SharedPolicy, limit


@dataclass(frozen=True)
class MeasurementPolicy(SharedPolicy):
    """Limits that decide where a signal ends and its noise begins; the meaning of each is in its metadata."""

    cut_off_abruptly: float = limit(
        40.0,
        "density just below a signal's end, in noise floors, beyond which it was cut there instead of fading",
    )
    skirt: float = limit(
        6.0,
        "ratio of the spectral densities of the lower and the upper half of the top third of the band, beyond which "
        "the spectrum falls there as a filter's skirt and holds no noise floor",
        source="white noise has 1, a first-order low-pass at half the band 8",
    )
    shared_below_end: float = limit(
        0.2,
        "mean coherence of angle and moment, by power, just below an abrupt end, below which what ends is noise that a "
        "filter cut there",
        source="filtered noise has 0.02, the last lines of a multisine 0.7 or more",
    )
    noise_changes: float = limit(
        0.55,
        "share of sign changes of third differences from which they are noise",
        source="white noise has 0.77, a smooth signal hardly any",
    )


POLICY = MeasurementPolicy()
