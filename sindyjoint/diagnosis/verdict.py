"""What a diagnosis comes to: sound data first, then whether the model explains them, then names and their steps."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from itertools import takewhile

import numpy as np

from sindyjoint.diagnosis.policy import CAMPAIGN, DiagnosisPolicy
from sindyjoint.diagnosis.result import Gap, Step
from sindyjoint.text import spelled

#: The name under which what is outside the catalogue stands among the rivals of a step.
UNKNOWN = "unknown"
#: Beside the terms of a Taylor series one zero error of a channel is the other: of the joint both say the same.
ZERO_ERRORS = frozenset(("constant_moment", "angle_offset"))
#: The verdict where the data are not sound enough for any other.
UNDECIDED = "undecided"


@dataclass(frozen=True)
class Residual:
    """What the effects found leave.

    Parameters
    ----------
    share : float
        Of the gap beyond noise, from 0 to 1.
    most : float
        Share above which something unknown is there.
    data : str
        What cannot tell effects apart: "these runs", "this record".
    misfit : float
        RMS of the prediction errors in units of what noise makes expected of each row, the slopes of the law included;
        infinite where that is not known.
    """

    share: float
    most: float
    data: str = "these runs"
    misfit: float = np.inf


def share_beyond_noise(
    before: tuple[float, float], after: tuple[float, float], policy: DiagnosisPolicy
) -> float:
    """Return what remains of a gap beyond noise, from 0 to 1; zero where all that remains is noise.

    ``before`` and ``after`` are χ² and its degrees of freedom before the first effect and with all of them.
    """
    if after[0] <= policy.significant_excess * after[1]:
        return 0.0
    return float(np.clip((after[0] - after[1]) / max(before[0] - before[1], 1e-9), 0.0, 1.0))


@dataclass(frozen=True)
class Gaps:
    """The figures that a verdict must agree with: a gap on data left out of the fit, and the noise floor.

    Parameters
    ----------
    initial, final, floor : Gap
        Of the model as it was given, of the model with its effects, and of what does not repeat; NaN where a figure
        could not be had.
    uncertainty : Gap
        Of the response, by noise of the law's numbers and of its drive, beside the floor.
    bound : bool
        Whether the floor is an upper bound: a gap below it may be noise, or not.
    moving : bool
        Whether the motion alone was measured, that of a free joint.
    """

    initial: Gap
    final: Gap
    floor: Gap
    uncertainty: Gap = Gap(0.0, 0.0)
    bound: bool = False
    moving: bool = False

    def figures(self) -> tuple[float, float, float]:
        """Return initial gap, final gap and floor of the moment, or of the response where no moment is measured."""
        name = "response" if self.of_response else "moment"
        return getattr(self.initial, name), getattr(self.final, name), getattr(self.floor, name)

    @property
    def of_response(self) -> bool:
        """Whether there is no moment to judge by."""
        return self.moving or bool(np.isnan(self.final.moment))

    def floors(self, policy: DiagnosisPolicy) -> float:
        """Return the final gap in units of the floor, and of a small share of it by which the processing errs."""
        _, final, floor = self.figures()
        return float(final / np.hypot(floor, policy.processing_error))

    def remains(self) -> float:
        """Return the share of the first gap that remains beyond the floor, by the worse of moment and response."""
        shares = [0.0]
        for name in ("moment", "response"):
            first, last, floor = (getattr(gap, name) for gap in (self.initial, self.final, self.floor))
            beyond = first**2 - floor**2
            if beyond > 0:
                shares.append(np.sqrt(max(last**2 - floor**2, 0.0) / beyond))
        return float(max(shares))

    def helped(self, policy: DiagnosisPolicy) -> bool:
        """Return whether the effects make the gap smaller by a share worth naming."""
        initial, final, _ = self.figures()
        return not final > (1 - policy.least_help) * initial

    def response_complaint(self, policy: DiagnosisPolicy) -> str:
        """Return what is wrong with the simulated response of the model with its effects; empty if nothing is.

        It may not grow beyond its noise, whatever explains that, and may stand above it by what the uncertainty of the
        law's numbers and of its drive explains.
        """
        before, after, unsure = self.initial.response, self.final.response, self.uncertainty.response
        if np.isnan(after):
            return "the response could not be simulated: it diverges or snaps through"
        if after > before and self.beyond_response_noise(policy):
            return f"the response gap grows from {_percent(before)} to {_percent(after)}"
        noise = np.hypot(self.floor.response, policy.processing_error)
        if after > np.hypot(policy.outstanding * noise, policy.clearly * unsure):
            return (
                f"the simulated response is off by {_percent(after)}, more than its noise floor of "
                f"{_percent(self.floor.response)} and the {_percent(unsure)} that uncertain numbers and drive explain"
            )
        return ""

    def beyond_response_noise(self, policy: DiagnosisPolicy) -> bool:
        """Return whether the simulated response stands above its own noise, whatever may explain that."""
        noise = np.hypot(self.floor.response, policy.processing_error)
        return bool(self.final.response > policy.clearly * noise)

    def response_reservation(self, policy: DiagnosisPolicy) -> str:
        """Return what a name rests on where the uncertainty of the law is what explains its response; else nothing."""
        unsure = self.uncertainty.response
        if not self.beyond_response_noise(policy) or unsure <= self.floor.response:
            return ""
        return (
            f"; its simulated response misses by {_percent(self.final.response)}, which the uncertainty of numbers and "
            f"drive explains ({_percent(unsure)}, noise floor {_percent(self.floor.response)}): these runs do not "
            "predict it better"
        )


def judge(steps: Sequence[Step], residual: Residual, gaps: Gaps, policy: DiagnosisPolicy) -> tuple[str, str]:
    """Return the verdict and its reason: first whether the model explains the data, then what the effects are called.

    Without a noise floor nothing is decided. A gap of more than ``clearly`` floors is never called noise, and no
    name is given as the whole answer while one remains; nor while the simulated response grows, or stands
    ``outstanding`` times above its own noise and what the uncertainty of the law explains.
    """
    _, final, floor = gaps.figures()
    if np.isnan(floor):
        return (
            "undecided",
            "no noise floor could be measured, so that no gap can be called noise or an effect",
        )
    size = f"a gap of {_percent(final)} where the noise floor is {_percent(floor)}"
    complaint = replace(gaps, initial=_without_zero_errors(steps, gaps.initial)).response_complaint(policy)
    share = f"{100 * residual.share:.0f} %"
    beyond = min(gaps.floors(policy), residual.misfit) > policy.clearly
    excess = residual.share > residual.most
    if not steps:
        if beyond:
            return "unknown", f"no known effect explains the gap; {size} remains"
        if excess:
            return "unknown", f"no known effect explains the gap; {share} of it is more than noise"
        if complaint and np.isfinite(gaps.final.response):
            return "unknown", f"the moment is explained to its noise, yet {complaint}"
        if gaps.bound:
            return (
                UNDECIDED,
                f"{size} at most: record runs that repeat, which show how much of the gap is noise",
            )
        # Of a free motion the moment is the smoothed acceleration's, which rounds off the corners of friction.
        what = "the simulated motion misses by" if gaps.of_response else "the residual is"
        return "nothing_missing", f"{what} no more than noise and the model's uncertainty"
    if (beyond or excess) and not gaps.helped(policy):
        return "unknown", f"the effects found hardly help on data left out of the fit; {size} remains"
    if beyond or excess:
        # The share is that of a gap from which channels put right have gone: all of it, where nothing else was found.
        left = size if final > floor else f"{share} of the gap beyond noise"
        return (
            "partly_named",
            f"{_explaining('a part', steps, gaps.initial, policy)}; {left} remains unexplained",
        )
    if complaint:
        what = f"the {'motion' if gaps.of_response else 'moment'}"
        return "partly_named", f"{_explaining(what, steps, gaps.initial, policy)}; yet {complaint}"
    reservation = gaps.response_reservation(policy)
    apart = [
        " or ".join(map(spelled, s.members))
        for s in steps
        if len(s.members) > 1 and not ZERO_ERRORS.issuperset(s.members)
    ]
    if apart:
        return "ambiguous", f"{residual.data} cannot tell apart: {'; '.join(apart)}{reservation}"
    return "named", "found: " + ", then ".join(spelled(s.effect) for s in steps) + reservation


def _one_after_another(steps: Sequence[Step]) -> str:
    return ", then ".join(" or ".join(map(spelled, s.members)) for s in steps)


def _explaining(what: str, steps: Sequence[Step], initial: Gap, policy: DiagnosisPolicy) -> str:
    """Return which effects explain what, and which take next to nothing away beside a remainder."""
    reported = with_falling_gaps(steps, initial)
    no_gain = without_help(reported, policy.least_help)
    helping = [step for step in reported if step not in no_gain]
    if not helping or not no_gain:
        return f"{_one_after_another(steps)} explains {what}"
    words = f"{_one_after_another(no_gain)} takes away less than {_percent(policy.least_help)} of the gap"
    return f"{_one_after_another(helping)} explains {what}, {words}"


def _without_zero_errors(steps: Sequence[Step], initial: Gap) -> Gap:
    """Return the gap once zero errors that come first are put right, its response at most as large as at first.

    From where a displacement is counted must not decide whether the effects after it make the response worse.
    """
    first = list(takewhile(lambda step: step.effect in ZERO_ERRORS, steps))
    if not first or len(first) == len(steps):
        return initial
    return replace(initial, response=float(np.fmin(initial.response, first[-1].gap_after.response)))


def _percent(share: float) -> str:
    return f"{100 * share:.3g} %"


def discount(steps: Sequence[Step], verdict: str, gaps: Gaps, policy: DiagnosisPolicy) -> tuple[Step, ...]:
    """Give what is outside the catalogue its probability, taken from all names of each step.

    Where something unknown remains, no name may be near certain: it may stand in for what is not known. Beside a
    remainder that is as likely as the share of the gap that remains, within ``partly_outside``.
    """
    if verdict in ("unknown", "undecided"):
        outside = policy.mostly
    elif verdict == "partly_named":
        outside = float(np.clip(gaps.remains(), *policy.partly_outside))
    else:
        return tuple(steps)
    inside = 1 - outside
    later = []
    for step in steps:
        rivals = [(name, inside * p) for name, p in step.rivals] + [(UNKNOWN, outside)]
        rivals.sort(key=lambda each: -each[1])
        later.append(replace(step, probability=inside * step.probability, rivals=tuple(rivals)))
    return tuple(later)


def grows(before: Gap, after: Gap, by: float = 0.0) -> bool:
    """Return whether a gap of the moment grows by more than a share, or of the response where no moment is measured.

    Where the response falls to a fraction of what it was, the moment may grow: that of a free motion is its inertia's.
    """
    if before.moment == before.moment and after.moment == after.moment:
        falls = after.response <= CAMPAIGN.little_help * before.response
        return after.moment > (1 + by) * before.moment and not falls
    return after.response > (1 + by) * before.response


def with_falling_gaps(steps: Sequence[Step], initial: Gap) -> tuple[Step, ...]:
    """Return steps none of which makes the gap larger: those that help only together have one gap, before and after.

    A displacement that is counted from the joint's own zero, say, fits worse until the law is there that has its middle
    at that zero. Such steps name each other, and share the gap before the first and after the last of them; where it
    grows at the end, with the step before.
    """
    groups: list[list[Step]] = []
    before, pending = initial, list[Step]()
    for step in steps:
        pending.append(step)
        if not grows(before, step.gap_after):
            groups.append(pending)
            before, pending = step.gap_after, []
    while pending and groups:
        pending = [*groups.pop(), *pending]
        before = groups[-1][-1].gap_after if groups else initial
        if not grows(before, pending[-1].gap_after):
            groups.append(pending)
            pending = []
    if pending:
        groups.append(pending)
    return tuple(_joined(groups, initial))


def _joined(groups: Sequence[Sequence[Step]], initial: Gap) -> Iterator[Step]:
    before, needless = initial, frozenset[str]()
    for group in groups:
        after = group[-1].gap_after
        names = tuple(step.effect for step in group) if len(group) > 1 else ()
        for step in group:
            # Effects that are fitted together all have the terms that no longer count: the first one states them.
            first = tuple(term for term in step.terms_dropped if term not in needless)
            needless |= set(first)
            yield replace(step, gap_before=before, gap_after=after, together=names, terms_dropped=first)
        before = after


def reported_together(steps: Sequence[Step]) -> list[tuple[Step, ...]]:
    """Return the steps in groups that share a gap, in their order."""
    groups: list[tuple[Step, ...]] = []
    for step in steps:
        if step.together and groups and groups[-1][-1].together == step.together:
            groups[-1] = (*groups[-1], step)
        else:
            groups.append((step,))
    return groups


def without_help(steps: Sequence[Step], least: float) -> tuple[Step, ...]:
    """Return the steps that take away less than a share of either gap: they may stand in for something else."""
    groups = reported_together(steps)
    return tuple(
        s for group in groups if not _helps(group[0].gap_before, group[-1].gap_after, least) for s in group
    )


def _helps(before: Gap, after: Gap, least: float) -> bool:
    pairs = (before.moment, after.moment), (before.response, after.response)
    return any(not last > (1 - least) * first for first, last in pairs if first == first)
