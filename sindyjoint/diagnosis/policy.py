"""The limits that decide what a diagnosis answers, and in which of them a structure differs from a campaign."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import partial

from sindyjoint.policy import limit

calibrated = partial(limit, source="calibrated on simulated campaigns and structures with hidden effects")
convention = partial(limit, source="convention")
judgement = partial(limit, source="chosen by judgement")


@dataclass(frozen=True)
class DiagnosisPolicy:
    """Limits of a diagnosis; each field says what it decides."""

    # Evidence: from the fall of χ² to probabilities.
    temper: float = calibrated(2.0, "divides log-likelihoods: linearised noise models are overconfident")
    lost_share: float = calibrated(
        0.002, "share of χ² within which candidates of a structure still race, too"
    )
    cancelled: float = convention(
        2.0, "a column so many times the moment is cancelled by others, and no effect"
    )
    rival_nats: float = convention(3.0, "effects so close to the best one are of its class", unit="nat")

    # The loop: what is accepted, refused, taken back.
    most_effects: int = convention(4, "most effects that are added")
    little_help: float = calibrated(
        0.7,
        "... unless the moment gap falls to this share; where it grows with a step, the response gap must fall to it",
    )
    refined_gap: float = judgement(
        0.005,
        "share by which the response gap may grow by refinement: at reversals of a prescribed motion it "
        "counts samples that are not fitted",
    )
    realign: float = convention(4.0, "fall of χ² at which a delay is corrected beside a later effect")
    needless_ratio: float = convention(3.0, "coefficient over standard error below which a term may go ...")
    needless_share: float = convention(0.02, "... if it carries less than this share of the moment's RMS")

    # Other starts, where the first search leaves something unexplained.
    start_worth: float = convention(
        1.1, "gap of a start over the best one so far up to which it is searched from"
    )

    # Admissible effects.

    sticking_share: float = limit(
        0.75,
        "share of the way, in half-cycles, along which a slider may stick before it is refused as a spring",
        source="a Jenkins element of another integrator that sticks along 55 %; springs in its guise stick along 100 %",
    )

    # The verdict.
    within_floors: float = limit(
        1.5,
        "gap over noise floor up to which nothing, or nothing more, is called missing",
        source="simulated campaigns with a hidden effect end at 0.8 to 1.1 once it is found, whatever the drive",
    )
    response_floors: float = limit(
        4.0,
        "simulated response over its floor, beside what the uncertainty of numbers and drive explains (as for gaps), "
        "above which something is called missing",
        source="laws named rightly on campaigns of other integrators, whose friction creeps, end at up to 3.8",
    )
    least_help: float = convention(
        0.1, "share of the gap that effects must take away to be named beside a remainder"
    )
    partly_outside: tuple[float, float] = limit(
        (0.25, 0.5),
        "least and largest probability that names beside a remainder stand in for something else",
        source="the share of the gap that remains; never so little that a name stands above 0.8",
    )
    unexplained: float = calibrated(0.15, "share of the gap beyond noise above which the rest is unknown")
    unexplained_rms: bool = convention(False, "whether that share is of the RMS, not of the mean square")
    significant_excess: float = calibrated(1.25, "mean square, in units of noise, up to which all is noise")
    outside: float = convention(0.5, "probability of an effect of no catalogue above which it is unknown")

    # Budget and localisation; drift of channels and change of the joint.
    significant_fall: float = convention(
        3.0, "standard deviations of χ² from which an error falls, or more than noise"
    )
    alike: float = convention(1.0, "standard deviations of χ² within which two kinds of law predict alike")
    same_level: float = convention(0.05, "runs whose amplitudes differ by a smaller share are of one level")
    region_share: float = convention(0.15, "least share of the gap that a stated region holds ...")
    region_excess: float = convention(1.3, "... and least ratio of it to its share of the samples")
    phase_share: float = convention(0.65, "least share of a gap to lie in periods, or in amplitudes")
    most_regions: int = convention(4, "most regions that are stated")
    drift_ratio: float = convention(6.0, "slope over standard error from which a channel drifts ...")
    drift_share: float = convention(0.005, "... if that moves it by this share of its RMS over a run")
    change_ratio: float = convention(6.0, "difference over standard error from which a stiffness changes ...")
    change_share: float = convention(0.002, "... if it changes by this share")
    change_start: float = convention(0.25, "share of a run from which a start left out was another joint ...")
    change_steady: float = convention(0.5, "... if this share of that start was steady")

    # Rows, gaps and simulations.
    fewest_half_cycles: int = judgement(8, "half-cycles below which a free run is regressed sample by sample")
    rate_share: float = calibrated(0.02, "rates below this share of the RMS have no sign")
    rest_misfit: float = limit(
        0.3, "share of the moment that a law may leave for the angle at which it rests to be believed"
    )
    processing_error: float = calibrated(5e-4, "share of the moment within which processing errs")
    training_share: float = convention(2 / 3, "share of a free run that is fitted to predict the rest")
    drive_band: float = calibrated(1.5, "bandwidth of a replicate's moment over that of its angle")
    known_to: float = convention(
        0.005, "relative standard error of a structure's own law where no model is given"
    )
    late_share: float = judgement(0.4, "share of a structure's record, its end, of which noise is measured")
    line_ratio: float = judgement(
        20.0, "line of that spectrum over the median beside it from which it is motion, and no noise"
    )
    audible: float = convention(3.0, "envelope over noise at which the record of a structure ends")
    model_error: float = calibrated(
        0.003, "least relative standard error in the prior of a model in a structure"
    )
    segments: int = judgement(
        9,
        "segments in all of a structure's runs that do not repeat, those in which its joints move most, that are "
        "simulated for every candidate",
    )
    behind: float = calibrated(80.0, "distance at which candidates of a structure are given up", unit="nat")
    linear: float = calibrated(4.0, "mean square, in units of noise, below which a response is linear")
    fallback: float = calibrated(
        1.1, "mean square, in units of noise, above which fallback variants are tried"
    )

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
    enough: float = convention(0.95, "expected confidence at which a run by a moment is as good as any")
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
    unexplained=0.25,
    unexplained_rms=True,
    most_regions=5,
)

#: Limits of a diagnosis from the runs of a structure. There are as many effects outside the joints as inside, and many
#: of them take something off any gap: one that leaves half of it is no answer.
IN_PLACE = replace(STRUCTURE, least_help=0.5)
