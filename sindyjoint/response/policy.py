"""Limits of the comparison of a model with a measured response, and of its refinement."""

from dataclasses import dataclass

from sindyjoint.policy import SharedPolicy, limit


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


POLICY = ResponsePolicy()
