"""Limits of the equation of a joint: when it describes the data."""

from __future__ import annotations

from dataclasses import dataclass

from sindyjoint.policy import SharedPolicy, limit


@dataclass(frozen=True)
class EquationPolicy(SharedPolicy):
    """Limits that decide what a model may be called; the meaning of each is in its metadata."""

    visible_gravity: float = limit(
        0.3,
        "angle from which sin(theta) is a candidate beside the powers, if the library is the default one",
        unit="rad",
        source="there the fifth power of the angle is 0.007 % of it: below, no test tells gravity from k1 and k3",
    )


POLICY = EquationPolicy()
