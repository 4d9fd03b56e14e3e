"""All detectors, run on a campaign or on a structure's test: one list of findings, the severest first."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np

from sindyjoint.errors import InputError, SindyJointError
from sindyjoint.mechanics.rig_test import RigRun, RigTest
from sindyjoint.record import Campaign
from sindyjoint.soundness.detectors import copies, course, sizes, spikes, tones, values
from sindyjoint.soundness.finding import Finding, in_order
from sindyjoint.soundness.law import filters, motions, odd_runs
from sindyjoint.soundness.masking import fill_test
from sindyjoint.soundness.record import Record, record_of, record_of_structure
from sindyjoint.soundness.structure.sensors import find_in_sensors
from sindyjoint.soundness.words import Words, words_of, words_of_rig
from sindyjoint.states.build import force_states
from sindyjoint.substructure.recovery import Recovery, recover

# Runs that do not repeat that are held against each other: time.
MOST_BROADBAND = 24


def find_faults(campaign: Campaign) -> tuple[Finding, ...]:
    """Return what is wrong with the data of a campaign, the severest first.

    Samples are looked at first; those that can be left out are, before runs are looked at as a whole, and runs that
    cannot be used are left out before they are held against each other.

    Parameters
    ----------
    campaign : Campaign
    """
    with np.errstate(all="ignore"):
        return in_order(_find_in_campaign(campaign, words_of(campaign.joint.motion)))


def find_rig_faults(test: RigTest) -> tuple[Finding, ...]:
    """Return what is wrong with the data of a structure, the severest first.

    Samples are looked at first; those that can be filled in are, before runs are looked at as a whole, and runs at
    fault are left out before channels are held against each other.

    Parameters
    ----------
    test : RigTest
    """
    with np.errstate(all="ignore"):
        return in_order(_find_in_test(test, words_of_rig(test)))


def _find_in_samples(records: Sequence[Record], words: Words) -> Iterator[Finding]:
    """Yield what single samples show, of whichever record."""
    for record in records:
        yield from values.find_lost(record, words)
        yield from values.find_saturation(record, words)
        yield from values.find_held(record, words)
        yield from values.find_coarse_steps(record, words)
    yield from spikes.find_spikes(records, words)


def _find_in_test(test: RigTest, words: Words) -> Iterator[Finding]:
    raw = [record_of_structure(test, run) for run in test.runs]
    yield from sizes.find_unit_mismatches(raw, words)
    dead, twice = list(values.find_dead(raw, words)), list(copies.find_copies(raw, words))
    samples = list(_find_in_samples(raw, words))
    filled = fill_test(test, samples)[0]
    whole = [record_of_structure(filled, run) for run in filled.runs]
    along = [
        f for record in whole for f in (*tones.find_lines(record, words), *course.find_course(record, words))
    ]
    found = [*dead, *twice, *samples, *along]
    yield from found
    odd = {f.run for f in found if f.severity != "note" and not f.masked and f.id != "no_signal"}
    sound = [run for run in filled.runs if run.name not in odd]
    yield from find_in_sensors(test, list(_recovered(test, sound)), words)


def _recovered(test: RigTest, runs: Sequence[RigRun]) -> Iterator[Recovery]:
    """Yield what is recovered of runs; what is too short for it is for the recovery to say."""
    for run in runs:
        try:
            yield recover(test, run)
        except InputError:
            continue


def _find_in_campaign(campaign: Campaign, words: Words) -> Iterator[Finding]:
    raw = [record_of(run) for run in campaign.runs]
    yield from sizes.find_unequal_units(campaign, words)
    yield from sizes.find_unit_mismatches(raw, words)
    yield from values.find_dead(raw, words)
    yield from sizes.find_sizes(raw, words)
    yield from copies.find_copies(raw, words)
    if campaign.quasi_static:
        for record in raw:
            yield from values.find_saturation(record, words)
        return
    samples = list(_find_in_samples(raw, words))
    yield from samples
    records = [record.bridged(samples) for record in raw]
    for record in records:
        yield from sizes.find_disagreement(record, words)
    lines = [finding for record in records for finding in tones.find_lines(record, words)]
    yield from lines
    whole = [r for r in records if r.name not in {f.run for f in lines}]
    along = [finding for record in whole for finding in course.find_course(record, words)]
    yield from along
    yield from tones.find_noise(records, words)
    yield from sizes.find_offsets(records, words)
    yield from sizes.find_coverage(records, words)
    even = [r for r in whole if r.name not in {f.run for f in along}]
    yield from _find_in_laws(campaign, even, words)


def _find_in_laws(campaign: Campaign, records: Sequence[Record], words: Words) -> Iterator[Finding]:
    """Yield what only the law between the channels shows."""
    for record in records:
        yield from tones.find_mains(record, words)
    cycles, inertia = motions.mean_cycles(records), campaign.joint.inertia
    backwards = list(filters.find_signs(records, cycles, inertia, words))
    found = [*backwards, *filters.find_inertia(cycles, inertia, words)]
    named = {finding.run for finding in backwards}
    if None not in named:
        cycles = cycles.take([i for i, name in enumerate(cycles.names) if name not in named])
        scales, cycles = odd_runs.find_other_scales(cycles, inertia, words)
        odd, cycles = odd_runs.find_odd_runs(cycles, inertia, words)
        found += [*scales, *odd, *filters.find_filters(cycles, inertia, words)]
    yield from found
    if any(finding.severity == "stops" for finding in found):
        return
    broadband = list(_find_in_broadband(campaign, records, words))
    yield from broadband
    filtered = any(f.id in ("low_pass", "ac_coupling") for f in found)
    odd_names = {f.run for f in (*found, *broadband) if f.id != "drift"}
    sound = [r.run for r in records if r.run is not None and r.name not in odd_names and len(r.alive) > 1]
    yield from () if filtered else filters.find_channel_delay(campaign, sound, words)


def _find_in_broadband(campaign: Campaign, records: Sequence[Record], words: Words) -> Iterator[Finding]:
    """Yield runs without a frequency that have another gain or law than the others, and those that drift."""
    inertia = campaign.joint.inertia
    alive = [r.run for r in records if r.declared is None and r.run is not None and len(r.alive) > 1]
    try:
        runs = motions.samples_of([force_states(run) for run in alive[:MOST_BROADBAND]])
        scales, runs = odd_runs.find_other_scales(runs, inertia, words)
        found, alike = odd_runs.find_odd_runs(runs, inertia, words)
        # What drifts departs from the law of the others, too.
        explained = {f.run for f in found if f.id != "run_differs"}
        left = runs.take([i for i, name in enumerate(runs.names) if name not in explained])
        drifts = list(odd_runs.find_drifts(left, alike, inertia, words)) if len(alike) else []
    # A joint that hardly moves, too short a run, states that are all alike or beyond what squares can hold.
    except (SindyJointError, np.linalg.LinAlgError, ValueError):
        return
    drifting = {f.run for f in drifts}
    yield from (*scales, *drifts, *(f for f in found if f.run not in drifting))
