"""Limits that decide an answer, of each folder one record; those of a diagnosis stand with it."""

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


MEASUREMENT = MeasurementPolicy()


SIMULATED = "measured on simulated stick–slip runs"


@dataclass(frozen=True)
class StatesPolicy(SharedPolicy):
    """Limits that decide what the force states are; the meaning of each is in its metadata."""

    unsteady: float = limit(
        5.0,
        "a period further from the later ones than so many of their median distances belongs to the start-up",
    )
    harmonic_significance: float = limit(
        2.5,
        "standard errors beyond which the amplitude of a harmonic is signal",
        source=f"{SIMULATED}: isolated high harmonics multiply noise by their order and cost 1.8 % in c1 at 5 % noise",
    )
    harmonic_misses: int = limit(
        4,
        "harmonics in a row that are not significant, at which the spectrum has ended in noise",
        source=f"{SIMULATED}: ending there costs 0.5 % in c1 at 5 % noise",
    )
    shortest_repetition: int = limit(256, "fewest samples of such a period", unit="samples")
    periodic_rate_share: float = limit(
        0.05, "share of the peak rate below which a sample of a periodic run is reversal"
    )
    periodic_guard: float = limit(
        0.5,
        "guard on each side of a reversal: the length over which a truncated series rings",
        unit="periods of the highest kept harmonic, or of the cut-off of a run that does not repeat and sticks",
    )
    periodic_guard_limit: float = limit(0.03, "the same at most", unit="periods of the excitation")
    coarse_period: float = limit(
        24.0,
        "samples per period below which the guard is one sample instead of two: two would leave none of ten",
        unit="samples",
    )
    dwelling: float = limit(
        0.47,
        "samples within 5 % of the peak rate, as a share of those within 15 %, beyond which the joint sticks instead "
        "of passing through zero rate",
        source="a third at constant acceleration; 0.5 to 0.9 of simulated joints that stick",
    )
    passing_rate_share: float = limit(
        0.02,
        "share of the peak rate below which a sample is reversal, where the joint only passes through zero: its slow "
        "samples distinguish friction from damping",
    )
    passing_guard: float = limit(
        0.25, "guard on each side of a reversal of such a run", unit="periods of the cut-off"
    )
    broadband_guard_limit: float = limit(
        0.1, "either guard at most, as a share of the usual spacing of reversals"
    )


STATES = StatesPolicy()


@dataclass(frozen=True)
class EquationPolicy(SharedPolicy):
    """Limits that decide what a model may be called; the meaning of each is in its metadata."""

    visible_gravity: float = limit(
        0.3,
        "angle from which sin(theta) is a candidate beside the powers, if the library is the default one",
        unit="rad",
        source="there the fifth power of the angle is 0.007 % of it: below, no test tells gravity from k1 and k3",
    )


EQUATION = EquationPolicy()


@dataclass(frozen=True)
class DiscoveryPolicy(SharedPolicy):
    """Limits that decide which terms are found; the meaning of each is in its metadata."""

    term_significance: float = limit(
        5.0,
        "least ratio of a coefficient to its standard error",
        source="simulated joints: among twenty candidates tried at every size, pure noise reaches 4.5 once in some "
        "hundred campaigns",
    )
    least_dependence: float = limit(
        0.0004,
        "least unique share of a coefficient's dependence on an input",
        source="errors of sensors and processing are alike at all levels of an input; at 0.002 random joints at 1 % "
        "noise lost one in sixteen of the dependences that move a coefficient by more than three intervals",
    )
    share_of_residual: float = limit(
        0.15,
        "least unique share of a term in the RMS of the residual where the blocks of a run share one estimate of the "
        "motion",
        source="low-passed virtual tests at 5 % noise: most terms that were not there carried below 0.13, nearly all "
        "true ones above 0.2",
    )
    largest_set: int = limit(
        9,
        "largest set of terms that resampled campaigns may choose",
        source="beyond ten terms a law is no law",
    )
    longest_delay: float = limit(0.02, "largest time delay between the channels that is searched", unit="s")
    least_delay: float = limit(
        2e-5, "least time delay that is reported", unit="s", source="the method's error on simulated joints"
    )
    test_functions: int = limit(
        16,
        "test functions of the weak form over one moving segment",
        source="32 virtual tests at 1 and 5 % noise: 16 and 32 find the exact terms 30 times, 8 find them 23 times",
    )
    test_half_width: float = limit(
        0.15,
        "half width of a test function as a share of its segment",
        source="virtual tests at 5 % noise: at half and at three times of it more terms are lost",
    )
    shortest_segment: int = limit(
        16,
        "least samples of a moving segment in the weak form: a test function then spans four",
    )


DISCOVERY = DiscoveryPolicy()


@dataclass(frozen=True)
class ResponsePolicy(SharedPolicy):
    """Limits that decide how a response is simulated, compared and refined; the meaning of each is in its metadata."""

    runaway: float = limit(
        1e4,
        "distance from the measured angles, in their range, at which a simulation without a softening limit is ended: "
        "with negative damping its amplitude would grow in ever shorter steps",
    )
    drive_band: float = limit(0.8, "share of the angle's band below which the band of the drive must end")
    fewest_initial: int = limit(
        4, "fewest samples from which a free run estimates its initial state", unit="samples"
    )
    sunk_periods: float = limit(
        3.0,
        "a vibration that ends so many periods before the other has no amplitude from there on",
        unit="periods",
    )
    reach: float = limit(
        0.5,
        "farthest that a parameter is searched: a coefficient until its term carries so much more or less of the "
        "moment, or of itself, a gain by that share, a delay in periods of the fastest motion, where a run starts "
        "in the signal's RMS; a standard error beyond this share of a parameter's size leaves it undetermined",
    )
    element_range: float = limit(
        20.0,
        "a number of an element may be refined up to so many times itself, and down to that part of it; other starts "
        "of its nonlinear parameters lie a third of that way, as a logarithm",
    )
    shape_range: float = limit(2.0, "the same of a nonlinear parameter without a unit")


RESPONSE = ResponsePolicy()


@dataclass(frozen=True)
class SubstructurePolicy(SharedPolicy):
    """Limits that decide what of a joint inside a structure is known; the meaning of each is in its metadata."""

    band: float = limit(
        0.37,
        "share of the sampling rate up to which harmonics of the sensors are used",
        source="above it recorders' filters fall; at 0.25 the missing harmonics cost 0.7 % in k3, at 0.35 0.3 % "
        "(noise-free pulse rig)",
    )
    line: float = limit(
        3.5,
        "standard errors beyond which a harmonic is signal, where a drive has many lines and each may be there or not",
    )
    edge: float = limit(
        4.0,
        "periods of the highest harmonic left out at either end of a record that does not repeat: its series rings",
    )
    together: float = limit(
        0.98, "correlation of the errors of two joints' moments beyond which they show only together"
    )
    refuting_share: float = limit(
        0.001,
        "share of the moment below which terms beyond the paper's refute nothing: masses and beams are hardly "
        "described more accurately, and what the recovery leaves of records that do not repeat looks like terms",
        source="by judgement; terms that were not there had at most 0.0001 (a sweep, a blow, 0.01 % noise)",
    )
    rows_per_unknown: float = limit(
        5.0,
        "samples in which a joint moves for each number of the slow part of its angle that is found with the law; with "
        "fewer, terms beside those that explain the moment are not sought, and none is refuted",
        source="3 after blows to the pulse rig (two campaigns), which made terms of what is beyond the band",
    )


SUBSTRUCTURE = SubstructurePolicy()


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


SOUNDNESS = SoundnessPolicy()


@dataclass(frozen=True)
class PlanningPolicy(SharedPolicy):
    """Limits that decide which runs are planned; the meaning of each is in its metadata."""

    joints: int = limit(12, "joints drawn from the range over which a plan is averaged")
    limit_share: float = limit(
        0.98,
        "share of a limit of the actuator that is used",
        source="the corners of the range are simulated, joints between them are not",
    )
    most_runs: int = limit(40, "most runs of a plan that is given the duration of a run")
    frequencies: int = limit(5, "frequencies of the band among which is chosen")
    levels: tuple[float, ...] = limit(
        (1.0, 0.84, 0.68, 0.53, 0.38),
        "levels among which is chosen, as shares of the highest that is allowed; the plain grid has every second one",
    )
    fewest_levels: int = limit(
        2,
        "different levels at each of these",
        source="terms of angle and rate are nearly collinear along one sine",
    )


PLANNING = PlanningPolicy()


@dataclass(frozen=True)
class VerdictPolicy(SharedPolicy):
    """Limits that decide a verdict; the meaning of each is in its metadata."""

    predicts: float = limit(
        1.1,
        "ratio of two RMS errors up to which they are one: gap over noise floor, held-out error over residual",
        source="500 campaigns (results/calibration.json): periodic runs, multisines and sweeps leave at most 1.06 "
        "floors under the true law; laws that lack an effect of 3 to 12 % (seeds 7001 to 7004) leave 1.02 to 6.8",
    )


JUDGEMENT = VerdictPolicy()


@dataclass(frozen=True)
class EvidencePolicy(SharedPolicy):
    """When a set of effects wins over one with less in it, and when two sets cannot be told apart."""

    chance: float = limit(
        0.001,
        "probability that anything is added where there is nothing but noise, all candidates tried",
        source="error rate, measured on simulated noise in the rows of the campaign itself",
    )
    column_error: float = limit(
        0.02,
        "relative error of an effect's column (motions are processed, nonlinear parameters rounded), and share of the "
        "moment that a term of the model carries at least",
        source="free decays with Coulomb friction leave 1 % of what it explains",
    )


EVIDENCE = EvidencePolicy()
