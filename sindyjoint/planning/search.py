"""Which runs together are most informative: greedy choice, then exchange, at enough frequencies and levels."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from sindyjoint.numeric import Array
from sindyjoint.planning.information import (
    Information,
    changes_over_band,
    chosen_terms,
    half_widths,
    margins,
)
from sindyjoint.planning.policy import POLICY, PlanningPolicy
from sindyjoint.planning.runs import PlannedRun

# What is made small, and how much each counts.
Goals = tuple[tuple[str, float], ...]
WIDTHS, FREQUENCY, PAPER = "widths", "frequency", "paper"
GOALS = (WIDTHS, FREQUENCY, PAPER)

WORST = 50.0  # logarithm of a relative half-width that is not determined at all
ROUNDS = 6
GAIN = 1e-6
# Of what is enough: beyond what tests of one joint scatter by.
AMPLE = 0.6


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
        the widest relative change over the band that could be overlooked. ``"paper"``: what the weakest term lacks of
        being taken by a discovery, which from one down it is.
    known : Information, optional
        Of runs that were already made, with axes (runs, joints).
    known_runs : tuple of (float, str)
        Frequency and level of these.
    policy : PlanningPolicy
    """

    runs: tuple[PlannedRun, ...]
    information: Information
    coefficients: Array
    terms: tuple[int, ...]
    goals: Goals = ((WIDTHS, 1.0),)
    known: Information | None = None
    known_runs: tuple[tuple[float, str], ...] = ()
    policy: PlanningPolicy = POLICY

    def widest(self, chosen: Sequence[int], goal: str = "") -> Array:
        """Return the widest relative half-width of each joint, or what another goal makes small, shape (joints,)."""
        information = self.information.take(chosen).with_runs(self.known)
        known = [frequency for frequency, _ in self.known_runs]
        frequencies = [*known, *(self.runs[i].frequency for i in chosen)]
        return made_small(goal or self.goals[0][0], information, self.coefficients, self.terms, frequencies)

    def missing(self, chosen: Sequence[int]) -> int:
        """Return how many different frequencies and levels are missing."""
        frequencies = {f"{f:.2g}" for f, _ in self.known_runs} | {
            f"{self.runs[i].frequency:.2g}" for i in chosen
        }
        # Levels are shares of the highest at their frequency: the same place among them is the same level.
        count = len(self.policy.levels)
        levels = {level for _, level in self.known_runs} | {str(i % count) for i in chosen}
        possible = min(self.policy.fewest_frequencies, len({run.frequency for run in self.runs}))
        return max(0, possible - len(frequencies)) + max(0, self.policy.fewest_levels - len(levels))

    def left_out(self, chosen: Sequence[int]) -> float:
        """Return the share of the joints of which a discovery would leave out a term that matters."""
        information = self.information.take(chosen).with_runs(self.known)
        taken = chosen_terms(information, self.coefficients)[:, list(self.terms)]
        return float(np.mean(~taken.all(axis=1)))

    def cost(self, chosen: Sequence[int]) -> float:
        """Return what is made small: the mean logarithm of the widest over the joints; what is missing or left out."""
        if not chosen and self.known is None:
            return WORST
        logs = [
            weight * float(np.log(np.clip(self.widest(chosen, goal), 1e-12, np.exp(WORST))).mean())
            for goal, weight in self.goals
        ]
        return (
            sum(logs)
            + self.policy.missing * self.missing(chosen)
            + self.policy.left_out * self.left_out(chosen)
        )


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
    if goal == FREQUENCY:
        widths = changes_over_band(information, frequencies)
    else:
        widths = half_widths(information, noise, draws)
    return np.asarray((widths / np.maximum(np.abs(coefficients), 1e-300))[..., [*terms]].max(axis=-1))


def best_runs(choice: Choice, count: int, until: float | None = None) -> list[int]:
    """Return the places of the best ``count`` runs, each as often as it is to be made, the most informative first.

    Greedily, then by exchange of single runs until none is better; then in the order in which each is the best next.
    Fewer runs where these already bring every joint far below the widest that is enough.
    """
    places = range(len(choice.runs))
    chosen: list[int] = []
    for _ in range(count):
        chosen.append(min(places, key=lambda i: choice.cost([*chosen, i])))
        if until is not None and choice.widest(chosen).max() <= AMPLE * until and not choice.missing(chosen):
            break
    count = len(chosen)
    cost = choice.cost(chosen)
    for _ in range(ROUNDS):
        before = cost
        for at in range(count):
            others = chosen[:at] + chosen[at + 1 :]
            best = min(places, key=lambda i: choice.cost([*others, i]))
            found = choice.cost([*others, best])
            if found < cost - GAIN:
                chosen, cost = [*others[:at], best, *others[at:]], found
        if cost > before - GAIN:
            break
    return _ordered(choice, chosen)


def _ordered(choice: Choice, chosen: list[int]) -> list[int]:
    waiting = list(chosen)
    order: list[int] = []
    while waiting:
        best = min(waiting, key=lambda i: choice.cost([*order, i]))
        waiting.remove(best)
        order.append(best)
    return order
