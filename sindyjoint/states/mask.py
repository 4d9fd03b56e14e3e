"""Where the joint moves: the samples in which the moment is a function of the state; and where only its noise does.

Friction with an internal state forgets with the way |θ̇|·dt. While a joint sticks the noise of its rate goes back and
forth, and a state that follows it has forgotten in half a second what the joint keeps.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from sindyjoint.numeric import Array
from sindyjoint.states.policy import POLICY
from sindyjoint.states.record import ForceStates
from sindyjoint.states.smoothing import smoothing_kernels


def rate_limit(rate: Array, noise: float, share: float) -> float:
    """Return the angular velocity below which its sign is unknown, rad/s.

    The larger of ``share`` of the peak rate and four standard errors of the rate: below it the sign of θ̇, and
    with it the side of the Coulomb friction, is not known.
    """
    return max(share * float(np.max(np.abs(rate))), POLICY.rate_sigmas * noise)


def moving_mask(rate: Array, limit: float, guard: int) -> NDArray[np.bool_]:
    """Return where |θ̇| passes ``limit`` with ``guard`` samples to spare on both sides.

    Parameters
    ----------
    rate : ndarray, shape (n,)
        rad/s.
    limit : float
        rad/s.
    guard : int
        Samples removed around every sample that is below the limit or in which the sign of the rate changes.
    """
    slow = np.abs(rate) <= limit
    slow[1:] |= np.sign(rate[1:]) != np.sign(rate[:-1])
    return within(~slow, guard)


def within(good: NDArray[np.bool_], guard: int) -> NDArray[np.bool_]:
    """Return where all samples up to ``guard`` to either side are good, shape (n,)."""
    count = np.concatenate([[0], np.cumsum(~good)])
    n = good.size
    low = np.maximum(np.arange(n) - guard, 0)
    high = np.minimum(np.arange(n) + guard + 1, n)
    return count[high] == count[low]


def without_noise_travel(states: ForceStates, angle: Array, rate: Array, step: float) -> tuple[Array, Array]:
    """Return angle and rate, straight from one known angle to the next where the rate is within its noise.

    Known are the ends of such a standstill, and between them angles that stand out of the noise of the angle (Douglas
    and Peucker, 1973). Samples are ``step`` seconds apart.
    """
    sure = POLICY.rate_sigmas
    still = np.abs(rate) <= sure * states.noise.rate
    if not still.any():
        return angle, rate
    low = smoothing_kernels(states.bandwidth, states.sample_rate)[0]
    # A sample and the chord between two others have noise alike.
    apart = np.sqrt(2) * states.noise.angle * float(np.linalg.norm(low))
    known = _known_angles(angle, still, sure * apart)
    place = np.arange(angle.size)
    straight = np.interp(place, known, angle[known])
    slope = np.repeat(np.diff(angle[known]) / (step * np.diff(known)), np.diff(known))
    return straight, np.where(still, np.append(slope, rate[-1:]), rate)


def _known_angles(angle: Array, still: NDArray[np.bool_], within: float) -> NDArray[np.intp]:
    """Return the samples between which the angle is straight: all that move, of a standstill those beyond noise."""
    edges = np.flatnonzero(np.diff(np.concatenate([[0], still.astype(np.int8), [0]])))
    known = ~still
    known[[0, -1]] = True
    open_ends = [(max(begin - 1, 0), min(end, angle.size - 1)) for begin, end in edges.reshape(-1, 2)]
    while open_ends:
        begin, end = open_ends.pop()
        if end - begin < 2:
            continue
        chord = np.linspace(angle[begin], angle[end], end - begin + 1)
        away = np.abs(angle[begin : end + 1] - chord)
        farthest = int(np.argmax(away))
        if away[farthest] > within:
            known[begin + farthest] = True
            open_ends += [(begin, begin + farthest), (begin + farthest, end)]
    return np.flatnonzero(known)
