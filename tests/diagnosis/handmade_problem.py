"""A problem made by hand, whose effects bring the gap to figures of their own."""

from dataclasses import dataclass, field, replace

import numpy as np

from sindyjoint.diagnosis.policy import CAMPAIGN
from sindyjoint.diagnosis.problem import Added, Proposal, Start
from sindyjoint.diagnosis.ranking import EvidenceScale, rank
from sindyjoint.diagnosis.result import Gap
from sindyjoint.diagnosis.verdict import Residual


@dataclass(frozen=True)
class Effect:
    name: str
    gain: float
    gap: Gap
    family: str = "made"
    parameters: dict = field(default_factory=dict)
    contains: tuple = ()


@dataclass(frozen=True)
class Made:
    """Effects that each bring the gap to a figure of their own; ``second`` is proposed as the other of a pair."""

    candidates: tuple
    found: tuple = ()
    gap: Gap = Gap(1.0, 1.0, 1.0)
    noise_measured: bool = False
    is_noise: bool = False
    paired: tuple = ()
    needless: str = ""
    dropped: tuple = ()
    policy: object = CAMPAIGN
    impossible: tuple = ()
    noise: float = 0.0001
    swallowed: tuple = ()

    @property
    def parameters(self):
        return {each.name: each.parameters for each in self.found}

    def floor(self):
        return Gap(self.noise, self.noise)

    def replaced(self, name, other):
        found = (*(f for f in self.found if f.name != name), other)
        return replace(self, found=found, gap=other.gap, dropped=self.swallowed)

    def propose(self, refused, pairs, say):
        open_ones = [c for c in self.candidates if c.name not in refused and c not in self.found]
        if not open_ones:
            return None
        scale = EvidenceScale(2000.0, 1000.0, 1000.0, 0.0)
        ranking = rank(open_ones, [1] * len(open_ones), scale, self.policy)
        return Proposal(ranking, pairs and ranking.fitted[0].name in self.paired)

    def complaint(self, candidate=None):
        return (
            f"{candidate.name} pushes" if candidate is not None and candidate.name in self.impossible else ""
        )

    def add(self, best):
        if np.isnan(best.gap.moment):
            return None
        again = {self.needless: None} if self.needless in [f.name for f in self.found] else {}
        found = (*(f for f in self.found if f.name not in again), best)
        return Added(replace(self, found=found, gap=best.gap), again)

    def zero_errors(self, refused):
        return None

    def without_delay(self):
        return None

    def ranked_again(self, name, members):
        return None

    def gap_without(self, names):
        return self.gap

    def units(self, fitted):
        return {}


@dataclass(frozen=True)
class Told:
    verdict: str
    final: Gap
    steps: tuple
    warnings: tuple = ()
    found: dict = field(default_factory=dict)


@dataclass(frozen=True)
class Based(Made):
    """A problem that can be started from another base."""

    other: Made | None = None
    numbers: int = 0
    initial_gap = Gap(1.0, 1.0, 1.0)
    floor_is_bound = False

    def corrected(self):
        return self, ()

    def zero_start(self, straight, last, say):
        return None

    def other_starts(self, straight, last, say, whole=False):
        return iter([Start(self.other, (), "another base", self)] if self.other and not whole else [])

    def residual(self, straight):
        return Residual(0.0, 1.0, 0.0)

    def uncertainty(self):
        return Gap(0.0, 0.0)

    def finished(self):
        return self

    def budget(self, first, last):
        return None

    def places(self):
        return ()

    def diagnosis(self, first, found):
        return Told(found["verdict"], found["final"], found["steps"], found=found)
