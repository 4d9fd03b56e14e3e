"""Spikes: samples far from their neighbours on both sides."""

from __future__ import annotations

from collections.abc import Iterator

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
        (POLICY.spike_acceleration if channel.name == "acceleration" else POLICY.spike_least) * _spread(x),
    )
    marked: NDArray[np.bool_] = away > usual
    return marked


def _running_median(x: Array) -> Array:
    padded = np.pad(x, REACH, mode="edge")
    windows = np.lib.stride_tricks.sliding_window_view(padded, 2 * REACH + 1)
    return np.partition(windows, REACH, axis=1)[:, REACH]


def _spread(x: Array) -> float:
    """Return half the range of the middle 98 % of the samples: the amplitude without the spikes."""
    low, high = np.quantile(x, [0.01, 0.99])
    return 0.5 * float(high - low)


def find_spikes(profile: Profile, words: Words) -> Iterator[Finding]:
    """Yield a finding for each channel of a run that has spikes."""
    for channel in profile.channels:
        marked = spike_samples(channel)
        count = int(np.count_nonzero(marked))
        # What happens all the time (impacts, stick-slip) belongs to the joint.
        if not 0 < count <= POLICY.most_spikes * channel.values.size:
            continue
        spans = spans_of(marked)
        size = float(np.abs(channel.values[marked] - np.median(channel.values)).max())
        yield Finding(
            "spikes",
            profile.run.name,
            channel.name,
            "biases",
            f"{len(spans)} spike(s) of the {words.of(channel.name)}, up to {size:.3g} {words.unit(channel.name)}, "
            f"{size / max(_spread(channel.values), 1e-300):.3g} times its amplitude",
            "raise the noise floor and shift every coefficient, M_F and k1 most"
            if channel.name == "moment"
            else "spoil the derivatives: c1, the inertia and every interval",
            "those samples are left out; look for loose contacts and light reflections",
            spans,
            True,
        )
