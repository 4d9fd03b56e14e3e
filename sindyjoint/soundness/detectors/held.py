"""Values that are held: dropouts, frozen segments and channels that never change."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np
from numpy.typing import NDArray

from sindyjoint.numeric import Array
from sindyjoint.soundness.finding import Finding
from sindyjoint.soundness.policy import POLICY
from sindyjoint.soundness.profile import Channel, Profile
from sindyjoint.soundness.spans import Spans, spans_of
from sindyjoint.soundness.words import Words

# Share of its range within which the angle of a joint that sticks stays.
STANDSTILL = 1e-2


def held_spans(channel: Channel, resolved: bool = False) -> Spans:
    """Return the spans in which a channel holds one value although it should have changed.

    Where the noise is far above the resolution, even three equal samples cannot be by chance. Elsewhere (a joint that
    sticks, coarse steps) the channel must also jump on entering or leaving the span, further than it ever moves in one
    sampling step.

    Parameters
    ----------
    channel : Channel
    resolved : bool
        Whether it is known otherwise that equal samples are no chance.
    """
    x = channel.values
    equal = np.abs(np.diff(x)) <= 1e-12 * channel.range
    spans = [(a, b + 1) for a, b in spans_of(equal)]
    # What is at a limit of the channel is saturation.
    low, high = channel.levels[0][[0, -1]]
    tolerance = 1e-9 * channel.range
    spans = [s for s in spans if x[s[0]] == 0.0 or low + tolerance < x[s[0]] < high - tolerance]
    if resolved or not channel.quantised:
        least = _least_length(equal)
        return tuple(s for s in spans if s[1] - s[0] >= least)
    moves = np.abs(np.diff(x))[~equal]
    if not moves.size:
        return ()
    # The largest moves are friction steps or the jumps themselves: those of 99.5 % are taken.
    far = POLICY.held_jump * max(float(np.quantile(moves, 0.98)), channel.step)
    return tuple(s for s in spans if s[1] - s[0] >= POLICY.held_samples and _jump(x, s) > far)


def _least_length(equal: NDArray[np.bool_]) -> int:
    """Return how many equal samples in a row are no chance: with a share p of equal pairs, n·p^(k − 1) is expected.

    Single pairs are counted for p, which held values have none of; where the signal is slow there are more.
    """
    lengths = np.array([b - a for a, b in spans_of(equal)])
    single = np.count_nonzero(lengths == 1)
    if not single:
        return 3
    share = np.sqrt(min(single / equal.size, 0.5))
    return 2 + int(np.ceil(np.log(POLICY.held_chance / equal.size) / np.log(share)))


def _jump(x: Array, span: tuple[int, int]) -> float:
    start, stop = span
    before = abs(x[start] - x[start - 1]) if start else 0.0
    after = abs(x[stop] - x[stop - 1]) if stop < x.size else 0.0
    return float(max(before, after))


def find_held(profile: Profile, words: Words) -> Iterator[Finding]:
    """Yield dropouts and frozen segments of a run's channels."""
    n = profile.run.n_samples
    for channel in profile.channels:
        spans = held_spans(channel)
        if not spans:
            continue
        lengths = [b - a for a, b in spans]
        share, longest = sum(lengths) / n, max(lengths)
        frozen = longest > POLICY.dropout_samples
        zero = all(channel.values[a] == 0.0 for a, _ in spans)
        if zero and channel.name == "acceleration" and _sticks(profile.run.angle, spans):
            continue
        what = "zero" if zero else "one value"
        maskable = share <= POLICY.most_masked
        yield Finding(
            "frozen_segment" if frozen else "dropouts",
            profile.run.name,
            channel.name,
            "biases" if maskable else "stops",
            f"the {words.of(channel.name)} stays at {what} {len(spans)} time(s), for up to {longest} samples "
            f"({1e3 * longest / profile.run.sample_rate:.3g} ms), {100 * share:.2g} % of the run",
            "pulls k1 and M_F towards zero"
            if channel.name == "moment"
            else "makes motion look like sticking and spoils the derivatives: c1, M_F and k1",
            "those samples are left out; look at cables and buffers"
            if maskable
            else "repeat the run, or leave it out",
            spans,
            maskable,
        )


def _sticks(angle: Array, spans: Sequence[tuple[int, int]]) -> bool:
    """Return whether a joint stands still where its acceleration is zero."""
    return all(np.ptp(angle[a:b]) <= STANDSTILL * np.ptp(angle) for a, b in spans)


def find_dead(profiles: Sequence[Profile], words: Words) -> Iterator[Finding]:
    """Yield channels that never change in a run: an angle always, a moment unless it is declared as zero everywhere."""
    for profile in profiles:
        for channel in profile.dead:
            if channel.name == "moment" and _is_declared(channel, profiles):
                continue
            yield Finding(
                "frozen_channel",
                profile.run.name,
                channel.name,
                "stops",
                f"the {words.of(channel.name)} is {channel.values[0]:.6g} {words.unit(channel.name)} in all "
                f"{channel.values.size} samples",
                "no coefficient can come from such a run, and all are drawn towards zero",
                "check the cable, repeat the run or leave it out; declare as constant what was not recorded",
            )


def _is_declared(channel: Channel, profiles: Sequence[Profile]) -> bool:
    """Return whether a constant moment is that of free decays: zero, and in every run or where the motion decays."""
    if channel.values[0] != 0.0:
        return all(p.channel("moment") is None for p in profiles)
    return all(p.channel("moment") is None or p.run.frequency is None for p in profiles)
