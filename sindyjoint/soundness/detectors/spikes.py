"""Spikes: samples far from their neighbours on both sides, unless they are the motion of a joint that jumps."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np
from numpy.typing import NDArray

from sindyjoint.numeric import Array
from sindyjoint.soundness.finding import Finding
from sindyjoint.soundness.policy import POLICY
from sindyjoint.soundness.profile import Channel, Profile
from sindyjoint.soundness.spans import spans_of
from sindyjoint.soundness.words import Words

# Neighbours on either side: a step between two of them is kept by their median, a spike of up to three is not.
REACH = 3
# Samples before a jump whose two halves tell where the motion goes.
BEFORE = 12


def spike_samples(channel: Channel) -> NDArray[np.bool_]:
    """Return the samples that differ from the median of their neighbourhood by far more than is usual in the run.

    What is usual is the channel's noise, and what 99 % of the samples differ by: the crests of a signal with few
    samples per period differ as well, but all of them do.
    """
    x = channel.values
    away = np.abs(x - _running_median(x))
    usual = max(
        POLICY.spike_noise * channel.noise,
        POLICY.spike_usual * float(np.quantile(away, 0.99)),
        POLICY.spike_step * channel.step,
        (POLICY.spike_acceleration if channel.name == "acceleration" else POLICY.spike_least)
        * amplitude_of(x),
    )
    marked: NDArray[np.bool_] = away > usual
    return marked


def _running_median(x: Array) -> Array:
    padded = np.pad(x, REACH, mode="edge")
    windows = np.lib.stride_tricks.sliding_window_view(padded, 2 * REACH + 1)
    return np.partition(windows, REACH, axis=1)[:, REACH]


def amplitude_of(x: Array) -> float:
    """Return half the range of the middle 98 % of the samples: the amplitude without the spikes."""
    low, high = np.quantile(x, [0.01, 0.99])
    return 0.5 * float(high - low)


def _joint_jumps(profiles: Sequence[Profile], name: str) -> bool:
    """Return whether the spikes of a channel are the motion of the joint, which jumps back within a sample or two.

    A spike knows nothing of the motion. Where several ones all remain near the range of the other samples, nearly all
    come while the channel goes the same way, back to its middle or away from it, and they do not end at one value (as
    dropouts do), they are the joint's.
    """
    inwards: list[bool] = []
    ends: list[Array] = []
    for x, marked in ((c.values, spike_samples(c)) for p in profiles for c in p.channels if c.name == name):
        if not 0 < np.count_nonzero(marked) <= POLICY.most_spikes * x.size:
            continue
        others = x[~marked]
        middle = float(np.median(others))
        far = POLICY.jump_range * np.array([others.min() - middle, others.max() - middle])
        away = x[marked] - middle
        if away.min() < far[0] or away.max() > far[1]:
            return False
        ends.append(away / amplitude_of(x))
        begins = np.array([begin for begin, _ in spans_of(marked)])
        for at in begins[np.diff(begins, prepend=-BEFORE) >= BEFORE]:  # one that rings is one
            before = x[max(at - BEFORE, 0) : at] - middle
            early, late = (float(np.median(half)) for half in np.array_split(before, 2) if half.size)
            inwards.append((late - early) * late < 0)
    if len(inwards) < POLICY.fewest_jumps or np.ptp(np.abs(np.concatenate(ends))) < POLICY.jump_values:
        return False
    share = float(np.mean(inwards))
    return max(share, 1 - share) >= POLICY.jump_share


def _motion_shows(profile: Profile, spans: Sequence[tuple[int, int]]) -> bool:
    """Return whether the rate changes at all of these samples as it hardly ever does: a stop, a blow, a jerk.

    What only the load's sensor knows of is a spike; what stops the joint is not.
    """
    x = np.pad(profile.run.angle, REACH + 1, mode="edge")
    moved = x[REACH:] - x[:-REACH]  # within REACH samples that begin so many before
    kink = np.abs(moved[REACH + 2 :] - moved[: -REACH - 2])
    usual = float(np.quantile(kink, 1 - POLICY.rare_kinks))
    return all(kink[max(begin - 1, 0) : end + 1].max(initial=0.0) > usual for begin, end in spans)


def find_spikes(profiles: Sequence[Profile], words: Words) -> Iterator[Finding]:
    """Yield a finding for each channel of a run that has spikes."""
    own = {name for name in {c.name for p in profiles for c in p.channels} if _joint_jumps(profiles, name)}
    for profile in profiles:
        yield from _of_run(profile, [c for c in profile.channels if c.name not in own], words)


def _of_run(profile: Profile, channels: Sequence[Channel], words: Words) -> Iterator[Finding]:
    for channel in channels:
        marked = spike_samples(channel)
        count = int(np.count_nonzero(marked))
        # What happens all the time (impacts, stick-slip) belongs to the joint.
        if not 0 < count <= POLICY.most_spikes * channel.values.size:
            continue
        spans = spans_of(marked)
        size = float(np.abs(channel.values[marked] - np.median(channel.values)).max())
        bearable = channel.name == "moment" and size < POLICY.jerk_size * amplitude_of(channel.values)
        if bearable and _motion_shows(profile, spans):
            continue
        yield Finding(
            "spikes",
            profile.run.name,
            channel.name,
            "biases",
            f"{len(spans)} spike(s) of the {words.of(channel.name)}, up to {size:.3g} {words.unit(channel.name)}, "
            f"{size / max(amplitude_of(channel.values), 1e-300):.3g} times its amplitude",
            "raise the noise floor and shift every coefficient, M_F and k1 most"
            if channel.name == "moment"
            else "spoil the derivatives: c1, the inertia and every interval",
            "those samples are left out; look for loose contacts and light reflections",
            spans,
            True,
        )
