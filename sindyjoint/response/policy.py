"""Limits of the comparison of a model with a measured response, and of its refinement."""

from dataclasses import dataclass

from sindyjoint.policy import limit


@dataclass(frozen=True)
class ResponsePolicy:
    """Limits that decide how a response is simulated, compared and refined; the meaning of each is in its metadata."""

    nearly: float = limit(
        0.1,
        "share that hardly counts: of the moment's RMS, below which a joint whose elastic moment is smaller is "
        "simulated with restarts, and one whose moment is smaller for all but this share of the time vibrates "
        "freely; and by which a refined model may miss the runs kept for validation by more than before, beside "
        "their noise, to be used",
        source="chosen by judgement: the pendulum's, which lacks a law, triples",
    )
    beyond_noise: float = limit(
        1.5,
        "ratio to noise of what only a prescribed motion leaves, from which the motion was the drive: of the moment "
        "beside its sinusoid, and of the power of the angle that the moment would make above the angle's band",
        source="prescribed motions of joints of another integrator have 2.6 to 98, driven ones up to 0.5",
    )
    significance: float = limit(
        6.0,
        "standard errors up to which harmonics of a prescribed sinusoid, and half-cycles of a vibration, are noise",
    )
    runaway: float = limit(
        1e4,
        "distance from the measured angles, in their range, at which a simulation without a softening limit is ended: "
        "with negative damping its amplitude would grow in ever shorter steps",
    )
    hardly: float = limit(
        0.01,
        "share that does not count: change of the moment within a run, in its RMS, that an input may make where it is "
        "held at its mean; lead by which another start must fit better than the given one before its end is used",
    )
    completion_follows: float = limit(
        0.15,
        "RMS difference of simulated and measured angle, relative to the angle's, up to which a simulation completes "
        "the states of a run",
    )
    chance: float = limit(
        3.0,
        "standard errors that are chance: of the noise's mean square, by which a completed angle may miss the "
        "measured one by more, and of the correlation of as many harmonics with which an exciter inertia is seen",
        source="one run in a thousand; two or three harmonics agree by chance",
    )
    many_times: float = limit(
        10.0,
        "standard errors from which a harmonic is the measured one; and how many times better parameters would be "
        "known if others were, from which they are not determined one by one although a change of all together "
        "shows that many times sooner",
        source="known to a tenth",
    )
    drive_band: float = limit(0.8, "share of the angle's band below which the band of the drive must end")
    inertia_seen: float = limit(
        0.5,
        "share of the angle's band above which an exciter inertia is looked for, and least correlation of "
        "acceleration and moment with which it is seen",
    )
    same_inertia: float = limit(
        1e-3, "relative difference up to which model and campaign have the same inertia"
    )
    fewest_initial: int = limit(
        4, "fewest samples from which a free run estimates its initial state", unit="samples"
    )
    fewest_draws: int = limit(5, "fewest simulated sets of coefficients of which a band is made")
    least_half_cycle: float = limit(
        0.002, "least half-cycle of a vibration, as a share of the whole range of the signal"
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
    large_part: float = limit(
        0.2,
        "share by which another start may fit worse than the best end, after its first steps, to be followed; and "
        "share of a direction that is not determined which a parameter must have to be named with it",
    )
    least_noise: float = limit(
        1e-4,
        "noise, as a share of the response, below which residuals are weighted as if it were this",
        source="less would weigh what no simulation can reach",
    )


POLICY = ResponsePolicy()
