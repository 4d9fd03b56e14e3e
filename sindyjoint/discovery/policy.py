"""Limits of discovery: when a term is significant, material and the same in every group of runs."""

from __future__ import annotations

from dataclasses import dataclass

from sindyjoint.policy import limit


@dataclass(frozen=True)
class DiscoveryPolicy:
    """Limits that decide which terms are found; the meaning of each is in its metadata."""

    term_significance: float = limit(
        5.0,
        "least ratio of a coefficient to its standard error",
        source="simulated joints: among twenty candidates tried at every size, pure noise reaches 4.5 once in some "
        "hundred campaigns",
    )
    least_share: float = limit(
        0.002,
        "least unique share of a term in the RMS of the moment; below, it cannot be distinguished from sensor "
        "and processing errors",
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
    group_consistency: float = limit(
        2.0,
        "least ratio of a coefficient to its jackknife standard error over groups: it may vary by half its size and "
        "still be the same term",
        source="with three or four groups the jackknife cannot ask for more",
    )
    separability: float = limit(
        3.0,
        "a chosen term that falls below so many standard errors when a candidate joins is not distinguishable from it",
    )
    largest_set: int = limit(
        9,
        "largest set of terms that resampled campaigns may choose",
        source="beyond ten terms a law is no law",
    )
    frequency_margin: float = limit(
        0.10, "relative change of a coefficient over the band that would not matter"
    )
    frequency_level: float = limit(
        0.05, "level of the tests of homogeneity and trend over frequency", source="convention"
    )
    equivalence_level: float = limit(
        0.01,
        "risk of calling a change within the margin that is as large as it",
        source="Schuirmann's 5 % would lose one campaign in twenty",
    )
    notable_change: float = limit(
        0.5,
        "share of the margin from which a significant change is called dependence; below, the answer mentions it",
        source="very sharp estimates make changes significant that do not matter",
    )
    scale_excess: float = limit(
        0.2,
        "share by which values may pass the scale of nonlinear parameters that a part of the rows gave; beyond, "
        "all rows are read once more under their own",
        source="the maxima of random motion, a segment at a time, differ by less",
    )
    lag_explains: float = limit(
        0.1,
        "share of the mean square left by the paper's law and its dependences on inputs that a lag of an input must "
        "explain",
    )
    longest_delay: float = limit(0.02, "largest time delay between the channels that is searched", unit="s")
    unresolved_delay: float = limit(
        0.1,
        "time delay left in the channels from which no verdict on terms is given",
        unit="samples",
        source="simulated joints that stick show up to 0.07 samples that are not there",
    )
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
