"""Which runs together are most informative: exchange of runs from several starts, by one criterion.

The criterion adds logarithms: of the widest relative interval, and of what a change over frequency could hide. For the
latter each coefficient is a parabola over the band, its values at the frequencies those of a fit to the runs of each
alone: the determinant of the parabola's information is largest where at least three frequencies each tell the
coefficients by themselves, which takes several levels (D-optimality; Atkinson, Donev and Tobias 2007, ch. 11).
"""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cache, cached_property

import numpy as np
from numpy.typing import NDArray

from sindyjoint.limits import PLANNING
from sindyjoint.numeric import SAME, Array, kept
from sindyjoint.planning import PlannedRun
from sindyjoint.planning.information import (
    Information,
    changes_over_band,
    chosen_terms,
    expected_errors,
    half_widths,
    margins,
    requirements,
)

# What is made small, and how much each counts.
Goals = tuple[tuple[str, float], ...]
WIDTHS, FREQUENCY, PAPER = "widths", "frequency", "paper"
GOALS = (WIDTHS, FREQUENCY, PAPER)
DEFAULT_GOALS = {WIDTHS: 4.0, FREQUENCY: 1.0}

WORST = 50.0  # logarithm of what is not determined at all
BROKEN = 10.0  # cost of each thing that a plan must not lack: larger than what logarithms of widths can win


def _logarithm(values: Array) -> Array:
    return np.log(np.clip(values, np.exp(-WORST), np.exp(WORST)))


@dataclass(frozen=True, eq=False)
class Choice:
    """What is chosen from, and for what.

    Parameters
    ----------
    runs : tuple of PlannedRun
    information : Information
        With axes (runs, joints).
    coefficients : ndarray, shape (joints, p)
    terms : tuple of int
        Places of the coefficients that matter.
    goals : tuple of (str, float)
        What counts, and how much; the first is reported. ``"widths"``: the widest relative interval. ``"frequency"``:
        a change over the band that could be overlooked. ``"paper"``: what the weakest term lacks of being taken by a
        discovery, which from one down it is.
    known : Information, optional
        Of runs that were already made, with axes (runs, joints).
    known_runs : tuple of (float, str)
        Frequency and level of these.
    grid : Information, optional
        Of the plain grid, than which no interval shall be wider.
    """

    runs: tuple[PlannedRun, ...]
    information: Information
    coefficients: Array
    terms: tuple[int, ...]
    goals: Goals = ((WIDTHS, 1.0),)
    known: Information | None = None
    known_runs: tuple[tuple[float, str], ...] = ()
    grid: Information | None = None

    def widest(self, chosen: Sequence[int]) -> Array:
        """Return what the first goal makes small, of each joint, shape (joints,)."""
        information = self.information.take(chosen).with_runs(self.known)
        made = [frequency for frequency, _ in self.known_runs]
        frequencies = [*made, *(self.runs[i].frequency for i in chosen)]
        return made_small(self.goals[0][0], information, self.coefficients, self.terms, frequencies)

    def missing(self, chosen: Sequence[int]) -> int:
        """Return how many settings are missing: of so many frequencies each at so many levels."""
        # Levels are shares of the highest at their frequency: the same place among them is the same level.
        count, levels = len(PLANNING.levels), dict[float, set[str]]()
        for frequency, level in (
            *self.known_runs,
            *((self.runs[i].frequency, str(i % count)) for i in chosen),
        ):
            levels.setdefault(_same(frequency), set()).add(level)
        possible = min(PLANNING.fewest, self._band.size)
        most = sorted((min(len(each), PLANNING.fewest_levels) for each in levels.values()), reverse=True)
        return max(0, possible * PLANNING.fewest_levels - sum(most[:possible]))

    def left_out(self, chosen: Sequence[int]) -> float:
        """Return the share of the joints of which a discovery would leave out a term that matters."""
        information = self.information.take(chosen).with_runs(self.known)
        taken = chosen_terms(information, self.coefficients)[:, list(self.terms)]
        return float(np.mean(~taken.all(axis=1)))

    @cached_property
    def _band(self) -> Array:
        """Frequencies that can be driven."""
        return np.unique([_same(run.frequency) for run in self.runs])

    @cached_property
    def _groups(self) -> tuple[Array, NDArray[np.intp], NDArray[np.intp]]:
        """All frequencies, and at which of them each run is, and each that was made."""
        at = [_same(run.frequency) for run in self.runs]
        made = [_same(frequency) for frequency, _ in self.known_runs]
        groups, places = np.unique([*at, *made], return_inverse=True)
        return groups, places[: len(at)], places[len(at) :]

    # Exchanges from several starts, and their last rounds, ask for the same runs again.
    @kept
    def costs(self, chosen: tuple[int, ...], count: int) -> Array:
        """Return the cost of some runs, in order, of a plan of ``count`` with each of all runs added, shape (runs,)."""
        groups, at, made = self._groups
        held = [_summed(self.information, chosen, at[[*chosen]], groups.size)]
        if self.known is not None:
            held.append(_summed(self.known, range(made.size), made, groups.size))
        single = _added(*held)
        errors, shares = expected_errors(_added(single.sum(), self.information), self.coefficients)
        widths = _logarithm(errors / np.abs(self.coefficients))[..., [*self.terms]]
        needed = requirements(errors, shares, self.coefficients)[..., [*self.terms]].min(axis=-1)
        small = {WIDTHS: lambda: widths.max(axis=-1), PAPER: lambda: -_logarithm(needed)}
        small[FREQUENCY] = lambda: self._changes(single)
        cost = sum(weight * small[goal]().mean(axis=-1) for goal, weight in self.goals)
        # A term that a discovery would leave out of every joint counts as intervals that are e times as wide.
        cost = cost + np.mean(needed < 1, axis=-1)
        if self.grid is not None and WIDTHS in dict(self.goals):
            # Narrower than the grid's by what the joints drawn for the search and those drawn for the prediction differ
            # by.
            wider = (widths - self._grid_widths(count)).mean(axis=-2) + 0.02
            cost = cost + BROKEN * np.maximum(wider, 0).sum(axis=-1)
        return np.asarray(cost + BROKEN * self._lacks(chosen, count))

    def _lacks(self, chosen: Sequence[int], count: int) -> Array:
        """Return what is missing, and how many runs too many are at one frequency, with each of all runs added."""
        _, at, _ = self._groups
        most = max(count // 2, -(-count // self._band.size))
        made = np.bincount(at[[*chosen]], minlength=at.max() + 1)
        crowded = np.maximum(made - most, 0).sum() + (made[at] >= most)
        return np.array([self.missing([*chosen, i]) for i in range(len(self.runs))]) + crowded

    @kept
    def _grid_widths(self, count: int) -> Array:
        """Return the logarithms of the errors that the grid promises in the time of so many runs."""
        assert self.grid is not None
        share = count / self.grid.blocks.shape[0]
        total = Information.of(lambda each: share * each, self.grid.sum())
        if self.known is not None:
            total = _added(total, self.known.sum())
        errors, _ = expected_errors(total, self.coefficients)
        return _logarithm(errors / np.abs(self.coefficients))[:, [*self.terms]]

    def _changes(self, single: Information) -> Array:
        """Return the mean logarithm of the error of a parabola over the band, shape (runs, joints).

        Per number of the parabola and coefficient, of runs whose information at each frequency is given, with each of
        all runs added.
        """
        groups, at, _ = self._groups
        order = min(3, self._band.size)
        place = (2 * groups - groups[0] - groups[-1]) / max(groups[-1] - groups[0], 1e-12)
        powers = place[:, None] ** np.arange(order)

        def known(total: Information) -> Array:
            errors, _ = expected_errors(total, self.coefficients)
            return np.asarray((self.coefficients / errors)[..., [*self.terms]] ** 2)

        before = known(single)
        more = known(_added(single.take(at.tolist()), self.information)) - before[at]
        gram = np.einsum("fjk,fa,fb->jkab", before, powers, powers)
        gram = gram + np.einsum("ijk,ia,ib->ijkab", more, powers[at], powers[at])
        determinant = np.maximum(np.linalg.det(gram), np.exp(-WORST))
        return np.asarray(-np.log(determinant).mean(axis=-1) / (2 * order))


@cache
def _same(frequency: float) -> float:
    """Return a frequency as it counts as one: that of a run is refined from its data."""
    return float(f"{frequency:.2g}")


def _added(*parts: Information) -> Information:
    return Information.of(lambda *each: sum(each), *parts)


def _summed(
    information: Information, runs: Sequence[int], groups: NDArray[np.intp], count: int
) -> Information:
    """Return the sums over the runs of each group."""

    def summed(each: Array) -> Array:
        total = np.zeros((count, *each.shape[1:]))
        np.add.at(total, groups, each[[*runs]])
        return total

    return Information.of(summed, information)


def made_small(
    goal: str,
    information: Information,
    coefficients: Array,
    terms: Sequence[int],
    frequencies: Sequence[float],
    noise: np.random.Generator | None = None,
    draws: int = 1,
) -> Array:
    """Return what a goal makes small, of each joint; with noise the scatter of reported intervals is drawn."""
    if goal == PAPER:
        return np.asarray(1 / np.maximum(margins(information, coefficients)[:, [*terms]].min(axis=1), 1e-12))
    over_band = goal == FREQUENCY
    widths = (
        changes_over_band(information, frequencies) if over_band else half_widths(information, noise, draws)
    )
    return np.asarray((widths / np.maximum(np.abs(coefficients), 1e-300))[..., [*terms]].max(axis=-1))


def best_runs(choice: Choice, count: int, until: float | None = None) -> list[int]:
    """Return the places of the best ``count`` runs, each as often as it is to be made, the most informative first.

    Greedily, and at random, then by exchange of single runs until none is better (Fedorov 1972); then in the order in
    which each is the best next, settings that no run has first. Fewer runs where these already bring every joint far
    below the widest that is enough.
    """
    chosen: list[int] = []
    for _ in range(count):
        chosen.append(int(np.argmin(choice.costs(tuple(sorted(chosen)), count))))
        # Less than what is enough by more than tests of one joint scatter by.
        if until is not None and choice.widest(chosen).max() <= 0.6 * until and not choice.missing(chosen):
            break
    rng = np.random.default_rng(0)
    # The exchange ends in local optima: it has fifteen further starts.
    drawn = rng.integers(len(choice.runs), size=(15, len(chosen))).tolist()
    _, best = min((_exchanged(choice, start) for start in (chosen, *drawn)), key=lambda found: found[0])
    return _ordered(choice, best)


def _exchanged(choice: Choice, start: Sequence[int]) -> tuple[float, list[int]]:
    """Return the cost of runs of which none can be exchanged for a better one, and these."""
    chosen, cost = [*start], float("inf")
    for _ in range(6):
        before = cost
        for at in range(len(chosen)):
            others = chosen[:at] + chosen[at + 1 :]
            costs = choice.costs(tuple(sorted(others)), len(chosen))
            best = int(np.argmin(costs))
            if costs[best] < cost - SAME:
                cost, chosen = float(costs[best]), [*others[:at], best, *others[at:]]
        if not cost < before - SAME:
            break
    return cost, chosen


def _ordered(choice: Choice, chosen: list[int]) -> list[int]:
    waiting, order = list(chosen), list[int]()
    while waiting:
        costs = choice.costs(tuple(sorted(order)), len(chosen))
        # Planned anew after each run, those at the end would be put off for ever.
        best = min(waiting, key=lambda i: (choice.missing([*order, i]), costs[i]))
        waiting.remove(best)
        order.append(best)
    return order
