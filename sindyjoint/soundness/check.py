"""A campaign that was checked: its findings, what is used of it, and what every result on it has to say first."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from typing import Any

from sindyjoint.errors import UnknownNameError, UnsoundError
from sindyjoint.record import Campaign, Motion
from sindyjoint.shown import Shown
from sindyjoint.soundness.faults import find_faults
from sindyjoint.soundness.finding import Finding, Soundness
from sindyjoint.soundness.kinds import DELAY, KINDS, PHASE
from sindyjoint.soundness.masking import mask_campaign
from sindyjoint.soundness.words import words_of
from sindyjoint.text import list_some, spelled


@dataclass(frozen=True, eq=False, repr=False)
class Check(Shown):
    """The check of a campaign.

    Parameters
    ----------
    campaign : Campaign
        As it was read.
    soundness : Soundness
    usable : Campaign
        Without the samples that are left out.
    warnings : tuple of str
        What every result on it says first: accepted faults, those that bias, what is left out, what was not checked.
    """

    campaign: Campaign = field(repr=False)
    soundness: Soundness
    usable: Campaign = field(repr=False)
    warnings: tuple[str, ...] = ()

    @property
    def stopping(self) -> tuple[Finding, ...]:
        """Findings under which no model is made."""
        return self.soundness.stopping

    @property
    def reason(self) -> str:
        """Why no model is made, in one sentence; empty where one may be."""
        if not self.stopping:
            return ""
        ids = " ".join(f"--accept {name}" for name in dict.fromkeys(f.id for f in self.stopping))
        faults = "; ".join(_describe(self.stopping, self.campaign.joint.motion))
        return f"the data are unsound: {faults} ({ids} goes on all the same)"

    def to_dict(self) -> dict[str, Any]:
        """Return what ``--json`` prints."""
        return self.soundness.to_dict()

    def undecided_by(self, aligned: bool = False) -> tuple[Finding, ...]:
        """Return the findings under which the paper's set of terms is neither confirmed nor refuted.

        Those that stop, accepted or not, and what shifts one channel against the other in time, unless it is a delay
        that was removed.
        """
        return tuple(
            f
            for f in self.soundness.findings
            if f.severity == "stops"
            or (f.id in PHASE and f.severity == "biases" and not (aligned and _removed_by_aligning(f)))
        )

    def warned(self, aligned: bool) -> tuple[str, ...]:
        """Return the warnings without that of a delay which was removed."""
        delays = [f for f in self.soundness.findings if aligned and _removed_by_aligning(f)]
        said = _describe(delays, self.campaign.joint.motion)
        return tuple(line for line in self.warnings if line not in said)


def _removed_by_aligning(finding: Finding) -> bool:
    """Return whether a finding is a delay that all runs share."""
    return finding.id == DELAY and finding.run is None


def check_campaign(campaign: Campaign, accept: Sequence[str] = ()) -> Check:
    """Return the check of a campaign.

    Parameters
    ----------
    campaign : Campaign
        Of runs too long for memory, the first segment is checked, and nothing is left out of them.
    accept : sequence of str
        Ids of findings that no longer stop the work.

    Raises
    ------
    UnknownNameError
        For an id that no finding has.
    """
    check_accepted(accept)
    soundness = Soundness(find_faults(campaign), tuple(dict.fromkeys(accept)))
    usable, masked = mask_campaign(campaign, soundness.findings)
    warnings = (*_list_faults(soundness, campaign.joint.motion), *masked, *_list_unchecked(campaign))
    return Check(campaign, soundness, usable, warnings)


def check_accepted(accept: Sequence[str]) -> None:
    """Raise UnknownNameError for an accepted id that no finding has."""
    for name in accept:
        if name not in KINDS:
            raise UnknownNameError(f"accept is {name!r}; expected one of {', '.join(KINDS)}")


def require_sound(check: Check) -> Check:
    """Return a check under which the work may go on.

    Raises
    ------
    UnsoundError
        Where findings stop it.
    """
    if check.stopping:
        raise UnsoundError(check.reason, check)
    return check


def summarize(soundness: Soundness) -> dict[str, Any]:
    """Return what a result's JSON says of its data: the verdict, and the ids that were found and accepted."""
    return {
        "verdict": soundness.verdict,
        "ids": list(dict.fromkeys(f.id for f in soundness.findings)),
        "accepted": list(soundness.accepted),
    }


def _list_faults(soundness: Soundness, motion: Motion) -> Iterator[str]:
    """Yield what was accepted, and what biases and is not left out."""
    accepted = [f for f in soundness.findings if f.severity == "stops" and f.id in soundness.accepted]
    yield from (f"accepted: {line}" for line in _describe(accepted, motion))
    yield from _describe([f for f in soundness.findings if f.severity == "biases" and not f.masked], motion)


def _describe(findings: Sequence[Finding], motion: Motion) -> list[str]:
    """Return a sentence for each kind of finding and channel: where, how much, what it does, what to do."""
    groups: dict[tuple[str, str | None], list[Finding]] = {}
    for finding in findings:
        groups.setdefault((finding.id, finding.channel), []).append(finding)
    lines = []
    for (kind, channel), group in groups.items():
        first = group[0]
        runs = list_some([f.run for f in group if f.run is not None])
        where = (f" of the {words_of(motion).of(channel)}" if channel else "") + (
            f" in {runs}" if runs else ""
        )
        lines.append(f"{spelled(kind, motion)}{where}: {first.extent}; {first.effect}; {first.remedy}")
    return lines


def _list_unchecked(campaign: Campaign) -> Iterator[str]:
    if campaign.quasi_static:
        yield "the samples have no time: delay, drift, filters, mains, spikes and repetition were not checked"
    long = [run.name for run in campaign.runs if run.whole is not None]
    if long:
        yield (
            f"too long for memory: {list_some(long)}; only the first segment was checked for faults, and no sample is "
            "left out"
        )
