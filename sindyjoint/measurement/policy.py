"""Limits of what channels show of their noise."""

from dataclasses import dataclass

from sindyjoint.policy import limit


@dataclass(frozen=True)
class MeasurementPolicy:
    """Limits that decide where a signal ends and its noise begins; the meaning of each is in its metadata."""

    signal_to_noise: float = limit(
        4.0, "ratio of spectral densities at which a signal falls to its noise floor"
    )
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
    white_differences: float = limit(
        1.5,
        "ratio of the noise by fourth differences at two samples' distance to that at one, beyond which they are the "
        "signal's",
        source="white noise has 1, a smooth signal 16",
    )
    estimates_agree: float = limit(
        2.0,
        "ratio of the noise by the spectrum to that by differences beyond which the top of the spectrum is the tail of "
        "the signal's steps",
    )
    shared_top: float = limit(
        0.5,
        "median coherence of angle and moment in the top third of the band, beyond which most of it is signal",
        source="half of the power",
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
