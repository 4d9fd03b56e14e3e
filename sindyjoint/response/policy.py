"""Limits of the comparison of a model with a measured response, and of its refinement."""

from __future__ import annotations

from dataclasses import dataclass

from sindyjoint.policy import limit


@dataclass(frozen=True)
class ResponsePolicy:
    """Limits that decide how a response is simulated, compared and refined; the meaning of each is in its metadata."""

    restoring_share: float = limit(
        0.1,
        "least elastic moment, as a share of the moment's RMS, with which a joint is simulated without "
        "restarts",
    )
    runaway: float = limit(
        1e4,
        "distance from the measured angles, in their range, at which a simulation without a softening limit is ended: "
        "with negative damping its amplitude would grow in ever shorter steps",
    )
    input_moves: float = limit(
        0.01,
        "largest change of the moment within a run, in its RMS, that an input may make where it is held at its mean",
    )
    pure: float = limit(
        1.5,
        "moment beside its sinusoid, over noise, from which the motion was the drive",
        source="calibrated on virtual tests",
    )
    sinusoidal: float = limit(
        6.0, "harmonics of an angle, in standard errors, up to which it is a sinusoid that was prescribed"
    )
    unanswered: float = limit(
        1.5,
        "power of the angle that the moment would make above the angle's band, over the noise there, from which a "
        "motion that does not repeat was the drive",
        source="prescribed motions of joints of another integrator have 2.6 to 98, driven ones up to 0.5",
    )
    completion_follows: float = limit(
        0.15,
        "RMS difference of simulated and measured angle, relative to the angle's, up to which a simulation completes "
        "the states of a run",
    )
    completion_chance: float = limit(
        3.0,
        "standard deviations of the noise's mean square by which a completed angle may miss the measured one by more",
        source="one run in a thousand",
    )
    harmonic_as_measured: float = limit(
        10.0, "standard errors from which a harmonic is the measured one", source="known to a tenth"
    )
    drive_band: float = limit(0.8, "share of the angle's band below which the band of the drive must end")
    inertia_band: float = limit(0.5, "share of the angle's band above which an exciter inertia is looked for")
    inertia_correlation: float = limit(
        0.5, "least correlation of acceleration and moment with which an exciter inertia is seen"
    )
    inertia_significance: float = limit(
        3.0,
        "the same in standard errors of a correlation of as many harmonics",
        source="two or three harmonics agree by chance",
    )
    free_share: float = limit(
        0.1,
        "a joint vibrates freely while the moment stays below this share of its scale, for all but this share of the "
        "time",
    )
    same_inertia: float = limit(
        1e-3, "relative difference up to which model and campaign have the same inertia"
    )
    fewest_initial: int = limit(
        4, "fewest samples from which a free run estimates its initial state", unit="samples"
    )
    initial_range: float = limit(
        0.5, "widest correction of the measured initial angle and rate of a free run, in their RMS"
    )
    fewest_draws: int = limit(5, "fewest simulated sets of coefficients of which a band is made")
    half_cycle_significance: float = limit(
        6.0, "least half-cycle between two turning points, in RMS of the smoothed noise"
    )
    least_half_cycle: float = limit(0.002, "the same as a share of the whole range of the signal")
    sunk_periods: float = limit(
        3.0,
        "a vibration that ends so many periods before the other has no amplitude from there on",
        unit="periods",
    )
    range_errors: float = limit(20.0, "a coefficient may be refined by so many standard errors, ...")
    range_share: float = limit(0.5, "... by this share of itself, ...")
    range_moment: float = limit(
        0.1, "... or until its term carries this much more of the moment, whichever is most"
    )
    element_range: float = limit(
        20.0,
        "a coefficient of an element may be refined up to so many times itself, and down to that part of it",
    )
    nonlinear_range: float = limit(
        10.0,
        "the same of a nonlinear parameter of an element that is an angle, a rate or a time: where it starts wrong "
        "its coefficient does, too",
    )
    shape_range: float = limit(2.0, "the same of a nonlinear parameter without a unit")
    start_spread: float = limit(
        2.5,
        "factor by which nonlinear parameters of elements are changed for the other starts of a refinement",
    )
    shape_spread: float = limit(1.4, "the same of nonlinear parameters without a unit")
    coarse_lag: float = limit(
        0.2,
        "share by which another start may fit worse than the best end, after its first steps, to be followed",
    )
    least_lead: float = limit(
        0.01, "share by which another start must fit better than the given one before its end is used"
    )
    kept_out_growth: float = limit(
        0.1,
        "share by which a refined model may miss the runs kept for validation by more than it did before, beside their "
        "noise, to be used",
        source="chosen by judgement: the pendulum's, which lacks a law, triples",
    )
    gain_range: float = limit(0.25, "widest error of gain that is searched")
    delay_range: float = limit(0.1, "widest delay that is searched", unit="periods of the fastest motion")
    offset_range: float = limit(0.5, "widest offset that is searched, as a share of the response's RMS")
    least_noise: float = limit(
        1e-4,
        "noise, as a share of the response, below which residuals are weighted as if it were this",
        source="less would weigh what no simulation can reach",
    )
    undetermined: float = limit(
        0.5, "standard error, as a share of a parameter's size, beyond which it is not determined"
    )
    undetermined_together: float = limit(
        0.05,
        "share of their sizes by which several parameters can change together without being determined one by one",
    )
    entangled: float = limit(10.0, "and how many times better each of them would be known if the others were")
    named_share: float = limit(
        0.2, "share of such a direction that a parameter must have to be named with it"
    )


POLICY = ResponsePolicy()
