"""Values that a sound channel does not take: constant, at a limit, held, lost, in coarse steps, spikes."""

from collections.abc import Iterator, Mapping, Sequence

import numpy as np

from sindyjoint.limits import SOUNDNESS
from sindyjoint.mechanics.rig_test import DRIVE
from sindyjoint.numeric import Array
from sindyjoint.soundness import Finding, Spans, Words
from sindyjoint.soundness.detectors import Channel, Mask, Record, spans_of

# Equal but for rounding, in ranges of the channel.
EQUAL, AT_LIMIT = 1e-12, 1e-9


def find_dead(records: Sequence[Record], words: Words) -> Iterator[Finding]:
    """Yield channels that never change in a run, but for a moment that is declared as zero, and a drive of noise."""
    for record in records:
        for channel in record.dead:
            driven = channel.name == "moment" and _goes_on(record)
            if channel.name == "moment" and not driven and _is_declared(channel, records):
                continue
            yield words.finding(
                "frozen_channel",
                record.name,
                channel.name,
                "stops",
                f"the {words.of(channel.name)} is {channel.values[0]:.6g} {words.unit(channel.name)} in all "
                f"{channel.values.size} samples{', though the motion does not die away' * driven}",
                "check the cable; leave the run or, of all runs, the sensor out"
                if words.structure
                else "check the cable, repeat the run or leave it out; declare as constant what was not recorded",
            )
        drive = record.channel(DRIVE)
        if drive is not None and drive.noise > (1 - SOUNDNESS.minor_share) * drive.std:
            yield words.finding(
                "no_signal",
                record.name,
                DRIVE,
                "stops",
                f"the drive is noise: {drive.std:.3g} {words.unit(DRIVE)} RMS, of which {drive.noise:.3g} from sample "
                "to sample",
                "check the force cell; leave the run out",
            )


def _is_declared(channel: Channel, records: Sequence[Record]) -> bool:
    """Return whether a constant moment is that of free decays: zero, and in no run that was driven."""
    still = (r for r in records if channel.name in {each.name for each in r.dead})
    return not any(channel.values[0] != 0.0 or r.declared is not None for r in still)


def _goes_on(record: Record) -> bool:
    """Return whether a motion is as large at its end as before: of a joint that nothing drives it dies away."""
    first, middle, last = (
        Channel(record.driven_by, part).amplitude for part in np.array_split(record.clock, 3)
    )
    return last > (1 - SOUNDNESS.small_share) * middle and last > (1 - SOUNDNESS.minor_share) * first


def find_saturation(record: Record, words: Words) -> Iterator[Finding]:
    """Yield the channels that stay at their highest or lowest value while the motion goes on."""
    for channel in record.alive:
        found = {
            side: at
            for side, sign in (("highest", 1.0), ("lowest", -1.0))
            if (at := saturated_samples(channel, sign)) is not None
        }
        if not found:
            continue
        at = np.logical_or.reduce(list(found.values()))
        share, name = float(np.mean(at)), words.of(channel.name)
        masked = channel.name == "moment" and share <= SOUNDNESS.large_part
        limits = ", ".join(
            f"{channel.values[some][0]:.4g} {words.unit(channel.name)}" for some in found.values()
        )
        yield words.finding(
            "saturation",
            record.name,
            channel.name,
            "biases" if masked or share <= SOUNDNESS.small_share else "stops",
            f"{100 * share:.2g} % of the samples of the {name} at its {' and '.join(found)} value ({limits})",
            "those samples are left out; repeat the run with a larger range of the amplifier"
            if masked
            else f"repeat the run with a larger range of the {name}, or leave it out",
            spans_of(at),
            masked,
        )


def saturated_samples(channel: Channel, sign: float) -> Mask | None:
    """Return the samples at the highest (``sign`` 1) or lowest (−1) value of a saturated channel, or None.

    The crest of a smooth signal dwells near its extreme as well; in steps of the resolution its highest level is at
    most 1/(√2 − 1) = 2.4 times as frequent as the next. A saturated channel arrives at its limit with a slope, and one
    without noise that is there for long has a law with a plateau.
    """
    levels, counts = channel.levels
    counts = counts if sign > 0 else counts[::-1]
    if levels.size < 8 or counts[-1] < max(
        SOUNDNESS.fewest_equal, SOUNDNESS.outstanding * counts[-4:-1].max()
    ):
        return None
    way = sign * ((levels[-1] if sign > 0 else levels[0]) - channel.values)
    at: Mask = way <= AT_LIMIT * channel.range
    # Share of the samples at one limit from which it is one of the law: Coulomb friction is there for half of the
    # time.
    if channel.noise == 0 and np.mean(at) > (1 / 3):
        return None
    # Noise far above the resolution rules out a standstill: it would not stay at one value.
    return at if not channel.quantised or _arrives_with_slope(way, at, channel.step) else None


def _arrives_with_slope(way: Array, at: Mask, step: float) -> bool:
    """Return whether a channel comes to its limit, ``way`` off, and goes from it with a slope, and does not creep."""
    arrivals = np.flatnonzero(at[1:] & ~at[:-1]) + 1
    departures = np.flatnonzero(at[:-1] & ~at[1:])
    near, far = (
        np.concatenate([way[arrivals[arrivals >= 9] - k], way[departures[departures < way.size - 9] + k]])
        for k in (3, 9)
    )
    if near.size < 2 or np.median(near) < 3 * step:
        return False
    return bool(np.median(far) < SOUNDNESS.saturated_arrival * np.median(near))


def find_held(record: Record, words: Words) -> Iterator[Finding]:
    """Yield dropouts and frozen segments of a record's channels."""
    for channel in record.alive:
        spans = held_spans(channel, words.structure)
        zero = all(channel.values[a] == 0.0 for a, _ in spans)
        if words.structure:
            spans = tuple(span for span in spans if _others_move(record, channel, span))
        if not spans or (zero and _rests(record, channel, spans)):
            continue
        share, longest = sum(b - a for a, b in spans) / record.n_samples, max(b - a for a, b in spans)
        masked = record.short(spans) if words.structure else share <= SOUNDNESS.large_part
        yield words.finding(
            "frozen_segment" if longest > SOUNDNESS.small_share * record.n_samples else "dropouts",
            record.name,
            channel.name,
            "biases" if masked or (words.structure and share <= SOUNDNESS.small_share) else "stops",
            f"the {words.of(channel.name)} stays at {'zero' if zero else 'one value'} {len(spans)} time(s), for up to "
            f"{longest} samples ({1e3 * longest / record.sample_rate:.3g} ms), {100 * share:.2g} % of the run",
            f"those samples are {words.done}; look at cables and buffers"
            if masked
            else "repeat the run, or leave it out; look at cables and buffers",
            spans,
            masked,
        )


def held_spans(channel: Channel, moves: bool = False) -> Spans:
    """Return the spans in which a channel holds one value although it should have changed.

    Where the noise is far above the resolution, even three equal samples cannot be by chance. Elsewhere (a joint that
    sticks, coarse steps) the channel must also jump on entering or leaving the span, further than it ever moves in one
    sampling step.

    Parameters
    ----------
    channel : Channel
    moves : bool
        Whether it never stands still, as no channel of a structure does: fine steps then are as good as noise.
    """
    x = channel.values
    equal = np.abs(np.diff(x)) <= EQUAL * channel.range
    # What is at a limit of the channel is saturation.
    low, high = channel.levels[0][[0, -1]] + AT_LIMIT * channel.range * np.array([1, -1])
    spans = [(a, b + 1) for a, b in spans_of(equal) if x[a] == 0.0 or low < x[a] < high]
    if not channel.quantised or (
        moves and channel.step < SOUNDNESS.minor_share * SOUNDNESS.small_share * channel.std
    ):
        least = _least_length(equal)
        return tuple(s for s in spans if s[1] - s[0] >= least)
    step = np.abs(np.diff(x, prepend=x[0], append=x[-1]))
    # The largest moves are friction steps or the jumps themselves.
    usual = float(np.quantile(step[1:-1][~equal], 0.98)) if not equal.all() else np.inf
    far = SOUNDNESS.outstanding * max(usual, channel.step)
    return tuple((a, b) for a, b in spans if b - a >= SOUNDNESS.fewest_equal and max(step[a], step[b]) > far)


def _least_length(equal: Mask) -> int:
    """Return how many equal samples in a row are no chance: with a share p of equal pairs, n·p^(k − 1) is expected.

    Single pairs are counted for p, which held values have none of; where the signal is slow there are more.
    """
    single = sum(b - a == 1 for a, b in spans_of(equal))
    if not single:
        return 3
    share = np.sqrt(min(single / equal.size, 0.5))
    return 2 + int(np.ceil(np.log(SOUNDNESS.false_alarm / equal.size) / np.log(share)))


def _others_move(record: Record, channel: Channel, span: tuple[int, int]) -> bool:
    """Return whether most other channels change while one is held: before a blow nothing does, nor at a standstill."""
    moves = [np.ptp(c.values[slice(*span)]) > 0 for c in record.alive if c is not channel]
    return bool(np.mean(moves) > 0.5)


def _rests(record: Record, channel: Channel, spans: Spans) -> bool:
    """Return whether a channel at zero is right: a drive about a blow, the acceleration of a joint that sticks."""
    sticks = all(np.ptp(record.clock[a:b]) <= SOUNDNESS.small_share * np.ptp(record.clock) for a, b in spans)
    return channel.name == DRIVE or (record.run is not None and channel.jumps and sticks)


def find_lost(record: Record, words: Words) -> Iterator[Finding]:
    """Yield the samples that were never recorded, or were left out before, of all channels or, of a structure, of one.

    A run that repeats has other periods that show what they were. Of one that does not, a gap that is short against the
    motion can be bridged; across a longer one derivatives would be invented.
    """
    for channel, spans in ((name, s) for name, lost in record.lost.items() if (s := spans_of(lost))):
        lengths = [b - a for a, b in spans]
        masked = record.short(spans)
        yield Finding(
            "lost_samples",
            record.name,
            channel,
            "biases" if masked else "stops",
            f"{sum(lengths)} samples in {len(spans)} place(s) are missing, "
            f"{100 * sum(lengths) / record.n_samples:.2g} % of the run, "
            f"the first after {spans[0][0] / record.sample_rate:.3g} s, "
            f"at most {1e3 * max(lengths) / record.sample_rate:.3g} ms in a row",
            "samples beside a gap are read as neighbours: their rate and phase are wrong, and with them c1, M_F and k1",
            f"those samples are {words.done}; look at the buffer of the recorder"
            if masked
            else "make a run of each part between the gaps, or repeat it; look at the buffer of the recorder",
            spans,
            masked,
        )


def find_coarse_steps(record: Record, words: Words) -> Iterator[Finding]:
    """Yield channels whose resolution is a sizeable part of what they measure, and runs of few samples a period."""
    for channel in record.alive:
        share = channel.step / channel.std if channel.std else 0.0
        few = channel.quantised and channel.levels[0].size <= channel.values.size / 4
        if not few or share < SOUNDNESS.small_share:
            continue
        coarse = share > SOUNDNESS.minor_share
        yield Finding(
            "coarse_quantisation",
            record.name,
            channel.name,
            "biases" if coarse else "note",
            f"the {words.of(channel.name)} comes in steps of {channel.step:.3g} {words.unit(channel.name)}, "
            f"{100 * share:.2g} % of its standard deviation",
            words.effect("coarse_quantisation", channel.name)
            if coarse
            else "adds a noise of a third of a step",
            "use a smaller range of the amplifier or of the converter",
        )
    per = record.samples_per_period / record.order
    if per < SOUNDNESS.few_samples:
        yield words.finding(
            "few_samples_per_period",
            record.name,
            "time",
            "note",
            f"{per:.3g} samples per period of the main line",
            f"sample at {SOUNDNESS.few_samples:g} times the main frequency or more",
        )


# Neighbours on either side: a step between two of them is kept by their median, a spike of up to three is not.
REACH = 3
# Samples before a jump whose two halves tell where the motion goes.
BEFORE = 12
# What so many of the samples stay below is usual; what all channels together stay below in so many, no event of theirs.
USUAL, SELDOM = 0.99, 0.95


def departures(values: Array) -> Array:
    """Return by how much every sample of a channel differs from the median of its neighbourhood."""
    return np.asarray(np.abs(values - np.partition(_neighbourhoods(values), REACH, axis=1)[:, REACH]))


def _bends(values: Array) -> Array:
    """Return the second difference of a channel at every sample, over so many on either side as are neighbours."""
    padded = np.pad(values, REACH, mode="edge")
    return np.asarray(np.abs(padded[2 * REACH :] - 2 * values + padded[: -2 * REACH]))


def _neighbourhoods(values: Array) -> Array:
    """Return a view of every sample with its neighbours, shape (n, 2·REACH + 1)."""
    return np.lib.stride_tricks.sliding_window_view(np.pad(values, REACH, mode="edge"), 2 * REACH + 1)


def spike_samples(channel: Channel) -> Mask:
    """Return the samples that differ from the median of their neighbourhood by far more than is usual in the run.

    What is usual is what 99 % of the samples differ by, 2.6 standard deviations of noise: the crests of a signal with
    few samples per period differ as well, but all of them do. What jumps may do so within its range, two amplitudes.
    """
    away = departures(channel.values)
    usual = SOUNDNESS.outstanding * max(float(np.quantile(away, USUAL)), channel.step)
    marked: Mask = away > max(usual, (2.0 if channel.jumps else SOUNDNESS.unknown) * channel.amplitude)
    # The crest of a motion that soon dies out departs as its neighbours do.
    near = _neighbourhoods(channel.values)[marked]
    spread = np.median(np.abs(near - np.median(near, axis=1, keepdims=True)), axis=1)
    marked[marked] = away[marked] > SOUNDNESS.clearly * spread
    # What happens all the time (impacts, stick-slip) belongs to the joint.
    return marked if np.mean(marked) <= SOUNDNESS.small_share else np.zeros_like(marked)


def find_spikes(records: Sequence[Record], words: Words) -> Iterator[Finding]:
    """Yield a finding for each channel of a run that has spikes."""
    marks = [{c.name: spike_samples(c) for c in record.alive} for record in records]
    names = () if words.structure else {name for marked in marks for name in marked}
    own = {name for name in names if _joint_jumps(records, marks, name)}
    for record, marked in zip(records, marks, strict=True):
        for channel in (c for c in record.alive if c.name not in own and marked[c.name].any()):
            spans = spans_of(marked[channel.name])
            if words.structure:
                spans = _alone(record, channel, marked[channel.name])
            size = float(np.abs(channel.values - np.median(channel.values))[marked[channel.name]].max())
            relative = size / max(channel.amplitude, 1e-300)
            small = channel.name == "moment" and relative < SOUNDNESS.many_times
            if not spans or (small and _motion_shows(record, spans)):
                continue
            yield words.finding(
                "spikes",
                record.name,
                channel.name,
                "biases",
                f"{len(spans)} spike(s) of the {words.of(channel.name)}, up to {size:.3g} {words.unit(channel.name)}, "
                f"{relative:.3g} times its amplitude",
                f"those samples are {words.done}; look for loose contacts"
                + " and light reflections" * (not words.structure),
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
        if np.any(x[marked] < SOUNDNESS.clearly * x[~marked].min()) or np.any(
            x[marked] > SOUNDNESS.clearly * x[~marked].max()
        ):
            return False
        ends.append(x[marked] / channel.amplitude)
        begins = np.array([begin for begin, _ in spans_of(marked)])
        for at in begins[np.diff(begins, prepend=-BEFORE) >= BEFORE]:  # one that rings is one
            halves = np.array_split(x[max(at - BEFORE, 0) : at], 2)
            early, late = (float(np.median(half)) for half in halves if half.size)
            inwards.append((late - early) * late < 0)
    if len(inwards) < SOUNDNESS.fewest or np.ptp(np.abs(np.concatenate(ends))) < SOUNDNESS.tolerated:
        return False
    share = float(np.mean(inwards))
    return max(share, 1 - share) >= 1 - SOUNDNESS.large_part


def _motion_shows(record: Record, spans: Spans) -> bool:
    """Return whether the rate changes at all of these samples as it hardly ever does: a stop, a blow, a jerk.

    What only the load's sensor knows of is a spike; what stops the joint is not.
    """
    x = np.pad(record.clock, REACH + 1, mode="edge")
    moved = x[REACH:] - x[:-REACH]  # within REACH samples that begin so many before
    kink = np.abs(moved[REACH + 2 :] - moved[: -REACH - 2])
    least = min(kink[max(begin - 1, 0) : end + 1].max(initial=0.0) for begin, end in spans)
    return bool(least > np.quantile(kink, USUAL))


def _alone(record: Record, channel: Channel, own: Mask) -> Spans:
    """Return the spikes of a channel that the others of the structure do not show, nor its other periods.

    A blow, and a joint that slips or stops, rings in channels near it and bends those far from it, and at each period's
    same time: how much they bend there together (the mean of the logarithms, each of the largest nearby) is seldom so
    much elsewhere. Where nothing repeats a few spikes of the drive are blows, to which sensors answer more slowly.
    """
    shown = [_bends(c.values) for c in record.alive if c is not channel]
    if record.declared is not None:
        bend, period = _bends(channel.values), round(record.samples_per_period)
        shown += [np.roll(bend, period), np.roll(bend, -period)]
    nearby = (
        np.lib.stride_tricks.sliding_window_view(np.pad(bend, REACH), 2 * REACH + 1).max(axis=1)
        for bend in shown
    )
    together = np.mean([np.log(bend + bend.mean()) for bend in nearby], axis=0)
    spans = spans_of(own & (together < np.quantile(together, SELDOM)))
    blows = record.declared is None and channel.name == DRIVE and len(spans) < SOUNDNESS.fewest
    return () if blows else spans
