"""Limits of what is recovered of joints inside a structure."""

from dataclasses import dataclass

from sindyjoint.policy import SharedPolicy, limit


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


POLICY = SubstructurePolicy()
