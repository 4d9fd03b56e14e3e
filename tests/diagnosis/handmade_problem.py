"""A problem made by hand, whose effects bring the gap to figures of their own."""

from dataclasses import dataclass, field, replace

import numpy as np

from sindyjoint.diagnosis import CAMPAIGN, Gap, Residual, add_effects, rank
from sindyjoint.diagnosis.evidence import Score
from sindyjoint.diagnosis.problem import Start


@dataclass(frozen=True)
class Effect:
    name: str
    gain: float
    gap: Gap
    family: str = "made"
    parameters: dict = field(default_factory=dict)


def scored(gain, excess=1.0):
    """A score that is higher by half of a fall of χ²."""
    return Score(np.array([0.5 * gain - 1000.0]), np.array([2000.0 - gain]), 0.0, excess)


@dataclass(frozen=True)
class Made:
    """Effects that each bring the gap to a figure of their own."""

    candidates: tuple
    found: tuple = ()
    gap: Gap = Gap(1.0, 1.0)
    is_noise: bool = False
    needless: str = ""
    policy: object = CAMPAIGN
    noise: float = 0.0001
    dropped = ()

    @property
    def parameters(self):
        return {each.name: each.parameters for each in self.found}

    @property
    def noise_floor(self):
        return Gap(self.noise, self.noise)

    def searched(self, begun, most, say, search):
        return add_effects(begun, most, say, search)

    def cost(self):
        return float(np.log(self.gap.moment))

    def propose(self, refused, say):
        open_ones = [c for c in self.candidates if c.name not in refused and c not in self.found]
        if not open_ones:
            return None
        return rank([(each, scored(each.gain)) for each in open_ones], scored(0.0), self.policy.rival_nats)

    def add(self, best):
        if np.isnan(best.gap.moment):
            return None
        needless = [f.name for f in self.found if f.name == self.needless]
        found = (*(f for f in self.found if f.name not in needless), best)
        # What is needless explains nothing any more.
        candidates = tuple(c for c in self.candidates if c.name not in needless)
        return replace(self, candidates=candidates, found=found, gap=best.gap)

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
    initial_gap = Gap(1.0, 1.0)
    floor_is_bound = False
    moves_freely = False

    def corrected(self):
        return self, ()

    def zero_start(self, straight, last, say):
        return None

    def other_start(self, straight, last, say):
        return Start(self.other, (), "another base", self) if self.other else None

    def residual(self, straight):
        return Residual(0.0, 1.0)

    def uncertainty(self):
        return Gap(0.0, 0.0)

    def without_needless(self):
        return self

    def finished(self):
        return self

    def budget(self, first, last):
        return None

    def places(self):
        return ()

    def diagnosis(self, first, found):
        return Told(found["verdict"], found["final"], found["steps"], found=found)
