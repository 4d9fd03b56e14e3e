"""Limits of the force states: when a run repeats, which harmonics are signal, and when the joint moves."""

from __future__ import annotations

from dataclasses import dataclass

from sindyjoint.policy import SharedPolicy, limit

SIMULATED = "measured on simulated stick–slip runs"


@dataclass(frozen=True)
class StatesPolicy(SharedPolicy):
    """Limits that decide what the force states are; the meaning of each is in its metadata."""

    unsteady: float = limit(
        5.0,
        "a period further from the later ones than so many of their median distances belongs to the start-up",
    )
    harmonic_significance: float = limit(
        2.5,
        "standard errors beyond which the amplitude of a harmonic is signal",
        source=f"{SIMULATED}: isolated high harmonics multiply noise by their order and cost 1.8 % in c1 at 5 % noise",
    )
    harmonic_misses: int = limit(
        4,
        "harmonics in a row that are not significant, at which the spectrum has ended in noise",
        source=f"{SIMULATED}: ending there costs 0.5 % in c1 at 5 % noise",
    )
    shortest_repetition: int = limit(256, "fewest samples of such a period", unit="samples")
    periodic_rate_share: float = limit(
        0.05, "share of the peak rate below which a sample of a periodic run is reversal"
    )
    periodic_guard: float = limit(
        0.5,
        "guard on each side of a reversal: the length over which a truncated series rings",
        unit="periods of the highest kept harmonic, or of the cut-off of a run that does not repeat and sticks",
    )
    periodic_guard_limit: float = limit(0.03, "the same at most", unit="periods of the excitation")
    coarse_period: float = limit(
        24.0,
        "samples per period below which the guard is one sample instead of two: two would leave none of ten",
        unit="samples",
    )
    dwelling: float = limit(
        0.47,
        "samples within 5 % of the peak rate, as a share of those within 15 %, beyond which the joint sticks instead "
        "of passing through zero rate",
        source="a third at constant acceleration; 0.5 to 0.9 of simulated joints that stick",
    )
    passing_rate_share: float = limit(
        0.02,
        "share of the peak rate below which a sample is reversal, where the joint only passes through zero: its slow "
        "samples distinguish friction from damping",
    )
    passing_guard: float = limit(
        0.25, "guard on each side of a reversal of such a run", unit="periods of the cut-off"
    )
    broadband_guard_limit: float = limit(
        0.1, "either guard at most, as a share of the usual spacing of reversals"
    )


POLICY = StatesPolicy()
