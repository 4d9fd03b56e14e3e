"""Limits of the force states: when a run repeats, which harmonics are signal, and when the joint moves."""

from __future__ import annotations

from dataclasses import dataclass

from sindyjoint.policy import limit

SIMULATED = "measured on simulated stick–slip runs"


@dataclass(frozen=True)
class StatesPolicy:
    """Limits that decide what the force states are; the meaning of each is in its metadata."""

    repeats_within: float = limit(
        0.2,
        "a run is periodic when what does not repeat stays below this share of its RMS: 5 % noise passes with room "
        "to spare; a free decay, a sweep or a multisine does not",
    )
    fewest_periods: int = limit(3, "fewest steady periods of a periodic run")
    frequency_significance: float = limit(
        4.0,
        "standard errors by which the drift of the phase must contradict the declared frequency to replace it",
    )
    unsteady: float = limit(
        5.0,
        "a period further from the later ones than so many of their median distances belongs to the start-up",
    )
    steady_scatter: float = limit(0.002, "least such distance, as a share of the fundamental")
    same_frequency: float = limit(0.01, "relative difference up to which two runs have one frequency")
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
    same_segment: float = limit(
        0.15,
        "two segments are the same excitation when they differ by less than this share of their RMS",
        source="twice 5 % noise, and √2",
    )
    same_motion: float = limit(
        0.05,
        "two periods of a run are one motion when the angle differs by less than this share of its RMS: to first "
        "order what that does to the moment is taken out, to second order it is a quarter of a per cent",
        source="convention",
    )
    fewest_repetitions: int = limit(3, "fewest periods of an excitation that is no sinusoid to be averaged")
    shortest_repetition: int = limit(256, "fewest samples of such a period", unit="samples")
    most_wasted: float = limit(
        0.1, "largest share of a record that may be lost after the last whole period; else it is not averaged"
    )
    departing: float = limit(
        1.5,
        "a motion that differs after two periods by so many times its difference after one does not repeat: noise "
        "differs alike, a phase that drifts twice as much ...",
    )
    departing_share: float = limit(
        0.01, "... where that is more than this share of its RMS: less is as good as the noise of most tests"
    )
    transient: float = limit(
        1.5,
        "a first period that differs from the others by so many times their mutual difference is left out",
    )
    rate_sigmas: float = limit(4.0, "standard errors of the rate below which its sign is not known")
    periodic_rate_share: float = limit(
        0.05, "share of the peak rate below which a sample of a periodic run is reversal"
    )
    periodic_guard: float = limit(
        0.5,
        "guard on each side of a reversal: the length over which a truncated series rings",
        unit="periods of the highest kept harmonic",
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
    sticking_rate_share: float = limit(
        0.1,
        "share of the peak rate below which a sample is reversal, in a run that does not repeat and sticks: smoothed, "
        "it rings about its standstill",
    )
    sticking_guard: float = limit(
        0.5, "guard on each side of a reversal of such a run", unit="periods of the cut-off"
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
