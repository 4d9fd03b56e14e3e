"""From predictive scores to probabilities, and to the class of effects that the data cannot tell apart."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Generic, Protocol, TypeVar

import numpy as np

from sindyjoint.diagnosis.evidence.score import Score


class Candidate(Protocol):
    """An effect with its best numbers."""

    @property
    def name(self) -> str:
        """Id of the effect."""

    @property
    def family(self) -> str:
        """Of the effect."""

    @property
    def parameters(self) -> dict[str, float]:
        """Its numbers by name, SI."""


C = TypeVar("C", bound=Candidate)


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


def rise(later: Score, fewer: Score) -> float:
    """Return by how much a score is above another, nats; errors beyond noise count as noise."""
    return (later.total - fewer.total) / max(later.excess, 1.0)


def rank(fitted: Sequence[tuple[C, Score]], base: Score, alike: float) -> Ranking[C]:
    """Return candidates with their probabilities, the best variant of each effect alone.

    Half of the prior belief is that nothing is missing; the other half is divided among the effects.

    Parameters
    ----------
    fitted : sequence of (Candidate, Score)
        Those of fewer numbers first, which lead where two are as good.
    base : Score
        Without any of them.
    alike : float
        Nats within which the data cannot tell one from the best.
    """
    best: dict[str, tuple[C, Score]] = {}
    for each, score in fitted:
        if each.name not in best or score.total > best[each.name][1].total:
            best[each.name] = each, score
    leading = max((score for _, score in best.values()), key=lambda score: score.total)
    nats = np.array([rise(leading, base) - rise(leading, score) for _, score in best.values()])
    weight = np.exp(
        np.append(nats - np.log(nats.size), 0.0) - max(float(nats.max() - np.log(nats.size)), 0.0)
    )
    weight /= weight.sum()
    kept = [each for each, _ in best.values()]
    order = np.argsort(-np.round(nats, 2), kind="stable")
    return Ranking(
        fitted=tuple(kept[i] for i in order),
        probabilities=tuple(float(weight[i]) for i in order),
        nothing=float(weight[-1]),
        members=tuple(kept[i] for i in order if nats[i] >= nats.max() - alike),
    )
