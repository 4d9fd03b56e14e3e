"""Data that were checked: verdict, reason, what is used of them, and what every result on them has to say first."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from typing import ClassVar, Generic, TypeVar

from sindyjoint.errors import UnknownNameError, UnsoundError
from sindyjoint.mechanics.rig_test import RigTest
from sindyjoint.record import Campaign, Motion, Run
from sindyjoint.shown import Shown
from sindyjoint.soundness.faults import find_faults, find_rig_faults
from sindyjoint.soundness.finding import DELAY, KINDS, PHASE, Finding, Soundness
from sindyjoint.soundness.masking import fill_test, mask_campaign
from sindyjoint.soundness.record import Record, record_of_structure
from sindyjoint.soundness.words import Words, words_of, words_of_rig
from sindyjoint.text import list_some, spelled

Data = TypeVar("Data", Campaign, RigTest)
C = TypeVar("C", bound="Checked")


@dataclass(frozen=True, eq=False, repr=False)
class Checked(Shown, Generic[Data]):
    """The check of a campaign or of a structure's test.

    Parameters
    ----------
    measured : Campaign or RigTest
        As it was read.
    soundness : Soundness
    usable : Campaign or RigTest
        Without the samples that are left out; of a structure, with them filled in where they can be.
    warnings : tuple of str
        What every result on it says first: accepted faults, those that bias, what is left out, what was not checked.
    """

    SCHEMA: ClassVar = 1
    WRITTEN: ClassVar = {"verdict": "soundness.verdict", "findings": "soundness.findings"}
    measured: Data = field(repr=False)
    soundness: Soundness
    usable: Data
    warnings: tuple[str, ...] = ()

    @property
    def name(self) -> str:
        """Of the joint, or of the structure."""
        return self.measured.name if isinstance(self.measured, RigTest) else self.measured.joint.name

    @property
    def motion(self) -> Motion:
        """Of the joints."""
        return self.measured.motion if isinstance(self.measured, RigTest) else self.measured.joint.motion

    @property
    def words(self) -> Words:
        """What the channels are called."""
        return words_of_rig(self.measured) if isinstance(self.measured, RigTest) else words_of(self.motion)

    @property
    def recorded(self) -> Sequence[Run | Record]:
        """The runs."""
        if isinstance(self.measured, RigTest):
            return [record_of_structure(self.measured, run) for run in self.measured.runs]
        return self.measured.runs

    @property
    def simulated(self) -> bool:
        """Whether the runs come from a virtual test."""
        return self.measured.simulated

    @property
    def excitations(self) -> Sequence[tuple[float | None, str | None]]:
        """Frequency and level of the runs that are used for identification."""
        return [(run.frequency, run.level) for run in self.measured.identification_runs]

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
        faults = "; ".join(describe(self.stopping, self.words, self.motion))
        return f"the data are unsound: {faults} ({ids} goes on all the same)"

    def undecided_by(self, aligned: bool = False) -> tuple[Finding, ...]:
        """Return the findings under which the paper's set of terms is neither confirmed nor refuted.

        Those that stop, accepted or not, and what shifts one channel against the other in time, unless it is a delay
        that was removed.
        """
        removed = self._removed(aligned)
        shifting = [f for f in self.soundness.findings if f.id in PHASE and f.severity == "biases"]
        return tuple(
            f
            for f in self.soundness.findings
            if f.severity == "stops" or (f in shifting and f not in removed)
        )

    def warned(self, aligned: bool) -> tuple[str, ...]:
        """Return the warnings without that of a delay which was removed."""
        said = describe(self._removed(aligned), self.words, self.motion)
        return tuple(line for line in self.warnings if line not in said)

    def _removed(self, aligned: bool) -> list[Finding]:
        """Return the delays that all runs share, where the channels were aligned."""
        return [f for f in self.soundness.findings if aligned and f.id == DELAY and f.run is None]


class Check(Checked[Campaign]):
    """The check of a campaign."""

    @property
    def campaign(self) -> Campaign:
        """As it was read."""
        return self.measured


class RigCheck(Checked[RigTest]):
    """The check of a structure's test."""

    @property
    def test(self) -> RigTest:
        """As it was read."""
        return self.measured


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
    faults = list_faults(soundness, words_of(campaign.joint.motion), campaign.joint.motion)
    return Check(campaign, soundness, usable, (*faults, *masked, *_list_unchecked(campaign)))


def check_rig_test(test: RigTest, accept: Sequence[str] = ()) -> RigCheck:
    """Return the check of a structure's test.

    Parameters
    ----------
    test : RigTest
        With runs.
    accept : sequence of str
        Ids of findings that no longer stop the work.

    Raises
    ------
    UnknownNameError
        For an id that no finding has.
    """
    check_accepted(accept)
    soundness = Soundness(find_rig_faults(test), tuple(dict.fromkeys(accept)))
    usable, filled = fill_test(test, soundness.findings)
    return RigCheck(
        test, soundness, usable, (*list_faults(soundness, words_of_rig(test), test.motion), *filled)
    )


def check_accepted(accept: Sequence[str]) -> None:
    """Raise UnknownNameError for an accepted id that no finding has."""
    for name in accept:
        if name not in KINDS:
            raise UnknownNameError(f"accept is {name!r}; expected one of {', '.join(KINDS)}")


def require_sound(check: C) -> C:
    """Return a check under which the work may go on.

    Raises
    ------
    UnsoundError
        Where findings stop it.
    """
    if check.stopping:
        raise UnsoundError(check.reason, check)
    return check


def list_faults(soundness: Soundness, words: Words, motion: Motion) -> Iterator[str]:
    """Yield what was accepted, and what biases and is not left out."""
    accepted = [f for f in soundness.findings if f.severity == "stops" and f.id in soundness.accepted]
    yield from (f"accepted: {line}" for line in describe(accepted, words, motion))
    biasing = [f for f in soundness.findings if f.severity == "biases" and not f.masked]
    yield from describe(biasing, words, motion)


def describe(findings: Sequence[Finding], words: Words, motion: Motion) -> list[str]:
    """Return a sentence for each kind of finding and channel: where, how much, what it does, what to do."""
    groups: dict[tuple[str, str | None], list[Finding]] = {}
    for finding in findings:
        groups.setdefault((finding.id, finding.channel), []).append(finding)
    lines = []
    for (kind, channel), group in groups.items():
        first, runs = group[0], list_some([f.run for f in group if f.run is not None])
        where = (f" of the {words.of(channel)}" if channel else "") + (f" in {runs}" if runs else "")
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
