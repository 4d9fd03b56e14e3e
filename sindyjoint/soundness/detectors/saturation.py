"""Saturation: a channel that stays at its highest or lowest value while the motion goes on."""

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


def saturated_samples(channel: Channel, sign: float) -> NDArray[np.bool_] | None:
    """Return the samples at the highest (``sign`` 1) or lowest (−1) value of a saturated channel, or None.

    The crest of a smooth signal dwells near its extreme as well; in steps of the resolution its highest level is at
    most 1/(√2 − 1) = 2.4 times as frequent as the next. A saturated channel arrives at its limit with a slope.
    """
    levels, counts = channel.levels
    if levels.size < 8:
        return None
    # The plateau of a channel whose limit is not exactly held: levels within rounding of each other.
    ordered = counts if sign > 0 else counts[::-1]
    count, others = int(ordered[-1]), ordered[-4:-1]
    n = channel.values.size
    if count < max(POLICY.saturated_samples, POLICY.saturated_crowd * others.max()):
        return None
    if count < POLICY.saturated_share * n:
        return None
    limit = levels[-1] if sign > 0 else levels[0]
    at: NDArray[np.bool_] = np.abs(channel.values - limit) <= 1e-9 * channel.range
    if channel.noise == 0 and count > POLICY.plateau * n:
        return None
    # Noise far above the resolution rules out a standstill: it would not stay at one value.
    arrives = not channel.quantised or _arrives_with_slope(sign * (limit - channel.values), at, channel.step)
    return at if arrives else None


def _arrives_with_slope(way: Array, at: NDArray[np.bool_], step: float) -> bool:
    """Return whether a channel comes to its limit and goes from it with a slope, and does not creep.

    Parameters
    ----------
    way : ndarray, shape (n,)
        Distance from the limit.
    at : ndarray of bool, shape (n,)
    step : float
        Resolution.
    """
    arrivals = np.flatnonzero(at[1:] & ~at[:-1]) + 1
    departures = np.flatnonzero(at[:-1] & ~at[1:])
    near, far = (
        np.concatenate([way[arrivals[arrivals >= 9] - k], way[departures[departures < way.size - 9] + k]])
        for k in (3, 9)
    )
    if near.size < 2 or np.median(near) < 3 * step:
        return False
    return bool(np.median(far) < POLICY.saturated_arrival * np.median(near))


def find_saturation(profile: Profile, words: Words) -> Iterator[Finding]:
    """Yield a finding for each channel of a run that saturates."""
    for channel in profile.channels:
        sides = {
            side: saturated_samples(channel, sign) for side, sign in (("highest", 1.0), ("lowest", -1.0))
        }
        found = {side: at for side, at in sides.items() if at is not None}
        if not found:
            continue
        at = np.logical_or.reduce(list(found.values()))
        share = float(np.mean(at))
        maskable = channel.name == "moment" and share <= POLICY.most_masked
        yield Finding(
            "saturation",
            profile.run.name,
            channel.name,
            "biases" if maskable or share <= POLICY.bearable_saturation else "stops",
            f"{100 * share:.2g} % of the samples of the {words.of(channel.name)} at its {' and '.join(found)} value "
            f"({_limits(channel, found, words)})",
            f"lowers the largest {words.moment}: softens the law, k1 and k3 come out too small"
            if channel.name == "moment"
            else "cuts the crests of the motion: k1, k3 and every derivative (c1, inertia) are wrong",
            "those samples are left out; repeat the run with a larger range of the amplifier"
            if maskable
            else f"repeat the run with a larger range of the {words.of(channel.name)} sensor, or leave it out",
            spans_of(at),
            maskable,
        )


def _limits(channel: Channel, found: dict[str, NDArray[np.bool_]], words: Words) -> str:
    values = [channel.values.max() if side == "highest" else channel.values.min() for side in found]
    return ", ".join(f"{value:.4g} {words.unit(channel.name)}" for value in values)
