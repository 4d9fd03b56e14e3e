"""Spikes: samples far from their neighbours on both sides, of which nothing else in the record knows."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence

import numpy as np

from sindyjoint.mechanics.rig_test import DRIVE
from sindyjoint.numeric import Array
from sindyjoint.soundness.finding import Finding
from sindyjoint.soundness.policy import POLICY
from sindyjoint.soundness.record import Channel, Mask, Record, Spans, spans_of
from sindyjoint.soundness.words import Words

# Neighbours on either side: a step between two of them is kept by their median, a spike of up to three is not.
REACH = 3
# Samples before a jump whose two halves tell where the motion goes.
BEFORE = 12
# What so many of the samples stay below is usual.
USUAL = 0.99


def spike_samples(channel: Channel) -> Mask:
    """Return the samples that differ from the median of their neighbourhood by far more than is usual in the run.

    What is usual is what 99 % of the samples differ by, 2.6 standard deviations of noise: the crests of a signal with
    few samples per period differ as well, but all of them do. What jumps may do so within its range, two amplitudes.
    """
    windows = np.lib.stride_tricks.sliding_window_view(
        np.pad(channel.values, REACH, mode="edge"), 2 * REACH + 1
    )
    away = np.abs(channel.values - np.partition(windows, REACH, axis=1)[:, REACH])
    usual = POLICY.outstanding * max(float(np.quantile(away, USUAL)), channel.step)
    marked: Mask = away > max(usual, (2.0 if channel.jumps else POLICY.spike) * channel.amplitude)
    # What happens all the time (impacts, stick-slip) belongs to the joint.
    return marked if np.mean(marked) <= POLICY.bears else np.zeros_like(marked)


def find_spikes(records: Sequence[Record], words: Words) -> Iterator[Finding]:
    """Yield a finding for each channel of a run that has spikes."""
    marks = [{c.name: spike_samples(c) for c in record.alive} for record in records]
    names = {name for marked in marks for name in marked}
    own = set() if words.structure else {name for name in names if _joint_jumps(records, marks, name)}
    for record, marked in zip(records, marks, strict=True):
        for channel in record.alive:
            spans = spans_of(marked[channel.name])
            if not spans or channel.name in own:
                continue
            if words.structure and record.declared is None:
                spans = _alone(channel, marked)
            size = float(np.abs(channel.values - np.median(channel.values))[marked[channel.name]].max())
            relative = size / max(channel.amplitude, 1e-300)
            jerk = channel.name == "moment" and relative < POLICY.another_scale
            if not spans or (jerk and _motion_shows(record, spans)):
                continue
            yield words.finding(
                "spikes",
                record.name,
                channel.name,
                "biases",
                f"{len(spans)} spike(s) of the {words.of(channel.name)}, up to {size:.3g} {words.unit(channel.name)}, "
                f"{relative:.3g} times its amplitude",
                "those samples are filled in; look for loose contacts"
                if words.structure
                else "those samples are left out; look for loose contacts and light reflections",
                spans,
                True,
            )


def _joint_jumps(records: Sequence[Record], marks: Sequence[Mapping[str, Mask]], name: str) -> bool:
    """Return whether the spikes of a channel are the motion of the joint, which jumps back within a sample or two.

    A spike knows nothing of the motion. Where several ones all remain near the range of the other samples, nearly all
    come while the channel goes the same way, back to its middle or away from it, and they do not end at one value (as
    dropouts do), they are the joint's.
    """
    inwards: list[bool] = []
    ends: list[Array] = []
    for channel, marked in (
        (r.channel(name), m[name]) for r, m in zip(records, marks, strict=True) if name in m
    ):
        if channel is None or not marked.any():
            continue
        x = channel.values - np.median(channel.values[~marked])
        if np.any(x[marked] < POLICY.clearly * x[~marked].min()) or np.any(
            x[marked] > POLICY.clearly * x[~marked].max()
        ):
            return False
        ends.append(x[marked] / channel.amplitude)
        begins = np.array([begin for begin, _ in spans_of(marked)])
        for at in begins[np.diff(begins, prepend=-BEFORE) >= BEFORE]:  # one that rings is one
            halves = np.array_split(x[max(at - BEFORE, 0) : at], 2)
            early, late = (float(np.median(half)) for half in halves if half.size)
            inwards.append((late - early) * late < 0)
    if len(inwards) < POLICY.fewest or np.ptp(np.abs(np.concatenate(ends))) < POLICY.changed:
        return False
    share = float(np.mean(inwards))
    return max(share, 1 - share) >= 1 - POLICY.large_part


def _motion_shows(record: Record, spans: Spans) -> bool:
    """Return whether the rate changes at all of these samples as it hardly ever does: a stop, a blow, a jerk.

    What only the load's sensor knows of is a spike; what stops the joint is not.
    """
    x = np.pad(record.clock, REACH + 1, mode="edge")
    moved = x[REACH:] - x[:-REACH]  # within REACH samples that begin so many before
    kink = np.abs(moved[REACH + 2 :] - moved[: -REACH - 2])
    usual = float(np.quantile(kink, USUAL))
    return all(kink[max(begin - 1, 0) : end + 1].max(initial=0.0) > usual for begin, end in spans)


def _alone(channel: Channel, marks: Mapping[str, Mask]) -> Spans:
    """Return the spikes of a channel of a record that no blow explains.

    A blow shows in several channels, and a joint that comes to a stop after it shows as less than the blow did. The
    blow itself is a spike of the drive, to which sensors answer more slowly.
    """
    x, own = np.abs(channel.values - np.median(channel.values)), marks[channel.name]
    far = POLICY.clearly * float(x[~own].max(initial=0.0))
    spans = [(a, b) for a, b in spans_of(own) if x[a:b].max() > far]
    if channel.name == DRIVE:
        return tuple(spans if len(spans) >= POLICY.fewest else ())
    others = np.logical_or.reduce([m for other, m in marks.items() if other != channel.name])
    near = np.convolve(others, np.ones(2 * BEFORE + 1), mode="same") > 0
    return tuple((a, b) for a, b in spans if not near[a:b].any())
