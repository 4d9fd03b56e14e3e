"""Where the joint moves: the samples in which the moment is a function of the state."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from sindyjoint.numeric import Array
from sindyjoint.states.policy import POLICY


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
