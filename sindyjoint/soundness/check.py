"""Data that were checked: their findings, what is used of them, and what every result on them has to say first."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from functools import cached_property

from sindyjoint.mechanics.rig_test import RigTest
from sindyjoint.record import Campaign, Motion, Run
from sindyjoint.soundness.checked import Checked, check_accepted, list_faults, require_sound
from sindyjoint.soundness.faults import find_faults, find_rig_faults
from sindyjoint.soundness.finding import Soundness
from sindyjoint.soundness.masking import fill_test, mask_campaign
from sindyjoint.soundness.record import Record, record_of_structure
from sindyjoint.soundness.words import Words, words_of, words_of_rig
from sindyjoint.text import list_some

__all__ = ["Check", "RigCheck", "check_accepted", "check_campaign", "check_rig_test", "require_sound"]


@dataclass(frozen=True, eq=False, repr=False)
class Check(Checked):
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
    usable: Campaign
    warnings: tuple[str, ...] = ()

    @property
    def measured(self) -> Campaign:
        """The campaign."""
        return self.campaign

    @property
    def name(self) -> str:
        """Of the joint."""
        return self.campaign.joint.name

    @property
    def motion(self) -> Motion:
        """Of the joint."""
        return self.campaign.joint.motion

    @property
    def words(self) -> Words:
        """What the channels are called."""
        return words_of(self.motion)

    @property
    def recorded(self) -> Sequence[Run]:
        """The runs."""
        return self.campaign.runs


@dataclass(frozen=True, eq=False, repr=False)
class RigCheck(Checked):
    """The check of a structure's test.

    Parameters
    ----------
    test : RigTest
        As it was read.
    soundness : Soundness
    usable : RigTest
        Its samples at fault filled in, where they can be.
    warnings : tuple of str
        What every result on it says first: accepted faults, those that bias, what is filled in.
    """

    test: RigTest = field(repr=False)
    soundness: Soundness
    usable: RigTest
    warnings: tuple[str, ...] = ()

    @property
    def measured(self) -> RigTest:
        """The test."""
        return self.test

    @property
    def name(self) -> str:
        """Of the structure."""
        return self.test.name

    @property
    def motion(self) -> Motion:
        """Of the joints."""
        return self.test.motion

    @property
    def words(self) -> Words:
        """What the channels are called."""
        return words_of_rig(self.test)

    @cached_property
    def recorded(self) -> Sequence[Record]:
        """The runs."""
        return [record_of_structure(self.test, run) for run in self.test.runs]


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
    faults = list_faults(soundness, words_of_rig(test), test.motion)
    return RigCheck(test, soundness, usable, (*faults, *filled))


def _list_unchecked(campaign: Campaign) -> Iterator[str]:
    if campaign.quasi_static:
        yield "the samples have no time: delay, drift, filters, mains, spikes and repetition were not checked"
    long = [run.name for run in campaign.runs if run.whole is not None]
    if long:
        yield (
            f"too long for memory: {list_some(long)}; only the first segment was checked for faults, and no sample is "
            "left out"
        )
