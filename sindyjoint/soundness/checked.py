"""What the check of a campaign and that of a structure have in common: verdict, reason, and what is said first."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from typing import ClassVar, Protocol, TypeVar

from sindyjoint.errors import UnknownNameError, UnsoundError
from sindyjoint.mechanics.rig_test import RigTest
from sindyjoint.numeric import Array
from sindyjoint.record import Campaign, Motion
from sindyjoint.shown import Shown
from sindyjoint.soundness.finding import Finding, Soundness
from sindyjoint.soundness.kinds import DELAY, KINDS, PHASE
from sindyjoint.soundness.words import Words
from sindyjoint.text import list_some, spelled

C = TypeVar("C", bound="Checked")


class RecordedRun(Protocol):
    """A run as it is drawn."""

    @property
    def name(self) -> str:
        """Of the run."""

    @property
    def sample_rate(self) -> float:
        """Hz."""

    @property
    def duration(self) -> float:
        """Length, s."""

    @property
    def channels(self) -> Mapping[str, Array]:
        """Signals by name."""

    @property
    def quasi_static(self) -> bool:
        """Whether its samples have no time."""


class Checked(Shown):
    """The check of a campaign or of a structure; the classes for these have the fields."""

    SCHEMA: ClassVar = 1
    WRITTEN: ClassVar = {"verdict": "soundness.verdict", "findings": "soundness.findings"}
    soundness: Soundness
    warnings: tuple[str, ...]

    @property
    def measured(self) -> Campaign | RigTest:
        """What was checked."""
        raise NotImplementedError

    @property
    def name(self) -> str:
        """Of the joint, or of the structure."""
        raise NotImplementedError

    @property
    def motion(self) -> Motion:
        """Of the joints."""
        raise NotImplementedError

    @property
    def words(self) -> Words:
        """What the channels are called."""
        raise NotImplementedError

    @property
    def recorded(self) -> Sequence[RecordedRun]:
        """The runs."""
        raise NotImplementedError

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
        return tuple(
            f
            for f in self.soundness.findings
            if f.severity == "stops"
            or (f.id in PHASE and f.severity == "biases" and not (aligned and _removed_by_aligning(f)))
        )

    def warned(self, aligned: bool) -> tuple[str, ...]:
        """Return the warnings without that of a delay which was removed."""
        delays = [f for f in self.soundness.findings if aligned and _removed_by_aligning(f)]
        said = describe(delays, self.words, self.motion)
        return tuple(line for line in self.warnings if line not in said)


def _removed_by_aligning(finding: Finding) -> bool:
    """Return whether a finding is a delay that all runs share."""
    return finding.id == DELAY and finding.run is None


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
    yield from describe(
        [f for f in soundness.findings if f.severity == "biases" and not f.masked], words, motion
    )


def describe(findings: Sequence[Finding], words: Words, motion: Motion) -> list[str]:
    """Return a sentence for each kind of finding and channel: where, how much, what it does, what to do."""
    groups: dict[tuple[str, str | None], list[Finding]] = {}
    for finding in findings:
        groups.setdefault((finding.id, finding.channel), []).append(finding)
    lines = []
    for (kind, channel), group in groups.items():
        first = group[0]
        runs = list_some([f.run for f in group if f.run is not None])
        where = (f" of the {words.of(channel)}" if channel else "") + (f" in {runs}" if runs else "")
        lines.append(f"{spelled(kind, motion)}{where}: {first.extent}; {first.effect}; {first.remedy}")
    return lines
