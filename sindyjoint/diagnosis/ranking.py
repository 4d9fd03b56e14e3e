"""From the fall of χ² to probabilities, and to the class of effects that the data cannot tell apart.

Half the fall of χ² is a log-likelihood ratio; a candidate pays ½·ln N for each number that it chooses (Schwarz 1978).
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Generic, Protocol, TypeVar

import numpy as np

from sindyjoint.diagnosis.policy import DiagnosisPolicy


class Candidate(Protocol):
    """An effect with its best numbers, and the fall of χ² that they bring."""

    @property
    def name(self) -> str:
        """Id of the effect."""

    @property
    def family(self) -> str:
        """Of the effect."""

    @property
    def contains(self) -> tuple[str, ...]:
        """Ids of effects that are special cases of it."""

    @property
    def gain(self) -> float:
        """Fall of χ²."""

    @property
    def parameters(self) -> dict[str, float]:
        """Its numbers by name, SI."""


C = TypeVar("C", bound=Candidate)


@dataclass(frozen=True)
class EvidenceScale:
    """What gains are measured against.

    Parameters
    ----------
    chi_square : float
        Without any candidate.
    degrees, rows : float
        Degrees of freedom, and rows of independent noise.
    column_error : float
        Relative error of the candidates' columns.
    inherited : float
        What the errors of the columns of effects found before leave, in units of χ²: no effect of its own.
    correlated : float
        Neighbouring rows that say the same thing.
    """

    chi_square: float
    degrees: float
    rows: float
    column_error: float
    inherited: float = 0.0
    correlated: float = 1.0


@dataclass(frozen=True)
class Weights:
    """How much evidence gains are, and what numbers cost.

    Parameters
    ----------
    per_gain : float
        Nats for each unit of χ².
    price, full_price : float
        Nats for each number that is chosen: among candidates, and beside a special case.
    """

    per_gain: float
    price: float
    full_price: float


@dataclass(frozen=True)
class Ranking(Generic[C]):
    """The candidates in order of probability.

    Parameters
    ----------
    fitted : tuple of Candidate
        One for each effect.
    probabilities : tuple of float
        Of each; what is missing to one is the probability that nothing is missing.
    nothing : float
    members : tuple of Candidate
        The best one and those that the data cannot distinguish from it.
    """

    fitted: tuple[C, ...]
    probabilities: tuple[float, ...]
    nothing: float
    members: tuple[C, ...]


def weights_of(largest: float, scale: EvidenceScale, policy: DiagnosisPolicy) -> Weights:
    """Return what gains and numbers count where the best candidate lowers χ² by ``largest``."""
    residual = max(1.0, (scale.chi_square - largest) / max(scale.degrees, 1))
    tempered = policy.temper * scale.correlated
    inflated = tempered + scale.column_error**2 * largest / residual
    number = 0.5 * np.log(scale.rows) * scale.correlated
    price = number / (inflated if policy.price_inflated else tempered)
    return Weights(0.5 / (residual * inflated), float(price), float(number / tempered))


def beside_special_cases(
    best: Mapping[str, tuple[float, float, Candidate]], weights: Weights
) -> dict[str, float]:
    """Return the evidence of candidates, given with evidence and size, where some are special cases of others.

    What a special case explains the larger law explains too: the data cannot prefer the one to the other, but only deny
    what the larger one's range leaves out. So the two tie where they fit alike, the special case first, and the larger
    one leads by what its further numbers earn beyond their full price (Schwarz 1978).
    """
    later = {name: evidence for name, (evidence, *_) in best.items()}
    for name, (evidence, size, each) in best.items():
        caps = []
        for special in set(each.contains) & set(best):
            simpler, fewer, _ = best[special]
            better = evidence - simpler + weights.price * (size - fewer)
            earned = max(better - weights.full_price * (size - fewer), 0.0)
            caps.append(simpler + min(better, earned))
        later[name] = min(caps, default=evidence)
    return later


def rank(
    fitted: Sequence[C], sizes: Sequence[float], scale: EvidenceScale, policy: DiagnosisPolicy
) -> Ranking[C]:
    """Return the candidates with their probabilities, the best variant of each effect alone.

    Three things keep likelihoods honest: a residual beyond noise counts as noise; columns err, which inflates the
    scale of differences in proportion to the gain; and half of the prior belief is that nothing is missing.

    Parameters
    ----------
    fitted : sequence of Candidate
    sizes : sequence of float
        How many numbers each chooses.
    scale : EvidenceScale
    policy : DiagnosisPolicy
    """
    weights = weights_of(max(f.gain for f in fitted), scale, policy)
    best: dict[str, tuple[float, float, C]] = {}
    for each, size in zip(fitted, sizes, strict=True):
        gain = max(each.gain - scale.inherited, 0.0)
        evidence = weights.per_gain * gain - weights.price * size
        if each.name not in best or evidence > best[each.name][0]:
            best[each.name] = evidence, size, each
    kept = [each for *_, each in best.values()]
    evidence_of = beside_special_cases(best, weights)
    values = np.array([*(evidence_of[each.name] - np.log(len(kept)) for each in kept), 0.0])
    weight = np.exp(values - values.max())
    weight /= weight.sum()
    # Of effects that tie but for rounding the one with fewer numbers leads, then the catalogue's order decides.
    order = np.lexsort(([size for _, size, _ in best.values()], -np.round(weight[:-1], 6)))
    least = weight[order[0]] * np.exp(-policy.rival_nats)
    return Ranking(
        fitted=tuple(kept[i] for i in order),
        probabilities=tuple(float(weight[i]) for i in order),
        nothing=float(weight[-1]),
        members=tuple(kept[i] for i in order if weight[i] >= least),
    )
