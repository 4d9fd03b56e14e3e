"""All detectors run on a campaign or a structure's test: findings, verdict, what is used, what is said first."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field, replace
from typing import Any, ClassVar, Generic, TypeVar

import numpy as np

from sindyjoint.described import Shown, same
from sindyjoint.errors import SindyJointError, UnknownNameError, UnsoundError
from sindyjoint.mechanics.rig_test import RigTest
from sindyjoint.record import Campaign
from sindyjoint.soundness import (
    DELAY,
    KINDS,
    PHASE,
    Finding,
    Soundness,
    Words,
    in_order,
    words_of_data,
)
from sindyjoint.soundness.detectors import (
    Record,
    copies,
    course,
    records_of,
    sizes,
    values,
)
from sindyjoint.soundness.law import filters, mean_cycles, odd_runs, samples_of
from sindyjoint.soundness.masking import bridge_record, leave_out_standstill, mask_faults
from sindyjoint.states import force_states
from sindyjoint.text import list_some, spelled


def find_faults(measured: Campaign | RigTest) -> tuple[Finding, ...]:
    """Return what is wrong with the data of a campaign or of a structure's test, the severest first.

    Samples are looked at first; those that can be left out (of a structure, filled in) are, before runs are looked at
    as a whole; and runs that cannot be used are left out before they, or channels, are held against each other.

    Parameters
    ----------
    measured : Campaign or RigTest
    """
    words = words_of_data(measured)
    with np.errstate(all="ignore"):
        if isinstance(measured, RigTest):
            return in_order(_find_in_test(measured, words))
        return in_order(_find_in_campaign(measured, words))


def _find_in_samples(records: Sequence[Record], words: Words) -> list[Finding]:
    """Return what single samples show, of whichever record."""
    each = (values.find_lost, values.find_saturation, values.find_held, values.find_coarse_steps)
    found = (f for record in records for find in each for f in find(record, words))
    return [*found, *values.find_spikes(records, words)]


def _find_in_test(test: RigTest, words: Words) -> list[Finding]:
    from sindyjoint.soundness.law.sensors import find_in_sensors, recovered

    raw = records_of(test)
    samples = _find_in_samples(raw, words)
    filled = mask_faults(test, samples)[0]
    found = [
        *values.find_dead(raw, words),
        *copies.find_blocks(raw, words),
        *copies.find_scaled(raw, words),
        *samples,
        *(
            f
            for record in records_of(filled)
            for f in (*sizes.find_lines(record, words), *course.find_course(record, words))
        ),
    ]
    odd = {f.run for f in found if f.severity != "note" and not f.masked and f.id != "no_signal"}
    sound = list(recovered(test, [run for run in filled.runs if run.name not in odd]))
    return [*sizes.find_unit_mismatches(raw, words), *found, *find_in_sensors(test, sound, words)]


def _find_in_campaign(campaign: Campaign, words: Words) -> list[Finding]:
    raw = records_of(campaign)
    found = [
        *sizes.find_guesses(campaign),
        *sizes.find_unequal_units(campaign, words),
        *sizes.find_other_sensors(campaign, words),
        *sizes.find_unit_mismatches(raw, words),
        *values.find_dead(raw, words),
        *sizes.find_sizes(raw, words),
        *copies.find_blocks(raw, words),
        *copies.find_scaled(raw, words),
    ]
    if campaign.quasi_static:
        return [*found, *(f for record in raw for f in values.find_saturation(record, words))]
    samples = _find_in_samples(raw, words)
    records = [bridge_record(record, samples) for record in raw]
    lines = [finding for record in records for finding in sizes.find_lines(record, words)]
    whole = [r for r in records if r.name not in {f.run for f in lines}]
    along = [finding for record in whole for finding in course.find_course(record, words)]
    even = [r for r in whole if r.name not in {f.run for f in along}]
    return [
        *found,
        *samples,
        *(f for record in records for f in sizes.find_disagreement(record, words)),
        *lines,
        *along,
        *sizes.find_noise(records, words),
        *sizes.find_offsets(records, words),
        *sizes.find_coverage(records, words),
        *(f for record in even for f in sizes.find_mains(record, words)),
        *_find_in_laws(campaign, even, words),
    ]


def _find_in_laws(campaign: Campaign, records: Sequence[Record], words: Words) -> list[Finding]:
    """Return what only the law between the channels shows."""
    cycles, inertia = mean_cycles(records), campaign.joint.inertia
    backwards = list(filters.find_signs(records, cycles, inertia, words))
    found = [*backwards, *filters.find_inertia(cycles, inertia, words)]
    named = {finding.run for finding in backwards}
    if None not in named:
        cycles = cycles.take([i for i, name in enumerate(cycles.names) if name not in named])
        scales, cycles = odd_runs.find_other_scales(cycles, inertia, words)
        odd, cycles = odd_runs.find_odd_runs(cycles, inertia, words)
        found += [*scales, *odd, *filters.find_filters(cycles, inertia, words)]
    if any(finding.severity == "stops" for finding in found):
        return found
    filtered = any(f.id in ("low_pass", "ac_coupling") for f in found)
    found += _find_in_broadband(campaign, records, words)
    odd_names = {f.run for f in found if f.id != "drift"}
    sound = [r.run for r in records if r.run is not None and r.name not in odd_names and len(r.alive) > 1]
    return found if filtered else [*found, *filters.find_channel_delay(campaign, sound, words)]


def _find_in_broadband(campaign: Campaign, records: Sequence[Record], words: Words) -> list[Finding]:
    """Return runs without a frequency that have another gain or law than the others, and those that drift."""
    inertia = campaign.joint.inertia
    alive = [r.run for r in records if r.declared is None and r.run is not None and len(r.alive) > 1]
    try:
        # So that it takes no longer, no more runs are held against each other.
        runs = samples_of([force_states(run) for run in alive[:24]])
        scales, runs = odd_runs.find_other_scales(runs, inertia, words)
        found, alike = odd_runs.find_odd_runs(runs, inertia, words)
        # What drifts departs from the law of the others, too.
        explained = {f.run for f in found if f.id != "run_differs"}
        left = runs.take([i for i, name in enumerate(runs.names) if name not in explained])
        drifts = list(odd_runs.find_drifts(left, alike, inertia, words)) if len(alike) else []
    # A joint that hardly moves, too short a run, states that are all alike or beyond what squares can hold.
    except (SindyJointError, np.linalg.LinAlgError, ValueError):
        return []
    drifting = {f.run for f in drifts}
    return [*scales, *drifts, *(f for f in found if f.run not in drifting)]


Data = TypeVar("Data", Campaign, RigTest)


@dataclass(frozen=True, eq=False, repr=False)
class Check(Shown, Generic[Data]):
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
    WRITTEN: ClassVar = {
        "verdict": "soundness.verdict",
        "findings": "soundness.findings",
        **same("notes"),
    }
    measured: Data = field(repr=False)
    soundness: Soundness
    usable: Data
    warnings: tuple[str, ...] = ()

    @property
    def campaign(self) -> Campaign | None:
        """As it was read; None of a structure."""
        return self.measured if isinstance(self.measured, Campaign) else None

    @property
    def notes(self) -> tuple[str, ...]:
        """What was decided when a campaign was read."""
        return self.measured.notes if isinstance(self.measured, Campaign) else ()

    @property
    def name(self) -> str:
        """Of the joint, or of the structure."""
        return self.measured.name if isinstance(self.measured, RigTest) else self.measured.joint.name

    @property
    def words(self) -> Words:
        """What the channels are called."""
        return words_of_data(self.measured)

    @property
    def recorded(self) -> Sequence[Record]:
        """The runs."""
        return records_of(self.measured)

    @property
    def simulated(self) -> bool:
        """Whether the runs come from a virtual test."""
        return self.measured.simulated

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
        faults = "; ".join(describe(self.stopping, self.words))
        return f"the data are unsound: {faults} ({ids} goes on all the same)"

    def undecided_by(self, aligned: bool = False) -> tuple[Finding, ...]:
        """Return the findings under which the paper's set of terms is neither confirmed nor refuted.

        Those that stop, accepted or not, and what shifts one channel against the other in time, unless it is a delay
        that was removed.
        """
        removed = self._removed(aligned)
        return tuple(
            f
            for f in self.soundness.findings
            if f.severity == "stops" or (f.severity == "biases" and f.id in PHASE and f not in removed)
        )

    def warned(self, aligned: bool) -> tuple[str, ...]:
        """Return the warnings without that of a delay which was removed."""
        said = describe(self._removed(aligned), self.words)
        return tuple(line for line in self.warnings if line not in said)

    def _removed(self, aligned: bool) -> list[Finding]:
        """Return the delays that all runs share, where the channels were aligned."""
        return [f for f in self.soundness.findings if aligned and f.id == DELAY and f.run is None]


def check_data(measured: Campaign | RigTest, accept: Sequence[str] = ()) -> Check[Any]:
    """Return the check of a campaign or of a structure's test.

    Parameters
    ----------
    measured : Campaign or RigTest
        Of runs too long for memory, the first segment is checked, and nothing is left out of them.
    accept : sequence of str
        Ids of findings that no longer stop the work.

    Raises
    ------
    UnknownNameError
        For an id that no finding has.
    """
    check_accepted(accept)
    soundness = Soundness(find_faults(measured), tuple(dict.fromkeys(accept)))
    words = words_of_data(measured)
    usable, said = mask_faults(measured, soundness.findings)
    if isinstance(measured, Campaign):
        usable, still, motionless = leave_out_standstill(usable, words)
        soundness = replace(soundness, findings=in_order((*soundness.findings, *motionless)))
        said = (*said, *still, *_list_unchecked(measured))
    return Check(measured, soundness, usable, (*list_faults(soundness, words), *said))


def check_accepted(accept: Sequence[str]) -> None:
    """Raise UnknownNameError for an accepted id that no finding has."""
    for name in accept:
        if name not in KINDS:
            raise UnknownNameError(f"accept is {name!r}; expected one of {', '.join(KINDS)}")


def require_sound(check: Check[Data]) -> Check[Data]:
    """Return a check under which the work may go on.

    Raises
    ------
    UnsoundError
        Where findings stop it.
    """
    if check.stopping:
        raise UnsoundError(check.reason, check)
    return check


def list_faults(soundness: Soundness, words: Words) -> list[str]:
    """Return what was accepted, and what biases and is not left out."""
    accepted = [f for f in soundness.findings if f.severity == "stops" and f.id in soundness.accepted]
    biasing = [f for f in soundness.findings if f.severity == "biases" and not f.masked]
    return [*(f"accepted: {line}" for line in describe(accepted, words)), *describe(biasing, words)]


def describe(findings: Sequence[Finding], words: Words) -> list[str]:
    """Return a sentence for each kind of finding and channel: where, how much, what it does, what to do."""
    groups: dict[tuple[str, str | None], list[Finding]] = {}
    for finding in findings:
        groups.setdefault((finding.id, finding.channel), []).append(finding)
    lines = []
    for (kind, channel), group in groups.items():
        first, runs = group[0], list_some([f.run for f in group if f.run is not None])
        named = spelled(kind, words.motion)
        named += f" of the {words.of(channel)}" if channel and words.of(channel) not in named else ""
        lines.append(
            f"{named}{f' in {runs}' if runs else ''}: {first.extent}; {first.effect}; {first.remedy}"
        )
    return lines


def _list_unchecked(campaign: Campaign) -> Iterator[str]:
    long = [run.name for run in campaign.runs if run.whole is not None]
    notes = [
        (
            campaign.quasi_static,
            "the samples have no time: delay, drift, filters, mains, spikes and repetition were not checked",
        ),
        (
            long,
            f"too long for memory: {list_some(long)}; only the first segment was checked for faults, and no sample is "
            "left out",
        ),
    ]
    return (words for there, words in notes if there)
