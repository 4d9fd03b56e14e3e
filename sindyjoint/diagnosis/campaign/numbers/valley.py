"""How far the shape of an element's law may move before replicates of the model grow unlike the measurement.

A number without a unit, such as the shape of Bouc and Wen's law, bends the law: a linearisation at the best fit says
little of how sure it is, and a search may end early in a long valley of nearly equal fits. The number is therefore
held at values ever farther from the best, all others are fitted to each, and its interval ends where χ² has risen by
its 95 % limit (profile likelihood; Venzon and Moolgavkar, Applied Statistics 37, 87, 1988).
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from sindyjoint.diagnosis.campaign.numbers.likeness import Likeness
from sindyjoint.diagnosis.campaign.repair import least_squares
from sindyjoint.numeric import Array

# 95 % of a normal distribution are within so many standard errors; χ² rises by its square.
SIGMAS95 = 1.96
# Points on either side, by how much steps grow where χ² hardly changes, and fits of the others at each.
MOST_POINTS, GROWTH, FITS = 12, 1.6, 3
# What a fit would still gain, as a share of the 95 % limit, where it ends.
LEAST_GAIN = 0.02


@dataclass(frozen=True, eq=False)
class Valley:
    """The best numbers for each value of one that is held.

    Parameters
    ----------
    at : int
        Which number was held.
    limit : float
        By how much the unlikeness may rise in a 95 % interval.
    unlikeness : ndarray, shape (k,)
        Of each point.
    values : ndarray, shape (k, n)
        All numbers there; the one that was held rises.
    """

    at: int
    limit: float
    unlikeness: Array
    values: Array

    @property
    def ends(self) -> Array:
        """All numbers where the 95 % interval begins and ends, shape (2, n)."""
        least = int(np.argmin(self.unlikeness))
        inside = np.flatnonzero(self.unlikeness <= self.unlikeness[least] + self.limit)
        return np.array([self._end(inside[0], -1), self._end(inside[-1], 1)])

    def _end(self, last: int, sign: int) -> Array:
        """Return the numbers between the last point inside and the one after it, where χ² meets the limit."""
        beyond = last + sign
        if not 0 <= beyond < self.unlikeness.size:
            return self.values[last]
        here, there = self.unlikeness[[last, beyond]]
        share = (float(np.min(self.unlikeness)) + self.limit - here) / (there - here)
        return self.values[last] + share * (self.values[beyond] - self.values[last])

    def widened(self, centre: Array, covariance: Array) -> Array:
        """Return a covariance whose intervals reach the farther end of this one.

        What the number that was held brings to it, c·cᵀ/c_k with c its k-th column, becomes d·dᵀ/1.96², d the way to
        that end: the same where the profile is a parabola.
        """
        own = covariance[self.at]
        low, high = self.ends - centre
        away = np.sign(high - low) * np.maximum(np.abs(low), np.abs(high))
        if away[self.at] <= SIGMAS95 * np.sqrt(own[self.at]):
            return covariance
        rest = covariance - np.outer(own, own) / own[self.at]
        return np.asarray(rest + np.outer(away, away) / SIGMAS95**2)


def walk(
    likeness: Likeness, best: tuple[float, Array], slopes: Array, at: int, errors: tuple[Array, float]
) -> Valley:
    """Return the valley of one number.

    Parameters
    ----------
    likeness : Likeness
        Its ends hold those of the number.
    best : tuple of float and ndarray
        Where it begins: unlikeness and all numbers.
    slopes : ndarray, shape (m, n)
        There, of what is left by each number times its unit; those of the terms are used throughout.
    at : int
    errors : tuple of ndarray and float
        Change of all numbers by a standard error of this one, and by how much χ² rises by it.
    """
    limit = SIGMAS95**2 * errors[1]
    down, up = (list(_side(likeness, best, slopes, at, (sign * errors[0], limit))) for sign in (-1, 1))
    points = [*down[::-1], best, *up]
    return Valley(at, limit, np.array([p[0] for p in points]), np.array([p[1] for p in points]))


def _side(
    likeness: Likeness, best: tuple[float, Array], slopes: Array, at: int, first: tuple[Array, float]
) -> Iterator[tuple[float, Array]]:
    """Yield points on one side of the best one, the last of them beyond the limit or at the end of the range."""
    step, limit = first
    (unlikeness, here), slopes = best, slopes.copy()
    least = unlikeness
    for _ in range(MOST_POINTS):
        goal = np.clip(here[at] + step[at], *likeness.ends[:, at])
        if goal == here[at]:
            return
        found = _fit(likeness, here + (goal - here[at]) / step[at] * step, slopes, at, LEAST_GAIN * limit)
        if found is None:
            return
        yield found
        if found[0] > least + limit:
            return
        step = found[1] - here
        if abs(found[0] - unlikeness) < limit / 4:
            step = GROWTH * step
        unlikeness, here = found
        least = min(least, unlikeness)


def _fit(
    likeness: Likeness, values: Array, slopes: Array, at: int, gain: float
) -> tuple[float, Array] | None:
    """Return the least unlikeness with one number held, and all numbers; None where replicates cannot be simulated."""
    values = np.clip(values, *likeness.ends)
    tried = likeness.left(values)
    if tried is None:
        return None
    others = likeness.free.copy()
    others[at] = False
    places = likeness.own[likeness.own != at]
    rest = tried[1]
    best = float(np.sum((likeness.target - rest) ** 2))
    for _ in range(FITS):
        if not likeness.renew(slopes, places, values, rest):
            return None
        away = likeness.target - rest
        step = np.zeros(values.size)
        step[others] = least_squares(slopes[:, others], away)[0]
        if best - float(np.sum((away - slopes @ step) ** 2)) < gain:
            break
        later = np.clip(values + step * likeness.unit, *likeness.ends)
        tried = likeness.left(later)
        if tried is None or not (there := float(np.sum((likeness.target - tried[1]) ** 2))) < best:
            break
        values, rest, best = later, tried[1], there
    return best, values
