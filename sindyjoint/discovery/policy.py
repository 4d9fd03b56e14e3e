"""Limits of discovery: when a term is significant, material and the same in every group of runs."""

from __future__ import annotations

from dataclasses import dataclass

from sindyjoint.policy import SharedPolicy, limit


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


POLICY = DiscoveryPolicy()
