"""Limits of what is recovered of joints inside a structure."""

from dataclasses import dataclass

from sindyjoint.policy import limit


@dataclass(frozen=True)
class SubstructurePolicy:
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
    hardly_seen: float = limit(
        0.003,
        "standard error of a harmonic of the angle below the strongest one, as a share of that one, beyond which the "
        "law tells it and not the sensors",
    )
    hardly_seen_record: float = limit(
        0.01,
        "RMS error of the angle, as a share of it, that the harmonics of a record that does not repeat may leave: "
        "slower ones the law tells",
    )
    edge: float = limit(
        4.0,
        "periods of the highest harmonic left out at either end of a record that does not repeat: its series rings",
    )
    not_shown: float = limit(
        0.3, "relative standard error of a joint's moment beyond which the sensors do not show the joint"
    )
    together: float = limit(
        0.98, "correlation of the errors of two joints' moments beyond which they show only together"
    )
    disagrees: float = limit(
        2.0,
        "mean square of the residual of the sensors, in their noise, beyond which they disagree with the structure as "
        "described",
        source="noise alone makes 1",
    )
    updated_by: float = limit(
        3.0,
        "standard errors beyond which an updated number of the structure is other than described",
        source="error rate: 0.3 % of numbers that are as described",
    )
    well_known: float = limit(
        0.01,
        "noise of a run's states, as a share of the moment, below which less noise gives it no more weight",
    )
    stands_out: float = limit(
        6.0,
        "standard errors that the sensors' noise leaves a term's coefficient, beyond which it is in the law however "
        "little of the moment it carries",
        source="below 4 for 18 terms that are not there, on 15 campaigns of the pulse rig with five that are; 20 for "
        "k2 at 0.12 % of the moment",
    )
    rows_per_unknown: float = limit(
        5.0,
        "samples in which a joint moves for each number of the slow part of its angle that is found with the law; with "
        "fewer, terms beside those that explain the moment are not sought, and none is refuted",
        source="3 after blows to the pulse rig (two campaigns), which made terms of what is beyond the band",
    )
    refuting_share: float = limit(
        0.001,
        "share of the moment below which terms beyond the paper's refute nothing: masses and beams are hardly "
        "described more accurately, and what the recovery leaves of records that do not repeat looks like terms",
        source="by judgement; terms that were not there had at most 0.0001 (a sweep, a blow, 0.01 % noise)",
    )
    explained: float = limit(
        10.0,
        "mean square of the residual of the rows, in that of the noise, up to which a term may stand out: beyond it "
        "the structure is another, and terms stand for that",
        source="1.8 with the pulse rig's beams 1 % wrong and updated, above 40 without the update",
    )
    simulated: float = limit(
        1e-4,
        "relative error that the simulation of runs that do not repeat leaves in the numbers of a law: time step, "
        "reduced coordinates, the drive between its samples",
        source="without noise, weighed as with it: at most 0.03 % of k3, 0.02 % of k2, 0.005 % of k1, c1 and M_F (two "
        "campaigns of sweeps, one of blows)",
    )
    differ: float = limit(0.01, "level at which joints that are declared alike are said to differ")


POLICY = SubstructurePolicy()
