"""The limits that decide what a diagnosis answers, and in which of them a structure differs from a campaign."""

from dataclasses import dataclass, replace
from functools import partial

from sindyjoint.limits import EvidencePolicy
from sindyjoint.policy import limit

calibrated = partial(limit, source="calibrated on simulated campaigns and structures with hidden effects")
convention = partial(limit, source="convention")
judgement = partial(limit, source="chosen by judgement")


@dataclass(frozen=True)
class DiagnosisPolicy(EvidencePolicy):
    """Limits of a diagnosis; each field says what it decides."""

    # Candidates.
    rival_nats: float = convention(3.0, "effects so close to the best one are of its class", unit="nat")

    # The loop: what is accepted, refused, taken back.
    most_effects: int = convention(4, "most effects that are added")
    little_help: float = calibrated(
        0.7,
        "... unless the moment gap falls to this share; where it grows with a step, the response gap must fall to it",
    )

    # Admissible effects.
    sticking_share: float = limit(
        0.75,
        "share of the way, in half-cycles, along which a slider may stick before it is refused as a spring",
        source="a Jenkins element of another integrator that sticks along 55 %; springs in its guise stick along 100 %",
    )

    # The verdict.
    least_help: float = convention(
        0.1, "share of the gap that effects must take away to be named beside a remainder"
    )
    partly_outside: tuple[float, float] = limit(
        (0.25, 0.5),
        "least and largest probability that names beside a remainder stand in for something else",
        source="the share of the gap that remains; never so little that a name stands above 0.8",
    )
    unexplained: float = calibrated(
        0.15, "share of the mean square gap beyond noise above which the rest is unknown"
    )
    significant_excess: float = calibrated(
        1.25,
        "mean square, in units of noise or of the whole gap's, up to which all is noise, or a region like others",
    )

    # Budget and localisation; drift of channels and change of the joint.
    phase_share: float = convention(0.65, "least share of a gap to lie in periods, or in amplitudes")
    most_regions: int = convention(4, "most regions that are stated")

    # Rows, gaps and simulations.
    fewest_half_cycles: int = judgement(8, "half-cycles below which a free run is regressed sample by sample")
    processing_error: float = calibrated(5e-4, "share of the moment within which processing errs")
    training_share: float = convention(2 / 3, "share of a free run that is fitted to predict the rest")
    drive_band: float = calibrated(1.5, "bandwidth of a replicate's moment over that of its angle")
    late_share: float = judgement(0.4, "share of a structure's record, its end, of which noise is measured")
    line_ratio: float = judgement(
        20.0, "line of that spectrum over the median beside it from which it is motion, and no noise"
    )
    segments: int = judgement(
        9,
        "segments in all of a structure's runs that do not repeat, those in which its joints move most, that are "
        "simulated for every candidate",
    )
    behind: float = calibrated(80.0, "distance at which candidates of a structure are given up", unit="nat")
    linear: float = calibrated(4.0, "mean square, in units of noise, below which a response is linear")

    # What a diagnosis may cost, stage by stage: work that is the same on every machine, and processor time, in
    # proportion, as a last resort. Work is counted in samples that trials of numbers go along; a step of a simulation
    # counts as five.
    search_work: float = judgement(
        2e9,
        "work of a search, from all its starts, after which no further effect is tried, nor another start; on a "
        "processor of 2024 one to two minutes",
        unit="samples",
    )
    verdict_work: float = judgement(
        3e8,
        "work of all verdicts: simulations by other numbers and noise, trials of what is outside the catalogue; "
        "without them a verdict is undecided",
        unit="samples",
    )
    numbers_work: float = judgement(
        2.4e9,
        "work of a refinement on the simulated response; without it the numbers stay as they are",
        unit="samples",
    )
    parts_work: float = judgement(
        2e8, "work by which the gap is divided into its parts and located", unit="samples"
    )
    advice_work: float = judgement(
        1.5e8,
        "samples that rivals are laid along, trial by trial, in the search for runs that separate them: the same on "
        "every machine, of a processor of 2024 some 15 s",
        unit="samples",
    )
    slowest: float = judgement(
        1e7,
        "work in a second of processor time, of a machine slower than which a stage ends before its work is used up",
        unit="samples/s",
    )

    # Advice.
    most_runs: int = convention(2, "most runs advised for one class")
    clear: float = convention(20.0, "margin after which no further run is advised", unit="nat")
    little_confidence: float = convention(0.02, "least gain of expected confidence by a further run ...")
    little_margin: float = convention(0.3, "... or of the margin", unit="nat")
    lowest_level: float = convention(0.7, "share of the lowest level tested from which a moment is advised")
    least_confidence: float = convention(0.6, "least expected confidence of a pulse that is advised")


CAMPAIGN = DiagnosisPolicy()
#: A structure is simulated and not regressed: each candidate costs simulations, and the response is nearly proportional
#: to what is missing.
STRUCTURE = replace(
    CAMPAIGN,
    most_effects=3,
    search_work=5e9,
    unexplained=0.0625,
    most_regions=5,
)

#: Limits of a diagnosis from the runs of a structure. There are as many effects outside the joints as inside, and many
#: of them take something off any gap: one that leaves half of it is no answer.
IN_PLACE = replace(STRUCTURE, least_help=0.5)
