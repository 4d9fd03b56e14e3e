"""How unlike the measurement the replicates of a model are, as its numbers change."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from sindyjoint.diagnosis.campaign.numbers.noise import left_in_all
from sindyjoint.diagnosis.campaign.numbers.replicates import Replicates
from sindyjoint.diagnosis.campaign.numbers.whole import Numbers, numbers_of, with_numbers
from sindyjoint.diagnosis.campaign.repair import Repaired
from sindyjoint.diagnosis.campaign.rows.run import reference_scales
from sindyjoint.diagnosis.campaign.start import Work
from sindyjoint.numeric import Array

# Slopes are differences over a standard error, or this share of a number.
LARGEST_DIFFERENCE = 0.05


@dataclass(frozen=True, eq=False)
class Likeness:
    """What a law with fixed numbers leaves of the measurement, to be held beside what it leaves of replicates.

    Parameters
    ----------
    work : Work
    fitted : Repaired
        The law that fits the rows; its form is that of the model that makes the replicates.
    numbers : Numbers
        Of that law, with the covariance of the regression.
    target : ndarray, shape (m,)
        What it leaves of the measurement, in units of noise.
    unit : ndarray, shape (n,)
        By how much each number is changed for a slope.
    ends : ndarray, shape (2, n)
        Least and largest value of each number.
    free : ndarray of bool, shape (n,)
        Numbers that move; a delay is out of the states already and does not.
    own : ndarray of int
        Places of those of the elements and other effects.
    """

    work: Work
    fitted: Repaired
    numbers: Numbers
    target: Array
    unit: Array
    ends: Array
    free: NDArray[np.bool_]
    own: NDArray[np.intp]

    @classmethod
    def of(cls, work: Work, fitted: Repaired, start: Array | None = None) -> Likeness:
        """Return it for a law, whose numbers may move within the ranges of the catalogue and those of the start."""
        numbers = numbers_of(fitted, work.rows)
        errors = np.sqrt(np.diag(numbers.covariance))
        free = np.ones(errors.size, dtype=bool)
        for each in fitted.effects:
            free[numbers.coefficients[each.name]] = not each.shifts
        own = np.r_[(*numbers.coefficients.values(), *numbers.inner.values())].astype(int)
        own = own[free[own]]
        # Numbers of an element that are hardly known are moved by less than their error: the response bends on the way.
        unit = errors.copy()
        unit[own] = np.minimum(errors[own], LARGEST_DIFFERENCE * np.abs(numbers.values[own]))
        ends = _ends(work, fitted, numbers, numbers.values if start is None else start)
        return cls(work, fitted, numbers, left_in_all(work.rows, fitted), unit, ends, free, own)

    def left(self, values: Array) -> tuple[Replicates, Array] | None:
        """Return replicates of the model with some numbers and what the law leaves of them; None where they fail."""
        there = Replicates.of(self.work, with_numbers(self.fitted, values, self.numbers.covariance))
        return None if there is None else (there, left_in_all(there.rows(), self.fitted))

    def renew(self, slopes: Array, places: NDArray[np.intp], values: Array, rest: Array) -> bool:
        """Write by how much what is left of replicates changes with some numbers, each by its unit.

        Return whether replicates could be simulated, on either side of each number.
        """
        for place in places:
            inside = 1.0 if values[place] + self.unit[place] <= self.ends[1, place] else -1.0
            for sign in (inside, -inside):
                later = values.copy()
                later[place] += sign * self.unit[place]
                if (moved := self.left(later)) is not None:
                    slopes[:, place] = sign * (moved[1] - rest)
                    break
            else:
                return False
        return True


def _ends(work: Work, fitted: Repaired, numbers: Numbers, start: Array) -> Array:
    """Return the least and the largest value of each number, shape (2, n): of parameters as the catalogue has them."""
    ends = np.outer([-np.inf, np.inf], np.ones(numbers.values.size))
    reference = reference_scales(work.rows)
    for each in fitted.effects:
        if not each.shifts:
            within = each.variant.bounds(reference) if each.within is None else each.within
            own = start[numbers.inner[each.name]]
            ends[:, numbers.inner[each.name]] = [
                np.minimum(within[:, 0], own), np.maximum(within[:, 1], own)
            ]  # fmt: skip
    return ends
