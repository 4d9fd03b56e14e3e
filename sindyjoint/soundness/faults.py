"""All detectors, run on a campaign: one list of findings, the severest first."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence

import numpy as np

from sindyjoint.numeric import Array
from sindyjoint.record import Campaign
from sindyjoint.soundness.cycle import cycles_of, spectra_of
from sindyjoint.soundness.detectors.accelerometer import find_disagreement
from sindyjoint.soundness.detectors.broadband_delay import find_broadband_delay
from sindyjoint.soundness.detectors.broadband_law import find_broadband_faults
from sindyjoint.soundness.detectors.copies import find_repeated_blocks, find_scaled_copies
from sindyjoint.soundness.detectors.course import find_course
from sindyjoint.soundness.detectors.declared_units import find_unit_mismatches
from sindyjoint.soundness.detectors.floor import find_coarse_steps, find_mains, find_noise
from sindyjoint.soundness.detectors.held import find_dead, find_held
from sindyjoint.soundness.detectors.lines import find_lines
from sindyjoint.soundness.detectors.lost import find_lost
from sindyjoint.soundness.detectors.odd_runs import find_odd_runs
from sindyjoint.soundness.detectors.other_scales import find_other_scales
from sindyjoint.soundness.detectors.saturation import find_saturation
from sindyjoint.soundness.detectors.shape import find_filters
from sindyjoint.soundness.detectors.sizes import (
    find_coverage,
    find_inertia,
    find_offsets,
    find_signs,
    find_sizes,
)
from sindyjoint.soundness.detectors.spikes import find_spikes
from sindyjoint.soundness.finding import Finding, in_order
from sindyjoint.soundness.profile import Profile, profile_of
from sindyjoint.soundness.spans import bridged
from sindyjoint.soundness.words import Words, words_of


def find_faults(campaign: Campaign) -> tuple[Finding, ...]:
    """Return what is wrong with the data of a campaign, the severest first.

    Samples are looked at first; those that can be left out are, before runs are looked at as a whole, and runs that
    cannot be used are left out before they are held against each other.

    Parameters
    ----------
    campaign : Campaign
    """
    words = words_of(campaign.joint.motion)
    with np.errstate(all="ignore"):
        return in_order(_find_all(campaign, words))


def _find_all(campaign: Campaign, words: Words) -> Iterator[Finding]:
    raw = [profile_of(run) for run in campaign.runs]
    yield from find_unit_mismatches(campaign, words)
    yield from find_dead(raw, words)
    yield from find_sizes(raw, words)
    if campaign.quasi_static:
        yield from find_scaled_copies(raw, words)
        for profile in raw:
            yield from find_saturation(profile, words)
        return
    for run in campaign.runs:
        yield from find_lost(run)
    yield from find_repeated_blocks(raw, words)
    yield from find_scaled_copies(raw, words)
    samples = [finding for profile in raw for finding in _find_in_samples(profile, words)]
    samples += find_spikes(raw, words)
    yield from samples
    profiles = [_bridged(profile, samples) for profile in raw]
    for profile in profiles:
        yield from find_disagreement(profile, words)
    lines = [finding for profile in profiles for finding in find_lines(profile, words)]
    yield from lines
    unusable = {finding.run for finding in lines}
    whole = [p for p in profiles if p.run.name not in unusable]
    course = [finding for profile in whole for finding in find_course(profile, words)]
    yield from course
    yield from find_noise(profiles, words)
    yield from find_offsets(profiles, words)
    yield from find_coverage(profiles, words)
    uneven = {finding.run for finding in course}
    even = [p for p in whole if p.run.name not in uneven]
    laws = list(_find_in_laws(campaign, even, words))
    yield from laws
    if any(finding.severity == "stops" for finding in laws):
        return
    broadband = list(find_broadband_faults(campaign, [p.run for p in even], words))
    yield from broadband
    odd = {finding.run for finding in broadband if finding.id != "drift"}
    yield from find_broadband_delay(campaign, [p.run for p in even if p.run.name not in odd], words)


def _find_in_samples(profile: Profile, words: Words) -> Iterator[Finding]:
    yield from find_saturation(profile, words)
    yield from find_held(profile, words)
    yield from find_coarse_steps(profile, words)


def _find_in_laws(campaign: Campaign, profiles: Sequence[Profile], words: Words) -> Iterator[Finding]:
    """Yield what only the law between the channels shows."""
    spectra = [spectra_of(p) for p in profiles]
    for profile, spectrum in zip(profiles, spectra, strict=True):
        yield from find_mains(profile, spectrum, words)
    cycles = cycles_of(profiles, spectra)
    inertia = campaign.joint.inertia
    signs = list(find_signs(profiles, cycles, inertia, words))
    yield from signs
    yield from find_inertia(cycles, campaign, words)
    named = {finding.run for finding in signs}
    if None in named or not len(cycles):
        return
    cycles = cycles.take([i for i, name in enumerate(cycles.names) if name not in named])
    scales, cycles = find_other_scales(cycles, inertia, words)
    yield from scales
    odd, alike = find_odd_runs(cycles, inertia, words)
    yield from odd
    yield from find_filters(alike, inertia, words)


def _bridged(profile: Profile, findings: Iterable[Finding]) -> Profile:
    """Return the profile of a run with straight lines across the samples that are to be left out."""
    run = profile.run
    changes: dict[str, Array] = {}
    for finding in findings:
        if finding.run == run.name and finding.spans and finding.channel and finding.id != "saturation":
            values = changes.get(finding.channel, run.channels[finding.channel])
            changes[finding.channel] = bridged(values, finding.spans)
    if not changes:
        return profile
    return profile_of(run.with_channels(changes))
