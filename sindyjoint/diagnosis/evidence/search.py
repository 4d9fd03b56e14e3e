"""A beam search over sets of candidates by their predictive score: add, drop, exchange.

Of several sets the one with the higher held-out score is preferred. One with more in it must win by more than the best
of all candidates wins where there is nothing but noise (measured on simulated noise), in the sum over the groups and in
their deviates, so that no single group decides.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any

import numpy as np

from sindyjoint.diagnosis.evidence import Evidence, Score
from sindyjoint.limits import EVIDENCE
from sindyjoint.numeric import Array

# Simulated noise of which the chance is a quantile, and where its exponential tail begins.
SHAMS, TAIL = 60, 0.95


@dataclass(frozen=True, eq=False)
class Candidate:
    """One form of an effect with its nonlinear parameters.

    Parameters
    ----------
    name : str
    form : int
        Which of the effect's forms.
    values : ndarray
        Nonlinear parameters.
    place : int
        Of its column.
    positive : bool
        Whether a negative coefficient would make no sense.
    corrects : bool
        Whether it corrects a channel, so that the states are made again.
    hysteretic : bool
        Whether its column follows internal states.
    mix : tuple of float
        Of a form with several columns the combination of them that the column is.
    """

    name: str
    form: int
    values: Array
    place: int
    positive: bool
    corrects: bool = False
    hysteretic: bool = False
    mix: tuple[float, ...] = (1.0,)

    @property
    def numbers(self) -> int:
        """Numbers that a fit of it chooses."""
        return 1 + self.values.size


Refine = Callable[[Candidate, Sequence[int], float], Candidate]


def deviate(rises: Array) -> float:
    """Return signed roots of twice each group's rise, clipped, as one normal deviate."""
    roots = np.sign(rises) * np.sqrt(2 * np.abs(rises))
    clipped = np.clip(roots, -EVIDENCE.significant, EVIDENCE.significant)
    return float(clipped.sum() / np.sqrt(rises.size))


@dataclass(frozen=True, eq=False)
class Chosen:
    """A set of candidates beside the terms of the model, and its score."""

    members: tuple[Candidate, ...]
    score: Score

    @property
    def names(self) -> frozenset[str]:
        """Of its members."""
        return frozenset(each.name for each in self.members)


def rise_by_group(later: Chosen, fewer: Chosen) -> Array:
    """Return what a set wins over another in each group, nats; errors beyond noise and discrepancy count as noise."""
    return (later.score.by_group - fewer.score.by_group) / max(later.score.excess, 1.0)


@dataclass(eq=False)
class Search:
    """A search for what a model lacks.

    Parameters
    ----------
    evidence : Evidence
    base : sequence of int
        Places of the columns that are there in any case.
    candidates : list of Candidate
    refine : callable
        Returns a candidate with its numbers refined beside some columns.
    before : float
        What corrections of the channels have won before, nats.
    sure : bool
        Whether repetition has measured the noise of every row.
    positive : sequence of int
        Places of columns of the model that may not be negative, as friction may not.
    """

    evidence: Evidence
    base: Sequence[int]
    candidates: list[Candidate]
    refine: Refine
    before: float = 0.0
    sure: bool = True
    positive: Sequence[int] = ()
    _rivals: dict[Any, list[Chosen]] = field(init=False, default_factory=dict)
    _refined: list[Candidate] = field(init=False, default_factory=list)

    @cached_property
    def limits(self) -> tuple[float, float]:
        """Rise in nats, and deviate, that the best candidate exceeds by chance, with that probability."""
        if not self.candidates:
            return 0.0, 0.0
        rises = self.evidence.chance_rises(self.base, [each.place for each in self.candidates], SHAMS, 0)
        beyond = float(np.log((1 - TAIL) / EVIDENCE.chance))
        total = float(np.quantile(rises.sum(axis=1), TAIL)) + beyond
        return max(total, beyond), float(np.quantile([deviate(each) for each in rises], TAIL))

    def wins(self, later: Chosen, fewer: Chosen) -> bool:
        """Return whether a set wins over one with less in it by more than chance, for each member that it has more."""
        least, need = self.limits
        more = max(len(later.members) - len(fewer.members), 1)
        won = rise_by_group(later, fewer)
        return bool(won.sum() > more * least and deviate(won) > need)

    def chosen(self, members: Sequence[Candidate]) -> Chosen:
        """Return a set with its score."""
        places = [*self.base, *(each.place for each in members)]
        return Chosen(tuple(members), self.evidence.score(places))

    def admissible(self, members: Sequence[Candidate], score: Score) -> bool:
        """Return whether the coefficients have the signs that physics asks for, within what columns err by."""
        places = [*self.base, *(each.place for each in members)]
        coefficients = self.evidence.fit(places, score.size)
        signs = zip(coefficients[len(self.base) :], members, strict=True)
        if any(value <= 0 for value, each in signs if each.positive):
            return False
        size = coefficients * np.array(self.evidence.norms)[places]
        least = -EVIDENCE.column_error * float(np.linalg.norm(self.evidence.target))
        return all(
            value >= least for value, place in zip(size, places, strict=True) if place in self.positive
        )

    def extended(self, begin: Chosen, without: frozenset[str] = frozenset()) -> list[Chosen]:
        """Return a set with each further effect in its best form, the best first."""
        taken = begin.names | without
        open_ = [each for each in self.candidates if each.name not in taken]
        places = [*self.base, *(each.place for each in begin.members)]
        scores = self.evidence.beside(places, [each.place for each in open_], begin.score.size)
        order = sorted(zip(scores, open_, strict=True), key=lambda each: -each[0].total)
        best: dict[str, Chosen] = {}
        for score, each in order:
            members = (*begin.members, each)
            if each.name not in best and self.admissible(members, score):
                best[each.name] = Chosen(members, score)
        return list(best.values())

    def with_numbers(self, pool: Sequence[Chosen], least: float) -> list[Chosen]:
        """Return sets, the best first, the numbers of the last members of those that lead refined."""
        later = list(pool)
        # Of the sets that lead a round so many have the numbers of their last member refined.
        for i, each in enumerate(later[:6]):
            if each.score.total > least and each.members[-1].values.size:
                later[i] = self.refined(each)
        return sorted(later, key=lambda each: -each.score.total)

    def refined(self, found: Chosen) -> Chosen:
        """Return a set with the numbers of its last member refined, if it is better by that."""
        *others, last = found.members
        if last in self._refined:
            return found
        places = [*self.base, *(each.place for each in others)]
        candidate = self.refine(last, places, found.score.size)
        self._refined.append(candidate)
        self.candidates.append(candidate)
        later = self.chosen((*others, candidate))
        better = later.score.total > found.score.total and self.admissible(later.members, later.score)
        return later if better else found

    # Four members are added at most.
    def run(self, begin: Sequence[Candidate] = (), most: int = 4) -> Chosen:
        """Return the best set of at most so many candidates.

        Two may win together of which neither wins alone: the beam goes one step beyond the best set.
        """
        best = start = self.chosen(begin)
        beam, idle = [best], 0
        for _ in range(most):
            pool = [later for each in beam for later in self.extended(each)]
            distinct: dict[frozenset[str], Chosen] = {}
            for each in sorted(pool, key=lambda each: -each.score.total):
                distinct.setdefault(each.names, each)
            leading = list(distinct.values())
            if not leading:
                break
            rise = leading[0].score.total - best.score.total
            # Five sets are kept from round to round.
            beam = self.with_numbers(leading, best.score.total + max(0.5 * rise, 0.4 * self.limits[0]))[:5]
            if self.wins(beam[0], best) and not self.enough(best, beam[0], start):
                best, idle = self.without_needless(beam[0]), 0
                if len(best.members) < len(beam[0].members):
                    beam[0] = best
            elif idle:
                break
            else:
                idle = 1
        return self.without_idle(best)

    def without_idle(self, found: Chosen) -> Chosen:
        """Return a set less the members that hardly make the prediction better, where a remainder is left in any case.

        Beside what nothing explains such a member stands in for a part of it; so it may where the noise is not sure,
        unless no discrepancy shows and the groups agree on it. What a correction wins shows when the states are made
        again: of it they must agree.
        """
        if self.sure and not self.remains(found):
            return found
        whole = not self.remains(found) and found.score.size == 0.0
        for each in found.members[::-1]:
            fewer = self.chosen([m for m in found.members if m is not each])
            ratio = found.score.chi_square.sum() / fewer.score.chi_square.sum()
            agreed = deviate(rise_by_group(found, fewer)) > EVIDENCE.stands_out
            helps = ratio <= (1 - EVIDENCE.minor_share) ** 2
            if not (helps or (agreed and (whole or each.corrects))):
                return self.without_idle(fewer)
        return found

    def remains(self, found: Chosen) -> bool:
        """Return whether a set misses groups left out by more than noise makes expected."""
        return bool(found.score.chi_square.sum() > EVIDENCE.clearly**2 * self.evidence.target.size)

    def enough(self, best: Chosen, later: Chosen, start: Chosen) -> bool:
        """Return whether a set leaves no more than noise and the errors of its columns, so that nothing is to be added.

        Columns err by a share of what they explain. Where only noise is left, or next to it beside hysteresis, whose
        columns err at every reversal, a larger set must add more than that to the score, too.
        """
        if not (best.members or self.before):
            return False
        left, rows = best.score.chi_square.sum(), self.evidence.target.size
        if left - rows < EVIDENCE.column_error**2 * (start.score.chi_square.sum() - left):
            return True
        if self.remains(best):
            return False
        if left > rows:
            start = self.chosen([each for each in best.members if not each.hysteretic])
        won = best.score.total - start.score.total + self.before
        return bool(later.score.total - best.score.total < EVIDENCE.tolerated * won)

    def without_needless(self, found: Chosen) -> Chosen:
        """Return a set without the members that win nothing beside the others."""
        for each in found.members:
            fewer = self.chosen([m for m in found.members if m is not each])
            if not self.wins(found, fewer) or self.enough(fewer, found, self.chosen(())):
                return self.without_needless(fewer)
        return found

    def rivals(self, found: Chosen, member: Candidate) -> list[Chosen]:
        """Return the sets with another effect in the place of a member, the best first."""
        key = (found.members, member)
        if key not in self._rivals:
            others = self.chosen([m for m in found.members if m is not member])
            pool = self.extended(others, frozenset([member.name]))
            halfway = 0.5 * (found.score.total + others.score.total)
            self._rivals[key] = self.with_numbers(pool, halfway)
        return self._rivals[key]

    def alike(self, found: Chosen, other: Chosen) -> bool:
        """Return whether a set loses less to another than chance makes, and predicts as well."""
        worse = other.score.chi_square.sum() * (1 - EVIDENCE.minor_share) ** 2 > found.score.chi_square.sum()
        return not self.wins(found, other) and not (worse and self.remains(other))
