"""A campaign that was checked: its findings, what is used of it, and what every result on it has to say first."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field

from sindyjoint.record import Campaign, Motion, Run
from sindyjoint.soundness.checked import Checked, check_accepted, list_faults, require_sound
from sindyjoint.soundness.faults import find_faults
from sindyjoint.soundness.finding import Soundness
from sindyjoint.soundness.masking import mask_campaign
from sindyjoint.soundness.words import Words, words_of
from sindyjoint.text import list_some

__all__ = ["Check", "check_accepted", "check_campaign", "require_sound"]


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
    def name(self) -> str:
        """Of the joint."""
        return self.campaign.joint.name

    @property
    def motion(self) -> Motion:
        """Of the joint."""
        return self.campaign.joint.motion

    @property
    def simulated(self) -> bool:
        """Whether the runs come from a virtual test."""
        return self.campaign.simulated

    @property
    def words(self) -> Words:
        """What the channels are called."""
        return words_of(self.motion)

    @property
    def recorded(self) -> Sequence[Run]:
        """The runs."""
        return self.campaign.runs

    @property
    def excitations(self) -> Sequence[tuple[float | None, str | None]]:
        """Frequency and level of the runs that are used for identification."""
        return [(run.frequency, run.level) for run in self.campaign.identification_runs]


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
    warnings = (
        *list_faults(soundness, words_of(campaign.joint.motion), campaign.joint.motion),
        *masked,
        *_list_unchecked(campaign),
    )
    return Check(campaign, soundness, usable, warnings)


def _list_unchecked(campaign: Campaign) -> Iterator[str]:
    if campaign.quasi_static:
        yield "the samples have no time: delay, drift, filters, mains, spikes and repetition were not checked"
    long = [run.name for run in campaign.runs if run.whole is not None]
    if long:
        yield (
            f"too long for memory: {list_some(long)}; only the first segment was checked for faults, and no sample is "
            "left out"
        )
