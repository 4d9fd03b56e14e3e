"""Limits of the equation of a joint: when it describes the data."""

from __future__ import annotations

from dataclasses import dataclass

from sindyjoint.policy import limit


@dataclass(frozen=True)
class EquationPolicy:
    """Limits that decide what a model may be called; the meaning of each is in its metadata."""

    tolerated_misfit: float = limit(
        0.05,
        "share of the moment's RMS, beyond the noise, that a model may leave unexplained and still be called a "
        "description",
        source="chosen by judgement",
    )
    visible_gravity: float = limit(
        0.3,
        "angle from which sin(theta) is a candidate beside the powers, if the library is the default one",
        unit="rad",
        source="there the fifth power of the angle is 0.007 % of it: below, no test tells gravity from k1 and k3",
    )
    range_slack: float = limit(
        0.05, "share of the tested angle or rate by which a motion may go beyond it without a word"
    )
    range_time: float = limit(
        0.005,
        "share of the time beyond the tested range from which it is said; a few samples of noise are not",
    )


POLICY = EquationPolicy()
