"""Limits of the search over sets: each is an error rate, or a share in units of noise."""

from __future__ import annotations

from dataclasses import dataclass

from sindyjoint.policy import limit


@dataclass(frozen=True)
class EvidencePolicy:
    """When a set of effects wins over one with less in it, and when two sets cannot be told apart."""

    chance: float = limit(
        0.001,
        "probability that anything is added where there is nothing but noise, all candidates tried",
        source="error rate, measured on simulated noise in the rows of the campaign itself",
    )
    most_deviate: float = limit(
        3.0,
        "standard deviations that a single group counts for at most",
        source="convention: one run does not decide",
    )
    within: float = limit(
        1.5,
        "prediction errors, RMS in units of what noise makes expected, up to which nothing more is called missing",
        source="as in the verdict: a noise floor is known within that factor",
    )
    least_help: float = limit(
        0.1,
        "share by which a member makes prediction errors smaller where more than noise remains",
        source="convention: what takes less than a tenth stands in for something else",
    )
    column_error: float = limit(
        0.02,
        "relative error of an effect's column: motions are processed, nonlinear parameters rounded",
        source="free decays with Coulomb friction leave 1 % of what it explains",
    )
    little: float = limit(
        0.05,
        "share of the score that is no further effect where noise, or hysteresis, explains the rest",
        source="campaigns with one hidden effect: what a second one wins there is an error of the first one's column",
    )


POLICY = EvidencePolicy()
