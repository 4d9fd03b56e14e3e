"""Limits of what data can show: a few, each shared by all detectors that ask the same question."""

from dataclasses import dataclass

from sindyjoint.policy import SharedPolicy, limit

REFEREE = "between what 69 injected faults and sound campaigns of random joints show"


@dataclass(frozen=True)
class SoundnessPolicy(SharedPolicy):
    """Limits that decide what is warned of; the meaning of each is in its metadata."""

    # How sure: error rates, and what takes their place where the distribution is not known.
    false_alarm: float = limit(
        1e-4,
        "expected number of false alarms in one record, of which follows how long an odd stretch must be",
    )
    contrast: float = limit(
        2.5,
        "step in a series of periods over the ranges of the four periods on either side, of two twice that; and ratio "
        "of the slopes of both halves of a drift up to which it is one",
        source="simulated white noise has one step in 5 000 series of 9 to 12 periods, none in 20 000 of 17 or more",
    )
    # How much: shares of a channel's range, amplitude or RMS.
    # How many.
    few_periods: int = limit(8, "periods below which a change in time cannot be seen", unit="periods")
    few_samples: float = limit(16.0, "samples per period below which processing shows in coefficients")
    fewest_equal: int = limit(
        6, "samples in a row, at one value or at a limit, that are no chance in coarse steps", unit="samples"
    )
    copied_samples: int = limit(16, "equal samples in a row that are a copy and no chance", unit="samples")
    # Single samples.
    saturated_arrival: float = limit(
        5.5,
        "ratio of the distances from its limit 9 and 3 samples away up to which a channel arrives with a slope",
        source="3 for a straight line, 9 for a standstill that is reached smoothly",
    )
    # The law that runs have in common.
    departs: float = limit(
        0.04, "RMS, in parts of a moment's, by which a run departs from the law of the others", source=REFEREE
    )
    explains: float = limit(
        0.4, "what a fault, once undone, leaves of a mean square, at most, to explain it", source=REFEREE
    )
    # What cannot be, or says nothing.
    largest_angle: float = limit(
        3.4, "largest plausible angle", unit="rad", source="half a turn and a margin"
    )
    largest_stroke: float = limit(10.0, "largest plausible displacement", unit="m")
    smallest_motion: float = limit(
        1e-9,
        "amplitude below which no joint moves",
        unit="rad or m",
        source="below any sensor of vibration tests",
    )
    far_offset: float = limit(0.5, "middle of the motion in amplitudes from which the zero is far from it")
    wrong_frequency: float = limit(
        0.004, "relative error of the declared frequency that is reported", source=REFEREE
    )
    # Sensors held against each other.
    gain: float = limit(
        0.03,
        "relative error of a gain, or share of energy given off or of the mains, that is reported",
        source="what sensors are calibrated to",
    )
    usual_uncertainty: float = limit(
        0.02,
        "relative standard uncertainty of every stiffness and mass of a structure that is assumed where less is stated",
        source="beams and masses are hardly known better; what it explains is no fault of a sensor",
    )
    usual_loss: float = limit(
        1.0,
        "the same of every beam's loss factor",
        source="viscous, hysteretic and modal damping that are alike in the first mode differ by more in the fifth",
    )


POLICY = SoundnessPolicy()
